"""Wrenches through the joints along a run, from the states, accelerations and external wrenches at its samples."""

from __future__ import annotations

import re

import numpy as np

from robot_dyn.effects.dahl import DahlFriction
from robot_dyn.effects.dry_friction import DryFriction
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.effects.joint_limit import JointStopDamper, JointStopSpring
from robot_dyn.effects.lugre import LuGreFriction
from robot_dyn.effects.rigid_backlash import RigidBacklash
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.effects.series_elastic import SeriesElastic
from robot_dyn.effects.spring import Spring
from robot_dyn.effects.wrench import ExternalWrench
from robot_dyn.foundations.errors import QueryError
from robot_dyn.model.newton_euler import JointWrenches
from robot_dyn.simulation.results.causes import bodies_and_effects
from robot_dyn.simulation.results.run_data import TrajectoryData

_AT_JOINTS = (  # parent and child exert these on each other, so that they are part of the wrench through the joint
    Spring, ViscousFriction, RegularisedCoulombFriction, DryFriction, DahlFriction, LuGreFriction, JointStopSpring,
    JointStopDamper, RigidStops, SeriesElastic, RigidBacklash,
)  # fmt: skip
KNOWN_ON_LINKS = frozenset(effect.name for effect in (*_AT_JOINTS, ExternalWrench))
"""Names of effects whose forces on the links are known."""


def joint_wrenches_of(run: TrajectoryData, frame: str | None, at: str | None) -> JointWrenches:
    """Return the wrenches of a run, see `Trajectory.joint_wrenches`.

    Raises:
        QueryError: If the run contains no robot, or an effect whose forces on the links are unknown.
    """
    robot, exerted = bodies_and_effects(run)
    for name in exerted:
        if re.sub(r" \d+$", "", name) not in KNOWN_ON_LINKS:
            raise QueryError(
                f"joint_wrenches: the forces of the effect {name} on the links are unknown; pass them to"
                " arm.joint_wrenches(run.q, run.v, run.a, external=…), for an arm with the payload that is carried"
            )
    finite = np.all([np.isfinite(x).all(axis=1) for x in (run.q, run.v, run.a)], axis=0)
    external = {link: F[np.searchsorted(F[:, 0], run.t[finite]), 1:] for link, F in run.wrenches.items()}
    some = robot.joint_wrenches(run.q[finite], run.v[finite], run.a[finite], external=external, frame=frame, at=at)
    at_joints = np.full((len(run.t), *some.at_joints.shape[1:]), np.nan)
    at_base = np.full((len(run.t), 6), np.nan)
    at_joints[finite], at_base[finite] = some.at_joints, some.at_base
    return JointWrenches(some.joints, at_joints, at_base)
