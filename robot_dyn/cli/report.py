"""Reports on robots, comparisons and runs: documents for --json (docs/reference/json.md), and tables of text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypedDict

import numpy as np

from robot_dyn.codegen.store.cache import Entry
from robot_dyn.cross_check.agreement import Comparison, marked
from robot_dyn.cross_check.compare import compare
from robot_dyn.effects.plant_state import PlantState, plant_state
from robot_dyn.foundations.answer import Table
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.validate import choice
from robot_dyn.model.robot import Robot, info
from robot_dyn.queries.dynamics import QUANTITIES
from robot_dyn.queries.units import numbers_row
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.doubts import Doubt
from robot_dyn.simulation.results.ledger import largest
from robot_dyn.simulation.results.statistics import Accuracy, Statistics
from robot_dyn.simulation.results.trajectory import Trajectory

Document = dict[str, Any]


class ComparisonDocument(TypedDict):
    """Comparisons of several robots.

    Attributes:
        ok: True if the implementations agree for every robot.
        robots: Comparison of each robot, by name.
        refused: With `--all`, reason for each robot that does not load, by name.
    """

    ok: bool
    robots: dict[str, Comparison]
    refused: dict[str, str]


def comparison(results: Sequence[tuple[str, Comparison]], refused: dict[str, str]) -> ComparisonDocument:
    """Return the comparisons by name, and the refused robots."""
    return {"ok": all(result.ok for _, result in results), "robots": dict(results), "refused": refused}


class CacheDocument(TypedDict):
    """The cache of compiled kernels.

    Attributes:
        folder: Folder of the kernels; None if there is no cache.
        removed: Number of kernels removed by `--clear`.
        bytes: Total size, in [bytes].
        kernels: The kernels.
    """

    folder: str | None
    removed: int
    bytes: int
    kernels: list[Entry]


class RunDocument(TypedDict):
    """Outcome, cost and accuracy of a run.

    Attributes:
        ending: "finished", "diverged" or "stopped".
        t: Time of the end, in [s].
        reason: Reason of the end, see [why did my run end](../explanation/why_did_my_run_end.md).
        joint: Joint that the reason names; empty if there is none.
        facts: Numbers and names that explain the reason.
        text: The reason in a sentence, with a remedy; empty if the run reached its duration.
        samples: Number of samples.
        acting: Gravity, payloads, effects, limits and control, in words; None if the run file lacks them.
        joints: Names of the joints.
        q, v: State at the end.
        work: Work of the control and of each effect without a potential, in [J], by name.
        ledger_residual: Largest unexplained energy, in [J].
        ledger_closure: Largest unexplained energy, as a fraction of the energy exchanged.
        ledger_doubt: Reason why the ledger does not close; None if it closes.
        error_largest: Largest estimated error of q; None without an estimate, or if it ends before the run.
        error_until_s: Time until which the estimate holds, in [s]; None without an estimate.
        error_verdict: "order seen", "bounded" or "none"; None without an estimate.
        error_doubts: Reasons why the estimate ends early, and why the order does not show.
        rms_tracking_error: Root mean square of q_d − q, or of the frame's distance in [m]; None without a reference.
        accuracy: The requested accuracy and its cost; None if none was requested.
        remarks: Observations at the ends of all steps.
        extremes: "least" and "largest" values of "q", "v" and "u", by joint; None if not observed.
        statistics: Steps, evaluations and times.
    """

    ending: str
    t: float
    reason: str
    joint: str
    facts: Mapping[str, object]
    text: str
    samples: int
    acting: tuple[str, ...] | None
    joints: tuple[str, ...]
    q: np.ndarray
    v: np.ndarray
    work: dict[str, float]
    ledger_residual: float
    ledger_closure: float
    ledger_doubt: Doubt | None
    error_largest: float | None
    error_until_s: float | None
    error_verdict: str | None
    error_doubts: list[Doubt]
    rms_tracking_error: float | None
    accuracy: Accuracy | None
    remarks: list[Remark]
    extremes: dict[str, dict[str, np.ndarray]] | None
    statistics: Statistics


def run(trajectory: Trajectory) -> RunDocument:
    """Return the outcome, the cost and the accuracy of a run; samples are in its run file."""
    error, outcome = trajectory.error, trajectory.outcome
    return {
        "ending": outcome.ending,
        "t": outcome.t,
        "reason": outcome.reason,
        "joint": outcome.joint,
        "facts": outcome.facts,
        "text": outcome.text,
        "samples": len(trajectory.t),
        "acting": trajectory.acting,
        "joints": trajectory.joint_names,
        "q": trajectory.q[-1],
        "v": trajectory.v[-1],
        "work": {name: work[-1] for name, work in trajectory.ledger.work.items()},
        "ledger_residual": largest(np.abs(trajectory.ledger.residual)),
        "ledger_closure": trajectory.ledger.closure,
        "ledger_doubt": trajectory.ledger.cause,
        "error_largest": None if error is None else error.largest,
        "error_until_s": None if error is None else error.until_s,
        "error_verdict": None if error is None else error.verdict,
        "error_doubts": [] if error is None else [x for x in (error.ends_early, error.no_order) if x],
        "rms_tracking_error": trajectory.rms_tracking_error,
        "accuracy": trajectory.accuracy,
        "remarks": [*trajectory.remarks],
        "extremes": _extremes(trajectory),
        "statistics": trajectory.statistics,
    }


def _extremes(trajectory: Trajectory) -> Document | None:
    """Return the smallest and largest value of each quantity over all steps, by joint."""
    if trajectory.extremes is None:
        return None
    return {
        name: {"least": least, "largest": largest}
        for name, (least, largest) in zip(("q", "v", "u"), trajectory.extremes, strict=True)
    }


# --- the same as text


def comparison_tables(results: Sequence[tuple[str, Comparison]], refused: dict[str, str]) -> Iterator[Any]:
    """Yield the table of one robot, or one line for each of several robots with the worst quantity."""
    agreed = f"{sum(result.ok for _, result in results)} of {len(results)} agree"
    if len(results) == 1:
        yield from results[0][1].blocks()
        yield agreed
        return
    rows = tuple(
        (name, of.n, marked(of.ok, x.error), f"{x.tolerance:.1e}", x.quantity, x.entry)
        for name, of, x in ((name, result, result.worst) for name, result in results)
    )
    headings = ("robot", "n", "worst error", "allowed", "quantity", "where")
    yield Table(headings, rows, right=headings[2:4])
    notes = ((name, note) for name, result in results for note in result.notes)
    yield from (f"{name}: {note}" for name, note in notes if "forward" in note or "yourdfpy" in note)
    yield from (f"{name} refused: {why}" for name, why in refused.items())
    yield agreed
    if results:
        name, result = max(results, key=lambda pair: pair[1].worst.tolerance_fraction)
        worst = result.worst
        yield f"worst: {name}, {worst.quantity}, {worst.error:.2e} of {worst.tolerance:.1e} allowed, at {worst.entry}"
        if not result.ok:
            yield from (f"  {key} = {numbers_row(x)}" for key, x in worst.state.items())


def formulations(robot: Robot) -> Document:
    """Return the number of instructions of each formulation by quantity, and the compiled formulation."""
    from robot_dyn.codegen.dynamics import CompiledDynamics
    from robot_dyn.codegen.trace import trace

    compiled = CompiledDynamics(robot)
    quantities = {name: {"served_by": compiled.served_by(name)} for name in trace.QUANTITIES}
    return {name: row | {"instructions": compiled.instructions.get(name, {})} for name, row in quantities.items()}


def queries(state: PlantState, names: Sequence[str], frame: str | None) -> Document:
    """Return the answers of the rigid bodies at a state to queries of the table, by name.

    Raises:
        QueryError: If there is no such query or frame, a query lacks its frame, or no query uses the frame.
    """
    framed = [name for name, quantity in QUANTITIES.items() if quantity.framed]
    if frame is not None and not set(names) & set(framed) and set(names) <= set(QUANTITIES):
        raise QueryError(f"--frame has no effect without --quantity {', '.join(framed[:-1])} or {framed[-1]}")
    answers = {}
    for name in names:
        quantity = QUANTITIES[choice("quantity", name, QUANTITIES)]
        frames = [frame] if quantity.framed and frame else []
        if quantity.framed and not frames:
            raise QueryError(f"{name} needs a frame; add --frame LINK")
        answers[name] = quantity.evaluate(state.plant.dynamics, vars(state), *frames)
    return answers


def query_lines(answers: Document, joints: Sequence[str], types: Sequence[str]) -> Iterator[str]:
    """Return the lines of these answers: a heading with its unit, and a row for each joint or row of a matrix."""
    for name, answer in answers.items():
        quantity = QUANTITIES[name]
        yield ""
        yield f"{name}, {quantity.description.removesuffix('.')} [{' or '.join(quantity.units(types))}]:"
        rows = np.asarray(answer).reshape(np.shape(answer)[0] if np.ndim(answer) else 1, -1)
        labels = joints if quantity.axes[:1] == ("n",) else ("",) * len(rows)
        yield from (f"  {numbers_row(row)}  {label}".rstrip() for row, label in zip(rows, labels, strict=True))


def formulation_table(answer: Document) -> Iterator[Any]:
    """Yield the table of `formulations`."""
    rows = []
    for name, row in answer.items():
        counts = dict(row["instructions"])
        served = counts.pop(row["served_by"], None)
        others = ", ".join(f"{implementation} {count}" for implementation, count in counts.items())
        rows.append((name, row["served_by"], "" if served is None else str(served), others))
    yield "compiled"
    headings = ("quantity", "served by", "instructions", "others")
    yield Table(headings, tuple(rows), right=("instructions",), wrap=True)


def demo_tables(robot: Robot) -> Iterator[Any]:
    """Yield a robot, its dynamics at a general state, and the cross-check."""
    yield info(robot)
    q, v, a = np.round(np.random.default_rng(7).uniform(-1, 1, (3, robot.n)), 2)
    yield ""
    yield "M(q) a + C(q, v) v + N(q) = τ at a general state"
    yield ""
    yield plant_state(robot, q, v, a)
    yield ""
    yield from comparison_tables([(robot.name, compare(robot, samples=20))], {})
