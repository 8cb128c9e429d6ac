"""Desired motions of a frame: p(t) along a line or a circle, and R(t) = exp(â φ(t)) R₀ about one axis.

Position and angle are piecewise polynomials; the twist is (ṗ, φ̇ a), in base axes. [Siciliano et al. 2009, sec. 4.3]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.control.orientation import orientation_error
from robot_dyn.control.reference import PiecewisePolynomial, Reference, hermite, number, numbers, quintic
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.coefficients import CoefficientField, OptionalCoefficientField, coefficient, default
from robot_dyn.foundations.errors import ControlError, shown
from robot_dyn.foundations.spatial import rotation as rotation_about
from robot_dyn.foundations.validate import duration

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


_MAX_TURNS = 1000
_TURN_KNOTS, _RAMP_KNOTS = 64, 32  # per turn and per ramp, for the accuracy stated in `circle`


@final
@dataclass(frozen=True, eq=False)
class CartesianReference(Reference):
    """A motion of a frame in the base.

    Attributes:
        position: p(t) of the frame's origin, 3 coordinates, in [m].
        rotation: R₀, shape (3, 3); None leaves the orientation free.
        axis: Unit axis a of the turn in base axes, shape (3,).
        angle: φ(t), 1 coordinate, in [rad]; None for a constant orientation.
    """

    position: PiecewisePolynomial
    rotation: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient(shapes=((3, 3),), can_vary=False)
    )
    axis: CoefficientField = field(
        default=default((0.0, 0.0, 1.0)), metadata=coefficient(shapes=((3,),), can_vary=False)
    )
    angle: PiecewisePolynomial | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.position, PiecewisePolynomial) or self.position.n != 3:
            raise ControlError(f"position must be a PiecewisePolynomial of 3 coordinates, got {shown(self.position)}")
        if self.angle is not None and not isinstance(self.angle, PiecewisePolynomial):
            raise ControlError(f"angle must be a PiecewisePolynomial of 1 coordinate, got {shown(self.angle)}")
        if self.angle is not None and (self.rotation is None or self.angle.n != 1):
            raise ControlError("angle must have 1 coordinate and needs an initial orientation, rotation")
        if self.rotation is not None:
            object.__setattr__(self, "rotation", _rotation("rotation", self.rotation))
        object.__setattr__(self, "axis", _direction("axis", self.axis))

    @property
    def knots(self) -> np.ndarray:
        """Times in [s] at which the polynomial of the position or the angle changes."""
        return self.position.knots if self.angle is None else np.union1d(self.position.knots, self.angle.knots)

    def at(self, t: Scalar) -> tuple[Array, Array | None, Array, Array]:
        """Evaluate position, orientation, twist and rate of the twist at t.

        Args:
            t: Time, shape () or (...), in [s].

        Returns:
            (p, R, V, V̇): shapes (..., 3), (..., 3, 3), (..., 6) and (..., 6), linear part first; R is None if the
            orientation is free.
        """
        p, p_rate, p_rate2 = self.position.at(t)
        if self.angle is None:
            still = np.zeros_like(p)
            return p, self.rotation, np.concatenate([p_rate, still], -1), np.concatenate([p_rate2, still], -1)
        phi, phi_rate, phi_rate2 = self.angle.at(t)
        R = rotation_about(self.axis, phi[..., 0]) @ self.rotation
        V, V_rate = (p_rate, phi_rate * self.axis), (p_rate2, phi_rate2 * self.axis)
        return p, R, np.concatenate(V, -1), np.concatenate(V_rate, -1)


@np.errstate(all="ignore")  # the check for finite values catches overflow
def line(
    p0: ArrayLike,
    p1: ArrayLike,
    duration_s: float,
    *,
    rotation: ArrayLike | None = None,
    rotation_end: ArrayLike | None = None,
    start_s: float = 0.0,
) -> CartesianReference:
    """Return a minimum-jerk motion along the line from p0 to p1, with the shortest rotation between two orientations.

    Args:
        p0: Start, shape (3,), in [m].
        p1: End, shape (3,), in [m].
        duration_s: Duration, in [s], positive.
        rotation: Orientation at the start, (3, 3); None leaves it free.
        rotation_end: Orientation at the end, (3, 3); None keeps the orientation constant.
        start_s: Time of the start, in [s].

    Raises:
        ControlError: If a value has the wrong shape or is not a rotation.

    Source: Siciliano et al. 2009, secs. 4.3.2 and 4.3.3.
    """
    p0, p1 = numbers("p0", p0, (3,)), numbers("p1", p1, (3,))
    position = quintic(p0, p1, duration_s, start_s=start_s)
    if rotation is None or rotation_end is None:
        if rotation_end is not None:
            raise ControlError("rotation_end needs rotation, the orientation at the start")
        return CartesianReference(position, rotation)
    turn = orientation_error(_rotation("rotation_end", rotation_end), _rotation("rotation", rotation))
    angle = np.linalg.norm(turn)
    if angle == 0:
        return CartesianReference(position, rotation)
    return CartesianReference(position, rotation, turn, quintic([0.0], [angle], duration_s, start_s=start_s))


@np.errstate(all="ignore")  # the check for finite values catches overflow
def circle(
    centre: ArrayLike,
    radius: float,
    normal: ArrayLike,
    period_s: float,
    *,
    turns: float = 1.0,
    ramp_s: float | None = None,
    toward: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    start_s: float = 0.0,
) -> CartesianReference:
    """Return a circle at constant speed, with a smooth start and end: quintic pieces within 1e-9 of the radius.

    The pieces match p, ṗ, p̈ at 64 or more knots per turn; between knots the radius is off by less than 1e-9 of its
    value. The speed rises and falls over `ramp_s` as a minimum-jerk quintic, so the motion lasts
    turns · period_s + ramp_s.

    Args:
        centre: Centre, shape (3,), in [m].
        radius: Radius, in [m], positive.
        normal: Axis of the turn by the right-hand rule, shape (3,), of any length.
        period_s: Time of one turn at full speed, in [s].
        turns: Number of turns, positive, at most 1000.
        ramp_s: Time to full speed, in [s], at most turns · period_s; 0 starts at full speed, with a jump. By default
            a quarter of the period, or turns · period_s if that is less.
        toward: Direction from the centre to the starting point, (3,); by default the base axis (x, y or z) closest to
            the plane, projected onto it.
        rotation: Constant orientation, (3, 3); None leaves it free.
        start_s: Time of the start, in [s].

    Raises:
        ControlError: If a value is invalid.

    Source: Siciliano et al. 2009, sec. 4.3.1 (path primitives).
    """
    centre, r, normal = numbers("centre", centre, (3,)), number("radius", radius, above=0), _direction("normal", normal)
    T, turns = duration("period_s", period_s, error=ControlError), number("turns", turns, above=0)
    if turns > _MAX_TURNS:
        raise ControlError(f"turns must be at most {_MAX_TURNS}, got {turns:g}; each turn takes {_TURN_KNOTS} pieces")
    rise = number("ramp_s", min(T / 4, turns * T) if ramp_s is None else ramp_s, least=0)
    if rise > turns * T:
        raise ControlError(f"ramp_s must be at most turns · period_s = {turns * T} s, got {rise} s")
    start = np.eye(3)[np.argmin(np.abs(normal))] if toward is None else numbers("toward", toward, (3,))
    x = _direction("toward, in the plane of the circle,", start - (start @ normal) * normal)
    y = np.cross(normal, x)
    angle = _ramped_angle(2 * pi / T, turns * T, rise)
    knots = _knots(angle, T, rise)
    phi, rate, rate2 = angle.at(knots)
    along, across = np.cos(phi) * x + np.sin(phi) * y, np.cos(phi) * y - np.sin(phi) * x
    data = np.stack([centre + r * along, r * rate * across, r * (rate2 * across - rate**2 * along)], axis=1)
    pieces = hermite(np.diff(knots), np.concatenate([data[:-1], data[1:]], axis=1))
    return CartesianReference(PiecewisePolynomial(number("start_s", start_s) + knots, pieces), rotation)


def _ramped_angle(speed: float, cruise: float, rise: float) -> PiecewisePolynomial:
    """Return an angle whose rate rises and falls as a quintic over `rise`; it ends at speed · cruise."""
    if rise == 0:
        return PiecewisePolynomial([0.0, cruise], [[[0.0], [speed]]])
    # ∫ 10 s³ − 15 s⁴ + 6 s⁵ is of degree 6, and ½ at s = 1
    up = speed * rise * np.array([0, 0, 0, 0, 2.5, -3, 1]) / rise ** np.arange(7.0)
    flat = np.array([speed * rise / 2, speed, 0, 0, 0, 0, 0])
    down = speed * rise * np.array([cruise / rise - 0.5, 1, 0, 0, -2.5, 3, -1]) / rise ** np.arange(7.0)
    if cruise == rise:
        return PiecewisePolynomial([0.0, rise, 2 * rise], np.stack([up, down])[..., None])
    return PiecewisePolynomial([0.0, rise, cruise, cruise + rise], np.stack([up, flat, down])[..., None])


def _knots(angle: PiecewisePolynomial, period: float, rise: float) -> np.ndarray:
    """Return times that divide each phase evenly, with at least _TURN_KNOTS per turn and _RAMP_KNOTS per ramp."""
    per_turn = np.ceil(np.diff(angle.breaks) / period * _TURN_KNOTS * (1 - 1e-12)).astype(int)  # 1e-12 for rounding
    ramps = np.isclose(np.diff(angle.breaks), rise)
    counts = np.where(ramps, np.maximum(per_turn, _RAMP_KNOTS), per_turn)
    phases = zip(angle.breaks[:-1], angle.breaks[1:], counts, strict=True)
    parts = [np.linspace(begin, end, count + 1)[:-1] for begin, end, count in phases]
    return np.concatenate([*parts, angle.breaks[-1:]])


@np.errstate(all="ignore")  # the check for finite values catches overflow
def _rotation(name: str, values: ArrayLike) -> np.ndarray:
    """Return a rotation matrix, read-only; raise a ControlError if RᵀR is not 1 to 1e-8 or det R is not positive."""
    R = numbers(name, values, (3, 3))
    if not np.abs(R.T @ R - np.eye(3)).max() <= 1e-8 or np.linalg.det(R) < 0:
        raise ControlError(f"{name} must be a rotation matrix, got {shown(values)}")
    return R


def _direction(name: str, values: ArrayLike) -> np.ndarray:
    """Return a unit vector, (3,), read-only; raise a ControlError if it is zero."""
    vector = numbers(name, values, (3,))
    largest = np.abs(vector).max()  # used as a scale, so that no square overflows
    if not largest > 1e-12:
        raise ControlError(f"{name} must not be zero, got {shown(values)}")
    return numbers(name, vector / largest / np.linalg.norm(vector / largest), (3,))
