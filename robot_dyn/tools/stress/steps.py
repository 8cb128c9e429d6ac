"""The longest stable step of each method of fixed step, by the advisor, and runs that confirm it.

The arm is held at a configuration by a PD with its gravity balanced, an equilibrium, and the viscous friction of its
file; a push that grows is the method's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite

import numpy as np

from robot_dyn import Plant, Robot, RobotDynError, Setup
from robot_dyn.accuracy import Advice, advice_about, at_rest
from robot_dyn.control import PDGravity, hold
from robot_dyn.effects import ViscousFriction
from robot_dyn.integrate import FIXED_STEP, Gauss, method
from robot_dyn.report import Budget
from robot_dyn.simulation import StateEquation, jacobian, step_map
from robot_dyn.tools.stress.confirm import BEYOND, WITHIN, pushed, run_from_near
from robot_dyn.tools.stress.finding import Limit
from robot_dyn.tools.stress.work import Work

_TIMES = 400.0  # of the run, 1/|λ| of the fastest motion
_STEPS = 10  # of a method whose stages are iterated
_PARTS = 20  # of the run: the longest step that is judged


def held(robot: Robot, q: np.ndarray, gains: tuple[np.ndarray, np.ndarray], rate: float) -> Setup:
    """The arm at rest at q, held there; the run lasts so many times its fastest motion."""
    effects = [ViscousFriction(robot.damping)] if np.any(robot.damping) else []
    return Setup(
        Plant(robot, effects), q, duration_s=_TIMES / rate, controller=PDGravity(robot, hold(q), *gains),
        engine="interpreted",
    )  # fmt: skip


def step_limits(setup: Setup, seed: int, work: Work) -> Iterator[Limit]:
    """Each method of fixed step: its limit, and runs at 0.98 and 1.02 of it.

    Args:
        setup: As of `held`.
        seed: Of the push.
        work: Does it.
    """
    names = {name: f"step of {name}" for name in FIXED_STEP}
    known = work.do("linearisation", lambda _: _linearised(setup), tuple(names.values()))
    if known is None:
        return
    advice, J = known
    setup = replace(setup, duration_s=min(setup.duration_s, _TIMES / abs(advice.fastest.eigenvalue)))
    for name, of in names.items():
        made = work.do(of, lambda until, name=name: _judged(setup, name, advice, J, seed, until))
        if made is not None:
            yield made


def _linearised(setup: Setup) -> tuple[Advice, np.ndarray]:
    """The advice at rest, and J there."""
    loop = StateEquation(setup.plant, setup.controller).in_a_mode
    ((t, y),) = at_rest(setup, loop)
    return advice_about(setup, at_rest), jacobian(loop, t, y, None)


def _judged(setup: Setup, name: str, advice: Advice, J: np.ndarray, seed: int, budget: Budget) -> Limit:
    """The limit of a method."""
    limit, joint, n = advice.limits[name], advice.fastest.joint, len(setup.q0)
    try:
        unstable = isfinite(limit) and not _iterates(name)
        matrix = step_map(method(name), J, n)(BEYOND * limit) if unstable else J
        start = pushed(replace(setup, integrator=name), matrix, seed)
        return _confirmed(start, setup.q0, name, limit, joint, budget)
    except RobotDynError as error:
        return Limit("step", name, joint, limit, "s", f"not run: {error}", "", None)


def _confirmed(setup: Setup, at: np.ndarray, name: str, limit: float, joint: str, budget: Budget) -> Limit:
    """The limit of a method, with runs at both sides of it, or with steps as long as are judged if it has none."""
    where = {"q": at.tolist()}
    if not isfinite(limit):
        longest = setup.duration_s / _PARTS
        longest_steps = replace(setup, step_s=longest)
        run = run_from_near(longest_steps, at, budget, True)
        told_of = f"step {longest:.3g} s: {run.description}"
        holds = run.stays or (_iterates(name) and not isfinite(run.growth))
        return Limit("step", name, "", limit, "s", told_of, "", holds and not run.misleads, where, (longest_steps,))
    what, iterates = name, _iterates(name)
    if iterates:  # every step is stable, and where its stages are not found, about there, the run says so
        setup, what = replace(setup, duration_s=_STEPS * limit), f"{name}, about where its stages are not found"
    setups = tuple(replace(setup, step_s=part * limit) for part in (WITHIN, BEYOND))
    within, beyond = run_from_near(setups[0], at, budget), run_from_near(setups[1], at, budget, not iterates)
    confirmed = within.stays and beyond.leaves(within) and not beyond.misleads
    if iterates:
        grew = any(not each.stays and isfinite(each.growth) for each in (within, beyond))
        confirmed = False if grew else None  # a limit that is not sharp is neither reached nor kept
    said = beyond.description + " AND DOES NOT SAY SO" * beyond.misleads
    return Limit("step", what, joint, limit, "s", within.description, said, confirmed, where, setups)


def _iterates(name: str) -> bool:
    """Whether the stages of a method are iterated, so that a run ends, and says so, where they are not found."""
    return isinstance(method(name), Gauss)
