"""The largest gains of a sampled PD that are stable, by its linearised map, and what advisor and runs say of them.

kp = ω² m,   kd = 2 ω m,   m the median of M_ii:   the largest ω at which ticks of the given period are stable
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, sqrt

import numpy as np

from robot_dyn import RobotDynError, Setup
from robot_dyn.accuracy import advice_about, at_rest
from robot_dyn.control import PDGravity
from robot_dyn.report import Budget
from robot_dyn.simulation import Stability, linearised
from robot_dyn.tools.stress.confirm import BEYOND, WITHIN, pushed, run_from_near
from robot_dyn.tools.stress.finding import Limit
from robot_dyn.tools.stress.work import Work

PERIOD_S = 1e-3
_WHAT = f"PD of ζ = 1 sampled at {PERIOD_S:g} s, ω"
_TICKS = 200  # of a run
_RANGE = (1.0, 1e5)  # of ω, in [rad/s]
_SHARP = 1e-3


def gain_limit(setup: Setup, seed: int, work: Work) -> Limit | None:
    """The largest frequency of a PD with ticks of 1 ms; None for lack of time.

    Args:
        setup: As of `steps.held`.
        seed: Of the push.
        work: Does it.
    """
    setup = replace(setup, duration_s=_TICKS * PERIOD_S, engine="auto")
    law = setup.controller
    inertia = law.kd**2 / (4 * law.kp)

    def of(omega: float) -> Setup:
        made = PDGravity(law.model, law.reference, inertia * omega**2, 2 * inertia * omega, PERIOD_S)
        return replace(setup, controller=made)

    low = work.do("largest gain", lambda budget: _largest(of, budget))
    if low is None or not 0 < low < inf:
        within = f"stable up to ω = {_RANGE[1]:g} rad/s" if low else f"unstable from ω = {_RANGE[0]:g} rad/s on"
        return None if low is None else Limit("gain", _WHAT, "", low, "rad/s", within, "", None)
    return work.do("largest gain, judged", lambda budget: _judged(of, low, inertia, seed, budget))


def _largest(of: Callable[[float], Setup], budget: Budget) -> float:
    """The limit, by bisection; inf or 0 if there is none."""

    def stable(omega: float) -> bool:
        budget.check()
        at = of(omega)
        y = np.concatenate([at.q0, np.zeros(len(at.q0))])
        try:
            return linearised(at.plant, at.controller, 0.0, y).growth(PERIOD_S).verdict is not Stability.UNSTABLE
        except np.linalg.LinAlgError:  # it is not finite
            return False

    low, high = _RANGE
    if not stable(low):
        return 0.0
    if stable(high):
        return inf
    while high / low > 1 + _SHARP:
        middle = sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _judged(of: Callable[[float], Setup], low: float, inertia: np.ndarray, seed: int, budget: Budget) -> Limit:
    """What advisor and runs say on both sides of the limit."""
    both = [of(part * low) for part in (WITHIN, BEYOND)]
    at, y = both[0].q0, np.concatenate([both[0].q0, both[0].v0])
    loop = linearised(both[1].plant, both[1].controller, 0.0, y)
    start = pushed(both[0], loop.matrix(PERIOD_S), seed)
    setups = tuple(replace(each, q0=start.q0, v0=start.v0) for each in both)
    try:
        periods = [advice_about(each, at_rest).longest_period_s for each in both]
        within, beyond = (run_from_near(each, at, budget) for each in setups)
    except RobotDynError as error:
        return Limit("gain", _WHAT, "", low, "rad/s", f"not run: {error}", "", None, {"q": at.tolist()}, setups)
    agrees = periods[0] >= PERIOD_S > periods[1]
    said = beyond.description + f"; THE ADVISOR TAKES IT FOR STABLE UP TO {periods[1]:.3g} s" * (not agrees)
    confirmed = agrees and within.stays and beyond.leaves(within)
    return Limit("gain", _WHAT, "", low, "rad/s", within.description, said, confirmed, {"q": at.tolist()}, setups)
