"""The terms of a plant at one state: M, C, N, the torque of each effect, and the joints held at rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.effects.effect import numbered
from robot_dyn.effects.hold import HeldJoint
from robot_dyn.effects.missing_time import MISSING_TIME
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.result import UNREPORTED
from robot_dyn.foundations.validate import JointValues, instance, number, one_state
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.model.remarks import degree_lines, gravity_lines, order_lines
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import joint_units, numbers_row, without_rounding


@final
@dataclass(frozen=True, eq=False, repr=False)
class PlantState(Answer, ReadOnly):
    """A plant of a robot at one state, M a + C v + N = τ.

    Attributes:
        robot: Name of the robot.
        gravity: Acceleration of free fall in base axes, in [m/s²].
        gravity_acts: True if gravity exerts a torque on a joint at some position.
        remarks: Order of q if the file has another order, joints without a torque of gravity, angles like degrees.
        joints: Names of the n joints.
        types: Types of the joints, such as "revolute".
        q, v, a, tau: The state, (n,), in SI units.
        M, C: Mass matrix and Coriolis matrix, (n, n).
        N: Gravity minus the torques of effects, (n,), in [N m] or [N].
        effects: Torque of each effect on the joints, (n,), by name.
        held_joints: The joints that dry friction and rigid stops hold; () if tau follows from a.
        plant: The plant, with the payloads carried at that time.
        is_forward: True if a follows from tau, False if tau follows from a.
    """

    robot: str
    gravity: tuple[float, float, float]
    gravity_acts: bool
    remarks: tuple[str, ...]
    joints: tuple[str, ...]
    types: tuple[str, ...]
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    M: np.ndarray
    C: np.ndarray
    N: np.ndarray
    effects: dict[str, np.ndarray]
    held_joints: tuple[HeldJoint, ...]
    plant: Plant = field(metadata=UNREPORTED)
    is_forward: bool = field(metadata=UNREPORTED)

    @property
    def title(self) -> str:
        return f"{self.robot}, M a + C v + N = τ"

    def blocks(self) -> Iterator[Block]:
        for name in ("q", "v", "a", "tau"):
            yield f"{name:4}{numbers_row(getattr(self, name))}  [{joint_units(name, self.types)}]"
        force = joint_units("tau", self.types)
        of_M = {"N m": "kg m²", "N": "kg"}.get(force, "kg m², kg m, kg")
        of_C = {"N m": "N m s/rad", "N": "N s/m"}.get(force, "rows times v: N m, N")
        meanings = (("M", "mass matrix", of_M), ("C", "Coriolis matrix", of_C), ("N", "gravity and effects", force))
        for name, meaning, of_entries in meanings:
            yield ""
            yield f"{name}, {meaning} [{of_entries}]:"
            rows = getattr(self, name).reshape(len(self.joints), -1)
            one_unit = name == "N" or force in ("N m", "N")
            rows = without_rounding(rows) if one_unit else rows  # together, so that M stays symmetric
            yield from (f"  {numbers_row(row)}  {joint}" for row, joint in zip(rows, self.joints, strict=True))
        if self.remarks:
            yield ""
            yield from self.remarks
        if self.held_joints:
            yield ""
            yield f"held at rest [{force}]:"
            headings = ("joint", "from", "load", "slides below", "slides above", "margin")
            loads = (
                without_rounding((hold.load, hold.lower_breakaway, hold.upper_breakaway, hold.margin))
                for hold in self.held_joints
            )
            rows = tuple(
                (hold.joint, ", ".join(hold.by), *load) for hold, load in zip(self.held_joints, loads, strict=True)
            )
            yield Table(headings, rows)


def plant_state(
    plant: Plant | Dynamics,
    q: JointValues,
    v: JointValues,
    a: JointValues | None = None,
    tau: JointValues | None = None,
    t: float | None = None,
) -> PlantState:
    """Evaluate a plant, or a robot, at a state: tau from a, or a and the joints held at rest from tau.

    Raises:
        QueryError: If the dynamics of the plant is not a robot, not exactly one of a and tau is passed, or an argument
            does not have shape (n,) or is not finite.
    """
    plant = plant if isinstance(plant, Plant) else Plant(plant)
    plant, t = plant.at(t), None if t is None else number("t", t)
    robot = instance("plant", plant.dynamics, Robot, "give the plant of a robot, such as rd.Plant(rd.load('ur5'))")
    if (a is None) == (tau is None):
        raise QueryError("give either a or tau: the other follows from it")
    q, v = (one_state(name, x, robot.joint_names) for name, x in (("q", q), ("v", v)))
    held_joints: tuple[HeldJoint, ...] = ()
    is_forward = tau is not None
    if is_forward:
        tau = plant.actuation(one_state("tau", tau, robot.joint_names), v)
        a, held_joints = plant.forward_dynamics(q, v, tau, t=t), plant.held_joints(q, v, tau, t=t)
    else:
        a = one_state("a", a, robot.joint_names)
        tau = plant.inverse_dynamics(q, v, a, t=t)
    torques = plant.equation_of_motion.torques(MISSING_TIME if t is None else t, q, v, q.shape)
    state = {"q": q, "v": v, "a": a, "tau": tau}
    terms = {"M": plant.M(q, t=t), "C": plant.C(q, v, t=t), "N": plant.N(q, v, t=t)}
    effects = dict(zip(numbered(*(force.name for force in plant.forces)), torques, strict=True))
    remarks = (
        *degree_lines(robot.joint_names, robot.joint_types, q, robot.lower, robot.upper),
        *order_lines(robot.joint_names, robot.file_order),
        *gravity_lines(robot.edits.gravity, robot.gravity_free, robot.balanced, robot.n),
    )
    return PlantState(
        robot.name, robot.edits.gravity, robot.gravity_acts, remarks, robot.joint_names, robot.joint_types,
        **state, **terms, effects=effects, held_joints=held_joints, plant=plant, is_forward=is_forward,
    )  # fmt: skip
