"""The largest loads on the bearing of each joint over a motion, from the wrench of the parent link on the child link.

    axial |f·z|,   radial |f − (f·z) z|,   tilting |τ − (τ·z) z|,   torsion |τ·z|

F = (f, τ) acts at the origin of the joint, and z is its axis. The component on the axis is the load side of the drive:
the torsion of a revolute joint and the axial force of a prismatic joint are τ without armature and friction.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn import Plant, Robot, Trajectory
from robot_dyn.effects import ExternalWrench
from robot_dyn.foundations import DescriptionError, QueryError, reported
from robot_dyn.model import JointWrenches
from robot_dyn.simulation import KNOWN_ON_LINKS, RemarkKind
from robot_dyn.tools.motors.motor_budget.cells import Cells

LOADS = {"axial": "N", "radial": "N", "tilting": "N m", "torsion": "N m"}
"""Loads on a bearing, with units."""
FIGURES = tuple(figure for load in LOADS for figure in (load, f"{load}_at_s"))
"""Each load and its time."""
_DIGITS = 12  # decimals of times in [s], as in `JointBudget`
_ROUNDS = 3  # of refinement: loads are smooth at their maxima, so that a round reduces the error by a factor of 16
_COARSE = 0.01  # relative to the largest load at the samples of a run, by which it may be exceeded between them
_NOTHING = 1e-4  # relative to the largest load, in [N] or [N m]: smaller loads may be errors of the run


@final
@dataclass(frozen=True)
class BearingLoads:
    """The largest loads on the bearing of a joint, at the origin of the joint, and their limits.

    Attributes:
        axial, axial_at_s: Largest |f·z|, in [N], and its time, in [s].
        radial, radial_at_s: Largest |f − (f·z) z|, in [N], and its time.
        tilting, tilting_at_s: Largest |τ − (τ·z) z|, in [N m], and its time.
        torsion, torsion_at_s: Largest |τ·z|, in [N m], and its time.
        axial_limit, radial_limit, tilting_limit, torsion_limit: The limits; inf for none.
    """

    axial: float
    axial_at_s: float
    radial: float
    radial_at_s: float
    tilting: float
    tilting_at_s: float
    torsion: float
    torsion_at_s: float
    axial_limit: float = inf
    radial_limit: float = inf
    tilting_limit: float = inf
    torsion_limit: float = inf

    @property
    def worst(self) -> str:
        """Name of the load with the largest used fraction of its limit."""
        return max(LOADS, key=lambda name: getattr(self, name) / getattr(self, f"{name}_limit"))

    @reported
    def used(self) -> float:
        """Largest used fraction of a limit; 0 without limits."""
        return getattr(self, self.worst) / getattr(self, f"{self.worst}_limit")

    @property
    def says(self) -> str:
        """The load with the largest used fraction, and its limit, in words."""
        name = self.worst
        load, at, limit = (getattr(self, f"{name}{suffix}") for suffix in ("", "_at_s", "_limit"))
        return f"{load:.4g} {LOADS[name]} {name} at its bearing (limit {limit:.4g}) at {at:.4g} s"


class Bearings(NamedTuple):
    """The loads on bearings by joint, with findings about them; or the reason why they are unknown."""

    by_joint: Mapping[str, BearingLoads]
    findings: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


Limits = Mapping[str, Mapping[str, float]]  # by joint and load


def of_plan(grid: Cells, plant: Plant, limits: Limits) -> Bearings:
    """Compute the largest loads along a plan, also between the nodes of its cells; impacts do not occur on a plan.

    Raises:
        QueryError: If limits are stated, but the forces of an effect on the links are unknown.
    """
    robot: Any = plant.dynamics
    acting = [effect.name for effect in (*plant.forces, *plant.equation_of_motion.payloads)]
    if unknown := [name for name in acting if name not in KNOWN_ON_LINKS]:
        remedy = "pass them to arm.joint_wrenches(q, v, a, external=…)"
        return _unknown(f"the forces of the effect {unknown[0]} on the links are unknown; {remedy}", limits)

    def loads(cell: np.ndarray, x: np.ndarray) -> np.ndarray:
        t, q, v, a = grid.states(cell, x)
        external: dict[str, np.ndarray] = {}
        for effect in (effect for effect in plant.effects if isinstance(effect, ExternalWrench)):
            F = np.where(effect.acts(t)[:, None], effect.at(robot.placement(q, effect.frame)), 0.0)
            external[effect.frame] = external.get(effect.frame, 0.0) + F
        return components(robot, robot.joint_wrenches(q, v, a, external=external)).reshape(len(t), -1)

    nodes = grid.nodes
    try:
        at_nodes = loads(*nodes)
    except DescriptionError as error:
        return _unknown(str(error), limits)
    near = grid.closer(at_nodes, loads, rounds=_ROUNDS)
    t = np.concatenate([grid.states(*places)[0] for places in (nodes, near)])
    return Bearings(_largest(robot, t, np.concatenate([at_nodes, loads(*near)]), limits))


def of_run(run: Trajectory, robot: Robot, limits: Limits) -> Bearings:
    """Compute the largest loads at the samples of a run, which contain no impacts.

    Raises:
        QueryError: If limits are stated, but the forces of an effect on the links are unknown.
    """
    try:
        loads = components(robot, run.joint_wrenches())
    except (QueryError, DescriptionError) as error:
        return _unknown(str(error), limits)
    finite = np.isfinite(loads).all(axis=(1, 2))
    by_joint = _largest(robot, run.t[finite], loads[finite].reshape(finite.sum(), -1), limits)
    return Bearings(by_joint, (*_impacts(run), *_between_samples(run, robot, by_joint)))


def components(robot: Robot, wrenches: JointWrenches) -> np.ndarray:
    """Return the loads on the bearings of n joints, (k, n, 4), in the order of `LOADS`."""
    axes = {joint.get("name"): joint.find("axis") for joint in robot.description.element.iterfind("joint")}
    z = np.array([axes[name].get("xyz").split() for name in robot.joint_names], float)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    F = np.stack([wrenches[name] for name in robot.joint_names], axis=1)
    parts = []
    for part in (F[..., :3], F[..., 3:]):
        on_axis = np.sum(part * z, axis=2)
        parts += [np.abs(on_axis), np.linalg.norm(part - on_axis[..., None] * z, axis=2)]
    axial, radial, torsion, tilting = parts
    return np.stack([axial, radial, tilting, torsion], axis=2)


def _largest(robot: Robot, t: np.ndarray, loads: np.ndarray, limits: Limits) -> dict[str, BearingLoads]:
    """Return the largest of loads at times, (k, 4 n), by joint."""
    row = loads.argmax(axis=0)
    largest, at = (x.reshape(robot.n, len(LOADS)).tolist() for x in (loads.max(axis=0), t[row]))
    return {
        name: BearingLoads(
            **dict(zip(LOADS, largest[i], strict=True)),
            **{f"{load}_at_s": round(x, _DIGITS) for load, x in zip(LOADS, at[i], strict=True)},
            **{f"{load}_limit": x for load, x in limits.get(name, {}).items()},
        )
        for i, name in enumerate(robot.joint_names)
    }


def _unknown(reason: str, limits: Limits) -> Bearings:
    """Return no loads, with the reason; raise a QueryError if there are limits to compare them with."""
    if limits:
        joint = next(iter(limits))
        raise QueryError(f"the bearing of {joint} cannot be checked: {reason}; or remove its limits from the motors")
    return Bearings({}, left_out=(f"loads on bearings: {reason}",))


def _impacts(run: Trajectory) -> Iterator[str]:
    """Yield a finding if the run has impacts at rigid stops or backlash."""
    count = sum(" strikes " in event.name for event in run.events if event.joint)
    accumulated = any(remark.kind == RemarkKind.ACCUMULATE for remark in run.remarks)
    if count or (accumulated and any(name.startswith("rigid_") for name in run.effect_torques or {})):
        number = f"{count}{' and more' if accumulated else ''}"
        yield f"the run has impacts ({number}): impulses in N s, which are in no load on a bearing"


def _between_samples(run: Trajectory, robot: Robot, by_joint: Mapping[str, BearingLoads]) -> Iterator[str]:
    """Yield a finding for each load that is larger halfway between samples, on the quintic through both.

    Intervals with an event are skipped, because velocity or acceleration may jump there.
    """
    t, q, v, a = run.t, run.q, run.v, run.a
    h, between = np.diff(t)[:, None], (t[1:] + t[:-1]) / 2
    middle = (
        (q[1:] + q[:-1]) / 2 - 5 / 32 * h * (v[1:] - v[:-1]) + h**2 / 64 * (a[1:] + a[:-1]),
        15 / 8 * (q[1:] - q[:-1]) / h - 7 / 16 * (v[1:] + v[:-1]) + h / 32 * (a[1:] - a[:-1]),
        3 / 2 * (v[1:] - v[:-1]) / h - (a[1:] + a[:-1]) / 4,
    )
    events = np.array([event.t for event in run.events])
    smooth = np.searchsorted(events, t[:-1], "left") == np.searchsorted(events, t[1:], "right")
    smooth &= np.all([np.isfinite(x).all(axis=1) for x in middle], axis=0)
    external = {link: F[np.searchsorted(F[:, 0], between[smooth]), 1:] for link, F in run.wrenches.items()}
    state = (x[smooth] for x in middle)
    loads = components(robot, robot.joint_wrenches(*state, external=external)).max(axis=0, initial=0.0)
    for i, (joint, largest) in enumerate(by_joint.items()):
        for k, load in enumerate(LOADS):
            shown = getattr(largest, load)
            if loads[i, k] > (1 + _COARSE) * shown + _NOTHING * loads.max():
                yield (
                    f"between samples the {load} load of {joint} reaches about {loads[i, k]:.4g} {LOADS[load]}"
                    f" (sampled: {shown:.4g}); use a shorter record_every_s"
                )
