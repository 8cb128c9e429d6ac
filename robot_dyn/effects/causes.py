"""Joint torques along a motion, split by cause: τ = M(q) a + C(q, v) v + ∂V/∂q − Σ τ_effect, one row for each time.

Causes are "inertia", "Coriolis", "gravity" and each effect by name. Their sign is that of the actuation: the torque
with which the drive balances the cause. A carried payload is one cause, with its inertia and weight.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.effects.carried_payload import robot_with
from robot_dyn.effects.effect import Drive, Stateful, numbered
from robot_dyn.effects.plant import Plant, carrying
from robot_dyn.effects.set_valued import SetValued
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.errors import EffectError, QueryError, RobotDynError
from robot_dyn.foundations.validate import rows
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import joint_types_of, unit, without_rounding

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


OF_BODIES = "inertia", "Coriolis", "gravity"
_ROUNDING = 1e-12  # relative to the terms, by which a torque may exceed its bound


@final
@dataclass(frozen=True, eq=False, repr=False)
class Causes(Answer, ReadOnly):
    """The torque of n joints at k times by cause; `torques` add up to `tau`.

    Attributes:
        joints: Names of the joints.
        types: Types of the joints, such as "revolute"; None where unknown.
        t: Times, (k,), in [s].
        tau: Actuation, (k, n), in [N m] or [N].
        torques: The part of each cause, (k, n): "inertia", "Coriolis", "gravity", and effects by name.
    """

    joints: tuple[str, ...]
    types: tuple[str | None, ...]
    t: np.ndarray
    tau: np.ndarray
    torques: dict[str, np.ndarray]

    @property
    def unexplained(self) -> np.ndarray:
        """τ minus the sum of its causes, (k, n): rounding, unless a sample of a run contradicts the effects."""
        return self.tau - sum(self.torques.values(), start=np.zeros_like(self.tau))

    def blocks(self) -> Iterator[Block]:
        yield "torque of each joint by cause, at the time where it is largest:"
        names, out = tuple(self.torques), []
        for i, (joint, kind) in enumerate(zip(self.joints, self.types, strict=True)):
            size = np.abs(self.tau[:, i])
            if np.isnan(size).all():
                continue
            k = int(np.nanargmax(size))
            parts = without_rounding([self.tau[k, i], *(torque[k, i] for torque in self.torques.values())])
            out.append((joint, float(self.t[k]), unit("tau", kind), *parts.tolist()))
        yield Table(("joint", "t [s]", "unit", "torque", *names), tuple(out))


def torques_by_cause(plant: Plant | Dynamics, t: ArrayLike, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Causes:
    """Compute the torque that a motion needs, by cause; for a run, use `run.causes()`.

    Dry friction is 0 on a joint whose velocity is exactly 0, as in `Plant.inverse_dynamics`: the torque that holds the
    joint there follows from the actuation, not from the motion.

    Args:
        plant: A plant, or rigid bodies.
        t: Times, (k,), in [s].
        q: Positions, (k, n), in [rad] or [m] by joint.
        v: Velocities, (k, n), in [rad/s] or [m/s].
        a: Accelerations, (k, n), in [rad/s²] or [m/s²].

    Raises:
        QueryError: If an argument has another shape or is not finite.
        EffectError: If an effect has states, which a motion does not determine.
    """
    plant = plant if isinstance(plant, Plant) else Plant(plant)
    t, q, v, a = motion(plant.dynamics.n, t, q, v, a)
    for effect in plant.forces:
        if isinstance(effect, Stateful):
            raise EffectError(
                f"causes: a motion does not determine the states of {effect.name}; simulate it and call run.causes()"
            )
    exerted = exerted_torques(plant, t, q, v, a)
    tau = plant.dynamics.inverse_dynamics(q, v, a) - sum(exerted.values(), start=np.zeros_like(q))
    return by_cause(plant.dynamics, t, q, v, a, tau, exerted)


def by_cause(
    dynamics: Dynamics, t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray, tau: np.ndarray,
    exerted: dict[str, np.ndarray],
) -> Causes:  # fmt: skip
    """Split an actuation by cause; rows that cannot be computed are NaN.

    Args:
        dynamics: The rigid bodies.
        t: Times, (k,).
        q: Positions, (k, n).
        v: Velocities, (k, n).
        a: Accelerations, (k, n).
        tau: Actuation, (k, n).
        exerted: Torque of each effect on the joints, (k, n), by name; see `exerted_torques`.
    """
    N = dynamics.nan_rows.N(q)
    # M a from the recursion, not from the matrix: O(n) time, and no n × n matrices to store
    of_bodies = (dynamics.nan_rows.inverse_dynamics(q, 0 * v, a) - N, dynamics.nan_rows.coriolis_torque(q, v))
    torques = dict(zip(OF_BODIES, (*of_bodies, N), strict=True)) | {name: 0.0 - x for name, x in exerted.items()}
    kinds = joint_types_of(dynamics)
    return Causes(dynamics.joint_names, kinds, t, tau, torques)


def exerted_torques(
    plant: Plant, t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray,
    tau: np.ndarray | None = None, states: np.ndarray | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Compute the torque of each effect on the joints, (k, n), by name: M a + C v + ∂V/∂q = τ + Σ exerted.

    If the actuation of a run is passed, effects that hold joints balance the remainder of the equation at joints of
    velocity 0, within their bounds, dry friction before stops; and the torque of a drive includes minus the actuation
    that its motors receive. Rows at which an effect raises an error, for example at the end of a run, are NaN.

    Args:
        plant: Bodies and effects; payloads may be picked up and dropped.
        t: Times, (k,).
        q: Positions, (k, n).
        v: Velocities, (k, n).
        a: Accelerations, (k, n).
        tau: Actuation, (k, n), or None if it follows from the motion.
        states: States of the effects, (k, state_size); None for their initial values.
    """
    payloads, forces = plant.equation_of_motion.payloads, plant.forces
    names = numbered(*(effect.name for effect in (*forces, *payloads)))
    exerted = {name: np.zeros_like(q) for name in names}
    carried = np.stack([payload.acts(t) for payload in payloads], axis=-1) if payloads else np.zeros((len(t), 0), bool)
    for pattern in np.unique(carried, axis=0):
        equation = (carrying(plant, pattern.tolist()) if payloads else plant).equation_of_motion
        for k in np.flatnonzero((carried == pattern).all(axis=1)):
            z = None if states is None else states[k]
            torques = _torques(equation, float(t[k]), q[k], v[k], z, raises=tau is None)
            for name, torque in zip(names, torques, strict=False):
                exerted[name][k] = torque
    bare = _inverse_dynamics(plant.dynamics, q, v, a)
    for j, name in enumerate(names[len(forces) :]):
        rows_carried, alone = carried[:, j], [i == j for i in range(len(payloads))]
        loaded = robot_with(plant.dynamics, payloads, alone)
        with_payload = _inverse_dynamics(loaded, q[rows_carried], v[rows_carried], a[rows_carried])
        exerted[name][rows_carried] = bare[rows_carried] - with_payload
    if tau is not None:
        _complete(plant, q, v, tau, bare, dict(zip(names, forces, strict=False)), exerted)
    return exerted


