"""Requirements for the fastest motion along a path: effects of q and v only, and sufficient limits."""

from __future__ import annotations

import numpy as np

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.effects import Bound, CarriedPayload, EffortLimit, Force, RigidStops, Stateful
from robot_dyn.foundations import PlanError
from robot_dyn.tools.motors.limits import Limits, outside_positions

_TIMES = 0.1234, 7.891  # times at which torques must be equal
_LEAST, _MOST = 1e-100, 1e100  # range of limits, so that squares and ratios do not overflow


def check_effects(plant: Plant) -> None:
    """Raise a PlanError for effects that depend on time, have states, or change the torque of the motors."""
    rng, n = np.random.default_rng(0), plant.dynamics.n
    q, v = rng.uniform(-1, 1, (2, 8, n))
    for effect in plant.effects:
        reason = ""
        if isinstance(effect, Stateful):
            reason = "has states"
        elif isinstance(effect, CarriedPayload):
            reason = "acts only for a part of the time: use an arm with the payload, arm.with_(payload=…)"
        elif any(0 < t < np.inf for t in effect.switches) or (
            isinstance(effect, Force)
            and np.diff([Plant(plant.dynamics, [effect]).torque(q, v, t=t) for t in _TIMES], axis=0).any()
        ):
            reason = "depends on the time"
        elif isinstance(effect, Bound) and not isinstance(effect, EffortLimit):
            reason = "changes the torque of the motors"
        if reason:
            raise PlanError(f"effect {effect.name!r} {reason}; remove it from the plant")


def check_positions(plant: Plant, path: PiecewisePolynomial) -> None:
    """Raise a PlanError if a path leaves the joint limits or passes rigid stops."""
    for stops in (None, *(effect for effect in plant.effects if isinstance(effect, RigidStops))):
        for where in outside_positions(plant.dynamics, path, stops, "s = {:.4g}"):
            raise PlanError(f"{where}; move the points, or give more of them where the spline overshoots")


def check_limited(plant: Plant, limits: Limits, path: PiecewisePolynomial) -> None:
    """Raise a PlanError for finite limits outside 1e-100 to 1e100, or if nothing limits the acceleration."""
    for name, x in (("effort", limits.effort), ("velocity", limits.velocity), ("acceleration", limits.acceleration)):
        if (wrong := np.isfinite(x) & ((x < _LEAST) | (x > _MOST))).any():
            joint, value = plant.dynamics.joint_names[int(wrong.argmax())], x[wrong][0]
            raise PlanError(f"{name} of joint {joint!r} is {value:g}; give one from {_LEAST:g} to {_MOST:g}, or inf")
    slope = path.at(_along(path))[1]
    no_limit = np.isinf(limits.effort) & np.isinf(limits.acceleration)
    alone = (np.abs(slope[:, ~no_limit]).max(axis=-1, initial=0.0) == 0) & np.isinf(limits.effort).all()
    if alone.any():
        i = int(np.argmax(np.abs(slope[np.argmax(alone)])))
        raise PlanError(
            f"nothing limits the acceleration of joint {plant.dynamics.joint_names[i]!r}: no effort limit is known;"
            " give effort=, acceleration= or motors="
        )


def why_not(plant: Plant, limits: Limits, path: PiecewisePolynomial) -> str:
    """Return why no motion was found: the joint that needs the largest share of its limit to move slowly."""
    s = _along(path)
    q, slope, _ = path.at(s)
    slowly = 1e-9 * slope  # slow motion, to include friction
    load = plant.inverse_dynamics(q, slowly, 0 * q, t=0.0) / limits.effort
    k, i = np.unravel_index(np.argmax(np.abs(load)), load.shape)
    name, limit = plant.dynamics.joint_names[i], float(limits.effort[i])
    needs_it = (
        f"joint {name!r} needs {load[k, i] * limit:.6g} of {limit:.6g} N m (or N) to move slowly at s = {s[k]:.6g}"
    )
    if abs(load[k, i]) > 1:
        return f"no motion along the path is within the limits: {needs_it}"
    return f"no motion along the path was found; {needs_it}, the largest share of all joints"


def _along(path: PiecewisePolynomial) -> np.ndarray:
    """Return places along a path, at least one in each piece."""
    inside = np.array([0.05, 0.25, 0.5, 0.75, 0.95]) if len(path.coefficients) > 50 else np.linspace(0.01, 0.99, 50)
    return (path.breaks[:-1, None] + np.diff(path.breaks)[:, None] * inside).ravel()
