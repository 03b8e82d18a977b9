"""Symbolic numbers, with which formulas become machine code.

The formulas of `crazyflie_model` take floats, arrays or whatever else calculates like these
(see `crazyflie_model.elementwise`). Given a `Symbol`, a formula leaves the instructions that
would calculate its result, in an LLVM function that is being built; nothing is calculated yet.
A symbol represents one number of each of several vehicles, its lanes.

A formula must not branch on a value; it chooses with ``where`` and ``clip``.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numpy.lib.mixins import NDArrayOperatorsMixin

from crazyflie_model.elementwise import NUMPY_FUNCTIONS

DOUBLE = ir.DoubleType()
_INDEX = ir.IntType(32)  #: Type of a lane's number.

#: Number of lanes -> prefix of the names of the C library's vector functions (x86-64 vector
#: function ABI), with AVX-512, AVX2 and SSE.
_VECTOR_LETTERS = {8: "e", 4: "d", 2: "b"}

#: Functions of the C library, whose names are those of Python's math.
_FUNCTIONS = {function: name for name, function in vars(NUMPY_FUNCTIONS).items()}

#: Intrinsics of LLVM: one instruction on most processors.
_INTRINSICS = {np.sqrt: "llvm.sqrt", np.floor: "llvm.floor", np.absolute: "llvm.fabs"}
#: Instructions of operators, which numpy's mixin makes functions.
_OPERATORS = {np.add: "fadd", np.subtract: "fsub", np.multiply: "fmul", np.divide: "fdiv"}
_COMPARISONS = {
    np.less: "<",
    np.less_equal: "<=",
    np.greater: ">",
    np.greater_equal: ">=",
    np.equal: "==",
}
_LOGIC = {np.bitwise_and: "and_", np.bitwise_or: "or_", np.invert: "not_"}


class Emitter:
    """Writes instructions for vectors of ``lanes`` numbers into an LLVM function.

    ``vector_functions`` says whether the C library has its functions for such vectors.
    """

    def __init__(self, builder: ir.IRBuilder, lanes: int, vector_functions: bool):
        self.builder = builder
        self.lanes = lanes
        self.type = ir.VectorType(DOUBLE, lanes)
        self._vector_functions = vector_functions

    def value(self, number: Any) -> ir.Value:
        """Return the vector of a symbol or a float."""
        if isinstance(number, Symbol):
            return number.value
        return ir.Constant(self.type, [float(number)] * self.lanes)

    def call(self, function: Any, arguments: Sequence[Any]) -> "Symbol | Condition":
        """Return a function, one of numpy's, of symbols or floats."""
        values = [self.value(argument) for argument in arguments]
        if function in _OPERATORS:
            return Symbol(self, getattr(self.builder, _OPERATORS[function])(*values))
        if function in _COMPARISONS:
            sign = _COMPARISONS[function]
            return Condition(self, self.builder.fcmp_ordered(sign, *values))
        if function is np.negative:
            return Symbol(self, self.builder.fsub(self.value(-0.0), *values))
        if function in _INTRINSICS:
            name = f"{_INTRINSICS[function]}.v{self.lanes}f64"
            return Symbol(self, self.builder.call(self._declare(name, self.type, 1), values))
        if function not in _FUNCTIONS:
            raise TypeError(f"{function} is not supported in a batch")
        name = _FUNCTIONS[function]
        if self._vector_functions:
            parameters = "v" * len(values)
            name = f"_ZGV{_VECTOR_LETTERS[self.lanes]}N{self.lanes}{parameters}_{name}"
            callee = self._declare(name, self.type, len(values))
            return Symbol(self, self.builder.call(callee, values))
        callee = self._declare(name, DOUBLE, len(values))
        lanes = zip(*map(self.numbers, values), strict=True)
        return Symbol(self, self.vector([self.builder.call(callee, lane) for lane in lanes]))

    def numbers(self, vector: ir.Value) -> list[ir.Value]:
        """Return the number of each lane of a vector."""
        indices = (ir.Constant(_INDEX, lane) for lane in range(self.lanes))
        return [self.builder.extract_element(vector, index) for index in indices]

    def vector(self, numbers: Sequence[ir.Value]) -> ir.Value:
        """Return the vector of a number for each lane; inverse of `numbers`."""
        result = ir.Constant(self.type, ir.Undefined)
        for lane, number in enumerate(numbers):
            result = self.builder.insert_element(result, number, ir.Constant(_INDEX, lane))
        return result

    def _declare(self, name, type_, count):
        module = self.builder.module
        if name in module.globals:
            return module.globals[name]
        return ir.Function(module, ir.FunctionType(type_, [type_] * count), name)


class _Traced(NDArrayOperatorsMixin):
    def __init__(self, emitter: Emitter, value: ir.Value):
        self.value = value
        self._emitter = emitter

    def __bool__(self) -> bool:
        raise TypeError("a formula of a batch must not branch; it chooses with where() or clip()")


class Condition(_Traced):
    """A condition that is true for some of the lanes."""

    def _of(self, other):
        # A condition without symbols is a bool.
        if isinstance(other, Condition):
            return other.value
        return ir.Constant(self.value.type, [bool(other)] * self.value.type.count)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Support ``&``, ``|`` and ``~``."""
        if method != "__call__" or kwargs or ufunc not in _LOGIC:
            return NotImplemented
        emit = getattr(self._emitter.builder, _LOGIC[ufunc])
        return Condition(self._emitter, emit(*map(self._of, inputs)))

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Support ``numpy.where``."""
        if function is not np.where:
            return NotImplemented
        _, value, other = args
        values = [self._emitter.value(number) for number in (value, other)]
        return Symbol(self._emitter, self._emitter.builder.select(self.value, *values))


class Symbol(_Traced):
    """A number whose value is known when the program runs; see the module."""

    def __pow__(self, exponent: Any) -> "Symbol":
        try:
            count = abs(int(exponent))
            is_whole = count == abs(exponent)
        except (TypeError, ValueError, OverflowError):
            is_whole = False
        if not is_whole:
            raise TypeError(f"a formula has the exponent {exponent!r}; expected a whole number")
        power = Symbol(self._emitter, self._emitter.value(1.0))
        for _ in range(count):
            power = power * self
        return 1.0 / power if exponent < 0 else power

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Support operators, ``numpy.sin`` and other functions."""
        if method != "__call__" or kwargs:
            return NotImplemented
        return self._emitter.call(ufunc, inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Support ``numpy.clip``."""
        if function is not np.clip:
            return NotImplemented
        value, low, high = args
        raised = np.where(value < low, low, value)
        return np.where(raised > high, high, raised)
