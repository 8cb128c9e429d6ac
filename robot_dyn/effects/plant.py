"""Plant: rigid bodies and the effects on them; its queries check their arguments and results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any, final

import numpy as np

from robot_dyn.effects.carried_payload import CarriedPayload, robot_with
from robot_dyn.effects.effect import Bound, Conservative, Effect, Force, Stateful
from robot_dyn.effects.equation_of_motion import EquationOfMotion
from robot_dyn.effects.explanation import explanation
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.effects.hold import HeldJoint, held_joints
from robot_dyn.effects.missing_time import MISSING_TIME
from robot_dyn.effects.set_valued import Mode, SetValued
from robot_dyn.foundations.arithmetic import FLOAT64, Arithmetic, Array
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.errors import EffectError, MissingTimeError, OverflowedError, QueryError, shown
from robot_dyn.foundations.suggestions import SuggestsNames
from robot_dyn.foundations.validate import check_batches, is_moderate, is_plain, joint_values, number
from robot_dyn.foundations.values import Caching, several
from robot_dyn.queries.dynamics import Dynamics, NanRows


@final
@dataclass(frozen=True)
class Plant(SuggestsNames, Caching):
    """A `Dynamics` and the effects that act on it.

    Attributes:
        dynamics: The rigid bodies in gravity.
        effects: The effects; "urdf" for the friction in the robot's file, if there is any.
    """

    dynamics: Dynamics
    effects: tuple[Effect, ...] = ()

    def __init__(self, dynamics: Dynamics, effects: Iterable[Effect] | str = ()) -> None:
        if isinstance(getattr(dynamics, "plant", None), Plant):
            raise EffectError(
                f"dynamics: got a {type(dynamics).__name__}; pass the Plant itself, with engine='compiled'"
            )
        if isinstance(dynamics, NanRows):
            raise EffectError("dynamics: nan_rows is for queries only; pass the robot itself")
        if not isinstance(dynamics, Dynamics):
            raise EffectError(f"dynamics must be a robot, such as rd.load('ur5'), got {shown(dynamics)}")
        object.__setattr__(self, "dynamics", dynamics)
        if isinstance(effects, str):
            if effects != "urdf":
                raise EffectError(
                    f"effects must be a list of effects, or 'urdf' for the friction in the file, got {shown(effects)}"
                )
            effects = stated_friction(dynamics)
        if (sequence := several(effects)) is None:
            raise EffectError(
                f"effects must be a sequence, such as [rd.effects.ViscousFriction(0.1)], got {shown(effects)}"
            )
        parts = [part for effect in sequence for part in (effect.parts if isinstance(effect, Effect) else (effect,))]
        for part in parts:
            if not isinstance(part, Force | Bound | CarriedPayload):
                raise EffectError(
                    f"{shown(part)} is neither a Force nor a Bound and would never be evaluated; subclass"
                    " Conservative, Dissipative, Active or Bound"
                )
            if isinstance(part, Conservative) and isinstance(part, Stateful):
                raise EffectError(
                    f"{part.name} is Conservative and has states; derive it from Active or Dissipative and define"
                    " stored_energy"
                )
        object.__setattr__(self, "effects", tuple(part.on(dynamics) for part in parts))

    def __repr__(self) -> str:
        return f"<Plant: {explanation(self.dynamics, self.effects)}>"

    def _repr_html_(self) -> str:
        return explanation(self.dynamics, self.effects)._repr_html_()

    @cached_property
    def equation_of_motion(self) -> EquationOfMotion:
        """The equation of motion, which does not check its arguments."""
        return EquationOfMotion(self.dynamics, self.effects)

    @cached_property
    def _timed_payloads(self) -> tuple[CarriedPayload, ...]:
        """The payloads that are picked up and dropped; within a phase of a run, each is fixed as carried or not."""
        return tuple(x for x in self.effects if isinstance(x, CarriedPayload) and x.carried is None)

    def at(self, t: float | None) -> Plant:
        """Return the plant with the payloads carried at time t, in [s], as fixed bodies; itself without payloads.

        Raises:
            QueryError: If t is not a finite number; MissingTimeError if it is None and there are such payloads.
        """
        payloads, time = self._timed_payloads, None if t is None else number("t", t)
        if not payloads:
            return self
        if time is None:
            raise MissingTimeError(f"{payloads[0].name} depends on the time: pass t=, in [s]")
        carried = [effect.payload for effect in payloads if effect.acts(time)]
        robot: Any = self.dynamics
        others = [effect for effect in self.effects if effect not in payloads]
        return Plant(robot.with_(payload=carried), others)

    @property
    def forces(self) -> tuple[Force, ...]:
        """The effects that exert a torque."""
        return self.equation_of_motion.forces

    def actuation(self, u: Array, v: Array | None = None) -> Array:
        """Return the actuation u, (..., n), after all bounds at velocity v, 0 by default.

        Raises:
            EffectError: If a bound does not fit.
        """
        (u,) = (u,) if self._is_plain(u) else self._states(u=u)
        v = 0 * u if v is None else v
        (v,) = (v,) if self._is_plain(v) else self._states(v=v)
        return self.equation_of_motion.actuation(u, v)

    def M(self, q: Array, *, t: float | None = None) -> Array:
        """Return the mass matrix, (..., n, n), with the payloads carried at time t in [s]."""
        return self.at(t).dynamics.M(q)

    def C(self, q: Array, v: Array, *, t: float | None = None) -> Array:
        """Return the Coriolis matrix, (..., n, n), with the payloads carried at time t in [s]."""
        return self.at(t).dynamics.C(q, v)

    def N(self, q: Array, v: Array, *, t: float | None = None) -> Array:
        """Return gravity minus the torques of the effects, N = ∂V/∂q − Σ τ_effect, (..., n), in [N m] or [N].

        For arguments and errors, see `torque`.
        """
        return self._finite(self.at(t).dynamics.N(q) - self.torque(q, v, t=t))

    def torque(self, q: Array, v: Array, *, t: float | None = None) -> Array:
        """Return the torque of all effects on the joints, Σ τ_effect, (..., n); 0 without effects.

        Args:
            q: Position, (..., n).
            v: Velocity, (..., n).
            t: Time, one number, in [s]; required if an effect depends on the time.

        Raises:
            QueryError: If an argument has another shape or is not finite; OverflowedError if the result is not;
                MissingTimeError if t is missing.
            EffectError: If an effect does not fit the joints.
        """
        is_time = t is None or (t.__class__ is float and isfinite(t))
        time: Any = MISSING_TIME if t is None else t
        if is_time and self._is_plain(q) and self._is_plain(v):
            total = sum(self.equation_of_motion.torques(time, q, v, v.shape), start=np.zeros(v.shape))
            if is_moderate(total):
                return total
        time, (q, v) = time if is_time else number("t", t), self._states(q=q, v=v)
        zeros = np.zeros((*check_batches(q=q, v=v), self.dynamics.n))
        with self._arithmetic.scope(), np.errstate(all="ignore"):  # overflow is reported as an error
            zeros = zeros if q.dtype != object else self._arithmetic.array(zeros)
            return self._finite(sum(self.equation_of_motion.torques(time, q, v, zeros.shape), start=zeros))

    def inverse_dynamics(self, q: Array, v: Array, a: Array, *, t: float | None = None) -> Array:
        """Return the actuation that causes the acceleration a, τ = M a + C v + N, (..., n)."""
        return self._finite(self.at(t).dynamics.inverse_dynamics(q, v, a) - self.torque(q, v, t=t))

    def forward_dynamics(self, q: Array, v: Array, u: Array, *, t: float | None = None) -> Array:
        """Return the acceleration under the actuation u, (..., n)."""
        equation = self.at(t).equation_of_motion
        total = equation.on_joints(self.actuation(u, v)) + self.torque(q, v, t=t)
        if not equation.set_valued:
            return equation.acceleration(q, v, total)
        q, v = self._states(q=q, v=v)
        batch, n = check_batches(q=q, v=v, u=total), self.dynamics.n
        rows = zip(*(np.broadcast_to(x, (*batch, n)).reshape(-1, n) for x in (q, v, total)), strict=True)
        return np.array([equation.acceleration(*row) for row in rows]).reshape(*batch, n)

    def held_joints(self, q: Array, v: Array, u: Array, *, t: float | None = None) -> tuple[HeldJoint, ...]:
        """Return the joints that dry friction and rigid stops hold in one state, with load and break-away loads.

        Args:
            q: Position, (n,).
            v: Velocity, (n,).
            u: Actuation, (n,).
            t: Time, in [s]; required if an effect depends on the time.

        Raises:
            QueryError: If an argument has another shape or is not finite.
            EffectError: If the arithmetic of the dynamics cannot decide which joints are held.
        """
        q, v, u = self._states(q=q, v=v, u=u)
        if any(x.shape != (self.dynamics.n,) for x in (q, v, u)):
            raise QueryError(f"held_joints takes one state: q, v and u must have shape ({self.dynamics.n},)")
        equation = self.at(t).equation_of_motion
        return held_joints(equation, q, v, equation.on_joints(self.actuation(u, v)) + self.torque(q, v, t=t))

    @cached_property
    def _arithmetic(self) -> Arithmetic:
        return getattr(self.dynamics, "arithmetic", FLOAT64)

    @cached_property
    def _shape(self) -> tuple[int] | None:
        """Shape of one state for the fast checks; None if states are converted to another arithmetic."""
        return (self.dynamics.n,) if self._arithmetic == FLOAT64 else None

    def _is_plain(self, x: Any) -> bool:
        return is_plain(x, self._shape)

    def _states(self, **arguments: Any) -> list[Array]:
        names = self.dynamics.joint_names
        return [joint_values(name, x, names, self._arithmetic) for name, x in arguments.items()]

    def _finite(self, result: Array) -> Array:
        if not self._arithmetic.finite(result).all():
            raise OverflowedError("the result overflows: the arguments are too large")
        return result


def carrying(plant: Plant, carried: Sequence[bool]) -> Plant:
    """Return the plant with each of its payloads fixed as carried or not."""
    payloads = plant.equation_of_motion.payloads
    fixed = {x: with_values(x, {"carried": is_carried}) for x, is_carried in zip(payloads, carried, strict=True)}
    effects = [fixed[effect] if isinstance(effect, CarriedPayload) else effect for effect in plant.effects]
    return Plant(robot_with(plant.dynamics, payloads, carried), effects)


def in_mode(plant: Plant, mode: Mode) -> Plant:
    """Return the plant in a mode of its set-valued effects."""
    effects = [effect.in_mode(mode) if isinstance(effect, SetValued) else effect for effect in plant.effects]
    return Plant(plant.dynamics, effects)


def stated_friction(dynamics: Dynamics) -> tuple[Effect, ...]:
    """Return the friction in the file of a robot.

    Raises:
        EffectError: If the dynamics are not those of a robot file.
    """
    try:
        robot: Any = dynamics
        damping, friction = robot.damping, robot.friction
    except AttributeError:
        raise EffectError(f"effects='urdf' needs a robot with a URDF, got {type(dynamics).__name__}") from None
    effects: list[Effect] = []
    if np.any(damping):
        effects.append(ViscousFriction(damping))
    if np.any(friction):
        effects.append(RegularisedCoulombFriction(friction))
    return tuple(effects)
