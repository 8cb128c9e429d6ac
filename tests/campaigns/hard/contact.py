"""Random scenes of friction, stops and impacts, of planar_2r and of panda: smooth ones, and set-valued ones.

    true error ≤ estimate / 0.3 wherever nothing else warns;   KKT residual ≤ 1e-13;   no impulse adds energy

The truth shares no line with the library's runs: SciPy's DOP853 near rounding over Pinocchio, cut at every switch; of
dry friction and rigid stops in modes that are found by trying all combinations. It is run twice, with other tolerances
and steps: below their distance, and below 1e-12 of the motion, nothing is judged. An estimate may be 0.3 of the error,
as stated in tests/campaigns/estimates. A set-valued scene ends at its event number 150, if there are as many: bounces
that kick each other off their stops go on by thousands; or where two joints come to rest and friction of rest, above
that of sliding, leaves it open which of them goes on: the law has several solutions there; or at 20 events within 1e-6
s, where the truth cannot follow. The residual of the convex problems is on the scale of the terms added, where a
Cholesky solution of n ≤ 7 joints leaves 3e-15; that of time stepping is asked again from outside, with M and loads by
Pinocchio alone. The kinetic energy behind an impact is at most that before it, but for 4 n u |v|ᵀ|M||v|: n + 3
roundings of each product. The energy that nothing accounts for is at most 1e-3 of that exchanged, or the summary says
it. In time stepping stops add none at all, but for the rounding of 400 steps, each 20 u of what is exchanged: 1e-12.
Its error there falls to a quarter with the step, order 1; the median over 50 scenes may be 0.4 of it, since impacts
fall anywhere within steps; of fewer it tells nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from unittest.mock import patch

import numpy as np

import robot_dyn as rd
from robot_dyn.effects import settling
from robot_dyn.foundations.convex import active_set, residual
from tests.campaigns.estimates.held import cut, held_scene
from tests.campaigns.estimates.judge import LEAST, Judgement, judged
from tests.campaigns.estimates.nonsmooth import Bodies, nonsmooth_truth
from tests.campaigns.estimates.scenes import Scene, scene
from tests.campaigns.estimates.truth import truth
from tests.campaigns.hard.case import Case, Row

TITLE = "Friction, stops, impacts"
U = 2.0**-53
KKT, OPEN, ADDED = 1e-13, 1e-3, 1e-12
STEPS = 100  # of time stepping
MANY = 50  # scenes in a block of the long form, for which compiling the time loops of all methods pays
SMOOTH = (2, 3)  # places of regularised friction and of stops as springs among the families of `scene`


def words(run: rd.Trajectory) -> str:
    """What the library says against a run."""
    return "; ".join(each for each in (run.outcome.text, run.error.note, run.leak) if each)


def of_estimates(case: str, found: list[Judgement]) -> Iterator[Row]:
    """Whether estimates mislead, and energy is lost, without a word."""
    misled = [each.scene.label for each in found if each.misleads]
    yield Row(case, "scenes that mislead" + "".join(f"; {each}" for each in misled), float(len(misled)), 0.0)
    quiet = [1 / each.ratio for each in found if each.silent]
    if quiet:
        yield Row(case, "true error over its estimate", max(quiet), 1 / LEAST)
    loud = max(found, key=lambda each: each.run.ledger.closure)
    yield Row(case, "energy unaccounted for, of that exchanged", loud.run.ledger.closure, OPEN, words(loud.run))


def _smooth(name: str, block: range, case: str, seed: int) -> Iterator[Row]:
    engine = "compiled" if len(block) >= MANY else "interpreted"
    made = [
        replace(each, setup=replace(each.setup, engine=engine))
        for each in (scene(seed, 6 * (i // 2) + SMOOTH[i % 2], name) for i in block)
    ]
    yield from of_estimates(case, [judged(each, truth, lambda s, t: truth(s, t, 2e-13, 7e-4)) for each in made])


@contextmanager
def watched() -> Iterator[list[float]]:
    """The residuals of all convex problems that events pose in interpreted runs."""
    worst: list[float] = [0.0]

    def recorded(*given: np.ndarray) -> bool:
        found = active_set(*given)
        worst.append(residual(*given[:6]))
        return found

    with patch.object(settling, "active_set", recorded):
        yield worst


def added(run: rd.Trajectory, bodies: Bodies) -> float:
    """Largest energy that impacts add between two samples, in units of the rounding that is allowed."""
    if "rigid_stops" not in run.ledger.work:
        return 0.0
    fastest = np.abs(run.extremes[1]).max(axis=0)
    size = max(float(fastest @ np.abs(bodies.M(q)) @ fastest) for q in run.q[:: max(1, len(run.q) // 20)])
    work = run.ledger.work["rigid_stops"]
    return float(np.diff(work).max()) / (4 * bodies.n * U * (size + float(np.abs(work).max())))


def step_residual(run: rd.Trajectory, bodies: Bodies) -> float:
    """How far the steps of time stepping are from M (v⁺ − v) = h load + r, −r ∈ h f ∂|v⁺| + N(v⁺), from outside."""
    worst = 0.0
    h = run.statistics.step_s
    for k in range(len(run.t) - 1):
        t = float(run.t[k])
        q, v = run.q[k] + run.v[k] * (h / 2), run.v[k]
        p = bodies.M(q) @ v + h * bodies.load(t + h / 2, q, v)
        friction = h * np.where(v != 0, bodies.level(v), bodies.rough)
        back = -np.where(v < 0, bodies.e, 1) * v, -np.where(v > 0, bodies.e, 1) * v
        lower = np.where(q <= bodies.lower, back[0], -np.inf)
        upper = np.where(q >= bodies.upper, back[1], np.inf)
        worst = max(worst, residual(bodies.M(q), p, friction, lower, upper, run.v[k + 1]))
    return worst


def _set_valued(name: str, block: range, case: str, seed: int) -> Iterator[Row]:
    found, kkt, energy, steps, ratios, broken, gained = [], 0.0, 0.0, [], [], [], []
    for i in block:
        made = cut(held_scene(seed, i, name)[0])
        made = replace(made, setup=replace(made.setup, engine="interpreted"))  # of which the problems are seen
        bodies = Bodies(made.setup)
        ends: list[np.ndarray] = []

        def exact(setup: rd.Setup, t: np.ndarray, ends=ends) -> np.ndarray:
            q = nonsmooth_truth(setup, t)
            ends.append(q[-1])
            return q

        with watched() as residuals:
            one = judged(made, exact, lambda s, t: nonsmooth_truth(s, t, 1e-12, 3e-3))
        found.append(one)
        kkt, energy = max(kkt, *residuals), max(energy, added(one.run, bodies))
        errors = []
        for count in (STEPS, 4 * STEPS):
            run = _stepped(made, count)
            errors.append(float(np.abs(run.q[-1] - ends[0]).max()))
        steps.append(step_residual(run, bodies))
        work = np.diff(run.ledger.work.get("rigid_stops", np.zeros(2)))
        gained.append(float(work[work > 0].sum()) / run.ledger.exchanged)
        ratios.append(errors[1] / max(errors[0], 1e-12))
        broken += [] if run.ledger.closure <= OPEN or run.leak else [made.label]
    yield from of_estimates(case, found)
    yield Row(case, "KKT residual at events", kkt, KKT)
    yield Row(case, "KKT residual of time stepping, from outside", max(steps), KKT)
    yield Row(case, "energy added by impacts, of the rounding allowed", energy, 1.0)
    yield Row(case, "time stepping: energy added by stops, of that exchanged", max(gained), ADDED)
    yield Row(case, "time stepping that leaks without a word", float(len(broken)), 0.0)
    if len(ratios) >= MANY:
        yield Row(case, "time stepping: error at a quarter of the step, median", float(np.median(ratios)), 0.4)


def _stepped(made: Scene, count: int) -> rd.Trajectory:
    setup = replace(
        made.setup, method="MoreauJean", step_s=made.setup.duration_s / count, record_every_s=0.0,
        engine="interpreted",
    )  # fmt: skip
    return rd.simulate(setup)


SCENES = {  # of the short form, and how many in the long one: 10 and 1000 in all
    ("smooth", "planar_2r"): (range(3), 500),
    ("smooth", "panda"): (range(2), 100),
    ("set-valued", "planar_2r"): (range(3), 300),
    ("set-valued", "panda"): (range(1, 5, 2), 100),  # of dry friction; with rigid stops in the long form
}


def _cases() -> Iterator[Case]:
    for (kind, name), (few, all_of_them) in SCENES.items():
        rows = _smooth if kind == "smooth" else _set_valued
        for block in (few, *(range(k, k + MANY) for k in range(0, all_of_them, MANY))):
            case = f"{name}, {kind}, scenes {block.start} to {block[-1]}"
            yield Case(case, partial(rows, name, block, case), block != few)


CASES = list(_cases())
