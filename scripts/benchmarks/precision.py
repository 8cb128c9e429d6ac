"""What accuracy costs in time: error of q against time, free swing of Panda-7 over 1 s, beside other programs.

error = the largest of |q − q_ref| at the end;   time = median of runs that take turns, prepared, recorded at their end

The reference is DOP853 at 3e-14. SciPy's DOP853 integrates `pin.aba`; MuJoCo makes RK4 steps in C; heyoka, where it is
installed, Taylor steps of the same equations in compact mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import robot_dyn as rd
from benchmarks.measure import Effort, arms, row, table
from benchmarks.mujoco_arm import mujoco_model
from robot_dyn.compiled.program import Kind, Program
from robot_dyn.simulation.choice import choose
from robot_dyn.simulation.event_run import EventRun
from robot_dyn.simulation.fixed_step import FixedStep
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.watch import Watch

READY = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])
TOLERANCES = tuple(10.0**-k for k in range(5, 14))
STEPS = (1000, 2000, 4000, 8000, 16000, 32000, 64000)
Timed = Callable[[], tuple[float, np.ndarray]]  # a run: its time in [s], and q at the end


def precision(effort: Effort, picture: Path | None) -> None:
    """A table of the time that each takes to an error, and a picture of all."""
    arm = arms()["Panda-7"]
    setup = rd.Setup(
        rd.Plant(arm), READY, record_period_s=1.0, estimate_error=False, engine="compiled",
        integrator=rd.Adaptive(rtol=3e-14, atol=1e-15),
    )  # fmt: skip
    exact = rd.simulate(setup).q[-1]
    sides = {
        "DOP853": [ours(setup, rd.Adaptive("DOP853", tol, tol)) for tol in TOLERANCES],
        "Rosenbrock": [ours(setup, rd.Adaptive("Rosenbrock", tol, tol)) for tol in TOLERANCES[:6]],
        "order_8": [ours(setup, "order_8", 1 / steps) for steps in (100, 200, 400, 800)],
        "rk4": [ours(setup, "rk4", 1 / steps) for steps in STEPS],
        "whole call of simulate, DOP853": [whole(setup, rd.Adaptive("DOP853", tol, tol)) for tol in TOLERANCES],
        "SciPy DOP853 + pin.aba": [scipy(arm, tol) for tol in TOLERANCES[:7]],
        "MuJoCo RK4": [mujoco(arm, steps) for steps in STEPS],
    }
    if find_spec("heyoka"):
        sides["heyoka, Taylor"] = [heyoka(setup, tol) for tol in (1e-9, 1e-11, 1e-13)]
    if effort.quick:
        sides = {name: runs[:2] for name, runs in sides.items()}
    found = {name: _measured(runs, exact, effort) for name, runs in sides.items()}
    targets = (1e-6, 1e-8, 1e-10)
    table("what", *(f"to {x:g}, ms" for x in targets), *(f"over DOP853, {x:g}" for x in targets))
    base = [_time_at(found["DOP853"], x) for x in targets]
    for name, points in found.items():
        times = [_time_at(points, x) for x in targets]
        ratios = [t / b for t, b in zip(times, base, strict=True)]
        row(name, *(f"{1e3 * t:.3f}" for t in times), *(f"{x:.1f}" for x in ratios))
    print("\nnan: not reached with the tolerances and steps tried.")
    if picture is not None:
        _draw(found, picture)


def ours(setup: rd.Setup, method: Any, step: float | None = None) -> Timed:
    """A run that is prepared, by its loop alone."""
    setup = replace(setup, integrator=method, **({} if step is None else {"step_s": step}))
    equation = StateEquation(setup.plant, None)

    def run() -> tuple[float, np.ndarray]:
        machine, _ = choose(setup, equation)
        assert machine is not None
        if setup.integrator.controls_error:
            made = machine.equations.functions, machine.parameters
            prepared: Any = EventRun(Watch(setup, equation), lambda _: made, None, machine.loop)
        else:
            functions, loop = machine.equations.functions, machine.loop
            prepared = FixedStep(setup, equation, functions, Fraction(1), loop, parameters=machine.parameters)
        began = perf_counter()
        record = prepared.record()
        return perf_counter() - began, record.y[-1, :7]

    return run


def whole(setup: rd.Setup, method: Any) -> Timed:
    """A warm call of simulate."""

    def run() -> tuple[float, np.ndarray]:
        began = perf_counter()
        made = rd.simulate(setup, integrator=method)
        return perf_counter() - began, made.q[-1]

    return run


def scipy(arm: rd.Robot, tolerance: float) -> Timed:
    """SciPy's DOP853 around Pinocchio's articulated-body algorithm."""
    import pinocchio as pin  # pyright: ignore[reportMissingImports]
    from scipy.integrate import solve_ivp

    model, zero = arm.model, np.zeros(7)
    data = model.createData()

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[7:], pin.aba(model, data, y[:7], y[7:], zero)])

    def run() -> tuple[float, np.ndarray]:
        start = np.concatenate([READY, zero])
        began = perf_counter()
        found = solve_ivp(rate, (0, 1), start, "DOP853", rtol=max(tolerance, 3e-14), atol=tolerance)
        return perf_counter() - began, found.y[:7, -1]

    return run


def mujoco(arm: rd.Robot, steps: int) -> Timed:
    """MuJoCo's RK4 in C, contacts and constraints off."""
    module: Any = import_module("mujoco")
    model: Any = mujoco_model(module, arm, bare=True)
    model.opt.timestep = 1 / steps

    def run() -> tuple[float, np.ndarray]:
        data = module.MjData(model)
        data.qpos[:] = READY
        began = perf_counter()
        module.mj_step(model, data, steps)
        return perf_counter() - began, data.qpos.copy()

    return run


