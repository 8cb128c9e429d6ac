"""The torque of each joint along a motion by cause: τ = M(q) a + C(q, v) v + ∂V/∂q − Σ τ_effect, a row for each time.

Causes are "inertia", "Coriolis", "gravity" and each effect by its name, with the sign of the actuation: what the drive
of the joint exerts because of them. A payload that comes and goes is one cause, with its inertia and its weight.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.effects.carried_payload import robot_with
from robot_dyn.effects.effect import Drive, Stateful, numbered
from robot_dyn.effects.plant import Plant, carrying
from robot_dyn.effects.set_valued import SetValued
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.errors import EffectError, QueryError, RobotDynError
from robot_dyn.foundations.validate import rows
from robot_dyn.foundations.values import Value, read_only
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import joint_types_of, unit, without_rounding

OF_BODIES = "inertia", "Coriolis", "gravity"
_ROUNDING = 1e-12  # of the terms, by which a torque at its bound may leave it


@final
@dataclass(frozen=True, eq=False, repr=False)
class Causes(Answer, Value):
    """The torque of n joints at k times by cause; `torques` add up to `tau`.

    Attributes:
        joints: Names of the joints.
        types: Their types, such as "revolute"; None where they are not known.
        t: Times, (k,), in [s].
        tau: Actuation, (k, n), in [N m] or [N].
        torques: Its part by cause, (k, n) each: "inertia", "Coriolis", "gravity", and effects by name.
    """

    joints: tuple[str, ...]
    types: tuple[str | None, ...]
    t: np.ndarray
    tau: np.ndarray
    torques: dict[str, np.ndarray]

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def unexplained(self) -> np.ndarray:
        """τ less the sum of its causes, (k, n): rounding, unless a sample of a run contradicts its effects."""
        return self.tau - sum(self.torques.values(), start=np.zeros_like(self.tau))

    def blocks(self) -> Iterator[Block]:
        yield "torque of each joint by cause, at the time where it is largest:"
        names, out = tuple(self.torques), []
        for i, (joint, kind) in enumerate(zip(self.joints, self.types, strict=True)):
            known = np.abs(self.tau[:, i])
            if np.isnan(known).all():
                continue
            k = int(np.nanargmax(known))
            parts = without_rounding([self.tau[k, i], *(each[k, i] for each in self.torques.values())])
            out.append((joint, float(self.t[k]), unit("tau", kind), *parts.tolist()))
        yield Table(("joint", "t [s]", "unit", "torque", *names), tuple(out))


def torques_by_cause(plant: Plant | Dynamics, t: Any, q: Any, v: Any, a: Any) -> Causes:
    """The torque that a motion asks for, by cause; of a run, ask `run.causes()`.

    Dry friction exerts nothing on a joint whose velocity is exactly 0, as in `Plant.inverse_dynamics`: what holds it
    there follows from the actuation, not from the motion.

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
                f"causes: {effect.name} has states, which a motion does not determine; simulate the motion, and ask"
                " run.causes()"
            )
    exerted = exerted_torques(plant, t, q, v, a)
    tau = plant.dynamics.inverse_dynamics(q, v, a) - sum(exerted.values(), start=np.zeros_like(q))
    return by_cause(plant.dynamics, t, q, v, a, tau, exerted)


def by_cause(
    dynamics: Dynamics, t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray, tau: np.ndarray,
    exerted: dict[str, np.ndarray],
) -> Causes:  # fmt: skip
    """The causes of an actuation; rows that have no answer are NaN.

    Args:
        dynamics: The rigid bodies.
        t: Times, (k,).
        q: Positions, (k, n).
        v: Velocities, (k, n).
        a: Accelerations, (k, n).
        tau: Actuation, (k, n).
        exerted: Torque of each effect on the joints by name, as of `exerted_torques`.
    """
    N = dynamics.N(q, errors="nan")
    # M a of the recursion, not of the matrix: an algorithm of order n, with nothing of order n² to store
    of_bodies = (dynamics.inverse_dynamics(q, 0 * v, a, errors="nan") - N, dynamics.coriolis_torque(q, v, errors="nan"))
    torques = dict(zip(OF_BODIES, (*of_bodies, N), strict=True)) | {name: 0.0 - x for name, x in exerted.items()}
    kinds = joint_types_of(dynamics)
    return Causes(dynamics.joint_names, kinds, t, tau, torques)


