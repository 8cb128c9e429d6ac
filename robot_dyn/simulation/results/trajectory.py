"""The trajectory of a run: samples with names and units, torques of effects, outcome and accuracy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.effects.causes import Causes
from robot_dyn.foundations.display import MAX_JOINTS, curves, plot
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.model.newton_euler import JointWrenches
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.columns import Column
from robot_dyn.simulation.results.causes import causes_of
from robot_dyn.simulation.results.formats.save import save_data
from robot_dyn.simulation.results.joint_wrenches import joint_wrenches_of
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.simulation.results.run_file import write_run
from robot_dyn.simulation.results.summary import summary
from robot_dyn.simulation.results.table import columns


@runtime_checkable
class Theorem(Protocol):
    """A proven enclosure of a motion; `rd.tools.proof.Proof` is one."""

    joint_names: tuple[str, ...]

    def contains(self, t: float, q: ArrayLike, v: ArrayLike | None = None) -> bool:
        """Return True if the enclosure at t contains a state."""
        ...

    def digits_of(self, t: np.ndarray, q: np.ndarray) -> float:
        """Return the number of confirmed decimal digits of positions (m, n) at times (m,)."""
        ...


@final
class Trajectory(TrajectoryData):
    """The m samples of a run and their derived quantities; arrays are (m,) or (m, n).

    Quantities derived from the states are computed on first access. `simulate` computes them itself if the run did not
    finish, or if parts are user-defined code.

    Attributes:
        joint_names: Names of the n joints.
        t: Times, in [s].
        q, v, a: Positions, velocities and accelerations, in [rad], [rad/s], [rad/s²] or [m], [m/s], [m/s²].
        u: Actuation within its bounds, in [N m] or [N].
        power: Power of the control and of each effect without a potential, by name, in [W].
        ledger: Energy and work.
        desired: Positions of a joint reference, or None.
        tracking_error: q_d − q, (m, n); or p_d − p of a frame that follows a Cartesian reference, (m, 3) in [m];
            None without a reference.
        outcome: Reason and time of the end.
        statistics: Steps, evaluations and times.
        error: Estimated error; None without an estimate.
        metadata: Texts from which the run can be repeated: URDF, its path, edits, settings, scene, versions; the
            controlled frame and the file that it was read from, if any.
        wrenches: External wrench by link, rows (t, force, torque), (k, 7), in base axes at its frame, in SI units:
            at the samples and at both sides of each switch.
        at_stop: True where a joint is at or beyond a stop, (m, n); None without stops.
        remarks: Observations at every step, which the samples may not show.
        extremes: The least and the largest of q, v and u over all steps, (3, 2, n); None if they were not observed.
        acting: Names of gravity, payloads, effects, limits and control that acted; None if unknown.
        controller_states: States z of the controller, (m, z), after the tick if it is sampled; None if it has none, or
            they were not recorded.
        events: Switches of effects, and user-defined events, in the order of time.
        effect_states: States z of each effect with states, by name, (m, z); empty if they were not recorded.
        accuracy: The requested accuracy and its cost; None if none was requested.
        effect_torques: Torques of each effect on the joints by name, (m, n), in [N m] or [N], so that
            M a + C v + ∂V/∂q = u + their sum; None if they were not recorded.
        desired_velocity: Velocities of a joint reference, or None.
    """

    def proven_digits(self, proof: Theorem) -> float:
        """Return the decimal digits of q that a proof confirms: −log₁₀ of the largest possible error in [rad] or [m].

        Args:
            proof: Proof of the same motion, see `rd.tools.proof.prove`; samples after its end are ignored.

        Raises:
            QueryError: If its joints differ, or its motion starts at another state.
        """
        if not isinstance(proof, Theorem):
            raise QueryError(f"proof: pass the result of rd.tools.proof.prove(setup), got {shown(proof)}")
        if proof.joint_names != self.joint_names:
            raise QueryError(f"the proof has the joints {', '.join(proof.joint_names)}; pass the proof of this motion")
        if self.t[0] == 0 and not proof.contains(0.0, self.q[0], self.v[0]):
            raise QueryError("the proof starts from another state; pass the proof of this motion")
        return proof.digits_of(self.t, self.q)

    def causes(self) -> Causes:
        """Return the actuation of each joint at the samples by cause: inertia, Coriolis, gravity, and effects by name.

        The causes add up to u, to rounding. If several effects hold a joint at rest, dry friction has as large a part
        as possible, and stops the rest. The cause of a drive is the torque that its motor needs, less the torque of its
        spring.

        Raises:
            QueryError: If the run contains no robot, or no torques of its effects.
        """
        return causes_of(self)

    def joint_wrenches(self, *, frame: str | None = None, at: str | None = None) -> JointWrenches:
        """Return the force and torque through every joint, and on the root link, at the samples, (m, k, 6).

        External wrenches count; friction, stops and drives act between parent and child. An impact is an impulse in N s
        between two samples, and is not included. Samples without an acceleration are nan. See `Robot.joint_wrenches`.

        Args:
            frame: Link whose axes are used for all wrenches; None for those of each child link.
            at: Link at whose origin all torques are taken; None for the origin of each joint.

        Raises:
            QueryError: If the run contains no robot, a link is unknown, or the forces of an effect on the links are:
                those of line springs, of payloads that come and go, and of user-defined effects.
        """
        return joint_wrenches_of(self, frame, at)

    @property
    def summary(self) -> str:
        """A few lines: outcome, effects, ledger, error, tracking, cost."""
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
        joints, types = self.joint_names[:MAX_JOINTS], joint_types(self)
        quantities = {"q": "q", "v": "v"} | ({"u": "tau"} if np.any(self.u) else {})
        plots = [
            plot(f"{name} [{joint_units(like, types)}]", self.t, dict(zip(joints, getattr(self, name).T, strict=False)))
            for name, like in quantities.items()
        ]
        return curves("Trajectory", self.summary, joints, plots, len(self.joint_names) - len(joints))
