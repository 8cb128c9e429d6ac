"""One run of a batch as a trajectory: the recorded quantities, and those computed from them and the setup.

a = M⁻¹ (τ − C v − N),   P_k = τ_kᵀ v;   nan if neither the record nor the setup determines a value
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_dyn.foundations.errors import QueryError
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.interpreted import sample
from robot_dyn.simulation.results.acting import acting, at_stop, wrenches
from robot_dyn.simulation.results.ledger import Ledger
from robot_dyn.simulation.results.provenance import settings_text
from robot_dyn.simulation.results.samples import Tracking, columns, tracking_of
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.rollouts.overview import remarks_of
from robot_dyn.simulation.rollouts.rollouts_data import RolloutsData
from robot_dyn.simulation.setup.setup import Setup


def trajectory(runs: RolloutsData, run: int) -> Trajectory:
    """Return the trajectory of a run; see `Rollouts`.

    Raises:
        QueryError: If positions or velocities were not recorded.
    """
    if runs.q is None or runs.v is None:
        raise QueryError("a run of rollouts is a trajectory if q and v were recorded: add them to record")
    recorded = ~np.isnan(runs.q[run]).all(axis=1)  # a run that ended early has nan after its end
    t, q, v = runs.t[recorded], runs.q[run, recorded], runs.v[run, recorded]
    setup = None if runs.setup is None else runs.setup_of(run)
    a, u, power, energy = _derived(setup, runs.sources, t, q, v, None if runs.u is None else runs.u[run, recorded])
    if runs.kinetic is not None and runs.potential is not None:
        energy = np.column_stack([runs.kinetic[run, recorded], runs.potential[run, recorded]])
    work = {name: np.full(len(t), np.nan) for name in runs.sources}
    if runs.work is not None:
        work = {name: x[run, recorded] for name, x in runs.work.items()}
    metadata, of_setup = runs.metadata | {"run": f"{run} of {len(runs)}"}, Tracking()._asdict()
    if setup is not None:
        metadata |= settings_text(setup)
        of_setup = tracking_of(setup, t, q)._asdict() | {
            "wrenches": wrenches(setup.plant, t, q), "at_stop": at_stop(setup.plant, q), "acting": acting(setup),
        }  # fmt: skip
    counts = {"steps": int(runs.steps[run]), "evaluations": int(runs.evaluations[run])}
    return Trajectory(
        joint_names=runs.joint_names, t=t, q=q, v=v, a=a, u=u, power=dict(zip(runs.sources, power.T, strict=True)),
        ledger=Ledger(energy[:, 0], energy[:, 1], work), outcome=runs.outcome(run),
        statistics=replace(runs.statistics, **counts), metadata=metadata, remarks=remarks_of(runs, run, setup, t, q),
        extremes=runs.observed.extremes[run], **of_setup,
    )  # fmt: skip


def _derived(
    setup: Setup | None, sources: tuple[str, ...], t: np.ndarray, q: np.ndarray, v: np.ndarray, u: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return acceleration, torque, powers and energies at the samples; nan if unknown."""
    unknown, energy = np.full_like(q, np.nan), np.full((len(t), 2), np.nan)
    equation = None if setup is None else StateEquation(setup.plant, setup.controller)
    if equation is None or equation.equation_of_motion.state_size:  # torques depend on states that are not recorded
        energy = energy if equation is None else np.column_stack(equation.energies(0.0, q, v))
        return unknown, unknown if u is None else u, np.full((len(t), len(sources)), np.nan), energy
    if u is None and (equation.sampled or equation.states):
        u = unknown  # it depends on earlier states
    derived = np.full((len(t), equation.size + q.shape[1] + 2), np.nan)
    y = np.hstack([q, v, np.zeros((len(t), equation.size - 2 * q.shape[1]))])
    for i in range(len(t)):
        sample(equation, float(t[i]), y[i], None if u is None else u[i], derived[i])
    _, _, a, u, _, power, energy = columns(equation, t, y, derived)
    return a, u, power, energy
