"""30 sweeps of 32 to 64 rows on given design tables: two for each of fifteen setups.

The tables are drawn by NumPy's PCG64 and given to the sweep, so that they depend on no design of the library. The
library imports the setups by name, in workers too, so that each is a function of this module.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from referee import library as lib
from referee.library import CONTROL as CT
from referee.library import DISTRIBUTIONS as OF
from referee.library import EFFECTS as FX
from referee.library import FIGURES, Texts, Values
from referee.results import PUSHES, UNITS, Result, with_growth
from referee.runs import KD2, KP2, Q2, Q6, V2, move, planar

COUNT = 30
ROWS = (32, 48, 64)


def _setup(*effects: Any, law: Any = None, by: str = "RK4", robot: Any = None, q0: Any = Q2, v0: Any = V2) -> Any:
    fixed = by not in ("DOP853", "Rosenbrock")
    plant = lib.plant(planar() if robot is None else robot, *effects)
    return lib.setup(
        plant, q0, v0, 0.2, law, lib.method(by, None if fixed else 1e-8), 2e-3 if fixed else None, 0.01,
        estimate=False,
    )  # fmt: skip


def swing() -> Any:
    return _setup(FX.viscous(0.5))


def tracking() -> Any:
    return _setup(FX.viscous(0.5), law=CT.pd(move(), KP2, KD2))


def soft_stops() -> Any:
    return _setup(FX.stops(-1.0, [0.5, 1.0], 4e3, 40.0))


def dry() -> Any:
    return _setup(FX.dry([6.0, 3.0], [9.0, 4.0], 0.2))


def rigid() -> Any:
    return _setup(FX.rigid_stops(-1.0, [0.5, 1.0], 0.5), by="order 8")


def bristles() -> Any:
    return _setup(FX.lugre(900.0, 8.0, 0.1, 2.0, 3.0, 0.1))


def dahl() -> Any:
    return _setup(FX.dahl(500.0, [2.0, 1.0]), by="DOP853")


def saturated() -> Any:
    return _setup(FX.effort_limit([25.0, 9.0]), law=CT.pid(move(), KP2, 2 * KP2, KD2, [30.0, 12.0]))


def elastic() -> Any:
    return _setup(FX.series_elastic(900.0, 2e-4, 80.0, 5.0, 5.0), law=CT.pd(move(), KP2, KD2), by="DOP853")


def sampled() -> Any:
    law = CT.pd(move(), KP2, KD2, 5e-3)
    return _setup(
        FX.viscous(0.5),
        law=CT.loop(law, [CT.noise(1e-4), CT.quantisation(1e-4)], [CT.low_pass(200.0)], (), 0.4, 1.0, 3),
    )


def stiff() -> Any:
    return _setup(FX.regularised_coulomb(2.0, 1e-2), FX.viscous(20.0), by="Rosenbrock")


def springs() -> Any:
    return _setup(FX.spring([20.0, 5.0]), by="Gauss 4")


def pushed() -> Any:
    return _setup(FX.wrench("tip", [5.0, -9.0, 4.0, 0.1, 0.5, -0.3], 0.05, 0.13), FX.viscous(0.5), by="DOP853")


def ur5() -> Any:
    robot = lib.arm("ur5")
    law = CT.computed_torque(lib.arm("ur5", mass_scale=1.1), move(Q6, 0.2), 225.0, 30.0)
    return _setup(FX.viscous(1.0), law=law, robot=robot, q0=Q6, v0=np.zeros(6))


def picks_up() -> Any:
    return _setup(FX.carried(lib.payload("tip", 0.8), 0.06, 0.15), FX.viscous(0.5))


def speed(run: Any) -> float:
    """A figure of a user: root mean square of the velocities."""
    return float(np.sqrt(np.mean(run.v**2)))


START = {"q0": OF.normal([0.4, 0.9], 0.05), "v0": OF.uniform([1.0, -1.0], [1.5, 0.5])}
MOTION = {"end": FIGURES.final("q", "joint_2"), "fastest": FIGURES.peak("v"), "speed": "referee.sweeps:speed"}
EFFORT = {
    "error": FIGURES.rms_tracking_error(),
    "torque": FIGURES.peak("u", "joint_1"),
    "end": FIGURES.final("v", "joint_1"),
}


@dataclass(frozen=True)
class Plan:
    """A setup, what varies in two sweeps of it, and the figures of their rows."""

    setup: Callable[[], Any]
    first: dict[str, Any]
    second: dict[str, Any]
    figures: dict[str, Any]


PLANS = (
    Plan(swing, START, {"viscous": OF.lognormal([0.5, 0.3], 0.4), "mass_scale": OF.normal(1.0, 0.1)}, MOTION),
    Plan(tracking, {"kp": OF.uniform([30.0, 10.0], [90.0, 30.0])}, {"kd": OF.choice([6.0, 12.0, 4000.0])}, EFFORT),
    Plan(soft_stops, {"soft upper": OF.triangular([0.45, 0.95], [0.5, 1.0], [0.9, 1.4])}, START, MOTION),
    Plan(dry, {"dry": OF.uniform([1.0, 0.5], [5.0, 2.5])}, START, MOTION),
    Plan(rigid, {"restitution": OF.uniform(0.1, 0.9)}, START, MOTION),
    Plan(bristles, {"lugre coulomb": OF.uniform(1.0, 2.0)}, {"lugre stiffness": OF.lognormal(900.0, 0.2)}, MOTION),
    Plan(dahl, {"dahl coulomb": OF.uniform([1.0, 0.5], [4.0, 2.0])}, START, MOTION),
    Plan(saturated, {"limit": OF.uniform([15.0, 5.0], [30.0, 12.0])}, {"ki": OF.lognormal(90.0, 0.5)}, EFFORT),
    Plan(elastic, {"elastic stiffness": OF.lognormal(900.0, 0.2)}, {"kp": OF.uniform([30.0, 9.0], [90.0, 30.0])},
         EFFORT),
    Plan(sampled, {"kp": OF.normal([60.0, 20.0], [5.0, 2.0])}, {"mass_scale": OF.uniform(0.8, 1.2)}, EFFORT),
    Plan(stiff, {"regularised": OF.uniform(1.0, 3.0)}, {"viscous": OF.uniform(10.0, 30.0), **START}, MOTION),
    Plan(springs, {"spring": OF.triangular([10.0, 2.0], [20.0, 5.0], [30.0, 9.0])}, START, MOTION),
    Plan(pushed, {"bar_2.mass": OF.normal(1.0, 0.1)}, START, MOTION),
    Plan(ur5, {"kp": OF.uniform(100.0, 300.0)}, {"mass_scale": OF.normal(1.0, 0.05)},
         {"error": FIGURES.rms_tracking_error(), "torque": FIGURES.peak("u", "elbow_joint")}),
    Plan(picks_up, START, {"viscous": OF.uniform(0.1, 1.0), "mass_scale": OF.triangular(0.9, 1.0, 1.2)}, MOTION),
)  # fmt: skip


def sweeps(pushes: bool = True) -> dict[str, Callable[[], Result]]:
    """Return what makes the result of each of the 30 sweeps, by name."""
    made = {}
    for k, plan in enumerate(PLANS):
        for number, vary in enumerate((plan.first, plan.second), 1):
            seed = 2 * k + number
            made[f"{plan.setup.__name__}, {' and '.join(vary)}"] = partial(_result, plan, vary, seed, pushes)
    return made


def _result(plan: Plan, vary: dict[str, Any], seed: int, pushes: bool) -> Result:
    """Run a sweep, and with pushes twice again with a design that is UNITS of rounding away."""
    columns = sum(lib.width(distribution) for distribution in vary.values())
    table = np.random.Generator(np.random.PCG64(seed)).random((ROWS[seed % 3], columns))

    def made(push: float) -> tuple[Values, Texts]:
        design = np.clip(table * (1 + push * UNITS * 2.0**-53), 0.0, np.nextafter(1.0, 0.0))
        with tempfile.TemporaryDirectory() as folder:
            of = lib.sweep(f"referee.sweeps:{plan.setup.__name__}", vary, plan.figures, design)
            return lib.sweep_values(of, Path(folder, "rows"))

    return with_growth(made(0.0), map(made, PUSHES if pushes else ()))
