"""Reports on robots, comparisons and runs: documents for --json (docs/json.md), and the same as tables of text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from robot_dyn.cli.state_report import query, query_tables
from robot_dyn.cli.terminal import numbers_row, or_dash, table
from robot_dyn.cross_check.compare import Comparison, compare
from robot_dyn.effects.plant import Plant
from robot_dyn.model.gravity import gravity_acts, no_torque
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.results.ledger import largest
from robot_dyn.simulation.results.trajectory import Trajectory

Document = dict[str, Any]
_WORDS = ("quantity", "robot", "where")


def info(robot: Robot) -> Document:
    """A robot's joints, couplings, mass and findings."""
    columns = ("lower", "upper", "effort_limit", "velocity_limit", "damping", "friction", "armature")
    values = np.column_stack([getattr(robot, column) for column in columns])
    joints = [
        {"name": name, "kind": kind} | dict(zip(columns, row, strict=True))
        for name, kind, row in zip(robot.joint_names, robot.joint_types, values, strict=True)
    ]
    return {
        "robot": robot.name,
        "source": robot.description.source,
        "n": robot.n,
        "total_mass": robot.total_mass,
        "gravity": robot.edits.gravity,
        "gravity_acts": gravity_acts(robot),
        "joints": joints,
        "couplings": _couplings(robot),
        "locked": dict(robot.edits.lock),
        "links": robot.frame_names,
        "findings": robot.findings,
    }


def comparison(results: Sequence[tuple[str, Comparison]], refused: dict[str, str]) -> Document:
    """Comparisons by name, and what was refused."""
    return {"ok": all(result.ok for _, result in results), "robots": dict(results), "refused": refused}


def run(trajectory: Trajectory) -> Document:
    """How a run ended, what it took and how far to trust it; samples are in its run file."""
    error, outcome = trajectory.error, trajectory.outcome
    return {
        "ending": outcome.ending,
        "t": outcome.t,
        "advice": outcome.advice,
        "samples": len(trajectory.t),
        "acting": trajectory.acting,
        "joints": trajectory.joint_names,
        "q": trajectory.q[-1],
        "v": trajectory.v[-1],
        "work": {name: work[-1] for name, work in trajectory.ledger.work.items()},
        "ledger_residual": largest(np.abs(trajectory.ledger.residual)),
        "ledger_closure": trajectory.ledger.closure,
        "error": None if error is None else error.final,
        "error_resolved_until": None if error is None else error.resolved_until,
        "error_verdict": None if error is None else error.verdict,
        "error_note": None if error is None else error.note or error.reason,
        "tracking_error": trajectory.tracking_error,
        "accuracy": trajectory.accuracy,
        "remarks": trajectory.remarks,
        "extremes": _extremes(trajectory),
        "statistics": trajectory.statistics,
    }


def _extremes(trajectory: Trajectory) -> Document | None:
    """The least and the largest of each quantity over all steps, by joint."""
    if trajectory.extremes is None:
        return None
    return {
        name: {"least": least, "largest": largest}
        for name, (least, largest) in zip(("q", "v", "u"), trajectory.extremes, strict=True)
    }


# --- the same as text


def info_tables(robot: Robot) -> Iterator[Any]:
    """`info` as text and a table."""
    document = info(robot)
    yield f"{robot.name}: {robot.n} joints, {robot.total_mass:.4g} kg, gravity {robot.edits.gravity} m/s²"
    yield document["source"]
    if not document["gravity_acts"]:
        yield no_torque(robot.edits.gravity)
    headings = ("joint", "kind", "lower", "upper", "effort", "velocity", "damping", "dry friction", "armature")
    stated = (list(joint.values()) for joint in document["joints"])
    rows = [[name, kind, *(or_dash(x, 4) for x in limits)] for name, kind, *limits in stated]
    yield table(headings, rows, words=headings[:2])
    yield "units: rad and N m for a joint that turns, m and N for one that slides; — is not stated"
    for each in document["couplings"]:
        yield f"coupled: {each['joint']} = {each['multiplier']:g} · {each['source']} + {each['offset']:g}"
    for name, value in document["locked"].items():
        yield f"locked: {name} = {value:g}"
    for finding in robot.findings:
        yield f"finding: {finding}"


