"""55 named timings: queries, loops, calls of simulate and rollouts, fresh processes, loading and comparing.

`Timer` prepares a timing on first use and returns the seconds of one call; a fresh process reports its own seconds.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from scipy.stats import binom

from referee import library as lib
from referee.library import CONTROL as CT
from referee.library import EFFECTS as FX
from referee.runs import KD6, KP6, Q2, Q6, V2, V6, batch, move, planar
from referee.sweeps import FIGURES, OF

COUNT = 55
BATCH = 4096
LOOP_S = 0.02  # of one turn
LEVEL = 0.95
STATE = {"M": 1, "C": 2, "N": 1}  # number of arguments; three where it is not listed
ONE_STATE = (
    "M", "C", "N", "inverse_dynamics", "forward_dynamics", "forward_dynamics_derivatives", "regressor",
)  # fmt: skip
INTO_OUT = ("M", "inverse_dynamics", "forward_dynamics")
BATCHES = ("M", "C", "inverse_dynamics", "forward_dynamics", "regressor")

Prepare = Callable[[], Callable[[], object]]


@cache
def robot(name: str) -> Any:
    return lib.arm("ur5") if name == "UR5" else lib.panda()


@cache
def machine_code(name: str) -> Any:
    return lib.compiled(robot(name))


def states(name: str, count: int) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(3, count, robot(name).n))


def query(
    of: Callable[[], Any], name: str, quantity: str, count: int = 1, has_out: bool = False
) -> Callable[[], object]:
    """Return a call of a query: one state, or a batch; into an array that is there, if has_out."""
    call = getattr(of(), quantity)
    x = states(name, count)[: STATE.get(quantity, 3)]
    arguments = tuple(x[:, 0] if count == 1 else x)
    if not has_out:
        return lambda: call(*arguments)
    out = np.empty_like(call(*arguments))
    return lambda: call(*arguments, out=out)


def bare(name: str, function: Any) -> Callable[[], object]:
    """Return a call of Pinocchio's function from Python."""
    model = lib.pinocchio_model(robot(name))
    data, (q, v, a) = model.createData(), states(name, 1)[:, 0]
    return lambda: function(model, data, q, v, a)


def simulated(setup: Callable[[], Any]) -> Callable[[], object]:
    of = setup()
    return lambda: lib.simulate(of)


def rolled_out(setup: Callable[[], Any], q: np.ndarray, v: np.ndarray, B: int) -> Callable[[], object]:
    of, q0, v0 = setup(), batch(B, q, 5), np.tile(v, (B, 1))
    return lambda: lib.rollouts(of, q0, v0)


def under_pd(by: Any, step: float | None, estimate: bool = False, engine: str = "compiled") -> Any:
    plant = lib.plant(robot("UR5"), FX.viscous(0.5))
    return lib.setup(
        plant, Q6, V6, 0.5, CT.pd(move(Q6, 0.4), KP6, KD6), by, step, 0.01, estimate=estimate, engine=engine
    )


def swing(effects: Any, by: Any, step: float | None = None, estimate: bool = False) -> Any:
    return lib.setup(lib.plant(planar(), *effects), Q2, V2, 0.5, None, by, step, 0.01, estimate=estimate)


def stops() -> list[Any]:
    return [FX.rigid_stops(-1.0, [0.7, 1.2], 0.5), FX.dry([2.0, 1.0])]


def swept() -> Any:
    return swing([FX.viscous(0.5)], lib.method("RK4"), 2e-3)


def small_sweep() -> Callable[[], object]:
    design = np.random.Generator(np.random.PCG64(1)).random((64, 2))
    vary, figures = {"viscous": OF.uniform([0.1, 0.1], [1.0, 1.0])}, {"end": FIGURES.final("q", "joint_2")}

    def run() -> object:
        with tempfile.TemporaryDirectory() as folder:
            of = lib.sweep("referee.timings:swept", vary, figures, design)
            return lib.sweep_values(of, Path(folder, "rows"))

    return run


FIRST_RUN = """
from time import perf_counter
began = perf_counter()
from referee import library as lib, timings
of = timings.under_pd(lib.method("RK4"), 1e-3)
lib.simulate(of)
print(perf_counter() - began)
"""
IMPORT = """
import numpy
from time import perf_counter
began = perf_counter()
import robot_dyn
robot_dyn.load
print(perf_counter() - began)
"""


def fresh(code: str, folder: Path | None = None) -> float:
    """Return the seconds that a fresh process prints; without a folder, its code is compiled into an empty one."""
    with tempfile.TemporaryDirectory() as empty:
        place = lib.environment(folder or Path(empty))
        done = subprocess.run([sys.executable, "-c", code], env=place, check=True, capture_output=True, text=True)
    return float(done.stdout)


def warm(code: str) -> Callable[[], float]:
    """Return a fresh process that finds the compiled code of an earlier one."""
    folder = tempfile.TemporaryDirectory()
    fresh(code, Path(folder.name))
    return lambda: fresh(code, Path(folder.name))


