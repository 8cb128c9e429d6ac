"""The trajectory of a run: samples with names and units, what each effect did, how it ended, how accurate it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol, final, runtime_checkable

import numpy as np

from robot_dyn.effects.causes import Causes
from robot_dyn.foundations.display import MOST_JOINTS, curves, plot
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.columns import Column
from robot_dyn.simulation.results.causes import causes_of
from robot_dyn.simulation.results.formats.save import save_data
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.simulation.results.run_file import write_run
from robot_dyn.simulation.results.summary import summary
from robot_dyn.simulation.results.table import columns


@runtime_checkable
class Theorem(Protocol):
    """What is proven of a motion, as `rd.tools.proof.Proof`."""

    joint_names: tuple[str, ...]

    def contains(self, t: float, q: Any, v: Any = None) -> bool:
        """Whether a state may be that of the motion at t."""
        ...

    def digits_of(self, t: np.ndarray, q: np.ndarray) -> float:
        """Decimal digits of positions (m, n) at times (m,) that are confirmed."""
        ...


@final
class Trajectory(TrajectoryData):
    """Samples of a run, m of them; arrays are (m,) or (m, n).

    What follows from the states of a run of `simulate` is computed when it is first read; where parts are user-defined
    code, or the run did not finish, `simulate` computes it.

    Attributes:
        joint_names: Of the n joints.
        t: In [s].
        q, v, a: In [rad], [rad/s], [rad/s²] or [m], [m/s], [m/s²].
        u: Actuation within its bounds, in [N m] or [N].
        power: Of the control and of each effect without a potential, by name, in [W].
        ledger: Energy and work.
        desired: Positions of a joint reference, or None.
        deviation: q − q_d, (m, n); or p − p_d of a frame that follows a Cartesian reference, (m, 3) in [m];
            None without a reference.
        outcome: How it ended.
        statistics: What it took.
        error: Its estimated error; None without an estimate.
        about: Texts that make it whole: URDF, its path, edits, settings, scene, versions; the controlled frame and the
            file that it was read from, if any.
        wrenches: External wrench by link, rows (t, force, torque), (k, 7), in base axes at its frame, in SI units:
            at the samples and at both sides of each switch.
        at_stop: Whether each joint is at or beyond a stop, (m, n); None without stops.
        remarks: What was observed at every step and need not show in the samples.
        extremes: The least and the largest of q, v and u over all steps, (3, 2, n); None if they were not observed.
        acting: Names of what acted: gravity, payloads, effects, limits, control; None if it is not known.
        controller_states: z of the controller, (m, z), of a sampled one after its tick; None if it has none, or they
            were not recorded.
        events: Where effects switched, and requested ones, in the order of time.
        effect_states: z of each effect with states, by name, (m, z); empty if they were not recorded.
        accuracy: The requested accuracy and its cost; None if none was requested.
        effect_torques: What each effect exerted on the joints by name, (m, n), in [N m] or [N], so that
            M a + C v + ∂V/∂q = u + their sum; None if they were not recorded.
        desired_velocity: Velocities of a joint reference, or None.
    """

    def proven_digits(self, proof: Theorem) -> float:
        """Decimal digits of q that a theorem confirms: −log₁₀ of the largest possible error, in [rad] or [m].

        Args:
            proof: Of the same motion, as `rd.tools.proof.prove` returns it; samples after its end are left out.

        Raises:
            QueryError: If it is of other joints, or its motion starts elsewhere.
        """
        if not isinstance(proof, Theorem):
            raise QueryError(f"proof: give one, as rd.tools.proof.prove(setup), got {shown(proof)}")
        if proof.joint_names != self.joint_names:
            raise QueryError(f"proof is of the joints {', '.join(proof.joint_names)}; give one of this motion")
        if self.t[0] == 0 and not proof.contains(0.0, self.q[0], self.v[0]):
            raise QueryError("the motion of the proof starts elsewhere; give one of this motion")
        return proof.digits_of(self.t, self.q)

    def causes(self) -> Causes:
        """The actuation of each joint at the samples by cause: inertia, Coriolis, gravity, and each effect by its name.

        The causes add up to u, to rounding. Where several effects hold a joint at rest, dry friction takes what it can
        and stops the rest. The cause of a drive is what its motor takes for itself, less the torque of its spring.

        Raises:
            QueryError: If the run carries no robot, or does not hold what its effects exerted.
        """
        return causes_of(self)

    @property
    def summary(self) -> str:
        """A few lines: outcome, what acted, ledger, error, tracking, cost."""
        return summary(self)

    def _columns(self) -> Iterator[Column]:
        return columns(self)

    def save(self, path: str | Path) -> Path:
        """Save the run in the format of the suffix of `path`, completely or not at all; return the path.

            .npz      run file: all data, with the robot, for `rd.read`; the default without a suffix
            .csv      `table`: a row for each sample; `float` restores the numbers
            .parquet  the same columns, with quantity, joint and unit as metadata
            .nc       `to_xarray` as netCDF-3, with units as attributes
            .mcap     ROS 2 messages: q, v, u and its causes; desired q; power, energy

        Formats other than .npz and .csv need `pip install 'robot-dyn[data]'`; all except .csv contain the robot's name,
        settings, versions and the summary. Numbers are exact to the bit, times in an MCAP log to 1 ns. An existing file
        is replaced only if it has the same format.

        Raises:
            RunFileError: If the suffix is unknown, or the file cannot be written.
            MissingExtraError: If the format needs a package that is not installed.
        """
        return save_data(self, path, write_run)

    def _repr_html_(self) -> str:
        joints, types = self.joint_names[:MOST_JOINTS], joint_types(self)
        quantities = {"q": "q", "v": "v"} | ({"u": "tau"} if np.any(self.u) else {})
        plots = [
            plot(f"{name} [{joint_units(of, types)}]", self.t, dict(zip(joints, getattr(self, name).T, strict=False)))
            for name, of in quantities.items()
        ]
        return curves("Trajectory", self.summary, joints, plots, len(self.joint_names) - len(joints))
