"""Smoothness of the right-hand side along a run: the first time at which it may have a kink.

A method of order p converges with order p only where f has p derivatives. Thresholds at which no step ends, and parts
that do not declare where they switch, may have kinks between the ends of steps. A thin layer, in which f bends, acts as
a kink on steps that cross much of it. [Hairer, Nørsett, Wanner 1993, II.6]
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.control.digital_loop.block import Block
from robot_dyn.effects.effect import Bound
from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.results.doubts import Doubt, DoubtKind, Onset, first_onset

if TYPE_CHECKING:
    from robot_dyn.simulation.dynamics.state_equation import StateEquation
    from robot_dyn.simulation.run.recording import Path
    from robot_dyn.simulation.setup.setup import Setup

_MOST_CROSSED = 1.0  # widths of a layer that a companion may cross in a step and still show the order of a method
_THIRDS = 3  # steps of the finest companion in a step of the run
_REACH = 3.0  # widths of a layer from its middle to its end: 1 − tanh 3 = 0.005, exp(−3²) = 1e-4
_NEAR_LIMIT = 0.95  # fraction of a level of the actuation
LOOKS = 4000  # evaluations, between steps, of parts that do not declare where they switch
_STATES = 300  # states at which the actuation is computed


def rounds(part: object) -> bool:
    """Return True for a block of a loop whose output jumps."""
    return isinstance(part, Block) and part.rounds


def first_kink(setup: Setup, equation: StateEquation, path: Path) -> Onset:
    """Return the first kink of the right-hand side along a run, from which it may not be smooth.

    Args:
        setup: The setup of the run.
        equation: State equation of the setup.
        path: States of the run, step by step.
    """
    if setup.undeclared:
        part, lacks = setup.undeclared[0]
        facts: dict[str, float | str] = {"part": named(part), "lacks": lacks, "shortest_s": setup.duration_s / LOOKS}
        return Onset(0.0, Doubt(DoubtKind.UNDECLARED, facts))
    if setup.controller is not None and any(rounds(block.part) for block in setup.controller.parts):
        return Onset(0.0, Doubt(DoubtKind.ROUNDED_AT_TICKS))
    if len(path.t) < 2:
        return Onset()
    kinks: list[Onset] = []
    if not setup.method.controls_error:
        kinks += _passed(setup, equation, path)
        kinks.append(first_crossing(equation, path, parts=_THIRDS))
    if not setup.finds_events:
        kinks.append(_saturation(setup, equation, path))
    return first_onset(kinks)


def _passed(setup: Setup, equation: StateEquation, path: Path) -> Iterator[Onset]:
    """Yield the first passage of each threshold at which no step ends."""
    n, y = equation.plant.dynamics.n, equation.with_velocities(path.y)
    low, high = extremes(path.t, *equation.motion(path.y))
    for k, effect in enumerate(setup.plant.effects):
        for threshold in effect.thresholds(n):
            joint, of_velocity = threshold.joint, threshold.of_velocity
            if threshold.of_actuation or (setup.finds_events and not (of_velocity and setup.method.canonical)):
                continue
            if of_velocity or threshold.state is not None:
                x = y[:, equation.row(k, threshold)]
                below, above = np.minimum(x[:-1], x[1:]), np.maximum(x[:-1], x[1:])
            else:
                below, above = low[:, joint], high[:, joint]
            facts: dict[str, float | str] = {
                "joint": equation.plant.dynamics.joint_names[joint], "threshold": threshold.name
            }  # fmt: skip
            passes = (below <= threshold.level) & (above >= threshold.level)
            yield _first(path.t, passes, Doubt(DoubtKind.PASSES_WITHIN_STEP, facts))


def first_crossing(equation: StateEquation, path: Path, pace: float = 1.0, parts: int = 1) -> Onset:
    """Return the first kink that is a layer of an effect: steps cross it too fast.

    Args:
        equation: The state equation.
        path: States of a run or of a companion, step by step.
        pace: Length of its steps, in steps of the run.
        parts: The number of equal parts into which each step is divided.
    """
    y, kinks = equation.with_velocities(path.y), []
    steps = np.maximum(1.0, np.diff(path.key) / pace) if (path.key >= 0).all() else 1.0
    for k, effect in enumerate(equation.plant.effects):
        for layer in effect.layers(equation.plant.dynamics.n):
            x = y[:, equation.row(k, layer)]
            crosses = np.abs(np.diff(x)) > _MOST_CROSSED * layer.width * steps * parts
            if layer.level is not None:
                off = x - layer.level
                near = np.minimum(np.abs(off[:-1]), np.abs(off[1:])) < _REACH * layer.width
                crosses &= near | (off[:-1] * off[1:] <= 0)
            facts: dict[str, float | str] = {
                "joint": equation.plant.dynamics.joint_names[layer.joint], "effect": effect.name
            }  # fmt: skip
            kinks.append(_first(path.t, crosses, Doubt(DoubtKind.LAYER_CROSSED, facts)))
    return first_onset(kinks)


def cubics(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a, b and c of the cubic q₀ + c s + b s² + a s³ through q and v at the ends of each interval, 0 ≤ s ≤ 1.

    Args:
        t: Times, (k,), in [s].
        q: Positions, (k, n).
        v: Velocities, (k, n).

    Returns:
        Three arrays of shape (k − 1, n).
    """
    h, rise = np.diff(t)[:, None], np.diff(q, axis=0)
    return h * (v[:-1] + v[1:]) - 2 * rise, 3 * rise - h * (2 * v[:-1] + v[1:]), h * v[:-1]


def extremes(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest q of each joint on each interval of `cubics`, two arrays of shape (k − 1, n)."""
    a, b, c = cubics(t, q, v)
    low, high = np.minimum(q[:-1], q[1:]), np.maximum(q[:-1], q[1:])
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - 3 * a * c)
        far = -(b + np.copysign(root, b))  # both roots of 3 a s² + 2 b s + c without cancellation
        for s in (far / (3 * a), c / far):
            s = np.where((s > 0) & (s < 1), s, 0.0)
            inside = q[:-1] + s * (c + s * (b + s * a))
            low, high = np.minimum(low, inside), np.maximum(high, inside)
    return low, high


def _saturation(setup: Setup, equation: StateEquation, path: Path) -> Onset:
    """Return the first kink that is a continuous control near a level of the actuation."""
    n, m = equation.plant.dynamics.n, equation.state_size
    if setup.controller is None or equation.sampled:
        return Onset()
    parts = [(setup.controller.thresholds(), lambda u, v: u)]
    parts += [(effect.thresholds(n), effect.limited) for effect in setup.plant.effects if isinstance(effect, Bound)]
    levels = [(x.joint, abs(x.level), values) for declared, values in parts for x in declared if x.of_actuation]
    if not levels:
        return Onset()
    q, v = equation.motion(path.y)
    rows = np.unique(np.linspace(0, len(path.t) - 1, _STATES).astype(int))
    u = np.array([equation.command(float(path.t[i]), q[i], v[i], path.y[i, 2 * n : 2 * n + m]) for i in rows])
    near = [np.abs(values(u, v[rows])[1:, i]) > _NEAR_LIMIT * level for i, level, values in levels]
    return _first(path.t[rows], np.any(near, axis=0), Doubt(DoubtKind.SATURATES))


def _first(t: np.ndarray, happens: np.ndarray, doubt: Doubt) -> Onset:
    """Return the onset of a doubt at the start of the first interval on which something happens."""
    rows = np.flatnonzero(happens)
    return Onset(float(t[rows[0]]), doubt) if len(rows) else Onset()
