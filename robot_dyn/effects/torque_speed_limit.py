"""Motors whose torque falls with speed: −τ(max(−v, 0)) ≤ u ≤ τ(max(v, 0)), with a polyline τ of the speed.

A driving motor (u v > 0) can exert |u| ≤ τ(|v|), which is 0 beyond its no-load speed; a braking motor can exert its
peak τ(0). With the corners ω_k of the polyline and the changes s_k of its slope there,

    τ(ω) = τ(0) + Σ s_k max(ω − ω_k, 0)

[Siciliano et al. 2009, sec. 5.2]
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.effects.effect import Bound, Effect
from robot_dyn.effects.torque_speed import NO_LINE, TorqueSpeed, check_line
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import (
    ROWS,
    CoefficientField,
    OptionalCoefficientField,
    coefficient,
    default,
    with_values,
)
from robot_dyn.foundations.errors import EffectError, RobotDynError, shown
from robot_dyn.foundations.saturation import limit_thresholds, piece, saturated
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.queries.dynamics import Dynamics

AT = "joint", "motor"
_MAX_JOINT_SPEED = 100.0  # [rad/s] or [m/s]: higher speeds at the joint must be those of a motor


@final
@dataclass(frozen=True, eq=False)
class TorqueSpeedLimit(Bound):
    """Limit of motors whose torque falls with speed: |u| ≤ τ(|v|) if they drive, |u| ≤ τ(0) if they brake.

    Attributes:
        speed: Speeds at the corners of the polyline τ, increasing, in [rad/s] or [m/s]: (k,) for all joints, (n, k), or
            by joint name; omitted joints have no limit. τ is constant below the first speed.
        torque: Peak torques there, in [N m] or [N], not increasing; the last one is 0, at the no-load speed. A row of
            inf for a joint without a limit.
        at: "joint" or "motor": where speeds and torques are measured.
        gear_ratio: N, a scalar or (n,), required at the motor: the joint has N times its torque at 1/N of its speed.

    Raises:
        EffectError: If the polyline is invalid, or speeds at the joint exceed 100 rad/s, as only those of a motor do.

    Example:
        >>> rd.effects.TorqueSpeedLimit(speed=[0.0, 200.0, 350.0], torque=[0.4, 0.4, 0.0], at="motor", gear_ratio=100.0)
    """

    speed: CoefficientField = field(metadata=coefficient("rad/s", symbol="ω", shapes=ROWS, minimum=0, can_vary=False))
    torque: CoefficientField = field(
        metadata=coefficient("N m", symbol="τ", shapes=ROWS, minimum=0, infinite=True, can_vary=False)
    )
    at: str = "joint"
    gear_ratio: OptionalCoefficientField = field(
        default=default(None), metadata=coefficient(symbol="N", exclusive_minimum=0, fill_value=1.0, can_vary=False)
    )

    # at the joint, on the joints of an arm: (n,); corners (k, n); slopes and floors of max(±v − ω_k, floor), (2, k, n)
    _peak: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient("N m", can_vary=False)
    )
    _corners: OptionalCoefficientField = field(
        default=default(None),
        init=False,
        repr=False,
        metadata=coefficient("rad/s", shapes=(("k", "n"),), can_vary=False),
    )
    _slopes: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(shapes=((2, "k", "n"),), can_vary=False)
    )
    _floors: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(shapes=((2, "k", "n"),), can_vary=False)
    )
    _limit: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )
    _middle: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient(can_vary=False)
    )

    term = "|u| ≤ τ(|v|)"
    of_velocity = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_place(self.at, self.gear_ratio is not None, EffectError)
        speed, torque = self._stated
        if isinstance(speed, Mapping) != isinstance(torque, Mapping):
            raise EffectError("speed and torque must both be by joint name or both be arrays")
        if isinstance(speed, Mapping) and speed.keys() != torque.keys():
            raise EffectError(f"speed and torque have different joints, {shown([*speed])} and {shown([*torque])}")
        for name, (x, y) in self._lines():
            if np.isinf(y).all():
                continue
            where = f"{self.name} of {name}" if name else self.name
            check_line(where, x, y, EffectError)
            if y[-1] != 0:
                raise EffectError(f"{where}: torque must end with 0, at the no-load speed, got {y[-1]:g}")
            if self.at == "joint":
                check_speed(where, float(x[-1]), EffectError)

    @property
    def _stated(self) -> tuple[Any, Any]:
        """Speeds and torques: arrays, or arrays by joint name."""
        return self.speed, self.torque

    def _lines(self) -> Iterator[tuple[str, tuple[np.ndarray, np.ndarray]]]:
        """Yield the polylines, with the name of the joint, "" if it is not stated."""
        speed, torque = self._stated
        if isinstance(speed, Mapping):
            yield from ((name, (x, torque[name])) for name, x in speed.items())
        elif np.shape(speed) != np.shape(torque):
            shapes = f"{np.shape(speed)} and {np.shape(torque)}"
            raise EffectError(f"{self.name}: speed and torque must have the same shape, got {shapes}")
        else:
            yield from (("", rows) for rows in zip(np.atleast_2d(speed), np.atleast_2d(torque), strict=True))

    def on(self, dynamics: Dynamics) -> Effect:
        resolved: Any = super().on(dynamics)
        if self._peak is not None:
            return resolved
        rows = [(name, np.stack(line)) for name, line in self._lines()]
        if isinstance(self._stated[0], Mapping):
            rows = [(name, dict(rows).get(name, NO_LINE)) for name in dynamics.joint_names]
        rows *= dynamics.n if len(rows) == 1 else 1
        if len(rows) != dynamics.n:
            raise EffectError(f"{self.name}: speed has rows for {len(rows)} joints, but the arm has {dynamics.n}")
        lines = TorqueSpeed.padded([line for _, line in rows])
        ratio = np.broadcast_to(1.0 if resolved.gear_ratio is None else resolved.gear_ratio, dynamics.n)
        at_joint = TorqueSpeed(lines.speed / ratio[:, None], lines.torque * ratio[:, None])
        slopes = np.diff(at_joint.slopes).T
        tables = {
            "_peak": at_joint.finite[:, 0],
            "_corners": at_joint.speed.T,
            "_slopes": np.array([slopes] * 2),
            "_floors": np.zeros((2, *slopes.shape)),
            "_limit": np.where(lines.exists, 1.0, inf),
            "_middle": np.zeros(dynamics.n),
        }
        return with_values(resolved, tables | {"speed": lines.speed, "torque": lines.torque})

    @property
    def _tables(self) -> tuple[Any, ...]:
        """Peaks, corners, slopes, floors, and limit and middle of the saturation."""
        if self._peak is None:
            raise EffectError(f"{self.name}: a plant determines the limits of joints; use rd.Plant(robot, [effect])")
        return self._peak, self._corners, self._slopes, self._floors, self._limit, self._middle

    def thresholds(self, n: int) -> tuple[Threshold, ...]:
        if self._peak is None:
            return ()
        _, corners, slopes, _, limit, middle = self._tables
        levels = {
            (i, sign * float(corners[k, i]) + 0.0): None
            for (way, k, i) in np.argwhere(slopes != 0).tolist()
            for sign in ((1, -1)[way],)
        }
        passed = (Threshold(i, x, "torque–speed corner", "passed", "left", of_velocity=True) for i, x in levels)
        return (*passed, *limit_thresholds(limit, middle, n))

    def on_side(self, n: int, sides: Mapping[Threshold, int]) -> Effect:
        _, corners, slopes, floors, limit, _ = self._tables
        slopes, floors = slopes.copy(), floors.copy()
        for threshold, side in sides.items():
            if threshold.of_velocity:
                i = threshold.joint
                for way, sign in enumerate((1, -1)):
                    here = corners[:, i] == sign * threshold.level
                    (floors if side * sign > 0 else slopes)[way, here, i] = -inf if side * sign > 0 else 0.0
        limit, middle = piece(limit, n, {x: side for x, side in sides.items() if x.of_actuation})
        return with_values(self, {"_slopes": slopes, "_floors": floors, "_limit": limit, "_middle": middle})

    def actuation(self, u: Array, v: Array) -> Array:  # pyright: ignore[reportIncompatibleMethodOverride]
        middle, half = self._range(v)
        *_, limit, place = self._tables
        return middle + saturated(u - middle, half * limit, half * place)

    def limited(self, u: Array, v: Array) -> Array:
        """Return the position of u between the limits at v: −1 at the lower, 0 in the middle, 1 at the upper limit."""
        middle, half = self._range(v)
        return (u - middle) / half

    @property
    def is_limited(self) -> np.ndarray:
        """True for joints with a limit, (n,); defined for an effect in a plant."""
        return np.isfinite(self._tables[4])

    def _range(self, v: Array) -> tuple[Array, Array]:
        """Return middle and half width of the allowed actuation, which is at least half of the peak."""
        peak, corners, slopes, floors, *_ = self._tables
        upper, lower = (
            peak
            + sum(s * np.maximum(sign * v - x, low) for x, s, low in zip(corners, of_side, low_of_side, strict=True))
            for sign, of_side, low_of_side in zip((1, -1), slopes, floors, strict=True)
        )
        return (upper - lower) / 2, (upper + lower) / 2


def check_place(at: object, has_ratio: bool, error: type[RobotDynError]) -> None:
    """Raise an error unless values are at the joint without a gear ratio, or at the motor with one."""
    if not isinstance(at, str) or at not in AT:
        raise error(f"at must be joint or motor, got {shown(at)}")
    if (at == "motor") != has_ratio:
        more = "give gear_ratio, 1 without a gear" if at == "motor" else "set at to motor, or remove gear_ratio"
        raise error(f"values at the {at} {'need a' if at == 'motor' else 'have no'} gear ratio: {more}")


def check_speed(name: str, speed: float, error: type[RobotDynError]) -> None:
    """Raise an error for a speed of a motor that is stated at the joint."""
    if speed > _MAX_JOINT_SPEED:
        raise error(
            f"{name}: {speed:.4g} rad/s ({speed * 30 / np.pi:.4g} rpm) at the joint must be the speed of a motor before"
            " its gear; set at to motor and give the gear ratio, 1 without a gear"
        )
