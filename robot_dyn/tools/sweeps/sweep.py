"""`Sweep`: a value with the varying parameters, the number and the figures of many runs of a scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn import RobotDynError, Setup, parameters
from robot_dyn.foundations import Answer, Block, QueryError, SweepError, Table, Value, integer, shorten, shown, truth
from robot_dyn.queries import joint_types_of, unit
from robot_dyn.tools.sweeps.designs import Design, design, from_table
from robot_dyn.tools.sweeps.distributions import Distribution, distribution
from robot_dyn.tools.sweeps.figures import Figure, UserFigure, figure
from robot_dyn.tools.sweeps.imported import by_name, imported, is_import_path, is_scene, source_of
from robot_dyn.tools.sweeps.kept_samples import Samples, samples_of
from robot_dyn.tools.sweeps.rows import FIXED, NUMBERS, OUTCOMES, SAMPLE_COLUMNS, TEXTS

STARTS = ("q0", "v0")
RESERVED = ("run", *NUMBERS, *TEXTS, "failed", *OUTCOMES, *SAMPLE_COLUMNS.values())


@final
@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Answer, Value):
    """Runs 0, …, N − 1 of a setup. Start, parameters and noise of run i depend only on this value and i.

    Attributes:
        scene: A scene file, or the import path of a function that returns a `Setup`, such as "my_arm:setup".
        runs: Number of runs, N.
        vary: Distributions by name: a parameter of `rollouts(vary=…)`, "q0" or "v0". Frozen distributions of
            scipy.stats and texts such as "uniform(low=0, high=3)" are allowed, too.
        figures: Figures of each run, by name: `rms_tracking_error()`, `peak("u")`, `final("q", joint)`, or a function
            of a `Run` by import path. Texts such as "peak('u')" are allowed, too.
        design: "random", "sobol", "halton", "latin", "saltelli", "grid"; or rows in [0, 1), (N, d), with a column for
            each varying number.
        seed: Seed of the design.
        samples: Samples to keep: "q", or `samples("q", "u", every=100)`; none by default.
        uncut: True for steps that pass thresholds, in lock step, see `rollouts`. The result compares figures of
            64 runs, drawn at random, with those of runs whose steps end at thresholds.
        drawn: The rows of the design, (N, d), as stored in a folder; None to draw them by name and seed.
        stated: The setup as stated in a folder, if its reader has not named the function that returns it; else None.

    Raises:
        SweepError: If an argument is invalid; the message names it.
        SceneError: If the scene cannot be read.
    """

    scene: str
    runs: int
    vary: dict[str, Distribution]
    figures: Mapping[str, Figure | UserFigure] = field(default_factory=dict)
    design: Any = "random"
    seed: int = 0
    samples: Samples | None = None
    uncut: bool = False
    drawn: np.ndarray | None = None
    stated: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "scene", source_of(self.scene))
        set_(self, "vary", {name: _varied(name, x) for name, x in by_name("vary", self.vary, "kp").items()})
        if not self.vary:
            raise SweepError(
                "vary: nothing varies; give distributions by name, for example {'kp': sw.uniform(low=1, high=2)},"
                " on the command line --vary 'kp=uniform(low=1, high=2)'"
            )
        figures = by_name("figures", self.figures, "settling")
        if taken := sorted(figures.keys() & {*RESERVED, *self.columns}):
            raise SweepError(f"figures: {taken[0]!r} is the name of another column of a sweep; choose another name")
        set_(self, "figures", {name: figure(name, value) for name, value in figures.items()})
        set_(self, "seed", integer("seed", self.seed, most=2**63 - 1, error=SweepError))
        set_(self, "samples", samples_of(self.samples))
        set_(self, "uncut", truth("uncut", self.uncut, error=SweepError))
        _ = self.points  # raises if the design cannot have N rows
        if self.stated is None:  # otherwise the folder contains a sweep that was checked
            self._check_names()

    @cached_property
    def setup(self) -> Setup:
        """The setup without varied parameters; a SweepError for a function that the reader has not named."""
        if self.stated is not None:
            raise SweepError(
                f"the folder names the function {self.scene} as its scene, which is called only if you name it:"
                f" sw.read_sweep(folder, scene={self.scene!r}), or --scene {self.scene}"
            )
        if is_scene(self.scene):
            from robot_dyn.scene import read_both  # imported here because functions do not need it

            return read_both(self.scene)[1]
        setup = imported(self.scene)()
        if not isinstance(setup, Setup):
            raise SweepError(f"{self.scene}: returned {shown(setup)}; return a robot_dyn.Setup")
        return setup

    @cached_property
    def points(self) -> Design:
        """The design, drawn once."""
        dimensions = len(self.dimensions)
        if self.drawn is not None and isinstance(self.design, str):
            return from_table(self.drawn, self.runs, dimensions, self.design)
        return design(self.design, self.runs, dimensions, self.seed)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the varying numbers; entries of an array such as "q0" are numbered from 0."""
        return tuple(f"{name}[{k}]" if of.shape else name for name, of in self.vary.items() for k in range(of.width))

    @cached_property
    def dimensions(self) -> tuple[str, ...]:
        """Names of the columns of the design, in their order."""
        return tuple(name if of.size == 1 else f"{name}[{k}]" for name, of in self.vary.items() for k in range(of.size))

    @cached_property
    def units(self) -> dict[str, str]:
        """Units of the columns that have one, by name."""
        if self.stated is not None:
            return dict(self.stated["units"])
        by_parameter = {parameter.name: parameter.unit for parameter in parameters(self.setup).parameters}
        by_parameter |= {
            f"{name}[{k}]": unit(name[0], kind) for name in STARTS for k, kind in enumerate(self.joint_types)
        }
        units = {name: by_parameter.get(name, by_parameter.get(parameter_of(name), "")) for name in self.columns}
        units |= {name: figure.unit(self.setup) for name, figure in self.figures.items()}
        units |= {column.name: column.unit for column in FIXED}
        return {name: text for name, text in units.items() if text}

    @property
    def joint_types(self) -> tuple[str | None, ...]:
        """Types of the joints, "revolute", "continuous" or "prismatic"; None if unknown."""
        return tuple(joint_types_of(self.setup.plant.dynamics) if self.stated is None else self.stated["joint_types"])

    @cached_property
    def bytes_expected(self) -> int:
        """Upper bound of the size on disk, in bytes, without footers and texts."""
        if self.stated is not None:
            return self.stated["bytes_expected"]
        rows = 8 * (len(self.columns) + len(self.figures) + len(NUMBERS)) + 4 * len(TEXTS)
        if self.samples is None or self.samples.failed:
            return self.runs * rows
        numbers = samples_of_run(self.setup) * self.setup.plant.dynamics.n * len(self.samples.names)
        return self.runs * rows + 8 * numbers * -(-self.runs // self.samples.every)

    def values(self, start: int, stop: int) -> dict[str, np.ndarray]:
        """Return the varying values in runs start, …, stop − 1, by name; raise a SweepError for other runs.

        Starts have shape (k, n), numbers (k,), arrays (k, size).
        """
        stop = integer("stop", stop, most=self.runs, error=SweepError)
        start = integer("start", start, most=stop, error=SweepError)
        return self._values(self.points.rows[start:stop])

    def _values(self, u: np.ndarray) -> dict[str, np.ndarray]:
        """Return the values at points u, (k, d), of the design."""
        first, values = 0, {}
        for name, of in self.vary.items():
            x = of.values(np.ascontiguousarray(u[:, first : first + of.size]))
            values[name] = x.reshape((len(u), -1) if name in STARTS or of.width > 1 else -1)
            first += of.size
        return values

    def _check_names(self) -> None:
        """Raise a SweepError if a varying parameter is unknown to the setup, or has another size."""
        from robot_dyn.simulation.rollouts.rollouts import batch_of

        n, values = self.setup.plant.dynamics.n, self._values(np.full((2, len(self.dimensions)), 0.5))
        for name in STARTS:
            if (size := values.pop(name, np.empty((2, n))).shape[1]) != n:
                message = f"vary: {name} has {n} numbers, got a distribution of {size}; give arrays of {n}"
                raise SweepError(f"{message}, for example normal(mean={[0] * n}, sd=0.1)")
        try:
            batch = batch_of(self.setup, None, None, values, ())
            if self.uncut and (why := batch.why_one_by_one):
                raise SweepError(f"uncut: {why}, so the runs are not in lock step; leave it out")
        except QueryError as error:
            raise SweepError(f"vary: {str(error).removeprefix('vary: ')}") from None

    @property
    def title(self) -> str:
        return f"Sweep of {Path(self.scene).name}"

    def blocks(self) -> Iterator[Block]:
        design = self.design if isinstance(self.design, str) else "a table"
        size = f"{self.bytes_expected / 2**20:.3g} MiB"
        yield f"{self.runs} runs of {Path(self.scene).name}, design {design}, seed {self.seed}; on disk {size}"
        rows = ((self._varies(name), str(of)) for name, of in self.vary.items())
        yield Table(("varies", "distribution"), tuple(rows), wrap=True)
        if self.figures:
            rows = ((heading(self, name), str(figure)) for name, figure in self.figures.items())
            yield Table(("figure", "computed by"), tuple(rows))

    def _varies(self, name: str) -> str:
        """Return a name in `vary` with its unit, or all units of an array with different units."""
        columns = [column for column in self.columns if name in (column, parameter_of(column))]
        units = dict.fromkeys(self.units[column] for column in columns if column in self.units)
        return f"{name} [{' or '.join(units)}]" if units else name


def heading(sweep: Sweep, column: str) -> str:
    """Return the name of a column with its unit, such as "torque [N m]"."""
    return f"{column} [{sweep.units[column]}]" if column in sweep.units else column


def from_scene(path: str | Path, **changes: Any) -> Sweep:
    """Return the sweep in the table `[sweep]` of a scene.

    Args:
        path: Path of the scene.
        **changes: Attributes of `Sweep` that replace those in the table.

    Raises:
        SceneError: If the scene cannot be read.
        SweepError: If the sweep is missing or invalid.
    """
    from robot_dyn.scene import read_both

    part = getattr(read_both(path)[0], "sweep", None)
    table = {} if part is None else part.model_dump(exclude_unset=True)
    for name, text in table.get("figures", {}).items():
        if is_import_path(text):
            raise SweepError(
                f"figures: {name}: {shorten(text)} would run code, but a scene is data; pass it in Python or by"
                " --figure"
            )
    stated = table | changes
    for name, example in (("vary", "kp"), ("figures", "settling")):
        stated[name] = {**table.get(name, {}), **by_name(name, changes.get(name, {}), example)}
    if "runs" not in stated:
        raise SweepError(
            f"{path}: the number of runs is missing; give --runs N (runs=N in Python), or runs = N in the table [sweep]"
        )
    return Sweep(str(path), **stated)


def samples_of_run(setup: Setup) -> int:
    """Return the largest number of samples of a run."""
    if setup.record_every_s:
        return int(setup.duration_s / setup.record_every_s) + 2
    return 1000 if setup.method.controls_error else setup.steps + 1


def parameter_of(column: str) -> str:
    """Return the name in `vary` of a column that is an entry of an array."""
    return column.rpartition("[")[0]


def _varied(name: str, value: Any) -> Distribution:
    try:
        return distribution(value)
    except RobotDynError as error:
        raise SweepError(f"vary: {name}: {error}") from None
