"""The writer by itself: any number of states side by side, several programs in one function, by LLVM alone."""

from __future__ import annotations

import ctypes
from typing import Any

import casadi as ca
import numpy as np
import pytest
from llvmlite import ir

from robot_dyn.codegen import program_of
from robot_dyn.codegen.llvm.elementary import RANGE
from robot_dyn.codegen.llvm.machine_code import addresses
from robot_dyn.codegen.llvm.vectors import F32, F64, I64
from robot_dyn.codegen.llvm.writer import Writer
from robot_dyn.codegen.store.keys import digest

X = ca.SX.sym("x", 3)
Z = ca.SX.sym("z", 2)
FIRST = ca.Function("f", [X], [ca.vertcat(ca.sin(X[0]) * X[1], ca.cos(X[0] + ca.exp(X[2])))])
SECOND = ca.Function("g", [Z, X], [ca.vertcat(ca.tanh(Z[0]) / X[1], ca.if_else(Z[1] < 0, Z[1], X[2]), 1.5)])


def write(kind: Any, count: int, any_angle: bool) -> Any:
    """Writes g(f(x), x) of `count` states: number k of state b at x[k · count + b]; returns the states beyond RANGE."""

    def body(module: Any, name: str) -> None:
        function = ir.Function(module, ir.FunctionType(I64, [kind.as_pointer()] * 2), name + "both")
        builder = ir.IRBuilder(function.append_basic_block())
        writer = Writer(builder, kind, count, any_angle)
        wide = writer.vectors.type.as_pointer()
        x, y = (builder.bitcast(pointer, wide) for pointer in function.args)

        def place(array: Any, k: int) -> Any:
            return builder.gep(array, [ir.Constant(I64, k)])

        inputs = [builder.load(place(x, k), align=writer.vectors.size) for k in range(3)]
        first = writer.write(program_of(FIRST), [inputs])
        second = writer.write(program_of(SECOND), [first.results, inputs])
        for k, value in enumerate(second.results):
            builder.store(value, place(y, k), align=writer.vectors.size)
        builder.ret(builder.zext(writer.vectors.any(first.out_of_range), I64))

    return body


@pytest.mark.parametrize("count", [1, 2, 4, 8, 16])
@pytest.mark.parametrize(("kind", "dtype"), [(F64, "float64"), (F32, "float32")])
@pytest.mark.parametrize("any_angle", [False, True])
def test_programs_are_written_for_any_number_of_states(kind: Any, dtype: str, count: int, any_angle: bool) -> None:
    """Against CasADi's own virtual machine: 8 ulp of numbers of size 1."""
    key = digest([str(program_of(FIRST)), str(program_of(SECOND)), dtype, str(count), str(any_angle)])
    place = addresses(("both",), key, write(kind, count, any_angle), None)[0]
    both = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)(place)
    x = np.random.default_rng(count).uniform(0.3, 1.2, (3, count)).astype(dtype)
    y = np.empty((3, count), dtype)
    assert both(x.ctypes.data, y.ctypes.data) == 0
    expected = np.array([SECOND(FIRST(column), column).full().ravel() for column in x.T.astype(float)]).T
    assert np.max(np.abs(y - expected)) < 8 * np.finfo(dtype).eps
    x[0, -1] = 2 * RANGE
    assert both(x.ctypes.data, y.ctypes.data) == (not any_angle)
