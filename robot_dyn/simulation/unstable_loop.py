"""Whether the loop of a sampled controller is stable about states of a run; what grows slowly may end before it shows.

δx⁺ = Φ(T) δx over a period T:   ρ(Φ)^(duration/T) > 1e3, beyond the growth of the same loop with control at all times
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.control.controller import Controller
from robot_dyn.errors import RobotDynError
from robot_dyn.simulation.remarks import Kind, Remark
from robot_dyn.simulation.sampled_loop import linearised
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.stability import below, blows_up, longest
from robot_dyn.simulation.state_equation import StateEquation


def unstable(setup: Setup, equation: StateEquation, t: np.ndarray, y: np.ndarray) -> Iterator[Remark]:
    """A remark if the loop is unstable about the start, the middle or the end of a run, as far as it is finite there.

    Args:
        setup: What ran.
        equation: Its state equation.
        t: Times of its samples, (m,), in [s].
        y: Its states there, (m, size).
    """
    controller, motion = setup.controller, equation.equation_of_motion
    if controller is None or not equation.sampled or equation.canonical:
        return
    if motion.payloads or any(drive.coupled for drive in motion.drives.values()):  # no one linearisation holds
        return
    n, first = setup.plant.dynamics.n, 2 * setup.plant.dynamics.n + equation.state_size
    good = np.flatnonzero(np.isfinite(y).all(axis=1))
    looks = sorted({int(k) for k in good[[0, len(good) // 2, -1]]}) if len(good) else []
    found = []
    for k in looks:
        with suppress(RobotDynError, np.linalg.LinAlgError, ValueError):  # too far out to be linearised
            z = np.zeros(controller.at_period(0.0).state_size)
            x = np.concatenate([y[k, : 2 * n], z, y[k, first : first + motion.state_size]])
            found += _growths(setup, controller, float(t[k]), x)
    if found:
        yield _remark(setup, controller, max(found, key=lambda each: each.factor))


class _Growth(NamedTuple):
    """How deviations grow about a state: when, of which joint most, by which factor in a period; and the loop there."""

    t: float
    joint: int
    factor: float
    cycle: Callable[[float], Array]
    loop: Array


def _growths(setup: Setup, controller: Controller, t: float, x: np.ndarray) -> list[_Growth]:
    """The growth about a state (q, v, z), if it is one."""
    n, period = setup.plant.dynamics.n, controller.period_s
    with np.errstate(all="ignore"):
        cycle, loop = linearised(setup.plant, controller, t, x)
        made = cycle(period)
        if not np.isfinite(made).all() or not blows_up(made, loop, period, setup.duration_s, controller.cycle):
            return []
        values, vectors = np.linalg.eig(made)
    worst = int(np.argmax(np.abs(values)))
    part = np.abs(vectors[:n, worst]) + period * np.abs(vectors[n : 2 * n, worst])
    return [_Growth(t, int(np.argmax(part)), float(np.abs(values[worst]) ** (1 / controller.cycle)), cycle, loop)]


def _remark(setup: Setup, controller: Controller, most: _Growth) -> Remark:
    period, joint = controller.period_s, setup.plant.dynamics.joint_names[most.joint]
    limit = longest(most.cycle, most.loop, setup.duration_s, controller.cycle)
    text = f"{joint} by {most.factor:.4g} in each period of {period:.4g} s about the state at {most.t:.4g} s"
    remedy = (
        f"the loop is stable up to {limit:.3g} s: take period_s={below(limit)}, or lower gains"
        if limit
        else "so it is with every period: take lower gains, or less delay"
    )
    return Remark(Kind.UNSTABLE, joint, "q", most.t, 0.0, most.t, most.factor, 1.0, text, remedy)
