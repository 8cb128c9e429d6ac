"""Spring and damper along the line between two points: τ = −(∂ℓ/∂q)ᵀ (k (ℓ − ℓ₀) + c ℓ'), with ℓ their distance.

Each point is fixed to a frame of the arm, or to the world. With e = (p − p') / ℓ, the direction of the line, and the
Jacobians of the points, ∂ℓ/∂q = eᵀ (J − J') and ℓ' = ∂ℓ/∂q v. If the points coincide, the line has no direction.
[Shabana, Computational Dynamics, 3rd ed., 2010, sec. 3.3]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.effects.effect import Conservative, Dissipative, Effect, check_frame
from robot_dyn.foundations.arithmetic import Array, apply, sqrt, transpose
from robot_dyn.foundations.coefficients import CoefficientField, coefficient, default
from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.spatial import hat
from robot_dyn.foundations.threshold import smooth
from robot_dyn.foundations.validate import instance
from robot_dyn.queries.dynamics import Dynamics

_POINT = coefficient("m", symbol="p, a point of the frame, in its axes", shapes=((3,),))
_OTHER = coefficient("m", symbol="p', a point of the other frame, in its axes, or of the world", shapes=((3,),))
_STIFFNESS = coefficient("N/m", symbol="k", shapes=((),), minimum=0)
_DAMPING = coefficient("N s/m", symbol="c", shapes=((),), minimum=0)
_LENGTH = coefficient("m", symbol="ℓ₀, the length without force", shapes=((),), minimum=0)


@dataclass(frozen=True, eq=False)
class _Line(Effect):
    """The line between a point of a frame and a point of another, or of the world."""

    frame: str
    other_frame: str | None
    point: CoefficientField = field(default=default((0.0, 0.0, 0.0)), metadata=_POINT)
    other_point: CoefficientField = field(default=default((0.0, 0.0, 0.0)), metadata=_OTHER)

    name = "line_spring_damper"
    thresholds = smooth

    def __post_init__(self) -> None:
        for name, frame in zip(("frame", "other_frame"), self._frames, strict=False):
            instance(name, frame, str, "give the name of a frame", error=EffectError)
        if self.frame == self.other_frame:
            raise EffectError(
                f"both points are fixed to {self.frame!r}, so their distance is constant; give another frame"
            )
        super().__post_init__()

    @property
    def _frames(self) -> tuple[str, ...]:
        return (self.frame,) if self.other_frame is None else (self.frame, self.other_frame)

    def on(self, dynamics: Dynamics) -> Effect:
        for frame in self._frames:
            check_frame(self, dynamics, frame)
        return self

    def _line(self, dynamics: Dynamics, q: Array) -> tuple[Array, Array]:
        """Return the vector p − p' in base axes, (..., 3), and ℓ, (..., 1); raise an EffectError if ℓ is 0."""
        other = _position(dynamics, q, self.other_frame, self.other_point)
        line = _position(dynamics, q, self.frame, self.point) - other
        square = (line**2).sum(axis=-1, keepdims=True)
        if square.dtype != object and not square.all():
            other = "the world" if self.other_frame is None else repr(self.other_frame)
            raise EffectError(
                f"{self.name}: the points on {self.frame!r} and {other} coincide, so the line has no direction"
            )
        return line, sqrt(square)

    def _along(self, dynamics: Dynamics, q: Array) -> tuple[Array, Array]:
        """Return ℓ, (..., 1), and ∂ℓ/∂q, (..., n)."""
        line, length = self._line(dynamics, q)
        direction = line / length
        slope = _slope(dynamics, q, self.frame, self.point, direction)
        if self.other_frame is not None:
            slope = slope - _slope(dynamics, q, self.other_frame, self.other_point, direction)
        return length, slope


def _position(dynamics: Dynamics, q: Array, frame: str | None, point: Array) -> Array:
    """Return a point in base axes, (..., 3)."""
    if frame is None:
        return point
    placement = dynamics.placement(q, frame)
    return apply(placement[..., :3, :3], point) + placement[..., :3, 3]


