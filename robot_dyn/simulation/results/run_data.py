"""The record of a run: the table of quantities, the fields common to one run and many, and those of one run.

To add a quantity, add it to SAMPLED and to the fields of `TrajectoryData`, and compute it in `derived.py`. Files,
tables, DataFrames, Datasets and exports then include it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType, NoneType
from typing import Annotated, Any, final

import numpy as np

from robot_dyn.foundations.store import Layout
from robot_dyn.foundations.values import Derived
from robot_dyn.simulation.columns import Column, Variable, by_heading, data_frame, data_set
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.error_estimate import ErrorEstimate
from robot_dyn.simulation.results.ledger import Ledger, leak
from robot_dyn.simulation.results.samples import root_mean_square
from robot_dyn.simulation.results.statistics import Accuracy, Statistics
from robot_dyn.simulation.run.outcome import Outcome

_DESCRIBED = "robot", "edits", "settings", "run", "versions"  # metadata that a table repeats


@final
@dataclass(frozen=True)
class SampledQuantity(Layout):
    """A quantity at the samples of a run; its layout is that of one run.

    Attributes:
        unit: SI unit, or "q", "v", "a" or "u" for the unit of the joint.
        title: Name in words.
        heading: Heading of its columns in tables; empty if it has none.
        over: Name of its second axis if that is not the joints.
    """

    unit: str = ""
    title: str = ""
    heading: str = ""
    over: str = ""

    @property
    def of_joints(self) -> bool:
        """True if it has a number for every joint."""
        return self.shape == _MN

    @property
    def of_runs(self) -> Layout:
        """The layout of many runs."""
        return Layout(("B", *self.shape), self.dtype)


_M, _MN = ("m",), ("m", "n")
SAMPLED: Mapping[str, SampledQuantity] = MappingProxyType(
    {
        "t": SampledQuantity(_M, unit="s", title="time", heading="t"),
        "q": SampledQuantity(_MN, unit="q", title="position", heading="q"),
        "v": SampledQuantity(_MN, unit="v", title="velocity", heading="v"),
        "a": SampledQuantity(_MN, absent=True, unit="a", title="acceleration", heading="a"),
        "u": SampledQuantity(_MN, absent=True, unit="u", title="actuation within its bounds", heading="u"),
        "desired": SampledQuantity(_MN, unit="q", title="desired position", heading="desired"),
        "desired_velocity": SampledQuantity(_MN, unit="v", title="desired velocity"),
        "tracking_error": SampledQuantity(
            ("m", ("n", 3)), unit="m", title="tracking error", heading="tracking error", over="axis"
        ),
        "at_stop": SampledQuantity(_MN, "bool", title="whether it is at or beyond a stop"),
        "effect_torques": SampledQuantity(_MN, absent=True, unit="u", title="torque of an effect"),
        "power": SampledQuantity(_M, absent=True, unit="W", heading="power", over="source"),
        "kinetic": SampledQuantity(_M, absent=True, unit="J", title="kinetic energy"),
        "potential": SampledQuantity(_M, absent=True, unit="J", title="potential energy"),
        "work": SampledQuantity(_M, absent=True, unit="J", title="work"),
        "energy": SampledQuantity(_M, unit="J", title="kinetic and potential energy", heading="energy"),
        "residual": SampledQuantity(_M, unit="J", title="unexplained energy", heading="residual"),
        "controller_states": SampledQuantity(("m", "z"), heading="controller state"),
        "effect_states": SampledQuantity(("m", None), heading="state"),
    }
)
"""Sampled quantities by name, in the order of tables; those without a unit have the unit of their effect."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RunData(Derived):
    """The record of a run at m samples, or of B runs, where all arrays except t have a leading axis B.

    Attributes:
        joint_names: Names of the n joints.
        t: Sample times, (m,), in [s].
        q, v, u: Positions, velocities and actuation, (m, n) or (B, m, n); None if not recorded.
        statistics: Steps, evaluations and times.
        metadata: Texts from which the run can be repeated: URDF, edits, settings, versions.
    """

    joint_names: tuple[str, ...]
    t: Annotated[np.ndarray, SAMPLED["t"]]
    q: np.ndarray | None
    v: np.ndarray | None
    u: np.ndarray | None
    statistics: Statistics
    metadata: dict[str, str] = field(default_factory=dict)

    @property
    def summary(self) -> str:
        """A few lines: outcome, accuracy and cost."""
        raise NotImplementedError

    def _columns(self) -> Iterable[Column]:
        """Return the columns of the table, with quantity, joint and unit, for exports too."""
        raise NotImplementedError

    def _variables(self) -> Mapping[str, Variable]:
        """Return further variables of a Dataset."""
        return {}

    def table(self) -> dict[str, np.ndarray]:
        """Return columns by quantity, joint and unit, for example `run.table()["q elbow_joint [rad]"]`.

        A run has a row for each sample. Rollouts have a row for each run: varied parameters, start, end,
        tracking error, the remarks; the rms of v and u over the samples up to the end, if they were recorded
        (`record=("q", "v", "u")` for u), and extremes of q, v and u over the steps, which need no record.
        """
        return by_heading(self._columns())

    def to_pandas(self) -> Any:
        """Return `table` as a `pandas.DataFrame`; MissingExtraError without pandas."""
        return data_frame(self._columns(), attributes(self))

    def to_xarray(self) -> Any:
        """Return `table` as an `xarray.Dataset` over t or run, and joint, with units; MissingExtraError without xarray.

        The Dataset of rollouts contains all samples too, over run, t and joint.
        """
        return data_set(self._columns(), self.joint_names, attributes(self), self._variables())

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary}>"


