"""The equation of motion, M(q) a + C(q, v) v + N(t, q, v) = τ, with N = ∂V/∂q − Σ τ_effect.

    a = M⁻¹ (τ + Σ τ_effect − C v − ∂V/∂q),    ṗ = τ + Σ τ_effect + Cᵀ v − ∂V/∂q  with p = M v

Arguments are not checked, and may be floats, balls or symbols. [Murray, Li, Sastry 1994, eq. 4.24]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.effects.carried_payload import CarriedPayload
from robot_dyn.effects.effect import Bound, Conservative, Drive, Effect, Force, Stateful
from robot_dyn.effects.set_valued import SetValued, settled
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.errors import EffectError, call, users_line
from robot_dyn.foundations.validate import integer
from robot_dyn.queries.dynamics import Dynamics, acceleration


@final
@dataclass(frozen=True)
class EquationOfMotion:
    """The terms of the equation, for one state (n,) or states (..., n).

    Attributes:
        dynamics: The rigid bodies in gravity.
        effects: The forces and bounds on them.
    """

    dynamics: Dynamics
    effects: tuple[Effect, ...]

    @cached_property
    def forces(self) -> tuple[Force, ...]:
        """The effects that exert a torque."""
        return tuple(effect for effect in self.effects if isinstance(effect, Force))

    @cached_property
    def set_valued(self) -> tuple[SetValued, ...]:
        """The effects that may hold joints."""
        return tuple(effect for effect in self.effects if isinstance(effect, SetValued))

    @cached_property
    def payloads(self) -> tuple[CarriedPayload, ...]:
        """The payloads that are picked up and dropped."""
        return tuple(effect for effect in self.effects if isinstance(effect, CarriedPayload))

    @cached_property
    def states(self) -> Mapping[int, slice]:
        """Slice of each effect's states in the vector of all states, by the index of the effect."""
        places, end = {}, 0
        for k, effect in enumerate(self.effects):
            if isinstance(effect, Stateful):
                size = integer(f"state_size of {effect.name}", effect.state_size(self.dynamics.n), error=EffectError)
                places[k], end = slice(end, end + size), end + size
        return places

    @cached_property
    def state_size(self) -> int:
        """Number of states of all effects."""
        return max((place.stop for place in self.states.values()), default=0)

    @cached_property
    def drives(self) -> Mapping[int, Drive]:
        """The effects whose motors receive the actuation of joints, by index."""
        drives = {k: effect for k, effect in enumerate(self.effects) if isinstance(effect, Drive)}
        joints = [i for drive in drives.values() for i in drive.driven(self.dynamics.n)]
        for i in joints:
            if joints.count(i) > 1:
                raise EffectError(f"joint {self.dynamics.joint_names[i]!r} has two drives; keep one")
        if drives and (bound := next((x for x in self.effects if isinstance(x, Bound) and x.of_velocity), None)):
            drive = next(iter(drives.values()))
            raise EffectError(
                f"{bound.name} limits motors that turn with their joints, but those of {drive.name} do not; remove one"
                " of the two"
            )
        return drives

    def on_joints(self, u: Array) -> Array:
        """Return the part of the actuation u, (..., n), that acts on joints directly, not on the motor of a drive."""
        if not self.drives:
            return u
        on_joints = u.copy()
        for drive in self.drives.values():
            on_joints[..., list(drive.driven(self.dynamics.n))] = drive.direct_actuation(u)
        return on_joints

    def torques(
        self, t: float, q: Array, v: Array, shape: tuple[int, ...] | None = None, z: Array | None = None
    ) -> list[Array]:
        """Return the torque of each force at states z of the effects, broadcast to `shape` if it is not None.

        Raises:
            EffectError: If a torque does not fit the joints.
        """
        return [
            self._torque_of(force, (t, q, v, *self._states_of(k, q, v, z)), shape)
            for k, force in enumerate(self.effects)
            if isinstance(force, Force)
        ]

    def _states_of(self, k: int, q: Array, v: Array, z: Array | None) -> tuple[Array, ...]:
        """Return the states of an effect as its last argument, initial ones by default; () if it has none."""
        effect = self.effects[k]
        if not isinstance(effect, Stateful):
            return ()
        return (effect.start(self.dynamics, q, v) if z is None else z[self.states[k]],)

    def start(self, q: Array, v: Array) -> Array:
        """Return the states of the effects at the start of a run, (state_size,)."""
        starts = [effect.start(self.dynamics, q, v) for effect in self.effects if isinstance(effect, Stateful)]
        return np.concatenate([*starts, np.zeros(0)])

    def _torque_of(self, force: Force, state: tuple[Any, ...], shape: tuple[int, ...] | None) -> Array:
        v = state[2]
        try:
            torque = call(force.torque, self.dynamics, *state)
            return torque if shape is None or np.shape(torque) == shape else np.broadcast_to(torque, shape)
        except (TypeError, ValueError) as error:
            if users_line(error):
                raise
            raise EffectError(
                f"{force.name} does not fit {self.dynamics.n} joints and v of shape {v.shape}: {error}"
            ) from None

    def actuation(self, u: Array, v: Array) -> Array:
        """Return the actuation at velocity v after all bounds without states, in the order of the effects.

        Raises:
            EffectError: If a bound does not fit the shape of u.
        """
        for k, effect in enumerate(self.effects):
            if isinstance(effect, Bound) and k not in self.states:
                u = self._bounded(effect, u, v)
        return u

    @cached_property
    def _first_continuous(self) -> int:
        """Index of the first bound with states or of the velocity; bounds before it act only at ticks."""
        bounds = ((k, effect) for k, effect in enumerate(self.effects) if isinstance(effect, Bound))
        return next((k for k, bound in bounds if k in self.states or bound.of_velocity), len(self.effects))

    def commanded(self, u: Array) -> Array:
        """Return the actuation after the bounds before the first one with states or of the velocity."""
        return self.applied(u, u, u, range(self._first_continuous))[0]

    @cached_property
    def bounds_at_all_times(self) -> range:
        """Indices of the effects whose bounds also act between ticks: those after the bounds of `commanded`."""
        return range(self._first_continuous, len(self.effects))

    def applied(self, u: Array, v: Array, z: Array, indices: range | None = None) -> tuple[Array, Mapping[int, Array]]:
        """Return the actuation after the remaining bounds, at v and states z, and the input of each bound by index."""
        reached = {}
        for k in self.bounds_at_all_times if indices is None else indices:
            effect = self.effects[k]
            if isinstance(effect, Bound):
                reached[k] = u
                u = self._bounded(effect, u, v, *self._states_of(k, u, u, z))
        return u, reached

    def _bounded(self, bound: Bound, u: Array, v: Array, *states: Array) -> Array:
        try:
            return call(bound.actuation, u, *((v,) if bound.of_velocity else ()), *states)
        except (TypeError, ValueError) as error:
            if users_line(error):
                raise
            raise EffectError(f"{bound.name} does not fit an actuation of shape {np.shape(u)}: {error}") from None

    def state_rates(
        self, t: float, q: Array, v: Array, u: Array, reached: Mapping[int, Array], z: Array, a: Array | None = None
    ) -> list[tuple[slice, Array]]:
        """Return the slice and ż of each effect with states.

        Bounds are evaluated at the actuation in `reached`, others at u. Motors that may move with their joints also
        take the acceleration a, 0 by default.
        """
        a = 0 * v if a is None else a
        rates = []
        for k, place in self.states.items():
            effect: Any = self.effects[k]
            more = (a,) if isinstance(effect, Drive) and effect.coupled else ()
            rates.append((place, call(effect.state_rate, self.dynamics, t, q, v, reached.get(k, u), z[place], *more)))
        return rates

    def acceleration(self, q: Array, v: Array, total: Array) -> Array:
        """Return the acceleration under the total torque τ + Σ τ_effect."""
        if not self.set_valued:
            return self.dynamics.forward_dynamics(q, v, total)
        return self.with_reaction(q, v, total)[0]

    def with_reaction(self, q: Array, v: Array, total: Array) -> tuple[Array, Array]:
        """Return the acceleration of one state and the reaction λ on held joints: M a + C v + ∂V/∂q = total + λ.

        Held joints have a = 0, the others λ = 0. Effects without a mode hold every resting joint that they can.
        """
        M, load = self.dynamics.M(q), total - self.dynamics.inverse_dynamics(q, v, 0 * v)
        held = self.set_valued[0].held
        if held is None:
            acceleration(M, load, self.dynamics.joint_names)  # raises if M is singular
            if M.dtype not in (np.float32, np.float64):
                raise EffectError(
                    f"{self.set_valued[0].name}: held joints can be determined in float64 only, not in {M.dtype}; use"
                    " a plant of the robot, or of its Lagrangian in float64"
                )
            a = settled(self.set_valued, M, load, q, v)[0]
            held = (a == 0).astype(float)
        else:
            free = 1 - held
            if any(drive.coupled for drive in self.drives.values()):
                M = M + self._added_inertia(held)
            alone = M * (free[:, None] * free[None, :]) + held * np.eye(len(load))
            a = acceleration(alone, free * load, self.dynamics.joint_names)
        return a, held * (M @ a - load)

    def _added_inertia(self, held: Array) -> Array:
        """Return the inertia of motors that move with their joints, (n, n)."""
        n = self.dynamics.n
        added = 0 * held
        for drive in self.drives.values():
            if drive.coupled:
                added[list(drive.driven(n))] = drive.added_inertia(n)
        return added * np.eye(n)

    def momentum_rate(self, q: Array, v: Array, total: Array) -> Array:
        """Return the rate of the momentum p = M v under the total torque."""
        return total + self.dynamics.coriolis_transpose(q, v) - self.dynamics.N(q)

    def energies(self, t: Scalar, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the kinetic energy, and the potential of gravity and all conservative effects, (...)."""
        potential = self.dynamics.potential_energy(q)
        for force in self.forces:
            if isinstance(force, Conservative):
                potential = potential + call(force.potential, self.dynamics, t, q)
        return self.dynamics.kinetic_energy(q, v), potential

    def powers(self, v: Array, u: Array, torques: list[Array], z: Array, a: Array) -> list[Scalar]:
        """Return the power of the actuation, and of each force without a potential, at one state.

        Args:
            v: Velocity, (n,).
            u: Actuation, (n,).
            torques: Torque of each force, (n,).
            z: States of the effects.
            a: Acceleration, (n,), for motors that move with their joints.
        """
        powers, speeds = [], v
        places = {drive: self.states[k] for k, drive in self.drives.items()}
        for force, torque in zip(self.forces, torques, strict=True):
            if isinstance(force, Drive):
                states = z[places[force]]
                speeds = speeds.copy()
                speeds[list(force.driven(len(v)))] = force.speeds(states)
                powers.append(force.power(v, u, torque, states, a))
            elif not isinstance(force, Conservative):
                powers.append(torque @ v)
        return [u @ speeds, *powers]
