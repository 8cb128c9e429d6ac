"""The torque of each joint along a run by cause: τ = M a + C v + ∂V/∂q − Σ τ_effect at its samples.

What effects exert follows from the states of the run, and is stored with it; the rest follows from its robot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_dyn.effects.causes import Causes, by_cause, exerted_torques
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import QueryError
from robot_dyn.model import right_angles
from robot_dyn.simulation.results.provenance import robot_of
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.simulation.results.samples import Columns

_OPEN = 1e-9  # of the torques: far above rounding


def plant_of(plant: Plant, compiled: bool) -> Plant:
    """The plant that a run had: machine code takes right angles of the file as exact."""
    robot = right_angles.robot_of(plant.dynamics) if compiled else None
    return plant if robot is None else replace(plant, dynamics=robot)


def effect_torques(
    plant: Plant, t: np.ndarray, columns: Columns, states: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Torque of each effect on the joints at k samples by name, (k, n), as of `exerted_torques`.

    Args:
        plant: Of the run.
        t: Times, (k,).
        columns: Quantities there.
        states: Of each effect that has some, in their order.
    """
    if not plant.forces and not plant.equation_of_motion.payloads:
        return {}
    return exerted_torques(plant, t, columns.q, columns.v, columns.a, columns.u, _stacked(states))


def broken_away(plant: Plant, t: np.ndarray, columns: Columns, states: dict[str, np.ndarray]) -> np.ndarray:
    """Accelerations at k samples, (k, n): where joints break away at the time of a sample, those after it.

    The sample was recorded before, with these joints held, which no torque of the effects explains.
    """
    q, v, a, u = columns[:4]
    exerted = effect_torques(plant, t, columns, states)
    needed, total = plant.dynamics.inverse_dynamics(q, v, a, errors="nan"), sum(exerted.values(), start=0 * u) + u
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
    """The causes of a run, as of `Trajectory.causes`.

    Raises:
        QueryError: If the run carries no robot, or not what is needed.
    """
    if run.effect_torques is None:
        raise QueryError(
            "the run does not hold what its effects exerted, so its torque cannot be split by cause: simulate it again"
            " with its error estimate (a run of rollouts with rd.simulate(runs.setup_of(i)))"
        )
    if np.isnan(run.a).all() or np.isnan(run.u).all():
        raise QueryError("the run holds no accelerations or no actuation; simulate it with rd.simulate")
    robot = robot_of(run)
    if "right_angles" in run.about:
        robot, _ = right_angles.completed(robot)
    return by_cause(robot, run.t, run.q, run.v, run.a, run.u, run.effect_torques)
