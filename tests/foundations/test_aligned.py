"""Vectors of runs in lock step lie in whole cache lines, in arrays and on the stack of machine code."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from llvmlite import ir

import robot_dyn as rd
from robot_dyn.codegen import program_of
from robot_dyn.codegen.llvm.batch import batch_function
from robot_dyn.codegen.llvm.lock_step import write_function
from robot_dyn.codegen.llvm.one_state import Limits
from robot_dyn.codegen.llvm.vectors import F64
from robot_dyn.foundations import FLOAT64
from robot_dyn.foundations.values import LINE, aligned
from robot_dyn.simulation import StateEquation
from robot_dyn.simulation.dynamics.loop_state import lanes_of
from robot_dyn.simulation.observation.guard_levels import guard_levels
from robot_dyn.simulation.observation.observation import observations_of

W = 64


def offsets(arrays: list[np.ndarray]) -> list[int]:
    """Of the first byte of each array in its cache line."""
    return [x.__array_interface__["data"][0] % LINE for x in arrays]


def test_arrays_of_zeros_begin_at_cache_lines() -> None:
    for shape in ((0, 4), (1,), (3, 5), (7, 3, W)):
        for dtype in (float, np.float32, np.int64, np.longdouble, object):
            x = aligned(shape, dtype)
            assert x.shape == shape and x.dtype == dtype and x.flags.c_contiguous and x.flags.writeable
            assert not x.any()
            assert dtype is object or not x.size or offsets([x]) == [0]


@pytest.mark.parametrize("method", ["RK4", "SemiImplicitEuler", "GaussLegendre4", "Rodas5PFixed"])
def test_what_each_step_touches_begins_at_cache_lines(method: str) -> None:
    """States, stages and extremes, of many allocations: by chance one in four does."""
    robot = rd.load("planar_2r")
    equation = StateEquation(rd.Plant(robot, [rd.effects.ViscousFriction([0.5] * 2)]), None)
    m, n, kept = equation.size, robot.n, []
    for _ in range(8):
        runs = lanes_of(equation, np.ones((m, W)), np.zeros((1, W)), 0, np.zeros(2), np.arange(W))
        K = rd.integrate.method(method).stepper(FLOAT64, m, n, m | 1, W).work.K
        kept += [runs.y, runs.after, K]
    start = np.random.default_rng(3).normal(size=(3 * n, 3 * W))
    for of in observations_of(start, guard_levels(robot, (), None, 3 * W), 3):
        kept += [of.low, of.high]
    assert offsets(kept) == [0] * len(kept)


def test_vectors_on_the_stack_begin_at_cache_lines() -> None:
    """The functions of vectors ask for it; else their alignment would be that of who calls them."""
    x = ca.SX.sym("x", 4)
    program = program_of(ca.Function("f", [ca.SX.sym("t"), x, ca.SX(0, 1), ca.SX(0, 1)], [x * ca.sin(x)]))
    module = ir.Module()
    write_function(module, "lanes", program, W)
    batch_function(module, "batch", program_of(ca.Function("f", [x], [x * x])), F64, Limits(1e9, 1e9), False)
    for name in ("lanes", "batch"):
        (head,) = (line for line in str(module).splitlines() if line.startswith("define") and f'@"{name}"' in line)
        assert f"alignstack({LINE})" in head