def exerted_torques(
    plant: Plant, t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray,
    tau: np.ndarray | None = None, states: np.ndarray | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Torque of each effect on the joints by name, (k, n), so that M a + C v + ∂V/∂q = τ + Σ exerted.

    With the actuation, that of a run, effects that hold joints exert on those of velocity 0 what the equation leaves,
    within their bounds, dry friction before stops; drives take the actuation of their motors from their joints; and
    rows at which an effect has no answer, where the run may have ended, are NaN.

    Args:
        plant: Bodies and effects, whose payloads may come and go.
        t: Times, (k,).
        q: Positions, (k, n).
        v: Velocities, (k, n).
        a: Accelerations, (k, n).
        tau: Actuation, (k, n), or None where it follows from the motion.
        states: States of the effects, (k, state_size); None for those of the start.
    """
    payloads, forces = plant.equation_of_motion.payloads, plant.forces
    names = numbered(*(each.name for each in (*forces, *payloads)))
    exerted = {name: np.zeros_like(q) for name in names}
    carried = np.stack([each.acts(t) for each in payloads], axis=-1) if payloads else np.zeros((len(t), 0), bool)
    for taken in np.unique(carried, axis=0):
        here = np.flatnonzero((carried == taken).all(axis=1))
        equation = (carrying(plant, taken.tolist()) if payloads else plant).equation_of_motion
        for k in here:
            z = None if states is None else states[k]
            torques = _torques(equation, float(t[k]), q[k], v[k], z, raises=tau is None)
            for name, torque in zip(names, torques, strict=False):
                exerted[name][k] = torque
    bare = _answer(plant.dynamics, q, v, a)
    for j, name in enumerate(names[len(forces) :]):
        here, alone = carried[:, j], [i == j for i in range(len(payloads))]
        loaded: Any = robot_with(plant.dynamics, payloads, alone)
        exerted[name][here] = bare[here] - _answer(loaded, q[here], v[here], a[here])
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


def _answer(dynamics: Dynamics, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return dynamics.inverse_dynamics(q, v, a, errors="nan")


def _complete(
    plant: Plant, q: np.ndarray, v: np.ndarray, tau: np.ndarray, needed: np.ndarray, forces: dict[str, Any],
    exerted: dict[str, np.ndarray],
) -> None:  # fmt: skip
    """Add to the torques of drives and of set-valued effects what follows from the actuation."""

    def left() -> np.ndarray:
        return needed - tau - sum(exerted.values(), start=np.zeros_like(tau))

    for name, force in forces.items():
        if isinstance(force, Drive):
            joints = list(force.driven(plant.dynamics.n))
            known = not isinstance(force, SetValued)  # the contact of a rigid backlash is not among its states
            exerted[name][:, joints] += (force.reaching(tau) - tau[:, joints]) if known else left()[:, joints]
    slack = _ROUNDING * (np.abs(needed) + np.abs(tau))
    holding = sorted((x for x in forces.items() if isinstance(x[1], SetValued)), key=lambda x: x[1].stops)
    for name, force in holding:
        rest, (least, most) = left(), _bounds(force, q)
        within = (least < most) & (rest >= least - slack) & (rest <= most + slack)
        exerted[name] += np.where(v == 0, np.where(within, rest, rest.clip(least, most)), 0.0)


def _bounds(force: SetValued, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    intervals = [force.at_rest(row) for row in q]
    least, most = (np.array([each[k] for each in intervals]).reshape(q.shape) for k in (0, 1))
    return least, most


def motion(n: int, t: Any, q: Any, v: Any, a: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times (k,) and a motion (k, n), checked."""
    t = rows("t", t)
    moved = [rows(name, x, n) for name, x in (("q", q), ("v", v), ("a", a))]
    for name, x in zip("qva", moved, strict=True):
        if t.ndim != 1 or x.shape != (len(t), n):
            raise QueryError(f"{name} must have shape (k, {n}) for times t of shape (k,), got {x.shape} and {t.shape}")
    return t, *moved  # pyright: ignore[reportReturnType]  three of them
