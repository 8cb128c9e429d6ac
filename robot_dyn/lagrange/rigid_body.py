"""Newton–Euler equations of one rigid body under a wrench, in world axes and in body axes.

    world axes   m p̈ = f,             I_s ω̇ + ω × I_s ω = τ,   I_s = R I Rᵀ
    body axes    m v̇ + ω × m v = f,   I ω̇ + ω × I ω = τ

p is the centre of mass, where the wrench (f, τ) acts; the body's frame has its origin there and is rotated by R. The
twist is (ṗ, ω) in world axes and (v, ω) = (Rᵀ ṗ, Rᵀ ω_s) in body axes. The world-axes twist is not the spatial twist
ġg⁻¹ of the frame, whose linear part is ṗ + p × ω. Arrays are float64 and may have leading batch axes.
[Murray, Li, Sastry 1994, ch. 4 §2.4]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.description.inertia import MassProperties, rotation_matrix
from robot_dyn.foundations.arithmetic import apply, transpose
from robot_dyn.foundations.errors import OverflowedError, QueryError
from robot_dyn.foundations.linear_algebra import NotPositiveDefiniteError, cholesky_solve
from robot_dyn.foundations.validate import check_batches, rows

_without_warnings = np.errstate(over="ignore", invalid="ignore")  # _finite reports overflow


@_without_warnings
def world_wrench(body: MassProperties, R: ArrayLike, omega: ArrayLike, acceleration: ArrayLike) -> np.ndarray:
    """Return the wrench for an acceleration, in world axes: (m p̈, I_s ω̇ + ω × I_s ω).

    Args:
        body: Mass and inertia; `com` is not used, because p is the centre of mass.
        R: Rotation from body axes to world axes, shape (..., 3, 3).
        omega: Angular velocity ω in world axes, shape (..., 3), in [rad/s].
        acceleration: (p̈, ω̇) in world axes, shape (..., 6), in [m/s²] and [rad/s²].

    Returns:
        (f, τ) at the centre of mass in world axes, shape (..., 6), in [N] and [N m].

    Raises:
        QueryError: If a shape is wrong, a value is not finite, or R is not a rotation.
    """
    R, omega = rotation_matrix(R), rows("omega", omega, 3)
    acceleration = rows("acceleration", acceleration, 6)
    check_batches(R=R[..., 0], omega=omega, acceleration=acceleration)
    I_s = R @ body.inertia @ transpose(R)
    torque = apply(I_s, acceleration[..., 3:]) + np.cross(omega, apply(I_s, omega))
    return _pair(body.mass * acceleration[..., :3], torque)


@_without_warnings
def world_acceleration(body: MassProperties, R: ArrayLike, omega: ArrayLike, wrench: ArrayLike) -> np.ndarray:
    """Return the acceleration under a wrench, in world axes: (f / m, I_s⁻¹ (τ − ω × I_s ω)).

    Args:
        body: Mass and inertia.
        R: Rotation from body axes to world axes, shape (..., 3, 3).
        omega: Angular velocity ω in world axes, shape (..., 3), in [rad/s].
        wrench: (f, τ) at the centre of mass in world axes, shape (..., 6), in [N] and [N m].

    Returns:
        (p̈, ω̇) in world axes, shape (..., 6), in [m/s²] and [rad/s²].

    Raises:
        QueryError: If a shape is wrong, a value is not finite, R is not a rotation, or the inertia is singular.
    """
    R, omega, wrench = rotation_matrix(R), rows("omega", omega, 3), rows("wrench", wrench, 6)
    check_batches(R=R[..., 0], omega=omega, wrench=wrench)
    I_s = R @ body.inertia @ transpose(R)
    torque = wrench[..., 3:] - np.cross(omega, apply(I_s, omega))
    return _pair(wrench[..., :3] / body.mass, apply(R, _solve(body, apply(transpose(R), torque))))


@_without_warnings
def body_wrench(body: MassProperties, twist: ArrayLike, rate: ArrayLike) -> np.ndarray:
    """Return the wrench for a rate of the twist, in body axes: (m v̇ + ω × m v, I ω̇ + ω × I ω).

    Args:
        body: Mass and inertia.
        twist: (v, ω) of the centre of mass in body axes, shape (..., 6), in [m/s] and [rad/s].
        rate: (v̇, ω̇), the derivative of these components, shape (..., 6), in [m/s²] and [rad/s²].

    Returns:
        (f, τ) at the centre of mass in body axes, shape (..., 6), in [N] and [N m].

    Raises:
        QueryError: If a shape is wrong or a value is not finite.
    """
    twist, rate = rows("twist", twist, 6), rows("rate", rate, 6)
    check_batches(twist=twist, rate=rate)
    force, torque = _gyroscopic(body, twist)
    return _pair(body.mass * rate[..., :3] + force, apply(body.inertia, rate[..., 3:]) + torque)


@_without_warnings
def body_acceleration(body: MassProperties, twist: ArrayLike, wrench: ArrayLike) -> np.ndarray:
    """Return the rate of the twist under a wrench, in body axes: (f/m − ω × v, I⁻¹ (τ − ω × I ω)), Euler's equations.

    Args:
        body: Mass and inertia.
        twist: (v, ω) of the centre of mass in body axes, shape (..., 6), in [m/s] and [rad/s].
        wrench: (f, τ) at the centre of mass in body axes, shape (..., 6), in [N] and [N m].

    Returns:
        (v̇, ω̇), shape (..., 6), in [m/s²] and [rad/s²].

    Raises:
        QueryError: If a shape is wrong, a value is not finite, or the inertia is singular.
    """
    twist, wrench = rows("twist", twist, 6), rows("wrench", wrench, 6)
    check_batches(twist=twist, wrench=wrench)
    force, torque = _gyroscopic(body, twist)
    return _pair((wrench[..., :3] - force) / body.mass, _solve(body, wrench[..., 3:] - torque))


@_without_warnings
def kinetic_energy(body: MassProperties, twist: ArrayLike) -> np.ndarray:
    """Return K = ½ m ‖ṗ‖² + ½ ωᵀ I ω in [J], (...), for twists (v, ω) of the centre of mass in body axes (..., 6).

    Only for the centre of mass do v and ω decouple; for any other point use `MassProperties.spatial`.

    Raises:
        QueryError: If the shape is wrong or a value is not finite.
    """
    twist = rows("twist", twist, 6)
    v, omega = twist[..., :3], twist[..., 3:]
    return _finite((body.mass * (v * v).sum(-1) + (omega * apply(body.inertia, omega)).sum(-1)) / 2)


@_without_warnings
def point_velocity(twist: ArrayLike, r: ArrayLike) -> np.ndarray:
    """Return the velocity ṗ = ṗ_c + ω × r of the point at r from the centre of mass, in the same axes; (..., 3), [m/s].

    Args:
        twist: Twist (ṗ_c, ω), shape (..., 6), in [m/s] and [rad/s].
        r: Point relative to the centre of mass, shape (..., 3), in [m].

    Raises:
        QueryError: If a shape is wrong or a value is not finite.
    """
    twist, r = rows("twist", twist, 6), rows("r", r, 3)
    check_batches(twist=twist, r=r)
    return _finite(twist[..., :3] + np.cross(twist[..., 3:], r))


@_without_warnings
def angular_momentum(body: MassProperties, R: ArrayLike, omega: ArrayLike) -> np.ndarray:
    """Return I_s ω about the centre of mass in world axes, (..., 3), in [N m s]; constant without torque.

    Args:
        body: Mass and inertia.
        R: Rotation from body axes to world axes, shape (..., 3, 3).
        omega: Angular velocity in world axes, shape (..., 3), in [rad/s].

    Raises:
        QueryError: If a shape is wrong, a value is not finite, or R is not a rotation.
    """
    R, omega = rotation_matrix(R), rows("omega", omega, 3)
    check_batches(R=R[..., 0], omega=omega)
    return _finite(apply(R @ body.inertia @ transpose(R), omega))


def _gyroscopic(body: MassProperties, twist: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ω × m v and ω × I ω."""
    v, omega = twist[..., :3], twist[..., 3:]
    return np.cross(omega, body.mass * v), np.cross(omega, apply(body.inertia, omega))


def _solve(body: MassProperties, torque: np.ndarray) -> np.ndarray:
    try:
        return cholesky_solve(np.broadcast_to(body.inertia, (*torque.shape[:-1], 3, 3)), torque)
    except NotPositiveDefiniteError:
        raise QueryError(
            "no angular acceleration: the inertia is singular, like that of points on a line; give a positive definite"
            " inertia"
        ) from None


def _pair(linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
    batch = np.broadcast_shapes(linear.shape, angular.shape)
    return _finite(np.concatenate([np.broadcast_to(linear, batch), np.broadcast_to(angular, batch)], axis=-1))


def _finite(result: np.ndarray) -> np.ndarray:
    if not np.isfinite(result).all():
        raise OverflowedError("the result is too large for float64; check the units of the arguments")
    return result
