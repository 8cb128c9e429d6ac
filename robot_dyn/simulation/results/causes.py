"""The torque of each joint along a run by cause: τ = M a + C v + ∂V/∂q − Σ τ_effect at its samples.

The torques of effects are computed from the states of the run and stored with it; the others from its robot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_dyn.effects.causes import Causes, by_cause, exerted_torques
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import QueryError
from robot_dyn.model import right_angles
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.results.provenance import robot_of
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.simulation.results.samples import Columns

_OPEN = 1e-9  # relative to the torques: far above rounding


def plant_of(plant: Plant, compiled: bool) -> Plant:
    """Return the plant of a run: machine code makes right angles of the file exact."""
    robot = right_angles.robot_of(plant.dynamics) if compiled else None
    return plant if robot is None else replace(plant, dynamics=robot)


def effect_torques(
    plant: Plant, t: np.ndarray, columns: Columns, states: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return the torque of each effect on the joints at k samples by name, (k, n), see `exerted_torques`.

    Args:
        plant: Plant of the run.
        t: Times of the samples, (k,), in [s].
        columns: Quantities there.
        states: States of the effects that have some, by name, in the order of the effects.
    """
    if not plant.forces and not plant.equation_of_motion.payloads:
        return {}
    return exerted_torques(plant, t, columns.q, columns.v, columns.a, columns.u, _stacked(states))


def broken_away(plant: Plant, t: np.ndarray, columns: Columns, states: dict[str, np.ndarray]) -> np.ndarray:
    """Return accelerations at k samples, (k, n): after breakaway, if a joint breaks away at the time of a sample.

    The sample is recorded before, with the joint at rest, which no torque of the effects explains.
    """
    q, v, a, u = columns[:4]
    exerted = effect_torques(plant, t, columns, states)
    needed, total = plant.dynamics.nan_rows.inverse_dynamics(q, v, a), sum(exerted.values(), start=0 * u) + u
    doubtful = np.abs(needed - total) > _OPEN * (np.abs(needed).max(axis=1) + np.abs(u).max(axis=1))[:, None]
    a, z = a.copy(), _stacked(states)
    for k in np.flatnonzero(doubtful.any(axis=1) & ((v == 0) & (a == 0)).any(axis=1)):
        equation = plant.at(float(t[k])).equation_of_motion
        torques = equation.torques(float(t[k]), q[k], v[k], z=None if z is None else z[k])
        a[k] = equation.acceleration(q[k], v[k], sum(torques, start=equation.on_joints(u[k])))
    return a


def _stacked(states: dict[str, np.ndarray]) -> np.ndarray | None:
    return np.hstack(list(states.values())) if states else None


def causes_of(run: TrajectoryData) -> Causes:
    """Return the causes of a run, see `Trajectory.causes`.

    Raises:
        QueryError: If the run contains no robot, or lacks a quantity that is needed.
    """
    robot, exerted = bodies_and_effects(run)
    return by_cause(robot, run.t, run.q, run.v, run.a, run.u, exerted)


def bodies_and_effects(run: TrajectoryData) -> tuple[Robot, dict[str, np.ndarray]]:
    """Return the robot of a run and the torques of its effects; raise a QueryError if the run lacks them."""
    if run.effect_torques is None:
        raise QueryError(
            "the run contains no torques of its effects: simulate it again with its error estimate"
            " (a run of rollouts with rd.simulate(runs.setup_of(i)))"
        )
    if np.isnan(run.a).all() or np.isnan(run.u).all():
        raise QueryError("the run contains no accelerations or no actuation; simulate it with rd.simulate")
    robot = robot_of(run)
    if "right_angles" in run.metadata:
        robot, _ = right_angles.with_exact_right_angles(robot)
    return robot, run.effect_torques