def comparison_tables(results: Sequence[tuple[str, Comparison]], refused: dict[str, str]) -> Iterator[Any]:
    """One robot quantity by quantity, or several a line each with the worst."""
    if len(results) == 1:
        ((_, result),) = results
        yield f"{result.robot}: Pinocchio and the own Lagrangian at {result.samples} random states"
        rows = [
            [x.quantity, _mark(x.ok, x.error), f"{x.tolerance:.1e}", x.entry, f"{x.pinocchio:.16g}", f"{x.own:.16g}"]
            for x in result.agreements
        ]
        yield table(("quantity", "worst error", "allowed", "where", "Pinocchio", "own"), rows, words=_WORDS)
        yield from result.notes
    else:
        rows = [
            [name, str(of.n), _mark(of.ok, x.error), f"{x.tolerance:.1e}", x.quantity, x.entry]
            for name, of, x in ((name, result, result.worst) for name, result in results)
        ]
        yield table(("robot", "n", "worst error", "allowed", "quantity", "where"), rows, words=_WORDS)
        notes = ((name, note) for name, result in results for note in result.notes)
        yield from (f"{name}: {note}" for name, note in notes if "forward" in note or "yourdfpy" in note)
        yield from (f"{name} refused: {why}" for name, why in refused.items())
    agreed = sum(result.ok for _, result in results)
    yield f"{agreed} of {len(results)} agree"
    if results:
        name, result = max(results, key=lambda pair: pair[1].worst.share)
        worst = result.worst
        yield f"worst: {name}, {worst.quantity}, {worst.error:.2e} of {worst.tolerance:.1e} allowed, at {worst.entry}"
        if not result.ok:
            yield from (f"  {key} = {numbers_row(x)}" for key, x in worst.state.items())


def formulations(robot: Robot) -> Document:
    """For each quantity the instructions of each formulation, and the one that is compiled."""
    from robot_dyn.codegen.dynamics import CompiledDynamics
    from robot_dyn.codegen.trace.trace import QUANTITIES

    compiled = CompiledDynamics(robot)
    quantities = {name: {"served_by": compiled.served_by(name)} for name in QUANTITIES}
    return {name: row | {"instructions": compiled.instructions.get(name, {})} for name, row in quantities.items()}


def formulation_table(answer: Document) -> Iterator[Any]:
    """`formulations` as a table."""
    rows = []
    for name, row in answer.items():
        counts = dict(row["instructions"])
        served = counts.pop(row["served_by"], None)
        others = ", ".join(f"{implementation} {count}" for implementation, count in counts.items())
        rows.append([name, row["served_by"], "" if served is None else str(served), others])
    yield "compiled"
    headings = ("quantity", "served by", "instructions", "others")
    yield table(headings, rows, words=("quantity", "served by", "others"), wrap=True)


def demo_tables(robot: Robot) -> Iterator[Any]:
    """A robot, its dynamics at a general state, and the cross-check."""
    yield from info_tables(robot)
    q, v, a = np.round(np.random.default_rng(7).uniform(-1, 1, (3, robot.n)), 2)
    yield ""
    yield "M(q) a + C(q, v) v + N(q) = tau at a general state"
    yield ""
    yield from query_tables(query(Plant(robot), q, v, a, None))
    yield ""
    yield from comparison_tables([(robot.name, compare(robot, samples=20))], {})


def _couplings(robot: Robot) -> list[Document]:
    """Joints that follow another one, as the file states them."""
    return [
        {
            "joint": joint.get("name"),
            "source": mimic.get("joint"),
            "multiplier": float(mimic.get("multiplier")),
            "offset": float(mimic.get("offset")),
        }
        for joint in robot.description.element.iterfind("joint[mimic]")
        if joint.get("name") in robot.model.names[1:] and (mimic := joint.find("mimic")) is not None
    ]


def _mark(ok: bool, error: float) -> str:
    return f"{error:.1e}" if ok else f"{error:.1e}  DISAGREE"
