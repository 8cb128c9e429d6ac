"""`SweepResult`: the rows in the folder of a sweep, and statistics of them with the number of failed runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn import Setup, Trajectory
from robot_dyn.foundations import (
    UNREPORTED,
    Answer,
    Block,
    SweepError,
    Table,
    choice,
    integer,
    nearest,
    needs,
    reported,
    save,
    target,
    truth,
)
from robot_dyn.simulation.rollouts.comparison import Comparison
from robot_dyn.tools.sweeps import statistics
from robot_dyn.tools.sweeps.export import KINDS, inputs_of, write_table
from robot_dyn.tools.sweeps.expression import Expression, Truth
from robot_dyn.tools.sweeps.folder import Folder
from robot_dyn.tools.sweeps.imported import is_scene
from robot_dyn.tools.sweeps.rows import FINISHED, FIXED, NUMBERS, OUTCOMES
from robot_dyn.tools.sweeps.sensitivity import Sensitivity, by_values, saltelli
from robot_dyn.tools.sweeps.specification import specification
from robot_dyn.tools.sweeps.statistics import Estimate
from robot_dyn.tools.sweeps.statistics import text as number_text
from robot_dyn.tools.sweeps.sweep import Sweep, heading
from robot_dyn.tools.sweeps.work import OneByOne, Work

if TYPE_CHECKING:
    import pandas

_SHOWN = 5  # number of listed reasons
_WORST = 10  # number of runs in a report
_PROBABILITIES = (0.05, 0.5, 0.95, 0.99)
_CONDITIONS = "finished", "known"


@final
@dataclass(frozen=True, eq=False, repr=False)
class SweepResult(Answer):
    """The rows of a sweep in its folder.

    Attributes:
        sweep: The sweep.
        folder: The folder with the rows.
    """

    sweep: Sweep = field(metadata=UNREPORTED)
    folder: Folder = field(metadata=UNREPORTED)

    @property
    def path(self) -> Path:
        """Path of the folder."""
        return self.folder.path

    @property
    def missing(self) -> np.ndarray:
        """Indices of missing chunks."""
        return self.folder.missing()

    @property
    def columns(self) -> dict[str, str]:
        """Meanings of the columns of the table, by name; units are in `units`."""
        varied = dict.fromkeys(self.sweep.columns, "value of a varied parameter")
        figures = dict.fromkeys(self.sweep.figures, "figure of the run; nan if it failed")
        fixed = {column.name: column.meaning for column in FIXED}
        return {"run": "number of the run"} | varied | figures | fixed

    def table(self, *names: str) -> dict[str, np.ndarray]:
        """Return columns of all runs, (N,), by their names in `columns`; by default all of them.

        Units are in `units`, and in the headings of saved tables.
        """
        self._check_complete()
        names = names or tuple(self.columns)
        for name in names:
            choice("column", name, tuple(self.columns), error=SweepError)
        table = self.folder.columns(name for name in names if name != "run")
        table["run"] = np.arange(self.sweep.runs)
        return {name: table[name] for name in names}

    def to_pandas(self, *names: str) -> pandas.DataFrame:
        """Return `table` as a `pandas.DataFrame` with the number of the run as its index.

        Args:
            *names: Columns, by default all.

        Raises:
            MissingExtraError: Without pandas: pip install 'robot-dyn[sweeps]'.
            SweepError: If a column is unknown, or chunks are missing.
        """
        frame = needs("pandas", extra="sweeps").DataFrame(self.table(*names))
        return frame.set_index("run") if "run" in frame else frame.rename_axis("run")

    def quantiles(
        self,
        figure: str,
        probabilities: Sequence[float] | float = (0.05, 0.5, 0.95),
        level: float = 0.95,
        condition: str | None = None,
    ) -> tuple[Estimate, ...]:
        """Estimate quantiles of a figure with intervals; a failed run without a value counts as +∞.

        Args:
            figure: Name of the figure, or of another column.
            probabilities: Probabilities of the quantiles, in (0, 1).
            level: Confidence level of the intervals.
            condition: "finished" for finished runs only, "known" for runs with a value only.

        Raises:
            SweepError: If an argument is invalid, or a finished run has no value and `condition` is not "known".
        """
        x, keep, failed = self._values(figure, condition)
        x = np.where(np.isnan(x), np.inf, x)[keep]
        estimates = statistics.quantiles(x, probabilities, level, self._scrambling(keep), failed=failed)
        return tuple(self._named(estimate, figure, condition) for estimate in estimates)

    def probability(self, event: str, level: float = 0.95, condition: str | None = None) -> Estimate:
        """Estimate the probability of an event, such as "diverged | error > 0.1", with an interval.

        Args:
            event: Names of columns and outcomes, numbers, comparisons, | & ! and parentheses. "failed" means that a run
                diverged or raised.
            level: Confidence level of the interval.
            condition: "finished" for finished runs only, "known" for runs in which the event is known only.

        Raises:
            SweepError: If the event is unknown in a run, because a figure has no value.
        """
        self._check_complete()
        truth, failed = self._happened(event), self._failed
        known = truth.certain == truth.possible
        keep = _some(self._included(known, condition), condition)
        if (unknown := ~known & keep).any():
            remedy = f"write 'failed | {event}', or pass condition='finished'"
            if (unknown & ~failed).any():
                remedy = "some finished, but have no figure: pass condition='known'"
            raise SweepError(
                f"{event!r} is unknown in {int(unknown.sum())} runs, such as run {int(unknown.argmax())}: {remedy}"
            )
        count = int((failed & keep).sum())
        estimate = statistics.probability(truth.certain[keep], level, self._scrambling(keep), failed=count)
        return replace(estimate, statistic=f"probability of {event}{_among(condition)}")

    def mean(self, figure: str, level: float = 0.95, condition: str | None = None) -> Estimate:
        """Estimate the mean of a figure, with an interval; runs without a value need `condition`, see `quantiles`."""
        x, keep, failed = self._values(figure, condition, "mean")
        estimate = statistics.mean(x[keep], level, self._scrambling(keep), failed=failed)
        return self._named(estimate, figure, condition)

    def sensitivity(self, figure: str, level: float = 0.95, condition: str | None = None) -> Sensitivity:
        """Compute the sensitivity of a figure to the varying parameters; for `condition`, see `mean`.

        Design "saltelli" gives first-order and total Sobol' indices, other designs rank correlations and PAWN indices.
        """
        level = statistics.check_level(level)
        x, keep, failed = self._values(figure, condition, "sensitivity")
        if self.sweep.points.name == "saltelli":
            scrambling = self.sweep.points.scrambling
            indices = saltelli(x, keep, self.sweep.dimensions, scrambling, level, failed=failed)
        else:
            values = self.folder.columns(self.sweep.columns)
            columns = np.column_stack([values[name] for name in self.sweep.columns])
            indices = by_values(x[keep], columns[keep], self.sweep.columns, failed=failed)
        return replace(indices, figure=heading(self.sweep, figure), condition=condition)

    def worst(self, figure: str, count: int = 5, condition: str | None = None) -> tuple[int, ...]:
        """Return the numbers of the runs with the largest values of a figure; `run(i)` repeats one.

        Runs without a value come first, in their order, unless `condition` excludes them: "finished" excludes failed
        runs, "known" all runs without a value.
        """
        count = integer("count", count, least=1, most=self.sweep.runs, error=SweepError)
        x = self._figure(figure)
        keep = self._included(np.isfinite(x), condition)
        runs, x = np.flatnonzero(keep), x[keep]
        order = np.argsort(-np.where(np.isnan(x), np.inf, x), kind="stable")
        return tuple(runs[order[:count]].tolist())

    def samples(self, *names: str) -> Any:
        """Return the samples of the kept runs as a `xarray.Dataset` over run, t and joint, nan after the end of a run.

        Args:
            *names: Some of the kept quantities; by default all.

        Raises:
            SweepError: If the sweep keeps no samples, or not those of a name, or a file is missing or damaged.
        """
        if self.sweep.samples is None:
            raise SweepError("no samples are kept: give the Sweep samples='q', or sw.samples('q', every=100)")
        self._check_complete()
        kept = self.sweep.samples.columns
        columns = {choice("samples", name, kept, error=SweepError): kept[name] for name in names or kept}
        return self.folder.samples(columns, self.sweep.joint_types)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Save the results in the format of the suffix of `path`, completely or not at all; return the path.

            .csv      table of all runs, with units in the headings; the default without a suffix
            .parquet  the same table, with units and meanings of columns as metadata
            .html     report: distributions, failures over the two strongest parameters, worst runs

        An existing file of the same format is replaced only with `force`; files in the folder of the sweep are never
        replaced. In a .csv, texts that a spreadsheet would compute, such as "=1+1", are prefixed with an apostrophe.

        Raises:
            SweepError: If the suffix is unknown, the sweep is incomplete, or the file exists or cannot be written.
        """
        force = truth("force", force, error=SweepError)
        self._check_complete()
        path = target(path, KINDS, SweepError, inputs_of(self.folder, path), force)
        if path.suffix.lower() == ".html":
            page = self._report()
            return save(path, lambda stream: stream.write(page), SweepError)
        return write_table(self.sweep, self.folder, path)

    def _report(self) -> bytes:
        """Return the report as an HTML page."""
        from robot_dyn.tools.sweeps.report import sections_page

        sections = self._failures(), *map(self._of_figure, self.sweep.figures)
        return sections_page(self.title, (("Runs", "", self.blocks()), *sections)).encode()

    @property
    def _repeat(self) -> str:
        """Python code that repeats a run, without the number of the run."""
        source = "" if is_scene(self.sweep.scene) else f", scene={self.sweep.scene!r}"
        return f"sw.read_sweep({str(self.path)!r}{source}).run"

    def _failures(self) -> tuple[str, str, list[Block]]:
        """Return the section of the report on failed runs."""
        from robot_dyn.tools.sweeps.report import failure_map, strongest

        varied, failed, table = self.sweep.columns, self._failed, self.table()
        blocks, drawing = [*self.probability("failed").blocks()], ""
        if failed.any():
            some = np.flatnonzero(failed)[:_WORST].tolist()
            rows = ((i, str(table["outcome"][i]), str(table["why"][i]), f"{self._repeat}({i})") for i in some)
            blocks.append(Table(("first runs that failed", "outcome", "reason", "repeat it by"), tuple(rows)))
        if failed.any() and len(varied) > 1:
            first, second = (varied[k] for k in strongest(failed, np.column_stack([table[name] for name in varied])))
            headings = heading(self.sweep, first), heading(self.sweep, second)
            drawing = failure_map(headings, [table[first], table[second]], failed)
            blocks.insert(0, "cells without runs are empty, each cross is a failed run")
            blocks.insert(0, f"share of failed runs over {first} and {second}, the two strongest parameters:")
        return "Failures", drawing, blocks

    def _of_figure(self, name: str) -> tuple[str, str, list[Block]]:
        """Return the section of the report on a figure: distribution, quantiles, worst runs, sensitivity."""
        from robot_dyn.tools.sweeps.report import histogram

        label, x = heading(self.sweep, name), self._figure(name)
        condition = "known" if (np.isnan(x) & ~self._failed).any() else None
        quantiles = self.quantiles(name, _PROBABILITIES, condition=condition)
        rows = tuple((x.statistic, *map(number_text, (x.estimate, x.low, x.high))) for x in quantiles)
        first, finite = quantiles[0], x[np.isfinite(x)]
        numbers = "estimate", f"{100 * first.level:g} % interval from", "to"
        worst = self.worst(name, min(_WORST, len(x)), condition="known")
        blocks: list[Block] = [
            Table(("", *numbers), rows, right=numbers),
            f"{first.n} runs, {first.failed} failed",
            Table(
                ("worst runs that finished", label, "repeat it by"),
                tuple((i, float(x[i]), f"{self._repeat}({i})") for i in worst),
            ),
        ]
        try:
            blocks += self.sensitivity(name, condition="known").blocks()
        except SweepError as error:  # the figure is the same in all runs
            blocks.append(f"no sensitivity: {error}")
        return label, histogram(label, finite) if len(finite) else "", blocks

    def run(self, i: int) -> Trajectory:
        """Repeat run i, recording all quantities of rollouts; the bits are the same.

        Raises:
            SweepError: If the run does not exist, or raised an error; with the reason.
        """
        return Work(self.sweep).run(integer("run", i, most=self.sweep.runs - 1, error=SweepError))

    def setup_of(self, i: int) -> Setup:
        """Return the setup of run i, for example for `rd.simulate` with an error estimate; for errors, see `run`."""
        return Work(self.sweep).setup_of(integer("run", i, most=self.sweep.runs - 1, error=SweepError))

    def verify(self) -> str:
        """Read every file, and return the digest of all rows, which is equal for all folders of the same sweep.

        Raises:
            SweepError: If a file is missing, damaged or was changed.
        """
        self._check_complete()
        return self.folder.digest_of_rows()

    @property
    def processors(self) -> dict[str, int]:
        """Number of chunks by processor, whose features decide the last bits of rows; "portable" counts as one."""
        count = Counter[str]()
        for chunk in np.flatnonzero(self.folder.present()).tolist():
            footer = self.folder.footer(chunk)
            features = sha256(str(footer.get("features")).encode()).hexdigest()[:8]
            count[footer.get("bits") or f"{footer.get('processor')} (features {features})"] += 1
        return dict(count)

    @reported
    def status(self) -> dict[str, int]:
        """Numbers of runs, chunks and missing chunks."""
        return {"runs": self.sweep.runs, "chunks": self.folder.count, "missing": len(self.missing)}

    @reported
    def specification(self) -> dict[str, object]:
        """Contents of `specification.json` in the folder: setup, `vary`, `figures`, `design`, `seed`, versions."""
        return specification(self.sweep, self.folder.chunk).model_dump(mode="json")

    @reported
    def units(self) -> dict[str, str]:
        """Units of columns that have one, by name."""
        return self.sweep.units

    @reported
    def outcomes(self) -> dict[str, int] | None:
        """Number of runs by outcome; None if chunks are missing."""
        if len(self.missing):
            return None
        outcome = self.folder.columns(("outcome",))["outcome"]
        return {name: int((outcome == name).sum()) for name in OUTCOMES}

    @reported
    def remarks(self) -> dict[str, int] | None:
        """Number of runs by remark, see `Rollouts.remarks`, by frequency; None if chunks are missing."""
        if len(self.missing):
            return None
        count = Counter[str]()
        for texts, runs in Counter(self.folder.columns(("remarks",))["remarks"].tolist()).items():
            count.update(dict.fromkeys(filter(None, texts.split("; ")), runs))
        return dict(count.most_common())

    @reported
    def comparison(self) -> Comparison | None:
        """Difference of cut from uncut runs, for some runs; None if the sweep is cut."""
        return self.folder.comparison() if self.sweep.uncut else None

    @reported
    def one_by_one(self) -> OneByOne:
        """Runs simulated one by one, not in lock step, and their time."""
        return self.folder.one_by_one()

    def reasons(self) -> dict[str, int]:
        """Return the number of failed runs by reason, most frequent first."""
        return dict(Counter(self.folder.columns(("reason",))["reason"][self._failed].tolist()).most_common())

    @property
    def title(self) -> str:
        return self.sweep.title

    def blocks(self) -> Iterator[Block]:
        yield from self.sweep.blocks()
        if len(missing := self.missing):
            yield f"{len(missing)} of {self.folder.count} chunks are missing: sw.run(sweep, {str(self.path)!r})"
            return
        yield ", ".join(f"{count} {name}" for name, count in (self.outcomes or {}).items())
        if len(processors := self.processors) > 1:
            yield f"rows of several processors, whose last bits may differ: {', '.join(processors)}"
        if self.sweep.uncut:
            compared = self.folder.comparison()
            yield f"uncut: steps pass thresholds; {compared or 'not compared yet, sw.run(sweep, folder) does that'}"
        alone = self.folder.one_by_one()
        if alone.runs:
            remedy = ""
            if alone.runs_s < alone.all_s:  # the others were in lock step
                remedy = "; with uncut=True, runs that pass a threshold stay in lock step"
            count = "1 run was" if alone.runs == 1 else f"{alone.runs} runs were"
            yield f"{count} made one by one, in {alone.runs_s:.2g} s of {alone.all_s:.2g} s over all threads{remedy}"
        reasons, why = self.folder.columns(("reason", "why")).values()
        for reason, count in list(self.reasons().items())[:_SHOWN]:
            yield f"{count} times {reason}, first: {why[self._failed & (reasons == reason)][0]}"
        for text, count in (self.remarks or {}).items():
            yield f"remark on {count} of {self.sweep.runs} runs: {text}"
        yield "rd.simulate(done.setup_of(i)) repeats run i, with an error estimate and its energy ledger"

    def _check_complete(self) -> None:
        if len(missing := self.missing):
            raise SweepError(
                f"{self.path}: {len(missing)} of {self.folder.count} chunks are missing, the first is {missing[0]};"
                " run the sweep again to compute them"
            )

    def _figure(self, name: str) -> np.ndarray:
        """Return a figure or a varying number for all runs, (N,); nan if a run has no value."""
        self._check_complete()
        names = (*self.sweep.figures, *self.sweep.columns, *NUMBERS)
        return self.folder.columns((choice("figure", name, names, error=SweepError),))[name]

    @property
    def _failed(self) -> np.ndarray:
        """True for runs that diverged or raised an error, (N,)."""
        return self.folder.columns(("outcome",))["outcome"] != FINISHED

    def _happened(self, event: str) -> Truth:
        """Evaluate an event in each run; raise a SweepError if it is invalid, or a name is unknown."""
        expression = Expression(event)
        numbers, outcomes = {*self.sweep.figures, *self.sweep.columns, *NUMBERS}, {*OUTCOMES, "failed"}
        for name in expression.names:
            if name not in numbers | outcomes:
                raise SweepError(f"no column {name!r}; {nearest(name, sorted(numbers | outcomes))}")
        columns = self.folder.columns((*numbers.intersection(expression.names), "outcome"))
        outcome = columns.pop("outcome")
        columns |= {name: outcome == name for name in OUTCOMES} | {"failed": outcome != FINISHED}
        return expression.evaluate(columns)

    def _included(self, known: np.ndarray, condition: str | None) -> np.ndarray:
        """Return True for included runs, (N,): all, finished ones, or finished ones with a known value."""
        if condition is None:
            return np.ones(len(known), bool)
        return known if choice("condition", condition, _CONDITIONS, error=SweepError) == "known" else ~self._failed

    def _values(self, name: str, condition: str | None, finite: str = "") -> tuple[np.ndarray, np.ndarray, int]:
        """Return a figure of all runs, the included runs, and the number of failed runs.

        Args:
            name: Name of the figure.
            condition: Condition on runs; see `quantiles`.
            finite: Name of a statistic that needs finite values; or empty.

        Raises:
            SweepError: If an included run finished without a value, or its value must be finite and is not.
        """
        x, failed = self._figure(name), self._failed
        unknown = np.isnan(x)
        keep = _some(self._included(~unknown, condition), condition)
        if (none := keep & unknown & ~failed).any():
            raise SweepError(
                f"{name!r} has no value in {int(none.sum())} runs that finished, such as run {int(none.argmax())}: pass"
                " condition='known', which omits them"
            )
        if finite and (lost := int((keep & unknown).sum())):
            raise SweepError(
                f"{lost} of {len(x)} runs failed: pass condition='finished' for the {finite} of finished runs, or"
                " condition='known' for that of runs with a value"
            )
        if finite and (infinite := keep & np.isinf(x)).any():
            raise SweepError(
                f"{name!r} is infinite in {int(infinite.sum())} runs, such as run {int(infinite.argmax())}: it has no"
                f" {finite}; quantiles and probabilities count it"
            )
        return x, keep, int((failed & (keep if condition is None else ~keep)).sum())

    def _named(self, estimate: Estimate, figure: str, condition: str | None) -> Estimate:
        """Add the figure, its unit and the condition on runs to the name of an estimate."""
        return replace(estimate, statistic=f"{estimate.statistic} of {heading(self.sweep, figure)}{_among(condition)}")

    def _scrambling(self, keep: np.ndarray) -> np.ndarray | None:
        """Return the scrambling of each included run; None for independent runs."""
        design = self.sweep.points
        return None if design.independent else design.scrambling[keep]


def _some(keep: np.ndarray, condition: str | None) -> np.ndarray:
    """Return the included runs; raise a SweepError if there are none."""
    if not keep.any():
        raise SweepError(f"no run is left with condition={condition!r}; remove it, or see the reasons of failure")
    return keep


def _among(condition: str | None) -> str:
    return "" if condition is None else f" given {condition}"
