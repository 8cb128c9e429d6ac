"""Limits of joints: effort, velocity and acceleration, of the robot's file, of its motors, or given."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn import Plant
from robot_dyn.effects import EffortLimit
from robot_dyn.foundations import EffectError, PlanError, check_coefficients, coefficient, declared, instance
from robot_dyn.tools.motors.motors_file import Motors

_SAME_ROTOR = 0.01  # difference of inertias, in their size


@final
@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of joints, each one number, by joint name or (n,), positive; inf for none.

    Attributes:
        effort: |τ|, in [N m] or [N].
        velocity: |q̇|, in [rad/s] or [m/s].
        acceleration: |q̈|, in [rad/s²] or [m/s²].
    """

    effort: Any = field(default=inf, metadata=coefficient("N m", above=0, infinite=True, elsewhere=inf))
    velocity: Any = field(default=inf, metadata=coefficient("rad/s", above=0, infinite=True, elsewhere=inf))
    acceleration: Any = field(default=inf, metadata=coefficient("rad/s^2", above=0, infinite=True, elsewhere=inf))

    def __post_init__(self) -> None:
        check_coefficients(self, PlanError, resolved=True)

    def on(self, dynamics: Any) -> Limits:
        """The limits of each joint of an arm, (n,).

        Raises:
            PlanError: If a joint is unknown, or the number of joints differs.
        """
        try:
            found = {name: each.on(name, getattr(self, name), dynamics) for name, each in declared(Limits).items()}
        except EffectError as error:
            raise PlanError(str(error)) from None
        return Limits(**{name: np.broadcast_to(each, dynamics.n) for name, each in found.items()})


def limits_of(plant: Plant, motors: Motors | None, effort: Any, velocity: Any, acceleration: Any) -> Limits:
    """The limits of a plant: those given, else of its motors, else of its file; never above its `EffortLimit`s.

    Raises:
        PlanError: If a joint is unknown, a limit is not positive, or a motor's rotor is not a part of the arm.
    """
    robot: Any = plant.dynamics
    if motors is not None:
        instance("motors", motors, Motors, "read them with rd.tools.motors.read_motors(path)", error=PlanError)
        _check_rotors(motors, robot)
        effort = motors.peak if effort is None else effort
        velocity = (motors.speed or None) if velocity is None else velocity
    effort = _stated(robot, "effort") if effort is None else effort
    velocity = _stated(robot, "velocity") if velocity is None else velocity
    given = Limits(effort, velocity, inf if acceleration is None else acceleration).on(robot)
    saturates = [np.broadcast_to(each.limit, robot.n) for each in plant.effects if isinstance(each, EffortLimit)]
    return Limits(np.minimum.reduce([given.effort, *saturates]), given.velocity, given.acceleration)


def _stated(robot: Any, kind: str) -> Any:
    """The limits in the file of a robot; inf for other dynamics."""
    limits = getattr(robot, f"{kind}_limit", inf)
    if zero := [
        name for name, limit in zip(robot.joint_names, np.broadcast_to(limits, robot.n), strict=True) if not limit
    ]:
        raise PlanError(
            f"the file states a limit of {kind} of 0 for {', '.join(map(repr, zero[:6]))}; give limits by joint,"
            f" {kind}={{{zero[0]!r}: 10.0}}: joints left out have none"
        )
    return limits


def same_rotor(one: float, other: float) -> bool:
    """Return True if two inertias of a rotor agree to 1 %."""
    return abs(one - other) <= _SAME_ROTOR * max(one, other)


def _check_rotors(motors: Motors, robot: Any) -> None:
    """Raise a PlanError if a rotor is not a part of the arm: its torque would be missing."""
    felt = dict(zip(robot.joint_names, getattr(robot, "armature", np.zeros(robot.n)), strict=True))
    for joint, inertia in motors.armature.items():
        there = float(felt.get(joint, inertia))
        if not same_rotor(inertia, there):
            raise PlanError(
                f"{motors.source}: the rotor of {joint!r} is felt as {inertia:.6g} kg m² at the joint, the arm has"
                f' {there:.6g}; take arm.with_(armature=motors.armature), in a scene kind = "armature"'
            )
