"""Reports on a robot at one state: M, C, N, effects, what is held, and the causes of one joint's torque."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import numpy as np

from robot_dyn.cli.terminal import numbers_row, or_dash, table
from robot_dyn.coefficients import declared, with_values
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
from robot_dyn.validate import joint_values

Document = dict[str, Any]


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
    numbers = {
        name: list(coefficient_texts(_at(force, i), answer["types"][i : i + 1]).values()) for name, force in named
    }
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


def query_tables(answer: Document) -> Iterator[Any]:
    """`query` and `why` as text."""
    joints = answer["joints"]
    for name in ("q", "v", "a", "tau"):
        yield f"{name:4}{numbers_row(answer[name])}  [{units(name, answer['types'])}]"
    force = units("tau", answer["types"])
    of_M = {"N m": "kg m²", "N": "kg"}.get(force, "kg m², kg m, kg")
    of_C = {"N m": "N m s/rad", "N": "N s/m"}.get(force, "rows times v: N m, N")
    meanings = (("M", "mass matrix", of_M), ("C", "Coriolis matrix", of_C), ("N", "gravity and effects", force))
    for name, meaning, of_entries in meanings:
        yield ""
        yield f"{name}, {meaning} [{of_entries}]:"
        rows = answer[name] if name != "N" else [[x] for x in answer[name]]
        yield from (f"  {numbers_row(row)}  {joint}" for row, joint in zip(rows, joints, strict=True))
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
    rows = ([x.joint, ", ".join(x.by), *map(or_dash, (x.load, x.least, x.most, x.margin))] for x in answer["held"])
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
