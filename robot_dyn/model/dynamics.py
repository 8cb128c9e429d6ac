"""The protocol that every engine answers: rigid bodies in gravity, M(q) a + C(q, v) v + N(q) = τ, N = ∂V/∂q."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Protocol, TypeVar

import numpy as np

from robot_dyn.arithmetic import FLOAT64, Arithmetic, Array, NotPositiveDefiniteError, cholesky_solve, rounding
from robot_dyn.errors import NotFiniteError, OverflowedError, QueryError, SingularError, UndecidedError, nearest

T = TypeVar("T")


class Axes(StrEnum):
    """The axes and reference point of a twist of a frame.

    WORLD_ALIGNED: at the frame's origin, along the base's axes: its linear part is ṗ.
    BODY: at the frame's origin, along the frame's axes: the body twist g⁻¹ġ.
    WORLD: at the base's origin, along the base's axes: the spatial twist ġg⁻¹.
    """

    WORLD_ALIGNED = "world_aligned"
    BODY = "body"
    WORLD = "world"

    @classmethod
    def of(cls, name: str) -> Axes:
        """The axes of that name; QueryError if there are none."""
        try:
            return cls(name)
        except ValueError:
            raise QueryError(f"expressed_in={name!r}; {nearest(str(name), list(cls))}") from None


class Dynamics(Protocol):
    """Rigid bodies in gravity.

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
        """Mass matrix of K = ½ vᵀ M v, symmetric positive definite, shape (..., n, n)."""
        ...

    def C(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Coriolis matrix of the Christoffel symbols, so that Ṁ = C + Cᵀ, shape (..., n, n)."""
        ...

    def N(self, q: Array, *, errors: str = "raise") -> Array:
        """Gravity torque ∂V/∂q, shape (..., n)."""
        ...

    def coriolis_torque(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Coriolis and centrifugal torque C(q, v) v, shape (..., n)."""
        ...

    def coriolis_transpose(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Cᵀ(q, v) v = ∂K/∂q, for momentum observers: d(M v)/dt = τ + Cᵀ v − N; shape (..., n)."""
        ...

    def inverse_dynamics(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> Array:
        """Torque τ = M a + C v + N, shape (..., n)."""
        ...

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *, errors: str = "raise") -> Array:
        """Acceleration a = M⁻¹ (τ − C v − N), shape (..., n); SingularError if M is singular."""
        ...

    def kinetic_energy(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """K = ½ vᵀ M v in [J], shape (...)."""
        ...

    def potential_energy(self, q: Array, *, errors: str = "raise") -> Array:
        """V = −Σ mᵢ gᵀ pᵢ of the bodies that move, in [J], shape (...)."""
        ...

    def momentum(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        """Generalised momentum p = ∂K/∂v = M v, shape (..., n)."""
        ...

    def placement(self, q: Array, frame: str, *, errors: str = "raise") -> Array:
        """Homogeneous matrix [[R, p], [0, 1]] of a link's frame in the base, shape (..., 4, 4)."""
        ...

    def jacobian(self, q: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise") -> Array:
        """J with twist = J v of a link's frame, rows (linear, angular), shape (..., 6, n)."""
        ...

    def jacobian_rate(
        self, q: Array, v: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise"
    ) -> Array:
        """dJ/dt along v, of the same J, shape (..., 6, n)."""
        ...


def checked(name: str, values: Array, joint_names: tuple[str, ...], arithmetic: Arithmetic = FLOAT64) -> Array:
    """`values` as numbers of the arithmetic, shape (..., n).

    Raises:
        QueryError: If they are not numbers, have another shape, or are not finite; names the joint.
    """
    array = shaped(name, values, joint_names, arithmetic)
    check_finite(name, array, joint_names, arithmetic)
    return array


def shaped(name: str, values: Array, joint_names: tuple[str, ...], arithmetic: Arithmetic = FLOAT64) -> Array:
    """`values` as numbers of the arithmetic, finite or not, shape (..., n).

    Raises:
        QueryError: If they are not numbers, or have another shape.
    """
    n = len(joint_names)
    try:
        array = arithmetic.asarray(values)
    except (TypeError, ValueError):
        raise QueryError(f"{name} must be an array of {n} numbers, got {values!r}") from None
    if array.ndim == 0 or array.shape[-1] != n:
        raise QueryError(f"{name} must have shape ({n},) or (..., {n}), got {array.shape}")
    return array


def check_finite(name: str, array: Array, joint_names: tuple[str, ...], arithmetic: Arithmetic = FLOAT64) -> None:
    """Raise NotFiniteError, which names the joint, unless every number of an argument (..., n) is finite."""
    finite = arithmetic.finite(array)
    if not finite.all():
        index = tuple(np.argwhere(~finite)[0])
        joint = "" if name == "t" else f" for joint {joint_names[index[-1]]!r}"
        raise NotFiniteError(f"{name} must be finite, got {array[index]}{joint}")


def shape_of(quantity: str, n: int) -> tuple[int, ...]:
    """Shape of a quantity of the protocol for one state."""
    if quantity in ("kinetic_energy", "potential_energy"):
        return ()
    special = {
        "mass_matrix_derivative": (n, n, n),
        "M": (n, n),
        "C": (n, n),
        "placement": (4, 4),
        "jacobian": (6, n),
        "jacobian_rate": (6, n),
    }
    return special.get(quantity, (n,))


def acceleration(M: Array, tau: Array, joint_names: tuple[str, ...]) -> Array:
    """Solve M a = τ for M (..., n, n) and what is left of the torque, τ (..., n).

    Raises:
        SingularError: If M is not positive definite; names the joint. UndecidedError if rounding hides whether it is.
    """
    n = len(joint_names)
    batch = np.broadcast_shapes(M.shape[:-2], tau.shape[:-1])
    try:
        return cholesky_solve(np.broadcast_to(M, (*batch, n, n)), np.broadcast_to(tau, (*batch, n)))
    except NotPositiveDefiniteError as error:
        if M.dtype.kind == "f" and not np.isfinite(M).all():
            raise OverflowedError("q is so large that M overflows") from None
        joint = joint_names[error.row]
        if error.decided:
            raise SingularError(joint, "at this q") from None
        raise UndecidedError(joint, "at this q", rounding(M)) from None


def entry(table: Mapping[str, T], frame: str) -> T:
    """What a table holds for a frame; QueryError with the nearest names if there is no such frame."""
    try:
        return table[frame]
    except (KeyError, TypeError):
        raise QueryError(f"no frame {frame!r}; {nearest(str(frame), table)}") from None


def check_batches(**arrays: Array) -> tuple[int, ...]:
    """The common batch shape of arguments; QueryError if they do not broadcast."""
    try:
        return np.broadcast_shapes(*(array.shape[:-1] for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise QueryError(f"batch axes do not match: {shapes}") from None
