"""The trajectory of a run: samples with names and units, what each effect did, how it ended, how accurate it is."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, Protocol, final, runtime_checkable

import numpy as np

from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.values import Derived, Layout, read_only
from robot_dyn.simulation.columns import attributes, by_heading, data_frame, data_set
from robot_dyn.simulation.events.occurrence import Occurrence
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.error_estimate import ErrorEstimate
from robot_dyn.simulation.results.ledger import Ledger
from robot_dyn.simulation.results.samples import root_mean_square
from robot_dyn.simulation.run.outcome import Outcome

if TYPE_CHECKING:
    from robot_dyn.effects.causes import Causes

# Residuals, as parts of the energy exchanged. Over 150 random scenes they were at most 10 times the estimated error of
# q, as a part of the motion; one that is far larger contradicts the estimate.
_CONTRADICTS, _ROUNDING = 100.0, 1e-12


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
@dataclass(frozen=True)
class Statistics:
    """What a run took.

    Attributes:
        method: Name of the integrator.
        step_s: Its step, or 0 if it chose its own.
        steps: Number of steps.
        evaluations: Evaluations of the equation of motion, those of its Jacobian apart.
        wall_s: Time of the run itself, in [s].
        companions_s: Time of the error estimate.
        engine: Which loop ran, and why if another was possible.
        compile_s: Time before the run, for the choice of the loop and for compiling it.
        samples_s: Time after it, for what follows from the states of its samples and is not computed later.
        companion_evaluations: Evaluations of the error estimate.
        companion_runs: Companion runs of the error estimate.
        user_code: Parts of the setup that are user-defined code, by name; each run calls them.
    """

    method: str
    step_s: float
    steps: int
    evaluations: int
    wall_s: float
    companions_s: float = 0.0
    engine: str = "interpreted"
    compile_s: float = 0.0
    samples_s: float = 0.0
    companion_evaluations: int = 0
    companion_runs: int = 0
    user_code: str = ""


@final
@dataclass(frozen=True)
class Accuracy:
    """A requested accuracy, the estimated one, and the cost in evaluations of the equation of motion.

    Attributes:
        requested: Largest error of q over joints and times, in [rad] and [m].
        estimated: The estimated one.
        rtol: The tolerance that was chosen, atol a hundredth of it; 0 for a method of fixed step.
        run: Of the run.
        pilots: Of the runs before it, with their error estimates.
        check: Of its own error estimate.
        digit_more, digit_less: Of a run with an error ten times smaller, or larger, by the order of the method.
    """

    requested: float
    estimated: float
    rtol: float
    run: int
    pilots: int
    check: int
    digit_more: float
    digit_less: float

    @property
    def margin(self) -> float:
        """The requested over the estimated error: at least 2, or 1 where no tolerance brings more; inf for no error."""
        return self.requested / self.estimated if self.estimated > 0 else inf

    def __str__(self) -> str:
        at = f" at rtol {self.rtol:.1e}" if self.rtol else ""
        return (
            f"requested {self.requested:.1e}, estimated {self.estimated:.1e}{at}, a margin of {self.margin:.1f};"
            f" {self.run} evaluations,"
            f" pilots {self.pilots}, check {self.check}; a digit more about {self.digit_more:.0f}, a digit less"
            f" {self.digit_less:.0f}"
        )


@final
@dataclass(frozen=True, eq=False)
class Trajectory(Derived):
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

    joint_names: tuple[str, ...]
    t: Annotated[np.ndarray, Layout(("m",))]
    q: Annotated[np.ndarray, Layout(("m", "n"))]
    v: Annotated[np.ndarray, Layout(("m", "n"))]
    a: Annotated[np.ndarray, Layout(("m", "n"), absent=True)]
    u: Annotated[np.ndarray, Layout(("m", "n"), absent=True)]
    power: dict[str, Annotated[np.ndarray, Layout(("m",), absent=True)]]
    ledger: Ledger
    desired: Annotated[np.ndarray, Layout(("m", "n"))] | None
    deviation: Annotated[np.ndarray, Layout(("m", ("n", 3)))] | None
    outcome: Outcome
    statistics: Statistics
    error: ErrorEstimate | None = field(default_factory=NoneType)
    about: dict[str, str] = field(default_factory=dict, repr=False)
    wrenches: dict[str, Annotated[np.ndarray, Layout((None, 7))]] = field(default_factory=dict)
    at_stop: Annotated[np.ndarray, Layout(("m", "n"), "bool")] | None = field(default_factory=NoneType)
    remarks: tuple[Remark, ...] = field(default_factory=tuple)
    extremes: Annotated[np.ndarray, Layout((3, 2, "n"), finite=False)] | None = field(default_factory=NoneType)
    acting: tuple[str, ...] | None = field(default_factory=NoneType)
    controller_states: Annotated[np.ndarray, Layout(("m", "z"))] | None = field(default_factory=NoneType)
    events: tuple[Occurrence, ...] = field(default_factory=tuple)
    effect_states: dict[str, Annotated[np.ndarray, Layout(("m", None))]] = field(default_factory=dict)
    accuracy: Accuracy | None = field(default_factory=NoneType)
    effect_torques: dict[str, Annotated[np.ndarray, Layout(("m", "n"), absent=True)]] | None = field(
        default_factory=NoneType
    )
    desired_velocity: Annotated[np.ndarray, Layout(("m", "n"))] | None = field(default_factory=NoneType)

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def tracking_error(self) -> float | None:
        """Root mean square of the deviation over samples and joints or axes; None without a reference."""
        return None if self.deviation is None else root_mean_square(self.deviation)

    @property
    def leak(self) -> str:
        """Why the energy ledger casts doubt on the run; empty if it does not."""
        return leak(self.ledger, self.error, self.q)

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

    def table(self) -> dict[str, np.ndarray]:
        """The samples as columns (m,), by quantity, joint and unit: `run.table()["q elbow_joint [rad]"]`."""
        from robot_dyn.simulation.results.table import columns

        return by_heading(columns(self))

    def to_pandas(self) -> Any:
        """Return `table` as a `pandas.DataFrame`; MissingExtraError without pandas."""
        from robot_dyn.simulation.results.table import columns

        return data_frame(columns(self), attributes(self))

    def to_xarray(self) -> Any:
        """Return `table` as an `xarray.Dataset` over t and joint, units as attributes; MissingExtraError without it."""
        from robot_dyn.simulation.results.table import columns

        return data_set(columns(self), self.joint_names, attributes(self))

    def causes(self) -> Causes:
        """The actuation of each joint at the samples by cause: inertia, Coriolis, gravity, and each effect by its name.

        The causes add up to u, to rounding. Where several effects hold a joint at rest, dry friction takes what it can
        and stops the rest. The cause of a drive is what its motor takes for itself, less the torque of its spring.

        Raises:
            QueryError: If the run carries no robot, or does not hold what its effects exerted.
        """
        from robot_dyn.simulation.results.causes import causes_of

        return causes_of(self)

    def __repr__(self) -> str:
        return f"<Trajectory: {self.summary}>"

    def _repr_html_(self) -> str:
        from robot_dyn.simulation.results.html import trajectory_html

        return trajectory_html(self)

    @property
    def summary(self) -> str:
        """A few lines: outcome, what acted, ledger, error, tracking, cost."""
        from robot_dyn.simulation.results.summary import summary

        return summary(self)


def leak(ledger: Ledger, error: ErrorEstimate | None, q: np.ndarray) -> str:
    """As of `Trajectory.leak`, from the ledger, the estimated error and the samples q (m, n) of a run."""
    if not ledger.closes:
        return f"it does not close: {ledger.cause or 'simulate it with its error estimate, which finds the cause'}"
    if ledger.rounded or error is None:
        return ""
    span = float(np.ptp(q, axis=0).max())
    if not span > 0 or ledger.closure <= _CONTRADICTS * max(error.largest / span, _ROUNDING):
        return ""
    why = ledger.cause or "do not trust the estimate, take a smaller step"
    return f"it does not close as well as the estimated error of q implies: {why}"
