"""What the command line says: plain documents for --json (docs/json.md), and the same as tables for a person."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite
from typing import Any, cast

import numpy as np

from robot_dyn.cli.terminal import table
from robot_dyn.coefficients import declared, with_values
from robot_dyn.cross_check.compare import Comparison, compare
from robot_dyn.effects.effect import Force
from robot_dyn.effects.hold import Hold
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import QueryError, nearest
from robot_dyn.lagrange.breakdown import breakdown
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.model.gravity import gravity_acts, no_torque
from robot_dyn.model.robot import Robot
from robot_dyn.queries.quantity import PLANT, C, M
from robot_dyn.queries.units import coefficient_texts, unit, units
from robot_dyn.simulation.dynamics.state_equation import numbered
from robot_dyn.simulation.results.ledger import largest
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.validate import joint_values

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


def query(plant: Plant, q: np.ndarray, v: np.ndarray, a: np.ndarray, tau: np.ndarray | None) -> Document:
    """M, C, N and the effects of a plant of a robot at t = 0; tau from a, or a from tau where tau is given."""
    robot: Any = plant.dynamics
    held: tuple[Hold, ...] = ()
    if tau is None:
        tau = plant.inverse_dynamics(0.0, q, v, a)
    else:
        tau = plant.actuation(joint_values("tau", tau, robot.joint_names))
        a, held = plant.forward_dynamics(0.0, q, v, tau), plant.held(0.0, q, v, tau)
    torques = plant.equation_of_motion.torques(0.0, q, v, q.shape)
    acting = dict(zip(_names(plant), torques, strict=True))
    state = {"q": q, "v": v, "a": a, "tau": tau}
    terms = {each.name: each.ask(plant, state | {"t": 0.0}) for each in (M, C, PLANT["N"])}
    return {
        "robot": robot.name,
        "gravity": robot.edits.gravity,
        "gravity_acts": gravity_acts(robot),
        "joints": robot.joint_names,
        "types": robot.joint_types,
        **state,
        **terms,
        "effects": acting,
        "held": held,
    }


def why(plant: Plant, answer: Document, joint: str) -> Document:
    """One joint's torque in an answer of `query`, split by link and cause.

    Raises:
        QueryError: If the joint is unknown.
    """
    joints, robot = answer["joints"], cast(Robot, plant.dynamics)
    if joint not in joints:
        raise QueryError(f"--why: no joint {joint!r}; {nearest(joint, joints)}")
    i = joints.index(joint)
    q, v, a = (np.array(answer[name]) for name in "qva")
    shares = [
        {"source": part.source, "inertia": part.M[i] @ a, "coriolis": part.C[i] @ v, "gravity": float(part.N[i])}
        for part in breakdown(Lagrangian(robot), q, v)
    ]
    torques = {name: 0.0 - torque[i] for name, torque in answer["effects"].items()}
    named = zip(_names(plant), plant.forces, strict=True)
    kind = answer["types"][i : i + 1]
    numbers = {name: list(coefficient_texts(_at(force, i), kind).values()) for name, force in named}
    needed = sum(each["inertia"] + each["coriolis"] + each["gravity"] for each in shares) + sum(torques.values())
    at_rest = answer["tau"][i] - needed if v[i] == 0 and _holding(plant) else 0.0
    share = {"joint": joint, "tau": answer["tau"][i], "unit": unit("tau", answer["types"][i])}
    parts = {"shares": shares, "effects": torques, "at_rest": float(at_rest), "coefficients": numbers}
    return {"why": share | parts}


def _holding(plant: Plant) -> list[str]:
    """Names of the effects that may hold joints."""
    return [each.name for each in plant.equation_of_motion.set_valued if each.rubs or each.stops]


def _names(plant: Plant) -> tuple[str, ...]:
    """Of its forces; a second one of a name gets a number."""
    return numbered(*(force.name for force in plant.forces))


def _at(force: Force, i: int) -> Force:
    """A force as it is at one joint."""
    numbers = {name: getattr(force, name) for name, each in declared(type(force)).items() if each.of_joints}
    return with_values(force, {name: x[i] if np.ndim(x) else x for name, x in numbers.items()})


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


# --- the same for a person


def info_tables(robot: Robot) -> Iterator[Any]:
    """`info` as text and a table."""
    document = info(robot)
    yield f"{robot.name}: {robot.n} joints, {robot.total_mass:.4g} kg, gravity {robot.edits.gravity} m/s²"
    yield document["source"]
    if not document["gravity_acts"]:
        yield no_torque(robot.edits.gravity)
    headings = ("joint", "kind", "lower", "upper", "effort", "velocity", "damping", "dry friction", "armature")
    stated = (list(joint.values()) for joint in document["joints"])
    rows = [[name, kind, *(_stated(x, 4) for x in limits)] for name, kind, *limits in stated]
    yield table(headings, rows, words=headings[:2])
    yield "units: rad and N m for a joint that turns, m and N for one that slides; — is not stated"
    for each in document["couplings"]:
        yield f"coupled: {each['joint']} = {each['multiplier']:g} · {each['source']} + {each['offset']:g}"
    for name, value in document["locked"].items():
        yield f"locked: {name} = {value:g}"
    for finding in robot.findings:
        yield f"finding: {finding}"


def query_tables(answer: Document) -> Iterator[Any]:
    """`query` and `why` as text."""
    joints = answer["joints"]
    for name in ("q", "v", "a", "tau"):
        yield f"{name:4}{_row(answer[name])}  [{units(name, answer['types'])}]"
    force = units("tau", answer["types"])
    of_M = {"N m": "kg m²", "N": "kg"}.get(force, "kg m², kg m, kg")
    of_C = {"N m": "N m s/rad", "N": "N s/m"}.get(force, "rows times v: N m, N")
    meanings = (("M", "mass matrix", of_M), ("C", "Coriolis matrix", of_C), ("N", "gravity and effects", force))
    for name, meaning, of_entries in meanings:
        yield ""
        yield f"{name}, {meaning} [{of_entries}]:"
        rows = answer[name] if name != "N" else [[x] for x in answer[name]]
        yield from (f"  {_row(row)}  {joint}" for row, joint in zip(rows, joints, strict=True))
    if not answer["gravity_acts"]:
        yield ""
        yield f"{no_torque(tuple(answer['gravity']))} without effects"
    yield from _held_table(answer)
    if "why" in answer:
        yield from _why_tables(answer["why"])


def _held_table(answer: Document) -> Iterator[Any]:
    """The joints that are held, each with its load and what it would bear."""
    if not answer["held"]:
        return
    yield ""
    yield f"held at rest [{units('tau', answer['types'])}]:"
    headings = ("joint", "from", "load", "slides below", "slides above", "margin")
    rows = ([x.joint, ", ".join(x.by), *map(_stated, (x.load, x.least, x.most, x.margin))] for x in answer["held"])
    yield table(headings, rows, words=headings[:2])


def _why_tables(why: Document) -> Iterator[Any]:
    yield ""
    yield f"why {why['joint']} needs {why['tau']:.6g} {why['unit']}:"
    rows = [(s["source"], s["inertia"], s["coriolis"], s["gravity"], 0.0) for s in why["shares"]]
    named = {effect: ", ".join((effect, *numbers)) for effect, numbers in why["coefficients"].items()}
    rows += [(named[effect], 0.0, 0.0, 0.0, torque) for effect, torque in why["effects"].items()]
    rows += [("dry friction and stops, at rest", 0.0, 0.0, 0.0, why["at_rest"])] if why["at_rest"] else []
    inertia, coriolis, gravity, effect = (sum(column) for column in list(zip(*rows, strict=True))[1:])
    rows.append(("sum", inertia, coriolis, gravity, effect))
    cells = ([source, *(f"{x:.6g}" for x in [*terms, sum(terms)])] for source, *terms in rows)
    yield table(("from", "inertia", "Coriolis", "gravity", "effect", "sum"), cells, words=("from",))


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
            yield from (f"  {key} = {_row(x)}" for key, x in worst.state.items())


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


def _stated(x: float, digits: int = 6) -> str:
    """A number, unless it is unlimited."""
    return f"{x:.{digits}g}" if isfinite(x) else "—"


def _mark(ok: bool, error: float) -> str:
    return f"{error:.1e}" if ok else f"{error:.1e}  DISAGREE"


def _row(numbers: Sequence[float]) -> str:
    return " ".join(f"{x:10.5g}" for x in numbers)
