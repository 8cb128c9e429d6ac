"""Where the right-hand side of a run is smooth, and where it may not be.

A method of order p converges with order p only where f has p derivatives. Thresholds at which no step ends, and parts
that do not declare where they switch, may have kinks between the ends of steps. A thin layer, in which f bends, acts as
a kink on steps that cross much of it. [Hairer, Nørsett, Wanner 1993, II.6]
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.control.digital_loop.block import Block
from robot_dyn.simulation.dynamics.declarations import named

if TYPE_CHECKING:
    from robot_dyn.simulation.dynamics.state_equation import StateEquation
    from robot_dyn.simulation.run.recording import Path
    from robot_dyn.simulation.setup.setup import Setup

_MOST_CROSSED = 1.0  # widths of a layer, in a step of a companion that shows a method's order
_THIRDS = 3  # of a step: the steps of the shortest companion
_REACH = 3.0  # widths from the middle of a layer: 1 − tanh 3 = 0.005, exp(−3²) = 1e-4
_NEAR_LIMIT = 0.95  # of a level of the actuation
LOOKS = 4000  # between steps, at parts that do not declare where they switch
_LOOKS = 300  # states at which the actuation is computed

Kink = tuple[float, str]  # time in [s], and why


def rounds(part: Any) -> bool:
    """Whether it is a block of a loop whose output jumps."""
    return isinstance(part, Block) and part.rounds


def first_kink(setup: Setup, equation: StateEquation, path: Path) -> Kink:
    """Time in [s] from which the right-hand side may not be smooth, and why; inf and "" if it is to the end.

    Args:
        setup: What was run.
        equation: Its state equation.
        path: Its states, step by step.
    """
    if parts := setup.undeclared:
        shortest = setup.duration_s / LOOKS
        return 0.0, f"{named(parts[0][0])} {parts[0][1]}; what is shorter than {shortest:.1g} s is not seen"
    if setup.controller is not None and any(rounds(each.part) for each in setup.controller.parts):
        return 0.0, "what is rounded at a tick may be rounded the other way"
    if len(path.t) < 2:
        return np.inf, ""
    q, v = path.y[:, : equation.plant.dynamics.n], equation.velocities(path.y)
    found = [(np.inf, "")]
    if not setup.method.controls_error:
        found += _passed(setup, equation, path, q, v)
        found.append(first_crossing(equation, path, parts=_THIRDS))
    if not setup.finds_events:
        found.append(_saturation(setup, equation, path, q, v))
    return min(found)


def _passed(setup: Setup, equation: StateEquation, path: Path, q: np.ndarray, v: np.ndarray) -> Iterator[Kink]:
    """When thresholds at which no step ends are passed."""
    n, states = equation.plant.dynamics.n, equation.equation_of_motion.states
    low, high = extremes(path.t, q, v)
    for k, effect in enumerate(setup.plant.effects):
        for each in effect.thresholds(n):
            if each.of_actuation or (setup.finds_events and not (each.of_velocity and setup.method.canonical)):
                continue
            if each.of_velocity or each.state is not None:
                z = path.y[:, 2 * n + equation.state_size :]
                x = v[:, each.joint] if each.state is None else z[:, states[k].start + each.state]
                below, above = np.minimum(x[:-1], x[1:]), np.maximum(x[:-1], x[1:])
            else:
                below, above = low[:, each.joint], high[:, each.joint]
            name = equation.plant.dynamics.joint_names[each.joint]
            happens = (below <= each.level) & (above >= each.level)
            yield _first(path.t, happens[:, None], f"{name!r} passes its {each.name} within a step")


def first_crossing(equation: StateEquation, path: Path, pace: float = 1.0, parts: int = 1) -> Kink:
    """Return the time in [s] from which steps cross a layer of an effect too fast, and why; inf and "" if none does.

    Args:
        equation: The state equation.
        path: States of a run or of a companion, step by step.
        pace: Length of its steps, in steps of the run.
        parts: The number of equal parts into which each step is divided.
    """
    n, states = equation.plant.dynamics.n, equation.equation_of_motion.states
    q, v = path.y[:, :n], equation.velocities(path.y)
    z = path.y[:, 2 * n + equation.state_size :]
    steps = np.maximum(1.0, np.diff(path.key) / pace) if (path.key >= 0).all() else 1.0
    found = [(np.inf, "")]
    for k, effect in enumerate(equation.plant.effects):
        for layer in effect.layers(n):
            if layer.state is not None:
                x = z[:, states[k].start + layer.state]
            else:
                x = (v if layer.of_velocity else q)[:, layer.joint]
            happens = np.abs(np.diff(x)) > _MOST_CROSSED * layer.width * steps * parts
            if layer.level is not None:
                off = x - layer.level
                near = np.minimum(np.abs(off[:-1]), np.abs(off[1:])) < _REACH * layer.width
                happens &= near | (off[:-1] * off[1:] <= 0)
            name = equation.plant.dynamics.joint_names[layer.joint]
            found.append(_first(path.t, happens[:, None], f"{name!r} crosses a layer of {effect.name} in a few steps"))
    return min(found)


def cubics(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """a, b and c of the cubic q₀ + c s + b s² + a s³ through q and v at the ends of each interval, s from 0 to 1.

    Args:
        t: (k,), in [s].
        q: (k, n).
        v: (k, n).

    Returns:
        Three arrays of shape (k − 1, n).
    """
    h, rise = np.diff(t)[:, None], np.diff(q, axis=0)
    return h * (v[:-1] + v[1:]) - 2 * rise, 3 * rise - h * (2 * v[:-1] + v[1:]), h * v[:-1]


def extremes(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest q of each joint on each interval of `cubics`, two arrays of shape (k − 1, n)."""
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


def _saturation(setup: Setup, equation: StateEquation, path: Path, q: np.ndarray, v: np.ndarray) -> Kink:
    """When a continuous control comes near a level of the actuation."""
    n, m = equation.plant.dynamics.n, equation.state_size
    least = np.full(n, np.inf)
    if setup.controller is not None and not equation.sampled:
        declared = [setup.controller.thresholds(), *(effect.thresholds(n) for effect in setup.plant.effects)]
        for each in (each for of in declared for each in of if each.of_actuation):
            least[each.joint] = min(least[each.joint], abs(each.level))
    if not np.isfinite(least).any():
        return np.inf, ""
    rows = np.unique(np.linspace(0, len(path.t) - 1, _LOOKS).astype(int))
    u = np.array([equation.command(float(path.t[i]), q[i], v[i], path.y[i, 2 * n : 2 * n + m]) for i in rows])
    return _first(path.t[rows], np.abs(u[1:]) > _NEAR_LIMIT * least, "a limit cuts the control")


def _first(t: np.ndarray, happens: np.ndarray, why: str) -> Kink:
    """Start of the first interval on which something happens at any joint."""
    rows = np.flatnonzero(happens.any(axis=1))
    return (float(t[rows[0]]), why) if len(rows) else (np.inf, "")
