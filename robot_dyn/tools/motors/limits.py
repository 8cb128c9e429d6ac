"""Limits of joints: torque, velocity and acceleration, from the robot's file, its motors, or arguments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial, extreme_values
from robot_dyn.effects import EffortLimit, RigidStops, TorqueSpeed
from robot_dyn.foundations import (
    EffectError,
    PlanError,
    check_coefficients,
    coefficient,
    declared,
    instance,
    nearest,
    shown,
)
from robot_dyn.queries import of_joint
from robot_dyn.tools.motors.gear import Gear
from robot_dyn.tools.motors.motors_file import Motors

_SAME_ROTOR = 0.01  # largest relative difference of inertias
_UNLIKE = 20.0  # factor between the limits of a motor and of the robot's file that suggests the wrong side of a gear
_BEYOND = 1e-9  # [rad] or [m]: rounding by which a position may exceed its limit


def _positive(unit: str) -> Mapping[str, object]:
    """Return the declaration of a positive limit, inf for none."""
    return coefficient(unit, exclusive_minimum=0, infinite=True, fill_value=inf)


@final
@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of joints, each one number, by joint name or (n,), positive; inf for none.

    Attributes:
        effort: Peak |τ|, in [N m] or [N]; 0 for a passive joint.
        velocity: |q̇|, in [rad/s] or [m/s].
        acceleration: |q̈|, in [rad/s²] or [m/s²].
        continuous: Root mean square of τ, in [N m] or [N].
        line: Peak torque of driving motors by speed; None for none.
        continuous_line: Continuous torque by the mean speed of a motion; None for none.
        brake: Holding torque of brakes by joint, in [N m] or [N].
        bearing: Largest loads on bearings by joint and load.
        gear: Gears with losses, so that torque limits are those of motors; None for none.
        findings: Doubtful limits, with remedies.
    """

    effort: Any = field(default=inf, metadata=coefficient("N m", minimum=0, infinite=True, fill_value=inf))
    velocity: Any = field(default=inf, metadata=_positive("rad/s"))
    acceleration: Any = field(default=inf, metadata=_positive("rad/s^2"))
    continuous: Any = field(default=inf, metadata=_positive("N m"))
    line: TorqueSpeed | None = None
    continuous_line: TorqueSpeed | None = None
    brake: Mapping[str, float] = field(default_factory=dict)
    bearing: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    gear: Gear | None = None
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_coefficients(self, PlanError, allow_unresolved=True)

    def on(self, dynamics: Any) -> Limits:
        """Return the limits of each joint of an arm, (n,).

        Raises:
            PlanError: If a joint is unknown, or the number of joints differs.
        """
        try:
            by_joint = {name: form.on(name, getattr(self, name), dynamics) for name, form in declared(Limits).items()}
        except EffectError as error:
            raise PlanError(str(error)) from None
        return replace(self, **{name: np.broadcast_to(np.asarray(x), dynamics.n) for name, x in by_joint.items()})

    def times(self, torque: float | np.ndarray, rates: float = 1.0) -> Limits:
        """Return the limits with peak torques times one factor, velocities and accelerations times another."""
        return replace(
            self, effort=torque * self.effort, velocity=rates * self.velocity, acceleration=rates * self.acceleration,
            line=self.line and self.line.times(torque),
        )  # fmt: skip

    def through_gear(self) -> Limits:
        """Return limits of the torque at the joint that a driving motor can supply, η times its own.

        A motor that is driven back could hold up to 1/η times its own, which these limits leave unused.
        """
        return self if self.gear is None else replace(self.times(self.gear.efficiency), gear=None)

    def bounds(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and largest torque of the motors at velocities v, (..., n) each."""
        effort = np.broadcast_to(self.effort, np.shape(v))
        driving = effort if self.line is None else np.minimum(effort, self.line.at(v))
        return -np.where(v <= 0, driving, effort), np.where(v >= 0, driving, effort)

    def used(self, tau: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the fraction of the peak torques, and of lines where motors drive, that τ at v uses, (..., n)."""
        used = used_fraction(np.abs(tau), self.effort)
        return used if self.line is None else np.maximum(used, np.where(tau * v >= 0, self.line.used(tau, v), 0.0))

    def at_mean_speed(self, speed: np.ndarray) -> Limits:
        """Return the limits with the continuous torque at mean speeds |v| of a motion, (n,)."""
        if self.continuous_line is None:
            return self
        least = 1e-12  # beyond the no-load speed; as an input, a limit of 0 is refused
        return replace(self, continuous=np.clip(self.continuous_line.at(speed), least, self.continuous))


def limits_of(
    plant: Plant, motors: Motors | None = None, effort: Any = None, velocity: Any = None, acceleration: Any = None,
    continuous: Any = None,
) -> Limits:  # fmt: skip
    """Return the limits of a plant: from arguments, else motors, else the file; its `EffortLimit`s always apply.

    Raises:
        PlanError: If a joint is unknown, a limit is not positive, or the rotor of a motor is not part of the arm.
    """
    robot: Any = plant.dynamics
    if motors is not None:
        _check_joints(motors, robot)
        effort = motors.peak if effort is None else effort
        velocity = (motors.speed or None) if velocity is None else velocity
        continuous = (motors.continuous or None) if continuous is None else continuous
    effort = _stated(robot, "effort") if effort is None else effort
    velocity = _stated(robot, "velocity") if velocity is None else velocity
    acceleration, continuous = (inf if x is None else x for x in (acceleration, continuous))
    limits = Limits(effort, velocity, acceleration, continuous).on(robot)
    if motors is not None:
        limits = replace(
            limits,
            brake=motors.brake,
            bearing=motors.bearing,
            gear=_gear(motors, robot),
            line=TorqueSpeed.of_joints(motors.line, robot.joint_names),
            continuous_line=TorqueSpeed.of_joints(motors.continuous_line, robot.joint_names),
            findings=tuple(_unlike(motors, robot)),
        )
    saturates = [np.broadcast_to(effect.limit, robot.n) for effect in plant.effects if isinstance(effect, EffortLimit)]
    return replace(limits, effort=np.minimum.reduce([limits.effort, *saturates]))


def _unlike(motors: Motors, robot: Any) -> Iterator[str]:
    """Yield a finding for each motor whose peak torque or speed is far from the limit in the robot's file."""
    for kind, of_motors, limit in (("peak", motors.peak, "effort_limit"), ("speed", motors.speed, "velocity_limit")):
        stated = np.broadcast_to(getattr(robot, limit, inf), robot.n).tolist()
        for name, of_file in zip(robot.joint_names, stated, strict=True):
            value = of_motors.get(name, of_file)
            if 0 < of_file < inf and not 1 / _UNLIKE <= value / of_file <= _UNLIKE:
                yield (
                    f"{motors.source}: the {kind} of {name!r} is {value:.4g} at the joint, but {of_file:.4g} in the"
                    " robot's file; check the columns at and gear_ratio, and the units"
                )


def _gear(motors: Motors, robot: Any) -> Gear | None:
    """Return the gears of an arm with its motors; None without losses."""
    if not motors.efficiency:
        return None
    efficiency = np.array([motors.efficiency.get(name, 1.0) for name in robot.joint_names])
    return Gear(efficiency, np.asarray(getattr(robot, "armature", np.zeros(robot.n))))


def _stated(robot: Any, kind: str) -> Any:
    """Return the limits in the file of a robot; inf for other dynamics."""
    limits = getattr(robot, f"{kind}_limit", inf)
    if zero := [
        name for name, limit in zip(robot.joint_names, np.broadcast_to(limits, robot.n), strict=True) if not limit
    ]:
        listed = ", ".join(map(repr, zero[:6])) + (", …" if len(zero) > 6 else "")
        passive = f", or {{{zero[0]!r}: 0}} for a passive joint" if kind == "effort" else ""
        raise PlanError(
            f"the file states the {kind} limit 0 for {listed}; give limits by joint, {kind}={{{zero[0]!r}: 10.0}}"
            f"{passive}: joints left out have none"
        )
    return limits


def used_fraction(demand: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Return demands as fractions of limits; of a limit of 0, 0 for no demand and inf for any other."""
    passive = np.where(np.asarray(demand) == 0, 0.0, inf)
    return np.divide(demand, limit, out=passive, where=np.asarray(limit) != 0)


def outside_positions(
    robot: Any, motion: PiecewisePolynomial, stops: RigidStops | None = None, at: str = "{:.4g} s"
) -> Iterator[str]:
    """Yield a message, with place and time, for each joint that a motion takes outside its position limits.

    Args:
        robot: The arm.
        motion: Motion of the arm.
        stops: Stops that replace the limits in the robot's file.
        at: Format of a time, or of a place along a path.
    """
    extremes, n = extreme_values(motion), robot.n
    limits = robot if stops is None else stops
    lower, upper = (np.broadcast_to(getattr(limits, x, y), n) for x, y in (("lower", -inf), ("upper", inf)))
    types = getattr(robot, "joint_types", (None,) * n)
    for i, name in enumerate(robot.joint_names):
        below, above = lower[i] - extremes.least[i], extremes.greatest[i] - upper[i]
        if max(below, above) > _BEYOND:
            q, t = (
                (extremes.least, extremes.least_at_s) if below > above else (extremes.greatest, extremes.greatest_at_s)
            )
            where = f"{q[i]:.6g} {of_joint('rad', types[i])} at {at.format(t[i])}"
            yield f"{name} is at {where}, outside its limits {lower[i]:.6g} to {upper[i]:.6g}"


def check_motors(motors: object) -> None:
    """Raise a PlanError if `motors` is not a `Motors`."""
    if motors is not None:
        instance("motors", motors, Motors, "read them with rd.tools.motors.read_motors(path)", error=PlanError)


def same_rotor(one: float, other: float) -> bool:
    """Return True if two inertias of a rotor agree to 1 %."""
    return abs(one - other) <= _SAME_ROTOR * max(one, other)


def _check_joints(motors: Motors, robot: Any) -> None:
    """Raise a PlanError if a joint is unknown, or a rotor is not part of the arm: its torque would be missing."""
    for joint in (*motors.peak, *motors.continuous, *motors.speed, *motors.brake, *motors.bearing):
        if joint not in robot.joint_names:
            raise PlanError(f"{motors.source}: no joint {shown(joint)}; {nearest(joint, robot.joint_names)}")
    armatures = dict(zip(robot.joint_names, getattr(robot, "armature", np.zeros(robot.n)), strict=True))
    for joint, inertia in motors.armature.items():
        armature = float(armatures.get(joint, inertia))
        if not same_rotor(inertia, armature):
            raise PlanError(
                f"{motors.source}: the rotor of {joint!r} has {inertia:.6g} kg m² at the joint, but the arm has"
                f' {armature:.6g}; use arm.with_(armature=motors.armature), in a scene kind = "armature"'
            )
