"""Where the right-hand side of a run is smooth, and where it may not be.

A method of order p converges with order p only where f has p derivatives. Joint stops, effort limits that cut a
continuous control, dry friction whose layer |v| < v_s is crossed within a step, and code that this library did not
write may have kinks between the ends of steps. [Hairer, Nørsett, Wanner 1993, II.6]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.control.block import Block
from robot_dyn.control.control_law import ControlLaw
from robot_dyn.control.controller import Controller
from robot_dyn.effects.actuator import EffortLimit
from robot_dyn.effects.dahl import DahlFriction
from robot_dyn.effects.friction import RegularisedCoulombFriction
from robot_dyn.effects.joint_limit import JointStopDamper, JointStopSpring
from robot_dyn.effects.lugre import LuGreFriction
from robot_dyn.effects.series_elastic import SeriesElastic

if TYPE_CHECKING:
    from robot_dyn.simulation.record import Path
    from robot_dyn.simulation.setup import Setup
    from robot_dyn.simulation.state_equation import StateEquation

STOPS = (JointStopSpring, JointStopDamper)
_IN_LAYER = 4  # steps within |v| < v_s that show a method's order
_NEAR_LIMIT = 0.95  # of the effort limit
LOOKS = 4000  # at foreign code, between steps
_LOOKS = 300  # states at which the actuation is computed


def foreign(setup: Setup) -> tuple[Any, ...]:
    """The parts of a setup that are not of this library's classes."""
    parts = (setup.plant.dynamics, *setup.plant.effects, setup.controller, setup.integrator)
    if setup.controller is not None:
        parts += (*setup.controller.models.values(), *setup.controller.references.values())
        parts += tuple(each.part for each in setup.controller.parts)
    return tuple(part for part in parts if part is not None and _is_foreign(part))


def _is_foreign(part: Any) -> bool:
    return isinstance(part, ControlLaw) or not type(part).__module__.startswith("robot_dyn.")


def named(part: Any) -> str:
    """Its name for people: that of its class, or of the function that it is."""
    return part.name if isinstance(part, Controller) else type(part).__name__


def rounds(part: Any) -> bool:
    """Whether it is a block of a loop whose output jumps."""
    return isinstance(part, Block) and part.rounds


def looked_s(setup: Setup) -> float:
    """Time in [s] between looks at what foreign code does, where steps are longer."""
    return setup.duration_s / LOOKS


def may_switch(setup: Setup) -> bool:
    """Whether something may act between two steps without acting at either."""
    if setup.finds_events:  # and windows are ends of segments
        return bool(foreign(setup))
    effects = setup.plant.effects
    windows = any(0.0 < t < setup.duration_s for effect in effects for t in effect.switches)
    return windows or any(isinstance(effect, STOPS) for effect in effects) or bool(foreign(setup))


def first_kink(setup: Setup, equation: StateEquation, path: Path) -> tuple[float, str]:
    """Time in [s] from which the right-hand side may not be smooth, and why; inf and "" if it is to the end.

    Args:
        setup: What was run.
        equation: Its state equation.
        path: Its states, step by step.
    """
    if parts := foreign(setup):
        return (
            0.0,
            f"{named(parts[0])} may switch, and what is shorter than {looked_s(setup):.1g} s is not seen",
        )
    if setup.controller is not None and any(rounds(each.part) for each in setup.controller.parts):
        return 0.0, "what is rounded at a tick may be rounded the other way"
    if len(path.t) < 2:
        return np.inf, ""
    n = equation.plant.dynamics.n
    q, v = path.y[:, :n], equation.velocities(path.y)
    found = [(np.inf, "")]
    for effect in () if setup.integrator.controls_error else setup.plant.effects:
        if isinstance(effect, STOPS) and not setup.finds_events:
            low, high = extremes(path.t, q, v)
            found.append(_first(path.t, (low < effect.lower) | (high > effect.upper), "a joint touches its stop"))
        elif isinstance(effect, RegularisedCoulombFriction):
            steps = np.diff(path.key)[:, None] if (path.key >= 0).all() else 1
            crosses = (v[:-1] * v[1:] <= 0) & (np.abs(np.diff(v, axis=0)) * _IN_LAYER > effect.velocity_scale * steps)
            crosses &= np.broadcast_to(np.asarray(effect.friction) > 0, crosses.shape)
            found.append(_first(path.t, crosses, "dry friction reverses within a few steps"))
        elif isinstance(effect, LuGreFriction | DahlFriction) and not (
            setup.finds_events and not setup.integrator.canonical
        ):
            found.append(_first(path.t, v[:-1] * v[1:] <= 0, "a joint with bristles stands or reverses"))
        elif isinstance(effect, SeriesElastic) and effect.backlash is not None and not setup.finds_events:
            found.append((0.0, "a backlash opens or closes"))
    if not setup.finds_events:
        found.append(_saturation(setup, equation, path, q, v))
    return min(found)


def extremes(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest q of each joint on each interval between times t, by the cubic through q and v at its ends.

    Args:
        t: (k,), in [s].
        q: (k, n).
        v: (k, n).

    Returns:
        Two arrays of shape (k − 1, n).
    """
    h = np.diff(t)[:, None]
    rise = np.diff(q, axis=0)
    a, b, c = h * (v[:-1] + v[1:]) - 2 * rise, 3 * rise - h * (2 * v[:-1] + v[1:]), h * v[:-1]
    low, high = np.minimum(q[:-1], q[1:]), np.maximum(q[:-1], q[1:])
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - 3 * a * c)
        far = -(b + np.copysign(root, b))  # both roots of 3 a s² + 2 b s + c without cancellation
        for s in (far / (3 * a), c / far):
            s = np.where((s > 0) & (s < 1), s, 0.0)
            inside = q[:-1] + s * (c + s * (b + s * a))
            low, high = np.minimum(low, inside), np.maximum(high, inside)
    return low, high


def _saturation(setup: Setup, equation: StateEquation, path: Path, q: np.ndarray, v: np.ndarray) -> tuple[float, str]:
    """When a continuous control comes near an effort limit."""
    limits = [np.asarray(x.limit) for x in setup.plant.effects if isinstance(x, EffortLimit)]
    if setup.controller is not None:
        limits.append(np.asarray(setup.controller.saturation))
    if equation.sampled or setup.controller is None or not any(np.isfinite(x).any() for x in limits):
        return np.inf, ""
    n, m = equation.plant.dynamics.n, equation.state_size
    rows = np.unique(np.linspace(0, len(path.t) - 1, _LOOKS).astype(int))
    u = np.array([equation.command(float(path.t[i]), q[i], v[i], path.y[i, 2 * n : 2 * n + m]) for i in rows])
    least = np.min([np.broadcast_to(x, (n,)) for x in limits], axis=0)
    return _first(path.t[rows], np.abs(u[1:]) > _NEAR_LIMIT * least, "an effort limit cuts the control")


def _first(t: np.ndarray, happens: np.ndarray, why: str) -> tuple[float, str]:
    """Start of the first interval on which something happens at any joint."""
    rows = np.flatnonzero(happens.any(axis=1))
    return (float(t[rows[0]]), why) if len(rows) else (np.inf, "")
