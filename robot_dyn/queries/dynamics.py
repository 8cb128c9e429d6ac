"""The protocol of every engine: rigid bodies in gravity, M(q) a + C(q, v) v + N(q) = τ, N = ∂V/∂q."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from robot_dyn.foundations.arithmetic import Array, rounding
from robot_dyn.foundations.errors import OverflowedError, SingularError, UndecidedError, shown
from robot_dyn.foundations.linear_algebra import NotPositiveDefiniteError, cholesky_solve
from robot_dyn.foundations.validate import choice

T = TypeVar("T")


class Axes(StrEnum):
    """The axes and reference point of a twist of a frame.

    WORLD_ALIGNED: at the frame's origin, along the base's axes: its linear part is ṗ. Pinocchio's LOCAL_WORLD_ALIGNED.
    BODY: at the frame's origin, along the frame's axes: the body twist g⁻¹ġ. Pinocchio's LOCAL.
    WORLD: at the base's origin, along the base's axes: the spatial twist ġg⁻¹. Pinocchio's WORLD.

    Pinocchio's names are taken too, as texts or as `pinocchio.ReferenceFrame`.
    """

    WORLD_ALIGNED = "world_aligned"
    BODY = "body"
    WORLD = "world"

    @classmethod
    def of(cls, name: Any) -> Axes:
        """The axes of that name; raises QueryError for any other."""
        text = name if isinstance(name, str) else str(getattr(name, "name", shown(name)))  # Pinocchio's have names
        return cls(choice("expressed_in", _OF_PINOCCHIO.get(text, text), list(cls)))


_OF_PINOCCHIO = {"LOCAL": "body", "LOCAL_WORLD_ALIGNED": "world_aligned", "WORLD": "world"}
_OF_PINOCCHIO |= {name.lower(): axes for name, axes in _OF_PINOCCHIO.items()}


@runtime_checkable
class Dynamics(Protocol):
    """Rigid bodies in gravity: M(q) a + C(q, v) v + N(q) = τ.

    `q`, `v`, `a`, `tau` have shape (n,), or (..., n) in a batch, in [rad], [rad/s], [rad/s²], [N m] for a revolute
    joint and [m], [m/s], [m/s²], [N] for a prismatic one. Twists are (linear, angular). Every method raises
    QueryError for a wrong shape, a value that is not finite or an unknown frame, and OverflowedError where the answer
    would not be finite; in a batch the message and the error's `row` say at which state. With errors="nan" the states
    of a batch that have no answer get NaN, and the others theirs.
    """

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        ...

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        ...

    def M(self, q: Array, *, errors: str = "raise") -> Array:
        """Mass matrix of the kinetic energy K = ½ vᵀ M v.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Symmetric positive definite matrix, shape (..., n, n), in [kg m²], [kg m] or [kg].

        Raises:
            QueryError: If q has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def C(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Coriolis matrix of the Christoffel symbols, so that Ṁ = C + Cᵀ.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Matrix, shape (..., n, n); C v is in [N m] or [N].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def N(self, q: Array, *, errors: str = "raise") -> Array:
        """Gravity torque ∂V/∂q: the torque that holds the robot at rest.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Torques, shape (..., n), in [N m] or [N].

        Raises:
            QueryError: If q has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def coriolis_torque(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Coriolis and centrifugal torque C(q, v) v.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Torques, shape (..., n), in [N m] or [N].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def coriolis_transpose(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Cᵀ(q, v) v = ∂K/∂q, as momentum observers use it: d(M v)/dt = τ + Cᵀ v − N.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Torques, shape (..., n), in [N m] or [N].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def inverse_dynamics(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> Array:
        """Torque of an acceleration: τ = M a + C v + N.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            a: Accelerations, shape (..., n), in [rad/s²] or [m/s²].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Torques, shape (..., n), in [N m] or [N].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *, errors: str = "raise") -> Array:
        """Acceleration of a torque: a = M⁻¹ (τ − C v − N).

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            tau: Torques, shape (..., n), in [N m] or [N].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Accelerations, shape (..., n), in [rad/s²] or [m/s²].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
            SingularError: If M is singular.
        """
        ...

    def kinetic_energy(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Kinetic energy K = ½ vᵀ M v.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Energy, shape (...), in [J].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def potential_energy(self, q: Array, *, errors: str = "raise") -> Array:
        """Potential energy of gravity V = −Σ mᵢ gᵀ pᵢ of the bodies that move, 0 at the origin of the base.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Energy, shape (...), in [J].

        Raises:
            QueryError: If q has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def total_energy(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Total energy E = K + V, constant where nothing but gravity acts.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Energy, shape (...), in [J].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        return self.kinetic_energy(q, v, errors=errors) + self.potential_energy(q, errors=errors)

    def momentum(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Generalised momentum p = ∂K/∂v = M v.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Momenta, shape (..., n), in [kg m²/s] or [kg m/s].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def placement(self, q: Array, frame: str, *, errors: str = "raise") -> Array:
        """Placement of a frame in the base: the homogeneous matrix [[R, p], [0, 1]].

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            frame: Name of a link, or of a joint: the frame of a joint is that of its child link. A name that a link
                and a joint share is the link's.
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Matrix, shape (..., 4, 4); p in [m].

        Raises:
            QueryError: If q has the wrong shape or is not finite, or the frame is unknown.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def jacobian(self, q: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise") -> Array:
        """Jacobian J(q) of a frame: twist = J v.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            frame: Name of a link or joint, as of `placement`.
            expressed_in: Axes and point of the twist, "world_aligned" (at the frame's origin, along the base's axes),
                "body" (along the frame's axes) or "world" (at the base's origin); or as Pinocchio calls them:
                "local_world_aligned", "local", "world".
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Matrix with rows (linear, angular), shape (..., 6, n); the twist is in [m/s] and [rad/s].

        Raises:
            QueryError: If q has the wrong shape or is not finite, or the frame or axes are unknown.
            OverflowedError: If the answer would not be finite.
        """
        ...

    def jacobian_rate(
        self, q: Array, v: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise"
    ) -> Array:
        """Rate of change dJ/dt of the Jacobian of a frame, along v.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            frame: Name of a link or joint, as of `placement`.
            expressed_in: Axes and point of the twist, as of `jacobian`.
            errors: "raise", or "nan" for NaN in place of the states of a batch that have no answer.

        Returns:
            Matrix with rows (linear, angular), shape (..., 6, n); dJ/dt v is in [m/s²] and [rad/s²].

        Raises:
            QueryError: If an argument has the wrong shape or is not finite, or the frame or axes are unknown.
            OverflowedError: If the answer would not be finite.
        """
        ...


def acceleration(M: Array, tau: Array, joint_names: tuple[str, ...]) -> Array:
    """Solve M a = τ for M (..., n, n) and the remaining torque τ (..., n).

    Raises:
        SingularError: If M is not positive definite; names the joint. UndecidedError if rounding hides whether it is.
    """
    if M.shape[:-2] != tau.shape[:-1]:
        batch = np.broadcast_shapes(M.shape[:-2], tau.shape[:-1])
        M, tau = np.broadcast_to(M, (*batch, *M.shape[-2:])), np.broadcast_to(tau, (*batch, *tau.shape[-1:]))
    try:
        return cholesky_solve(M, tau)
    except NotPositiveDefiniteError as error:
        if M.dtype.kind == "f" and not np.isfinite(M).all():
            raise OverflowedError("q is so large that M overflows") from None
        joint = joint_names[error.row]
        if error.decided:
            raise SingularError(joint, "at this q") from None
        raise UndecidedError(joint, "at this q", rounding(M)) from None


def entry(table: Mapping[str, T], frame: str) -> T:
    """The entry of a table for a frame; QueryError with the nearest names if it is unknown."""
    return table[choice("frame", frame, table)]