def _slope(dynamics: Dynamics, q: Array, frame: str, point: Array, direction: Array) -> Array:
    """Compute ∂(eᵀ p)/∂q for a point of a frame and a direction e: Jᵀ (e, r × e), with r from frame to point."""
    r = apply(dynamics.placement(q, frame)[..., :3, :3], point)
    force = np.concatenate([direction, apply(hat(r), direction)], axis=-1)
    return apply(transpose(dynamics.jacobian(q, frame)), force)


@final
@dataclass(frozen=True, eq=False)
class LineSpring(_Line, Conservative):
    """The elastic part of a line spring-damper: τ = −(∂ℓ/∂q)ᵀ k (ℓ − ℓ₀), of energy ½ k (ℓ − ℓ₀)².

    Attributes:
        frame, other_frame, point, other_point, stiffness, length: Same as in `LineSpringDamper`.

    Example:
        >>> rd.effects.LineSpring(frame="tip", other_frame="bar_1", point=[0.1, 0.0, 0.2],
        ...     other_point=[0.0, 0.0, 0.4], stiffness=30.0, length=0.7)
    """

    stiffness: float = field(kw_only=True, metadata=_STIFFNESS)
    length: float = field(kw_only=True, metadata=_LENGTH)

    term = "−(∂ℓ/∂q)ᵀ k (ℓ − ℓ₀)"

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        length, slope = self._along(dynamics, q)
        return -self.stiffness * (length - self.length) * slope

    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        _, length = self._line(dynamics, q)
        return self.stiffness * ((length - self.length) ** 2).sum(axis=-1) / 2


@final
@dataclass(frozen=True, eq=False)
class LineDamper(_Line, Dissipative):
    """The dissipative part of a line spring-damper: τ = −(∂ℓ/∂q)ᵀ c ℓ'.

    Attributes:
        frame, other_frame, point, other_point, damping: Same as in `LineSpringDamper`.

    Example:
        >>> rd.effects.LineDamper(frame="tip", other_frame="bar_1", point=[0.1, 0.0, 0.2],
        ...     other_point=[0.0, 0.0, 0.4], damping=2.0)
    """

    damping: float = field(kw_only=True, metadata=_DAMPING)

    term = "−(∂ℓ/∂q)ᵀ c ℓ'"

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        _, slope = self._along(dynamics, q)
        return -self.damping * (slope * v).sum(axis=-1, keepdims=True) * slope


@final
@dataclass(frozen=True, eq=False)
class LineSpringDamper(_Line):
    """A spring and a damper along the line between two points: τ = −(∂ℓ/∂q)ᵀ (k (ℓ − ℓ₀) + c ℓ').

    A plant splits it into a `LineSpring` and a `LineDamper`. If the points coincide, the line has no direction: the
    torque raises an EffectError, and a run ends.

    Attributes:
        frame: A frame of the arm.
        other_frame: Another frame of the arm; None for the world.
        point: A point in the axes of the frame, (3,), in [m]; the origin by default.
        other_point: A point in the axes of the other frame, or of the base for the world, (3,), in [m].
        stiffness: k, in [N/m], not negative.
        damping: c, in [N s/m], not negative.
        length: ℓ₀, length without force, in [m], not negative.

    Example:
        >>> rd.effects.LineSpringDamper(frame="tip", other_frame="bar_1", point=[0.1, 0.0, 0.2],
        ...     other_point=[0.0, 0.0, 0.4], stiffness=30.0, damping=2.0, length=0.7)
    """

    stiffness: float = field(kw_only=True, metadata=_STIFFNESS)
    damping: float = field(kw_only=True, metadata=_DAMPING)
    length: float = field(kw_only=True, metadata=_LENGTH)

    @property
    def parts(self) -> tuple[Effect, ...]:
        ends = self.frame, self.other_frame, self.point, self.other_point
        spring = LineSpring(*ends, stiffness=self.stiffness, length=self.length)
        return spring, LineDamper(*ends, damping=self.damping)