def heyoka(setup: rd.Setup, tolerance: float) -> Timed:
    """Heyoka's Taylor method of the equations that our machine code is of, in compact mode."""
    hy: Any = import_module("heyoka")
    machine, _ = choose(setup, StateEquation(setup.plant, None))
    assert machine is not None
    program, parameters = machine.equations.programs["rate"], machine.parameters
    names = [hy.make_vars(f"y{i}") for i in range(14)]
    rates = _in_heyoka(hy, program, names, parameters)
    start = [*READY, *np.zeros(7)]
    integrator = hy.taylor_adaptive(list(zip(names, rates, strict=True)), start, tol=tolerance, compact_mode=True)

    def run() -> tuple[float, np.ndarray]:
        integrator.time = 0.0
        integrator.state[:] = start
        began = perf_counter()
        integrator.propagate_until(1.0)
        return perf_counter() - began, integrator.state[:7].copy()

    return run


def _in_heyoka(hy: Any, program: Program, y: list[Any], parameters: np.ndarray) -> list[Any]:
    """The outputs y' of a program without branches, of its inputs (t, y, p, own)."""
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
        of = [values[i] for i in op.of]
        if op.kind is Kind.SINE_COSINE:
            values[op.made[0]], values[op.made[1]] = hy.sin(of[0]), hy.cos(of[0])
        else:
            values[op.made[0]] = two[op.kind](*of) if len(of) == 2 else one[op.kind](*of)
    return [values[i] for i in program.outputs[: len(y)]]


def _measured(runs: list[Timed], exact: np.ndarray, effort: Effort) -> list[tuple[float, float]]:
    """Error and median time of each run, the runs taking turns."""
    times: list[list[float]] = [[] for _ in runs]
    errors = [float(np.abs(run()[1] - exact).max()) for run in runs]
    for _ in range(effort.repeats):
        for each, run in zip(times, runs, strict=True):
            each.append(run()[0])
    return [(error, median(each)) for error, each in zip(errors, times, strict=True)]


def _time_at(points: list[tuple[float, float]], error: float) -> float:
    """The time to an error, between those measured in the logarithms of both; nan beyond them."""
    low = np.minimum.accumulate([max(e, 1e-15) for e, _ in points])
    keep = np.concatenate([[True], np.diff(low) < 0])
    x, t = np.log(low[keep])[::-1], np.log([t for _, t in points])[keep][::-1]
    return float(np.exp(np.interp(np.log(error), x, t, left=np.nan, right=t[-1])))


def _draw(found: dict[str, list[tuple[float, float]]], picture: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    for (name, points), mark in zip(found.items(), "osv^DPX*", strict=False):
        error, time = np.array(points).T
        axes.loglog(error, 1e3 * time, marker=mark, markersize=4, label=name)
    axes.invert_xaxis()
    axes.set(xlabel="error of q after 1 s [rad]", ylabel="time [ms]", title="Panda-7, free swing of 1 s")
    axes.grid(alpha=0.3, which="both", linewidth=0.4)
    axes.legend(fontsize=8)
    figure.savefig(picture, dpi=120)
