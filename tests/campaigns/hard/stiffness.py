"""Stiff motion: what is asked of methods that choose their steps, and what those of a fixed step of 1 ms say.

    asked for 1e-6:       |q_h − q| ≤ 10 · 1e-6
    rtol of 1e-6:         |q_h − q| ≤ 10 · (1e-6 max |q| + 1e-8)
    a fixed step:         |q_h − q| ≤ estimate / 0.3; or no estimate, and a reason

A tolerance bounds the error of each step, and what decays does not add them up: ten of them are allowed. Where an
explicit step is beyond its limit of stability, the step that `advise` names, or its method, is what is judged.
[Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.2 and IV.15]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn import RobotDynError
from tests.campaigns.hard.case import Case, Row
from tests.campaigns.hard.stiff_motion import SAMPLES, Motion, damper, dry, of_arm, spring, stop

TITLE = "Stiffness"
ASKED, TIMES, LEAST = 1e-6, 10.0, 0.3
STEP = 1e-3  # [s]
IMPLICIT = "Rodas5PFixed", "GaussLegendre2", "GaussLegendre4"
ROUNDING = 1e-9  # [rad], below which the truth of an arm cannot tell


def true_error(run: rd.Trajectory, motion: Motion) -> float:
    """The largest up to where the run is said to be resolved."""
    until = run.error.until_s if run.error else run.t[-1]
    known = run.t <= max(until, 0.0)
    return float(np.abs(run.q[known] - motion.exact(run.t)[known]).max())


def rows(case: str, make: Callable[[], Motion], engine: str, seed: int) -> Iterator[Row]:
    motion = make()
    setup = replace(motion.setup, record_every_s=motion.setup.duration_s / SAMPLES, engine=engine)
    yield _asked(case, motion, setup)
    yield _controlled(case, motion, setup)
    for name in IMPLICIT:
        yield _fixed(case, name, motion, replace(setup, method=name, step_s=STEP))
    yield from _explicit(case, motion, replace(setup, method="RK4", step_s=STEP))


def _asked(case: str, motion: Motion, setup: rd.Setup) -> Row:
    what = f"asked for {ASKED:g}: true error over that"
    try:
        run = rd.simulate(setup, accuracy=ASKED)
    except RobotDynError as refusal:
        return Row(case, what, float("nan"), TIMES, str(refusal))
    return Row(case, what, true_error(run, motion) / ASKED, TIMES, run.outcome.text)


def _controlled(case: str, motion: Motion, setup: rd.Setup) -> Row:
    run = rd.simulate(setup, method=rd.integrate.Adaptive("Rodas5P", ASKED, ASKED / 100))
    error = true_error(run, motion)
    scale = ASKED * float(np.abs(run.q).max()) + ASKED / 100
    said = str(run.error) if run.error.at(run.error.until_s) >= LEAST * error else ""
    return Row(case, f"Rodas5P of rtol {ASKED:g}: true error over tolerance", error / scale, TIMES, said)


def _fixed(case: str, name: str, motion: Motion, setup: rd.Setup) -> Row:
    run = rd.simulate(setup)
    what = f"{name} of {setup.nominal_step_s:g} s: true error over estimate"
    if run.outcome.ending != "finished":
        return Row(case, what, float("nan"), 1 / LEAST, run.outcome.text)
    if not run.error.until_s > 0:
        return Row(case, what, float("nan"), 1 / LEAST, str(run.error))
    found = max(true_error(run, motion), ROUNDING) / max(run.error.at(run.error.until_s), ROUNDING)
    return Row(case, what, found, 1 / LEAST, f"energy ledger: {run.leak}" if run.leak else "")


def _explicit(case: str, motion: Motion, setup: rd.Setup) -> Iterator[Row]:
    """At a step that may be far beyond stability, and as advised."""
    yield _fixed(case, "RK4", motion, setup)
    try:
        advice = rd.advise(setup)
    except RobotDynError as refusal:
        yield Row(case, "RK4 as advised: true error over estimate", float("nan"), 1 / LEAST, str(refusal))
        return
    if advice.stable:
        return
    limit = advice.limits["RK4"]
    others = [name for name, h in advice.limits.items() if h >= STEP]
    if others:
        yield _fixed(case, f"{others[0]}, as advised for RK4,", motion, replace(setup, method=others[0]))
    if setup.duration_s / limit < 20_000:
        yield _fixed(case, "RK4 at half the limit", motion, replace(setup, step_s=limit / 2))


def _driven(name: str, k: float) -> Motion:
    d = np.sqrt(k)
    law = rd.control.PD(rd.control.hold(np.full(rd.load(name).n, 0.3)), kp=k, kd=d)
    return of_arm(name, [], lambda q, v: k * (0.3 - q) - d * v, law)


ONE: dict[str, Any] = {
    **{f"damper of {b:g} N m s/rad": partial(damper, b) for b in (1e-3, 1e3, 1e6)},
    **{f"spring of {k:g} N m/rad": partial(spring, k) for k in (1e4, 1e8)},
    **{f"stop of {k:g} N m/rad": partial(stop, k) for k in (1e5, 1e9)},
    **{f"tanh friction of width {w:g} rad/s": partial(dry, w) for w in (1e-2, 1e-6)},
}
ARMS: dict[str, Any] = {
    "2R, dampers of 1e4 N m s/rad": partial(
        of_arm, "planar_2r", [rd.effects.ViscousFriction(1e4)], lambda q, v: -1e4 * v
    ),
    "2R, PD of 1e6 N m/rad": partial(_driven, "planar_2r", 1e6),
    "2R, tanh friction of width 1e-4 rad/s": partial(
        of_arm, "planar_2r", [rd.effects.RegularisedCoulombFriction(30.0, 1e-4)], lambda q, v: -30.0 * np.tanh(v / 1e-4)
    ),
    "2R, inertia of motors 1e3 kg m²": partial(
        of_arm, "planar_2r", [rd.effects.ViscousFriction(10.0)], lambda q, v: -10.0 * v, armature=1e3
    ),
}
_DAMPER = "damper of 1e+06 N m s/rad"
SHORT = {_DAMPER: ONE.pop(_DAMPER)}  # interpreted: machine code of five methods takes longer to make
CASES = [
    *(Case(name, partial(rows, name, make, "interpreted")) for name, make in SHORT.items()),
    *(Case(name, partial(rows, name, make, "auto"), True) for name, make in (ONE | ARMS).items()),
]
