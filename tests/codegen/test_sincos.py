"""Sine and cosine of the kernels, against ball arithmetic, inside a compiled batch kernel."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from flint import arb, ctx

from robot_dyn.codegen import Kernel, program_of
from robot_dyn.codegen.llvm.elementary import RANGE
from robot_dyn.codegen.llvm.one_state import Status


@cache
def kernel(dtype: str) -> Kernel:
    """The sine and cosine of one angle, in a kernel of all fast-math flags."""
    x = ca.SX.sym("x", 1)
    return Kernel(program_of(ca.Function("f", [x], [ca.vertcat(ca.sin(x), ca.cos(x))])), (2,), dtype)


def angles(size: float) -> np.ndarray:
    """General angles, and those nearest to multiples of π/2, where the reduction cancels most."""
    rng = np.random.default_rng(4)
    general = rng.uniform(-size, size, 1500)
    return np.concatenate([general, np.round(general[:500] / (np.pi / 2)) * (np.pi / 2)])


def ulps(x: np.ndarray, values: np.ndarray, *functions: Any) -> float:
    """The largest error of values of functions, a column each, in units of the last place of the value."""
    last = np.spacing(np.abs(values)).astype(float)
    with ctx.workprec(160):
        exact = [[function(arb(at)) for function in functions] for at in x.astype(float).tolist()]
        errors = [[abs(float(arb(a) - b)) for a, b in zip(*row, strict=True)]
                  for row in zip(values.astype(float).tolist(), exact, strict=True)]  # fmt: skip
    return float(np.max(np.array(errors) / last))


SINE_AND_COSINE = arb.sin, arb.cos


@pytest.mark.parametrize("size", [1.0, 1e3, RANGE])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_sine_and_cosine_in_a_batch_kernel_err_by_less_than_two_ulp(size: float, dtype: str) -> None:
    """Half an ulp of the last rounding, half of r, and the polynomial: 1.5 measured, 2 allowed."""
    x = angles(size).astype(dtype)[:, None]
    x = x[np.abs(x[:, 0]) <= RANGE]
    y = np.empty((len(x), 2), dtype)
    assert kernel(dtype).many([x], y) is Status.FINE
    assert ulps(x[:, 0], y, *SINE_AND_COSINE) < 2


@pytest.mark.parametrize("size", [3e5, 1e9, 1e15])
def test_beyond_the_range_an_exact_path_serves(size: float) -> None:
    """The C library is right to 1 ulp at any size; one angle beyond the range sends its batch there."""
    x = angles(size)[:, None]
    y = np.empty((len(x), 2))
    assert kernel("float64").many([x], y) is Status.FINE
    assert ulps(x[:, 0], y, *SINE_AND_COSINE) < 2
    one = np.empty(2)
    assert kernel("float64").call(x[7], one) == Status.FAR
    assert kernel("float64").any_angle(x[7], one) == Status.FINE
    assert ulps(x[7], one[None], *SINE_AND_COSINE) < 2


@pytest.mark.parametrize(("dtype", "allowed"), [("float64", 2.0), ("float32", 1.0)])
def test_tanh_in_a_batch_kernel_errs_by_less_than_two_ulp(dtype: str, allowed: float) -> None:
    """Both branches and their seam at 0.625, tiny and saturated arguments, NaN and infinities."""
    x = ca.SX.sym("x", 1)
    made = Kernel(program_of(ca.Function("f", [x], [ca.tanh(x)])), (1,), dtype)
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.normal(size=1500), rng.uniform(0.6, 0.65, 200), 10.0 ** rng.uniform(-8, 3, 300)])
    values = values.astype(dtype)[:, None]
    y = np.empty_like(values)
    assert made.many([values], y) is Status.FINE
    assert not re.search(r"\b_?tanhf?\b", made.assembly())  # no call of the C library
    assert ulps(values[:, 0], y, arb.tanh) < allowed
    odd = np.resize(np.array([np.nan, np.inf, -np.inf], dtype), (18, 1))
    result = np.empty_like(odd)
    assert made.many([odd], result) is Status.ARGUMENT
    assert np.isnan(result[0])
    assert np.array_equal(result[1:3, 0], [1.0, -1.0])