def taken(values: np.ndarray | dict[str, np.ndarray] | None, part: slice) -> np.ndarray | dict[str, np.ndarray] | None:
    """Return a part of an array along its first axis, or of all arrays of a dictionary; None for None."""
    if isinstance(values, dict):
        return {name: x[part] for name, x in values.items()}
    return None if values is None else values[part]


def attributes(run: RunData) -> dict[str, str]:
    """Return the attributes of a table: robot, settings, versions, and the summary without its times.

    They contain no path of this machine.
    """
    metadata = {name: run.metadata[name] for name in _DESCRIBED if name in run.metadata}
    lines = [line for line in run.summary.splitlines() if not line.startswith("time: ")]
    return {"title": "run of robot_dyn", "method": run.statistics.method} | metadata | {"summary": "\n".join(lines)}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TrajectoryData(RunData):
    """The fields of one run; see `Trajectory`."""

    q: Annotated[np.ndarray, SAMPLED["q"]]
    v: Annotated[np.ndarray, SAMPLED["v"]]
    a: Annotated[np.ndarray, SAMPLED["a"]]
    u: Annotated[np.ndarray, SAMPLED["u"]]
    power: dict[str, Annotated[np.ndarray, SAMPLED["power"]]]
    ledger: Ledger
    desired: Annotated[np.ndarray, SAMPLED["desired"]] | None
    tracking_error: Annotated[np.ndarray, SAMPLED["tracking_error"]] | None
    outcome: Outcome
    error: ErrorEstimate | None = field(default_factory=NoneType)
    wrenches: dict[str, Annotated[np.ndarray, Layout((None, 7))]] = field(default_factory=dict)
    at_stop: Annotated[np.ndarray, SAMPLED["at_stop"]] | None = field(default_factory=NoneType)
    remarks: tuple[Remark, ...] = field(default_factory=tuple)
    extremes: Annotated[np.ndarray, Layout((3, 2, "n"), finite=False)] | None = field(default_factory=NoneType)
    acting: tuple[str, ...] | None = field(default_factory=NoneType)
    controller_states: Annotated[np.ndarray, SAMPLED["controller_states"]] | None = field(default_factory=NoneType)
    events: tuple[Occurrence, ...] = field(default_factory=tuple)
    effect_states: dict[str, Annotated[np.ndarray, SAMPLED["effect_states"]]] = field(default_factory=dict)
    accuracy: Accuracy | None = field(default_factory=NoneType)
    effect_torques: dict[str, Annotated[np.ndarray, SAMPLED["effect_torques"]]] | None = field(default_factory=NoneType)
    desired_velocity: Annotated[np.ndarray, SAMPLED["desired_velocity"]] | None = field(default_factory=NoneType)

    @property
    def rms_tracking_error(self) -> float | None:
        """Root mean square of the tracking error over samples and joints or axes; None without a reference."""
        return None if self.tracking_error is None else root_mean_square(self.tracking_error)

    @property
    def leak(self) -> str:
        """Text of the doubt that the energy ledger casts on the run; empty if there is none."""
        return leak(self.ledger, self.error, self.q)
