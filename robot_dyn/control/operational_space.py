"""The dynamics of the end effector: Λ ẍ + μ + p = F, with Λ = (J M⁻¹ Jᵀ)⁻¹ and τ = Jᵀ F.

The task velocity ẋ consists of rows of a frame's world-aligned twist (ṗ, ω). [Khatib 1987, IEEE J. Robotics and
Automation 3(1), A unified approach for motion and force control of robot manipulators]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass, field
from math import nan
from operator import index
from typing import Any, final

import numpy as np

from robot_dyn.control.cartesian import CartesianReference
from robot_dyn.control.controller import Stateless, check_model
from robot_dyn.control.orientation import orientation_error
from robot_dyn.control.reference import number, numbers
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.arithmetic import Array, apply, symmetric, transpose
from robot_dyn.foundations.coefficients import CoefficientField, OptionalCoefficientField, coefficient, default
from robot_dyn.foundations.errors import ControlError, shown
from robot_dyn.foundations.linear_algebra import eigh
from robot_dyn.foundations.threshold import smooth
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.queries.dynamics import Dynamics, acceleration

POSITION, POSE = (0, 1, 2), (0, 1, 2, 3, 4, 5)  # rows of a twist


@final
@dataclass(frozen=True, eq=False, repr=False)
class TaskDynamics(Answer, ReadOnly):
    """The terms of Λ ẍ + μ + p = F at one state, or at several along batch axes.

    Attributes:
        J: Task Jacobian, shape (..., m, n).
        Lambda: Λ = (J M⁻¹ Jᵀ)⁻¹, the inertia felt at the task, shape (..., m, m), in [kg], [kg m], [kg m²].
        J_bar: J̄ = M⁻¹ Jᵀ Λ, the inverse of J that is consistent with the dynamics, shape (..., n, m).
        mu: μ = J̄ᵀ C v − Λ J̇ v, shape (..., m), in [N] and [N m].
        p: p = J̄ᵀ N, gravity at the task, shape (..., m), in [N] and [N m].
        drift: J̇ v, the task acceleration at constant v, shape (..., m).
        smallest: Smallest eigenvalue of J M⁻¹ Jᵀ, shape (...): below the threshold, Λ and J̄ are damped.
    """

    J: Array
    Lambda: Array
    J_bar: Array
    mu: Array
    p: Array
    drift: Array
    smallest: Array

    @property
    def projector(self) -> Array:
        """1 − Jᵀ J̄ᵀ, the projector onto torques that do not accelerate the task, shape (..., n, n)."""
        J = self.J
        return np.eye(J.shape[-1], dtype=J.dtype) - transpose(J) @ transpose(self.J_bar)

    def blocks(self) -> Iterator[Block]:
        *batch, m, n = self.J.shape
        states = f" at {'×'.join(map(str, batch))} states" if batch else ""
        yield f"Λ ẍ + μ + p = F of a task of {m} rows, {n} joints{states}"
        least = float(np.min(self.smallest)) if np.size(self.smallest) else nan
        yield f"smallest eigenvalue of J M⁻¹ Jᵀ: {least:.4g} [1/kg or 1/(kg m²)]"
        if not batch:
            rows = np.column_stack([np.arange(1, m + 1), self.Lambda, self.mu, self.p, self.drift]).astype(float)
            yield Table(("row", *(f"Λ {k}" for k in range(1, m + 1)), "μ", "p", "J̇ v"), tuple(map(tuple, rows)), 4)


def task_dynamics(
    dynamics: Dynamics, q: Array, v: Array, frame: str, *, rows: tuple[int, ...] = POSE, threshold: float = 0.01
) -> TaskDynamics:
    """Compute the dynamics of a frame as a task, damped near singularities.

    Along an eigenvector of A = J M⁻¹ Jᵀ with eigenvalue s, Λ is 1/s; for s below the threshold ε it is

        s/ε² = s/(s² + λ²),   λ² = ε² − s²,

    which keeps Λ below 1/ε and gives zero force at the singularity itself, where no force can act. Other directions
    remain exact. Metres and radians have equal weight.

    Args:
        dynamics: The arm.
        q: Shape (n,) or (..., n), in [rad] or [m].
        v: Shape (n,) or (..., n), in [rad/s] or [m/s].
        frame: Name of a link.
        rows: Rows of (ṗ, ω) that form the task: POSE, POSITION, or others such as (0, 1) for a planar arm.
        threshold: ε in [1/kg] and [1/(kg m²)], positive: the default bounds the apparent mass by 100 kg.

    Raises:
        QueryError: If q or v has the wrong shape or the frame is unknown.
        ControlError: If rows or threshold are invalid.
        SingularError: If M is singular.

    Source: Khatib 1987; Chiaverini, Siciliano, Egeland 1994 (damping in the singular directions only).
    """
    check_model(dynamics)
    return _task_dynamics(dynamics, q, v, frame, _rows(rows), number("threshold", threshold, above=0))


def _task_dynamics(
    dynamics: Dynamics, q: Array, v: Array, frame: str, rows: tuple[int, ...], epsilon: float
) -> TaskDynamics:
    """Compute `task_dynamics` from checked arguments."""
    J = dynamics.jacobian(q, frame)[..., rows, :]
    drift = apply(dynamics.jacobian_rate(q, v, frame)[..., rows, :], np.asarray(v))
    # rows of J M⁻¹, one solve each: M is symmetric
    J_over_M = acceleration(dynamics.M(q)[..., None, :, :], J, dynamics.joint_names)
    s, U = eigh(symmetric(J_over_M @ transpose(J)))
    with np.errstate(over="ignore", under="ignore"):
        weight = s / np.maximum(s, epsilon) ** 2
    Lambda = (U * weight[..., None, :]) @ transpose(U)
    J_bar = transpose(J_over_M) @ Lambda
    mu = apply(transpose(J_bar), dynamics.coriolis_torque(q, v)) - apply(Lambda, drift)
    return TaskDynamics(
        J, Lambda, J_bar, mu, apply(transpose(J_bar), dynamics.N(q)), drift, np.minimum.reduce(s, axis=-1)
    )


@final
@dataclass(frozen=True, eq=False)
class OperationalSpace(Stateless):
    """Computed torque for a frame, with a posture in the null space of the task.

        F = Λ (ẍ_d + kd ė + kp e) + μ + p
        τ = Jᵀ F + (1 − Jᵀ J̄ᵀ)(M (posture_kp (q_p − q) − posture_kd v) + C v + N)

    With the exact model and away from singularities ẍ = ẍ_d + kd ė + kp e. The orientation error is the rotation vector
    of R_d Rᵀ. Near a singularity (`task_dynamics`) the task torque τ_x = Jᵀ Λ (ẍ_d + kd ė + kp e − J̇ v) obeys
    τ_xᵀ M⁻¹ τ_x ≤ ‖ẍ_d + kd ė + kp e − J̇ v‖²/ε, and the posture controls the direction that the task gives up.

    Attributes:
        model: The controller's model of the arm.
        frame: Name of the controlled link.
        reference: Motion of the link; if it leaves the orientation free, only the position is controlled.
        kp: Position gain, a scalar or one for each row of the task, in [1/s²], not negative.
        kd: Velocity gain, a scalar or one for each row of the task, in [1/s], not negative.
        posture: q_p, shape (n,), in [rad] or [m]; None for damping only.
        posture_kp: Position gain of the posture, a scalar or (n,), in [1/s²], not negative.
        posture_kd: Velocity gain of the posture, a scalar or (n,), in [1/s], not negative.
        rows: Rows of (ṗ, ω) that form the task; by default POSE, or POSITION if the orientation is free.
        threshold: ε of `task_dynamics`, in [1/kg] and [1/(kg m²)].
        period_s: Sampling period, in [s]; 0 for continuous control.

    Source: Khatib 1987; Siciliano et al. 2009, sec. 8.6.
    """

    model: Dynamics
    frame: str
    reference: CartesianReference
    _: KW_ONLY
    kp: CoefficientField = field(metadata=coefficient("1/s²", shapes=((), ("m",)), minimum=0))
    kd: CoefficientField = field(metadata=coefficient("1/s", shapes=((), ("m",)), minimum=0))
    posture: OptionalCoefficientField = field(default=default(None), metadata=coefficient("rad", shapes=(("n",),)))
    posture_kp: CoefficientField = field(default=default(0.0), metadata=coefficient("1/s²", minimum=0))
    posture_kd: CoefficientField = field(default=default(0.0), metadata=coefficient("1/s", minimum=0))
    rows: Any = None
    threshold: float = field(default=0.01, metadata=coefficient("1/kg", shapes=((),), exclusive_minimum=0))
    period_s: float = 0.0

    term = "Jᵀ (Λ (ẍ_d + kd ė + kp e) + μ + p) + null-space posture"
    thresholds = smooth

    def __post_init__(self) -> None:
        check_model(self.model)
        if not isinstance(self.reference, CartesianReference):
            raise ControlError(f"reference must be a CartesianReference, such as line(…), got {shown(self.reference)}")
        free = self.reference.rotation is None
        rows = _rows((POSITION if free else POSE) if self.rows is None else self.rows)
        if free and max(rows) > 2:
            raise ControlError(
                f"rows {rows} include the orientation, but the reference leaves it free; use rows 0 to 2"
            )
        self.model.jacobian(np.zeros(self.n), self.frame)  # reports an unknown frame now, not during a run
        object.__setattr__(self, "rows", rows)
        if self.posture is None:
            object.__setattr__(self, "posture", np.zeros(self.n))
            if np.any(self.posture_kp):
                raise ControlError("posture_kp needs a posture; give both or neither")
        super().__post_init__()
        for name, *shapes in (("kp", (), (len(rows),)), ("kd", (), (len(rows),)), ("posture", (self.n,))):
            numbers(name, getattr(self, name), *shapes)

    @property
    def task_frame(self) -> str | None:
        return self.frame

    @property
    def n(self) -> int:
        return self.model.n

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        model = self.model
        task = _task_dynamics(model, q, v, self.frame, self.rows, self.threshold)
        F = apply(task.Lambda, self.task_acceleration(t, q, v)) + task.mu + task.p
        free = model.inverse_dynamics(q, v, self.posture_kp * (self.posture - q) - self.posture_kd * v)
        return apply(transpose(task.J), F) + apply(task.projector, free)

    def task_acceleration(self, t: float, q: Array, v: Array) -> Array:
        """Return the desired task acceleration ẍ_d + kd ė + kp e, shape (m,), in [m/s²] and [rad/s²]."""
        rows = self.rows
        p_d, R_d, twist_d, rate_d = self.reference.at(t)
        g = self.model.placement(q, self.frame)
        p, R = g[..., :3, 3], g[..., :3, :3]
        turn = np.zeros_like(p) if R_d is None else orientation_error(R_d, R)
        e = np.concatenate([p_d - p, turn], axis=-1)[..., rows]
        twist = apply(self.model.jacobian(q, self.frame), np.asarray(v))
        return rate_d[..., rows] + self.kd * (twist_d - twist)[..., rows] + self.kp * e


def _rows(rows: Any) -> tuple[int, ...]:
    """Return rows of a twist as a tuple; raise a ControlError unless they increase from 0 to 5."""
    try:
        chosen = tuple(index(row) for row in rows if not isinstance(row, bool))
    except (TypeError, OverflowError):
        chosen = ()
    if not chosen or chosen != tuple(sorted(set(chosen) & set(POSE))):
        raise ControlError(f"rows must be increasing numbers from 0 to 5, the rows of (ṗ, ω), got {shown(rows)}")
    return chosen
