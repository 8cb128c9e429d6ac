"""heyoka's Taylor method, in compact mode, for the equations of this library's machine code."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

from robot_dyn.accuracy.work_precision_diagram.method_under_test import COMPILED, Limit, MethodUnderTest, Run
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import ArmMotion, PeerError
from robot_dyn.codegen.program import Kind, Program
from robot_dyn.simulation.compiled.cache import machine_code

_TOLERANCES = (1e-6, 1e-10, 1e-14)  # each is compiled separately, which takes many seconds


def methods_under_test(motion: ArmMotion) -> list[MethodUnderTest]:
    """Return heyoka's Taylor method."""
    hy: Any = import_module("heyoka")
    setup, n = motion.setup, motion.robot.n
    if setup.engine != COMPILED:
        raise PeerError("it needs the equations in machine code, which this run does not use")
    machine = machine_code(setup.equation)
    names = [hy.make_vars(f"y{i}") for i in range(2 * n)]
    rates = _in_heyoka(hy, machine.code.programs["rate"], names, machine.parameters)
    start = np.concatenate([setup.q0, setup.v0])
    integrators: dict[float, Any] = {}

    def warm() -> None:
        system = list(zip(names, rates, strict=True))
        for tolerance in _TOLERANCES:
            integrators[tolerance] = hy.taylor_adaptive(system, start.tolist(), tol=tolerance, compact_mode=True)

    def run(tolerance: float, limit: Limit) -> Run:
        integrator = integrators[tolerance]
        integrator.time = 0.0
        integrator.state[:] = start
        began = perf_counter()
        *_, steps, _, y = integrator.propagate_grid(motion.times.tolist())
        spent = perf_counter() - began
        limit(motion.times[-1])
        return motion.run(y[:, :n], y[:, n:], steps, None, spent)

    return [MethodUnderTest("heyoka, Taylor", "", True, None, "tolerance", lambda: _TOLERANCES, run, warm)]


def _in_heyoka(hy: Any, program: Program, y: list[Any], parameters: np.ndarray) -> list[Any]:
    """Return the outputs y' of a program without branches, for its inputs (t, y, p, run parameters)."""
    works = program.inputs[1] - len(y)
    inputs = [hy.expression(0.0), *y, *[hy.expression(0.0)] * works, *[hy.expression(0.0)] * program.inputs[2]]
    inputs += [hy.expression(float(x)) for x in parameters]
    values: dict[int, Any] = dict(enumerate([*inputs, *(hy.expression(x) for x in program.constants)]))
    two: dict[Kind, Callable[[Any, Any], Any]] = {
        Kind.ADD: lambda a, b: a + b, Kind.SUBTRACT: lambda a, b: a - b, Kind.MULTIPLY: lambda a, b: a * b,
        Kind.DIVIDE: lambda a, b: a / b, Kind.MINIMUM: lambda a, _: a, Kind.MAXIMUM: lambda a, _: a,
    }  # fmt: skip
    one: dict[Kind, Callable[[Any], Any]] = {
        Kind.NEGATE: lambda a: -a, Kind.SQUARE: lambda a: a * a, Kind.TWICE: lambda a: 2.0 * a,
        Kind.RECIPROCAL: lambda a: 1.0 / a, Kind.SQUARE_ROOT: hy.sqrt,
    }  # fmt: skip
    for op in program.ops:
        operands = [values[i] for i in op.operands]
        if op.kind is Kind.SINE_COSINE:
            values[op.results[0]], values[op.results[1]] = hy.sin(operands[0]), hy.cos(operands[0])
        elif (function := two.get(op.kind) if len(operands) == 2 else one.get(op.kind)) is not None:
            values[op.results[0]] = function(*operands)
        else:
            raise PeerError(f"the operation {op.kind.name.lower()} of the equations is not translated")
    return [values[i] for i in program.outputs[: len(y)]]
