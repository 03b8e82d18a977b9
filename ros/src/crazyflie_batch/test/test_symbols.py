"""Symbols calculate as floats do, whatever the processor has."""

import contextlib
import math
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from llvmlite import binding

from crazyflie_batch import (
    Controller,
    FiniteDifferences,
    Measurement,
    Model,
    machine_code,
    program,
    quadrotor,
    simulate,
)
from crazyflie_batch.flight import Plan, yaw_from_quaternion
from crazyflie_batch.symbols import Condition, Emitter, Symbol
from crazyflie_model.angles import quaternion_from_rpy, rpy_from_quaternion
from crazyflie_model.dynamics import NearHover

FEATURES = {8: {"avx512f": True}, 4: {"avx2": True}, 2: {}}


def fly():
    """Return the final states of flights with all errors, compiled again."""
    program.clear()
    flights = simulate(
        quadrotor(np.linspace(-0.1, 0.1, 5)),
        Controller(np.tile([0.0, 0.1, 0.0, 0.0, 0.3, 0.0, -0.2], (4, 1))),
        n=5,
        duration=1.0,
        measurement=Measurement(1e-3, 1e-2, [0.0, 0.01, 0.02, 0.03, 2.0], 0.1),
    )
    return flights.x


@pytest.fixture(scope="module")
def expected():
    """Return what they are with all that this processor has."""
    return fly()


@pytest.mark.parametrize(("lanes", "has_vector_functions"), [(4, True), (2, False)])
def test_all_processors_fly_the_same(monkeypatch, expected, lanes, has_vector_functions):
    present = binding.get_host_cpu_features()
    wanted = dict.fromkeys(("avx512f", "avx2"), False) | FEATURES[lanes]
    if any(value and not present.get(name) for name, value in wanted.items()):
        pytest.skip(f"this processor has no {lanes} lanes")
    features = SimpleNamespace(get=wanted.get, flatten=present.flatten)
    monkeypatch.setattr(binding, "get_host_cpu_features", lambda: features)
    if not has_vector_functions:
        monkeypatch.setattr(machine_code, "_load", lambda library: library != "libmvec.so.1")
    try:
        assert fly() == pytest.approx(expected, rel=1e-9, abs=1e-9)
    finally:
        program.clear()


def works():
    """Do nothing: the library is initialized already."""


def raises():
    """Do what llvmlite 0.45 and later do."""
    raise RuntimeError("llvmlite.binding.initialize() is deprecated and will be removed.")


@pytest.mark.parametrize("initialize", [works, raises, None])
def test_llvmlite_is_initialized_where_it_must_be(monkeypatch, expected, initialize):
    called = []
    if initialize is None:
        monkeypatch.delattr(binding, "initialize", raising=False)
    else:
        monkeypatch.setattr(
            binding, "initialize", lambda: (called.append(True), initialize()), raising=False
        )
    assert (fly() == expected).all()
    assert called == [True] * (initialize is not None)


def test_threads_that_need_the_same_program_compile_it_once(monkeypatch):
    compiled = []
    begun = threading.Barrier(4)

    class Slow:
        def __init__(self, plan):
            compiled.append(plan)
            # Time for the others to begin, too, if nothing stops them.
            with contextlib.suppress(threading.BrokenBarrierError):
                begun.wait(0.2)

    monkeypatch.setattr(program, "MachineCode", Slow)
    plan = Plan(NearHover, (), math.inf, FiniteDifferences, 10, {})
    program.clear()
    try:
        with ThreadPoolExecutor(4) as executor:
            found = set(executor.map(program.program, [plan] * 4))
    finally:
        program.clear()
    assert len(found) == len(compiled) == 1


class Power(NearHover):
    """A model whose rate along x is a power of its height, and whose other rates are numbers."""

    def __init__(self, exponent):
        self._exponent = exponent

    def rates(self, t, x, u):
        """See `Dynamics.rates`."""
        return [(x[2] - 1.5) ** self._exponent, *[0.0] * 6]


@pytest.mark.parametrize("exponent", [-3, -1, 0, 1, 2, 5, 2.0, np.int64(4)])
@pytest.mark.parametrize("z", [0.75, 2.25])
def test_powers_are_those_of_floats(exponent, z):
    flights = simulate(
        Model(partial(Power, exponent)), Controller(np.zeros((4, 7))), x0=(0.0, 0.0, z)
    )
    # 10 s, but for the first two ticks, in which nothing has been commanded yet.
    assert flights.x[0, 0] == pytest.approx(9.99 * (z - 1.5) ** exponent)


@pytest.mark.parametrize("exponent", [0.5, -1.5, math.nan, math.inf, "2"])
def test_powers_that_are_not_whole_are_refused(exponent):
    symbol = Symbol(None, None)
    text = f"the exponent {exponent!r}; expected a whole number"
    with pytest.raises(TypeError, match=re.escape(text)):
        symbol**exponent


def test_a_symbol_does_not_tell_whether_it_is_zero():
    with pytest.raises(TypeError, match="must not branch"):
        bool(Symbol(None, None))


def test_what_is_not_known_is_refused():
    emitter = SimpleNamespace(builder=None)
    with pytest.raises(TypeError, match="must not branch"):
        bool(Condition(emitter, None))
    with pytest.raises(TypeError, match="is not supported"):
        Emitter(None, 2, vector_functions=False).call(np.cbrt, [1.0])


@pytest.mark.parametrize("roll", [-0.4, 0.0, 0.7])
@pytest.mark.parametrize("pitch", [-math.pi / 2, -0.3, 0.0, 0.5, math.pi / 2])
@pytest.mark.parametrize("yaw", [-3.0, 0.0, 1.2])
def test_yaw_is_that_of_the_nodes(roll, pitch, yaw):
    quaternion = quaternion_from_rpy(roll, pitch, yaw)
    assert yaw_from_quaternion(quaternion) == pytest.approx(rpy_from_quaternion(*quaternion)[2])