def in_process() -> Iterator[tuple[str, Prepare]]:
    """Return name and preparation of each timing in this process."""
    for name in ("UR5", "Panda"):
        code = partial(machine_code, name)
        for quantity in ONE_STATE:
            yield f"{name}, {quantity}, one state", partial(query, code, name, quantity)
        for quantity in INTO_OUT:
            yield f"{name}, {quantity}, into out", partial(query, code, name, quantity, has_out=True)
        for quantity in BATCHES:
            yield f"{name}, {quantity}, batch of {BATCH}", partial(query, code, name, quantity, BATCH, True)
        yield f"{name}, pin.aba", partial(bare, name, pin.aba)
        yield f"{name}, pin.rnea", partial(bare, name, pin.rnea)
    yield "UR5, M of a robot", partial(query, partial(robot, "UR5"), "UR5", "M")
    yield "UR5, forward_dynamics of a robot", partial(query, partial(robot, "UR5"), "UR5", "forward_dynamics")
    yield "UR5, M of the own implementation", partial(query, lambda: lib.own_lagrangian(robot("UR5")), "UR5", "M")
    by = lib.method
    yield "simulate, RK4", partial(simulated, lambda: under_pd(by("RK4"), 1e-3))
    yield "simulate, RK4 with its error estimate", partial(simulated, lambda: under_pd(by("RK4"), 1e-3, True))
    yield "simulate, RK4 interpreted", partial(simulated, lambda: under_pd(by("RK4"), 5e-3, engine="interpreted"))
    yield "simulate, DOP853", partial(simulated, lambda: under_pd(by("DOP853", 1e-8), None))
    yield (
        "simulate, Rodas5P",
        partial(simulated, lambda: swing([FX.regularised_coulomb(2.0, 1e-3)], by("Rosenbrock", 1e-8))),
    )
    yield "simulate, Gauss 4", partial(simulated, lambda: under_pd(by("Gauss 4"), 5e-3))
    yield "simulate, time stepping", partial(simulated, lambda: swing(stops(), by("time stepping"), 1e-3))
    yield "simulate, events", partial(simulated, lambda: swing(stops(), by("DOP853", 1e-8)))
    yield "simulate, short", partial(simulated, lambda: swing([], by("RK4"), 0.05))
    yield "rollouts in lock step", partial(rolled_out, lambda: under_pd(by("RK4"), 2e-3), Q6, V6, 64)
    yield "rollouts past stops", partial(rolled_out, lambda: swing(stops(), by("RK4"), 2e-3), Q2, V2, 64)
    yield "rollouts by DOP853", partial(rolled_out, lambda: under_pd(by("DOP853", 1e-8), None), Q6, V6, 64)
    yield "load UR5", lambda: partial(lib.arm, "ur5")
    yield "compare, one state", lambda: partial(lib.compare, robot("UR5"), 1)
    yield "sweep of 64 rows", small_sweep


FRESH: dict[str, Callable[[], Callable[[], float]]] = {
    "fresh process, import": lambda: partial(fresh, IMPORT),
    "fresh process, first run, nothing compiled": lambda: partial(fresh, FIRST_RUN),
    "fresh process, first run, from the cache": lambda: warm(FIRST_RUN),
}


def names(pattern: str = "") -> list[str]:
    """Return the names of all 55 timings, or of those that contain a text."""
    return [name for name in [*(name for name, _ in in_process()), *FRESH] if pattern in name]


class Timer:
    """Times calls by name; a call is prepared, and the number of its repeats chosen, on first use."""

    def __init__(self) -> None:
        self._calls: dict[str, tuple[Callable[[], object], int]] = {}
        self._fresh: dict[str, Callable[[], float]] = {}

    def seconds(self, name: str) -> float:
        """Return the seconds of one call, from a loop of about LOOP_S."""
        if name in FRESH:
            if name not in self._fresh:
                self._fresh[name] = FRESH[name]()
            return self._fresh[name]()
        if name not in self._calls:
            call, number = dict(in_process())[name](), 1
            call()
            while _loop(call, number) < LOOP_S / 2:
                number *= 2
            self._calls[name] = call, number
        call, number = self._calls[name]
        return _loop(call, number) / number


def _loop(call: Callable[[], object], number: int) -> float:
    repeats = range(number)
    began = perf_counter()
    for _ in repeats:
        call()
    return perf_counter() - began


def measured(turns: int, pattern: str = "") -> dict[str, dict[str, float]]:
    """Return median, spread and number of turns of each timing; all of them take turns."""
    timer, times = Timer(), {name: [] for name in names(pattern)}
    for _ in range(turns):
        for name, seconds in times.items():
            seconds.append(timer.seconds(name))
    return {name: summary(seconds) for name, seconds in times.items()}


def summary(seconds: list[float]) -> dict[str, float]:
    """Return the median, and the interquartile range over it."""
    middle = median(seconds)
    lower, _, upper = quantiles(seconds, n=4) if len(seconds) > 1 else (middle, middle, middle)
    return {"median_s": middle, "spread": (upper - lower) / middle, "turns": len(seconds)}


def upper_end(ratios: list[float]) -> float:
    """Return the upper 95 % end of the median: the least order statistic that covers it; inf for less than 5 values."""
    n = len(ratios)
    covers = [k for k in range(1, n + 1) if binom.cdf(k - 1, n, 0.5) >= LEVEL]
    return sorted(ratios)[covers[0] - 1] if covers else np.inf
