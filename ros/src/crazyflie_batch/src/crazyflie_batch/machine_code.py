"""The machine code that flies a group of vehicles, traced from the formulas of `flight`."""

import ctypes
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from llvmlite import binding, ir

from crazyflie_batch import flight
from crazyflie_batch.flight import Components, Plan
from crazyflie_batch.symbols import DOUBLE, Emitter, Symbol
from crazyflie_model.stabilized_quadrotor import STEPS_PER_SAMPLE

_INTEGER = ir.IntType(64)
_BYTES = 8  #: Size of a number.


class MachineCode:
    """Flies groups of `lanes` vehicles by vector instructions, as `program.ArrayProgram` does."""

    def __init__(self, plan: Plan):
        self.lanes, self._machine, vector_functions = _machine()
        module = ir.Module()
        _Writer(plan, module, self.lanes, vector_functions).write()
        # The machine code lives as long as its engine.
        self._engine = binding.create_mcjit_compiler(
            binding.parse_assembly(str(module)), self._machine
        )
        self._engine.finalize_object()
        signature = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5, *[ctypes.c_int64] * 3)
        self._fly = signature(self._engine.get_function_address("fly"))

    def fly(
        self, memory: Any, parameters: Any, noise_samples: Any, record: Any, slots: int
    ) -> None:
        """See `program.ArrayProgram.fly`."""
        transit = np.zeros((slots, flight.POSE_DIM, self.lanes))
        arrays = (memory, parameters, transit, noise_samples, record)
        self._fly(
            *(array.ctypes.data for array in arrays),
            len(noise_samples),
            slots,
            0 if len(record) == 1 else record[0].size,
        )


def _machine() -> tuple[int, Any, bool]:
    """Return lanes and target of this processor, and whether there are functions of vectors."""
    # Later versions than Debian 12's initialize themselves: theirs raises, or is gone.
    with suppress(AttributeError, RuntimeError):
        binding.initialize()
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    features = binding.get_host_cpu_features()
    lanes = 8 if features.get("avx512f") else 4 if features.get("avx2") else 2
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=features.flatten(), opt=2, jit=True
    )
    has_functions = "x86_64" in binding.get_process_triple() and _load("libmvec.so.1")
    if not has_functions:
        _load("libm.so.6")
    return lanes, target, has_functions


def _load(library: str) -> bool:
    try:
        binding.load_library_permanently(library)
    except RuntimeError:
        return False
    return True


class _Writer(Emitter):
    """Writes the function ``fly`` into a module."""

    def __init__(self, plan: Plan, module: ir.Module, lanes: int, vector_functions: bool):
        pointer = ir.PointerType(ir.VectorType(DOUBLE, lanes))
        type_ = ir.FunctionType(ir.VoidType(), [pointer] * 5 + [_INTEGER] * 3)
        self._function = ir.Function(module, type_, "fly")
        builder = ir.IRBuilder(self._function.append_basic_block())
        super().__init__(builder, lanes, vector_functions)
        self._plan = plan

    def write(self) -> None:
        builder, plan = self.builder, self._plan
        memory, parameters, transit, noise_samples, record, ticks, slots, row = self._function.args
        dims = plan.memory_dims()
        with self._loop(ticks) as tick:
            values = self._load(parameters, plan.parameter_dims)
            state = self._load(memory, dims)
            row_of_tick = builder.gep(noise_samples, [self._times(tick, flight.NOISE_DIM)])
            noise = self._load(row_of_tick, {"noise": flight.NOISE_DIM})["noise"]
            state = flight.update_metrics(plan, state, values)
            pose = flight.measure(plan, state, values, noise)
            self._send(transit, pose, tick, slots)
            (delay,) = values["delay"]
            arrived = self._receive(transit, delay, tick, slots)
            state = flight.run_controller(plan, state, values, arrived)
            self._store(memory, dims, state)
            offset = builder.sdiv(builder.mul(tick, row), self._integer(self.lanes))
            self._store(builder.gep(record, [offset]), dims, state)
            with self._loop(self._integer(plan.steps // STEPS_PER_SAMPLE)):
                values = self._load(parameters, plan.parameter_dims)
                state = self._load(memory, dims)
                for count in range(STEPS_PER_SAMPLE):
                    state = flight.step(plan, state, values, count)
                self._store(memory, dims, state)
        builder.ret_void()

    def _send(self, transit, pose, tick, slots):
        slot = self.builder.srem(tick, slots)
        place = self.builder.gep(transit, [self._times(slot, flight.POSE_DIM)])
        self._store(place, {"pose": flight.POSE_DIM}, {"pose": pose})

    def _receive(self, transit, delay, tick, slots):
        """Return the pose that was sent ``delay`` ticks ago; delays of lanes differ."""
        builder = self.builder
        numbers = builder.bitcast(transit, ir.PointerType(DOUBLE))
        delays = builder.fptosi(delay.value, ir.VectorType(_INTEGER, self.lanes))
        sent = [builder.sub(builder.add(tick, slots), each) for each in self.numbers(delays)]
        size = flight.POSE_DIM * self.lanes
        places = [self._times(builder.srem(each, slots), size) for each in sent]
        pose = []
        for part in range(0, size, self.lanes):
            offsets = [builder.add(each, self._integer(part + i)) for i, each in enumerate(places)]
            values = [builder.load(builder.gep(numbers, [offset])) for offset in offsets]
            pose.append(Symbol(self, self.vector(values)))
        return pose

    def _load(self, pointer: ir.Value, dims: Mapping[str, int]) -> Components:
        rows = range(sum(dims.values()))
        load = self.builder.load
        symbols = [Symbol(self, self._aligned(load, pointer, row)) for row in rows]
        return flight.components(symbols, dims)

    def _aligned(self, action, pointer, index, *value):
        place = self.builder.gep(pointer, [self._integer(index)])
        return action(*value, place, align=_BYTES)

    def _store(self, pointer, dims, components):
        index = 0
        for name, dim in dims.items():
            assert len(components[name]) == dim, name
            for part in components[name]:
                value = self.value(part)
                self._aligned(self.builder.store, pointer, index, value)
                index += 1

    def _times(self, integer, factor):
        return self.builder.mul(integer, self._integer(factor))

    @staticmethod
    def _integer(value: Any) -> Any:
        return ir.Constant(_INTEGER, value)

    @contextmanager
    def _loop(self, count: ir.Value) -> Iterator[ir.Value]:
        """Write a loop around the instructions of the with block; the value is its index."""
        builder = self.builder
        before = builder.block
        body = builder.append_basic_block()
        builder.branch(body)
        builder.position_at_end(body)
        index = builder.phi(_INTEGER)
        index.add_incoming(self._integer(0), before)
        yield index
        following = builder.add(index, self._integer(1))
        index.add_incoming(following, builder.block)
        after = builder.append_basic_block()
        builder.cbranch(builder.icmp_signed("<", following, count), body, after)
        builder.position_at_end(after)
