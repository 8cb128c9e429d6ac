"""`Sweep`: what varies in the runs of a scene, how many there are, and which figures of each are kept. A value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn import RobotDynError, Setup, sweepable
from robot_dyn.foundations import Answer, Block, Caching, QueryError, SweepError, Table, Value, integer, shown
from robot_dyn.queries import joint_types_of, unit
from robot_dyn.tools.sweeps.designs import Design, design, given
from robot_dyn.tools.sweeps.distributions import Distribution, distribution
from robot_dyn.tools.sweeps.folder.rows import FIXED, NUMBERS, OUTCOMES, TEXTS
from robot_dyn.tools.sweeps.folder.samples import Samples, samples_of
from robot_dyn.tools.sweeps.imported import imported, path_of
from robot_dyn.tools.sweeps.plan.figures import Figure, figure
from robot_dyn.tools.sweeps.plan.stated import StatedScene

READER = "robot_dyn.scene.scene:read_scene"  # of scenes, a room above: it is named as users' functions are
STARTS = ("q0", "v0")
RESERVED = ("run", *NUMBERS, *TEXTS, "failed", *OUTCOMES)


@final
@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Answer, Value, Caching):
    """Runs 0, …, N − 1 of a setup. Run i is a function of this value and i alone: start, parameters and noise.

    Attributes:
        scene: A scene file, or the import path of a function that returns a `Setup`, such as "my_arm:setup". In a
            sweep that was read from a folder without naming its function: its stored description.
        runs: N.
        vary: Distributions by name: a parameter of `rollouts(params=…)`, "q0" or "v0". A frozen distribution of
            scipy.stats is one, and a text such as "uniform(low=0, high=3)".
        figures: What to keep of each run, by name: `rms_error()`, `peak("u")`, `final("q", joint)`, or a function of a
            `Run` by import path. Texts such as "peak('u')" are figures too.
        design: "random", "sobol", "halton", "latin", "saltelli", "grid"; or rows in [0, 1), (N, d), a column for each
            number that varies.
        seed: Of the design.
        samples: What to keep of the motion: "q", or `samples("q", "u", every=100)`; nothing by default.
        drawn: The rows of the design, (N, d), as a folder keeps them; None to draw them by name and seed.

    Raises:
        SweepError: If an argument is not allowed; names it.
        SceneError: If the scene cannot be read.
    """

    scene: str | StatedScene
    runs: int
    vary: dict[str, Distribution]
    figures: dict[str, Figure] = field(default_factory=dict)
    design: Any = "random"
    seed: int = 0
    samples: Samples | None = None
    drawn: np.ndarray | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "scene", _source(self.scene))
        set_(self, "vary", {name: _varied(name, of) for name, of in _named("vary", self.vary).items()})
        if not self.vary:
            raise SweepError(
                "vary: nothing varies; give distributions by name, such as {'kp': sw.uniform(low=1, high=2)}"
            )
        figures = _named("figures", self.figures)
        if taken := sorted(figures.keys() & {*RESERVED, *self.columns}):
            raise SweepError(f"figures: {taken[0]!r} is the name of another column of a sweep; take another one")
        set_(self, "figures", {name: figure(name, given) for name, given in figures.items()})
        set_(self, "seed", integer("seed", self.seed, most=2**63 - 1, error=SweepError))
        set_(self, "samples", samples_of(self.samples))
        _ = self.points  # refused if the design does not have so many rows
        self._check_names()

    @cached_property
    def setup(self) -> Setup:
        """Return the setup without varied parameters; SweepError for a function that the reader has not named."""
        if isinstance(self.scene, StatedScene):
            self.scene.refuse()
        made = imported(READER)(self.scene) if is_scene(self.scene) else imported(self.scene)()
        if not isinstance(made, Setup):
            raise SweepError(f"{self.scene}: returned {shown(made)}; return a robot_dyn.Setup")
        return made

    @cached_property
    def points(self) -> Design:
        """The design, drawn once."""
        dimensions = sum(each.size for each in self.vary.values())
        if self.drawn is not None and isinstance(self.design, str):
            return given(self.drawn, self.runs, dimensions, self.design)
        return design(self.design, self.runs, dimensions, self.seed)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the numbers that vary: of an array such as "q0", numbered from 0."""
        return tuple(
            name if not each.shape else f"{name}[{k}]"
            for name, each in self.vary.items()
            for k in range(each.shape[0] if each.shape else 1)
        )

    @cached_property
    def units(self) -> dict[str, str]:
        """Units of the columns that have one, by name."""
        if isinstance(self.scene, StatedScene):
            return dict(self.scene.units)
        types = self.joint_types
        of = {each.name: each.unit for each in sweepable(self.setup).parameters}
        of |= {f"{name}[{k}]": unit(name[0], kind) for name in STARTS for k, kind in enumerate(types)}
        varied = {name: of.get(name, of.get(name.rpartition("[")[0], "")) for name in self.columns}
        figures = {name: each.unit(self.setup) for name, each in self.figures.items()}
        fixed = {column.name: column.unit for column in FIXED}
        return {name: text for name, text in (varied | figures | fixed).items() if text}

    @property
    def source(self) -> str:
        """Absolute path of the scene, or import path of its function."""
        return self.scene.path if isinstance(self.scene, StatedScene) else self.scene

    @property
    def joint_types(self) -> tuple[str | None, ...]:
        """Types of the joints, "revolute", "continuous" or "prismatic"; None where the dynamics do not state one."""
        if isinstance(self.scene, StatedScene):
            return self.scene.joint_types
        return tuple(joint_types_of(self.setup.plant.dynamics))

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of the columns of the design, in their order."""
        names = ((name, each.size) for name, each in self.vary.items())
        return tuple(name if size == 1 else f"{name}[{k}]" for name, size in names for k in range(size))

    def values(self, start: int, stop: int) -> dict[str, np.ndarray]:
        """What varies in runs start, …, stop − 1, by name, (k, size); SweepError if there are no such runs."""
        stop = integer("stop", stop, most=self.runs, error=SweepError)
        start = integer("start", start, most=stop, error=SweepError)
        u, first, found = self.points.rows[start:stop], 0, {}
        for name, each in self.vary.items():
            found[name] = each.values(np.ascontiguousarray(u[:, first : first + each.size])).reshape(stop - start, -1)
            first += each.size
        return found

    def _check_names(self) -> None:
        """Raise SweepError if what varies has no name or not the size that the setup knows."""
        if isinstance(self.scene, StatedScene):
            return  # they were checked when the folder was begun
        from robot_dyn.simulation.rollouts.rollouts import batch_of

        n = self.setup.plant.dynamics.n
        for name in (name for name in STARTS if name in self.vary):
            if (size := _width(self.vary[name])) != n:
                raise SweepError(f"vary: {name} has {n} numbers, got a distribution of {size}; give arrays of {n}")
        middle = {name: np.repeat(each.values(np.full((1, each.size), 0.5)).reshape(1, -1), 2, 0)
                  for name, each in self.vary.items() if name not in STARTS}  # fmt: skip
        try:
            batch_of(
                self.setup, None, None, {name: x[:, 0] if x.shape[1] == 1 else x for name, x in middle.items()}, ()
            )
        except QueryError as error:
            raise SweepError(f"vary: {str(error).removeprefix('params: ')}") from None

    @cached_property
    def bytes_expected(self) -> int:
        """What its rows and samples take on disk, at most but for footers and texts."""
        if isinstance(self.scene, StatedScene):
            return self.scene.bytes_expected
        rows = 8 * (len(self.columns) + len(self.figures) + len(NUMBERS)) + 4 * len(TEXTS)
        if self.samples is None or self.samples.failed:
            return self.runs * rows
        numbers = samples_of_run(self.setup) * self.setup.plant.dynamics.n * len(self.samples.names)
        return self.runs * rows + 8 * numbers * -(-self.runs // self.samples.every)

    @property
    def title(self) -> str:
        return f"Sweep of {Path(self.source).name}"

    def blocks(self) -> Iterator[Block]:
        design = self.design if isinstance(self.design, str) else "a table"
        size = f"{self.bytes_expected / 2**20:.3g} MiB"
        yield f"{self.runs} runs of {Path(self.source).name}, design {design}, seed {self.seed}; on disk {size}"
        rows = ((self._varies(name), _text(each.to_dict())) for name, each in self.vary.items())
        yield Table(("varies", "distribution"), tuple(rows), wrap=True)
        if self.figures:
            rows = ((heading(self, name), _text(each.to_dict())) for name, each in self.figures.items())
            yield Table(("figure", "computed by"), tuple(rows))

    def _varies(self, name: str) -> str:
        """A name in `vary` with its unit, each once where those of the numbers of an array differ."""
        columns = [each for each in self.columns if each == name or each.rpartition("[")[0] == name]
        of = dict.fromkeys(self.units[each] for each in columns if each in self.units)
        return f"{name} [{' or '.join(of)}]" if of else name


def heading(sweep: Sweep, column: str) -> str:
    """The name of a column with its unit, as "torque [N m]"."""
    return f"{column} [{sweep.units[column]}]" if column in sweep.units else column


def samples_of_run(setup: Setup) -> int:
    """Number of samples of a run, at most."""
    if setup.record_period_s:
        return int(setup.duration_s / setup.record_period_s) + 2
    return 1000 if setup.integrator.controls_error else setup.steps + 1


def _text(stored: Mapping[str, Any]) -> str:
    """A distribution or figure as users write it."""
    (_, name), *given = stored.items()
    of = [f"{key}={value!r}" for key, value in given if value is not None]
    return name if ":" in str(name) else f"{name}({', '.join(of)})"


def _width(of: Distribution) -> int:
    return of.shape[0] if of.shape else 1


def is_scene(source: str) -> bool:
    """Return True for the path of a scene file, False for an import path."""
    return source.lower().endswith(".toml")


def _source(given: Any) -> str | StatedScene:
    """The absolute path of a scene, or an import path; a stated scene as it is."""
    if isinstance(given, StatedScene):
        return given
    if isinstance(given, Setup):
        raise SweepError(
            "scene: a Setup cannot be made again in another process; give a scene file, or a function that returns the"
            " setup, by import path such as 'my_arm:setup'"
        )
    if isinstance(given, Path) or (isinstance(given, str) and is_scene(given)):
        return str(Path(given).absolute())
    try:
        return path_of(given)
    except SweepError as error:
        raise SweepError(f"scene: {error}") from None


def _named(what: str, given: Any) -> dict[str, Any]:
    if not isinstance(given, Mapping) or not all(isinstance(name, str) and name for name in given):
        raise SweepError(f"{what}: give them by name, as {{'kp': …}}, got {shown(given)}")
    return dict(given)


def _varied(name: str, given: Any) -> Distribution:
    try:
        return distribution(given)
    except RobotDynError as error:
        raise SweepError(f"vary: {name}: {error}") from None
