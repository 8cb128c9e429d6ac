"""The largest gains of a sampled PD that are stable, by the advisor, and runs that confirm them.

kp = ω² m,   kd = 2 ω m,   m the median of M_ii:   the largest ω at which the longest stable period is the given one
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, sqrt

import numpy as np

from robot_dyn.control.computed_torque import PDGravity
from robot_dyn.errors import RobotDynError
from robot_dyn.simulation.sampled_loop import longest_period
from robot_dyn.simulation.setup import Setup
from robot_dyn.stress_test.confirm import BEYOND, WITHIN, pushed, told
from robot_dyn.stress_test.finding import Limit
from robot_dyn.stress_test.lines import expression

PERIOD_S = 1e-3
_TICKS = 200  # of a run
_RANGE = (1.0, 1e5)  # of ω, in [rad/s]
_SHARP = 1e-3


def gain_limit(setup: Setup, seed: int, tell: Callable[[str], object]) -> Limit:
    """The largest frequency of a PD with ticks of 1 ms.

    Args:
        setup: As of `steps.held`.
        seed: Of the push.
        tell: Called with what is being done.
    """
    tell("gains: linearisation")
    what = f"PD of ζ = 1 sampled at {PERIOD_S:g} s, ω"
    law = setup.controller
    inertia = law.kd**2 / (4 * law.kp)
    setup = replace(setup, duration_s=_TICKS * PERIOD_S)

    def of(omega: float) -> PDGravity:
        return PDGravity(law.model, law.reference, inertia * omega**2, 2 * inertia * omega, PERIOD_S)

    y = np.concatenate([setup.q0, np.zeros(len(setup.q0))])

    def stable(omega: float) -> bool:
        return longest_period(setup.plant, of(omega), 0.0, y, setup.duration_s) >= PERIOD_S

    low, high = _RANGE
    if not stable(low) or stable(high):
        within = f"stable up to ω = {high:g} rad/s" if stable(low) else f"unstable from ω = {low:g} rad/s on"
        return Limit("gain", what, "", inf if stable(low) else 0.0, "rad/s", within, "", None, "")
    while high / low > 1 + _SHARP:
        middle = sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    tell("gains: runs")
    setup, at = pushed(setup, seed), setup.q0
    python = (
        f"m = {expression(inertia)}\nq = {expression(at)}\nfor omega in ({WITHIN * low!r}, {BEYOND * low!r}):\n"
        f"    law = rd.PDGravity(robot, rd.hold(q), np.array(m) * omega**2, 2 * np.array(m) * omega, {PERIOD_S!r})\n"
        f"    setup = {expression(replace(setup, controller=None))}\n    run = rd.simulate(setup, controller=law)\n"
        "    print(run.outcome.ending, abs(run.q[-1] - q).max(), rd.advise(setup, controller=law).longest_period_s)\n"
    )
    try:
        within, beyond = (told(replace(setup, controller=of(part * low)), at) for part in (WITHIN, BEYOND))
    except RobotDynError as error:
        return Limit("gain", what, "", low, "rad/s", f"not run: {error}", "", None, python)
    confirmed = within.stays and beyond.leaves(within)
    return Limit("gain", what, "", low, "rad/s", within.words, beyond.words, confirmed, python)