def _torques(
    equation: Any, t: float, q: np.ndarray, v: np.ndarray, z: np.ndarray | None, *, raises: bool
) -> list[np.ndarray]:
    try:
        return equation.torques(t, q, v, q.shape, z)
    except RobotDynError:
        if raises:
            raise
        return [np.full_like(q, np.nan)] * len(equation.forces)


def _inverse_dynamics(dynamics: Dynamics, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return dynamics.nan_rows.inverse_dynamics(q, v, a)


def _complete(
    plant: Plant, q: np.ndarray, v: np.ndarray, tau: np.ndarray, needed: np.ndarray, forces: dict[str, Any],
    exerted: dict[str, np.ndarray],
) -> None:  # fmt: skip
    """Add the torques of drives and set-valued effects that follow from the actuation."""

    def remainder() -> np.ndarray:
        return needed - tau - sum(exerted.values(), start=np.zeros_like(tau))

    for name, force in forces.items():
        if isinstance(force, Drive):
            joints = list(force.driven(plant.dynamics.n))
            # the contact of a rigid backlash is not among its states
            has_contact = isinstance(force, SetValued)
            exerted[name][:, joints] += (
                remainder()[:, joints] if has_contact else force.direct_actuation(tau) - tau[:, joints]
            )
    slack = _ROUNDING * (np.abs(needed) + np.abs(tau))
    holding = sorted((x for x in forces.items() if isinstance(x[1], SetValued)), key=lambda x: x[1].stops)
    for name, force in holding:
        rest, (least, most) = remainder(), _bounds(force, q)
        within = (least < most) & (rest >= least - slack) & (rest <= most + slack)
        exerted[name] += np.where(v == 0, np.where(within, rest, rest.clip(least, most)), 0.0)


def _bounds(force: SetValued, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    intervals = [force.at_rest(row) for row in q]
    least, most = (np.array([interval[k] for interval in intervals]).reshape(q.shape) for k in (0, 1))
    return least, most


def motion(
    n: int, t: ArrayLike, q: ArrayLike, v: ArrayLike, a: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Check times (k,) and a motion (k, n), and return them as arrays."""
    t = rows("t", t)
    arrays = [rows(name, x, n) for name, x in (("q", q), ("v", v), ("a", a))]
    for name, x in zip("qva", arrays, strict=True):
        if t.ndim != 1 or x.shape != (len(t), n):
            raise QueryError(f"{name} must have shape (k, {n}) for times t of shape (k,), got {x.shape} and {t.shape}")
    return t, *arrays  # pyright: ignore[reportReturnType]  three of them
