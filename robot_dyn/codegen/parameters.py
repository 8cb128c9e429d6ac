"""The parameters of a plant and its controller: numbers that machine code takes as inputs, p, not as constants.

Coefficients of effects, gains, coefficients of references other than polynomials, gravity and payloads: changing one
compiles nothing, and each may differ from run to run. Armature and the factor on all masses are inputs where they are
swept, and so are mass and inertia of a single link; lengths are constants of the code.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.coefficients import Coefficient, declared, with_values
from robot_dyn.lagrange.tree import Described, tree_of
from robot_dyn.model.robot import Robot

Part = tuple[Any, ...]  # ("effect", i), ("controller",), ("reference", attribute), ("robot",) or ("model", attribute)
ROBOT: Part = ("robot",)
CONTROLLER: Part = ("controller",)
_GRAVITY = Coefficient("m/s²", shapes=((3,),))
_WHEN_SWEPT = {"armature": Coefficient("kg m²", least=0), "mass_scale": Coefficient(shapes=((),), above=0)}
_OF_LINK = {"mass": Coefficient("kg", shapes=((),), above=0), "inertia": Coefficient("kg m²", shapes=((3, 3),))}
_PAYLOAD = {
    "mass": Coefficient("kg", shapes=((),), least=0),
    "com": Coefficient("m", shapes=((3,),)),
    "inertia": Coefficient("kg m²", shapes=((3, 3),), swept=False),
}


@final
@dataclass(frozen=True, eq=False)
class Parameter:
    """One of the numbers, or one for each joint.

    Attributes:
        part: What it belongs to.
        key: Its attribute there.
        name: As users call it, such as "viscous_friction.damping", "kp" or "payload_mass:tool0".
        value: As the part has it, one for each joint where it is of joints.
        declared: Unit, sign and shape.
        entries: Which of its entries, row by row, are inputs; the others are 0.
    """

    part: Part
    key: str
    name: str
    value: np.ndarray
    declared: Coefficient
    entries: tuple[int, ...]

    @property
    def place(self) -> tuple[Any, ...]:
        """Its place in machine code: two with the same one are the same input."""
        return self.part, self.key, self.entries

    @property
    def size(self) -> int:
        """Number of its entries that are inputs."""
        return len(self.entries)


@final
@dataclass(frozen=True)
class Numbered:
    """A robot with other numbers, of any arithmetic.

    Attributes:
        description: Its file.
        edits: Its edits, gravity and payloads of these numbers among them.
        joint_names: In the order of q.
    """

    description: Description
    edits: Edits
    joint_names: tuple[str, ...]


def parameters(
    dynamics: Any, effects: Iterable[Effect], controller: Controller | None, swept: Collection[str] = ()
) -> tuple[Parameter, ...]:
    """All parameters of a plant and its controller; of those that are swept, all entries are inputs.

    Zeros of gravity and of payloads are constants otherwise: with gravity along z, the angle of a vertical first joint
    does not matter, and its sine is not computed.
    """
    n = dynamics.n
    known = [*_of_robot(dynamics, ROBOT, "", swept)]
    effects = tuple(effects)
    for i, name in enumerate(names_of(effects)):
        known += _of_part(effects[i], ("effect", i), f"{name}.", n)
    if controller is not None:
        known += _of_part(controller, CONTROLLER, "", n)
        for path, label, part in controller.parts:
            known += _of_part(part, CONTROLLER, label, n, f"{path}.")
        for name, reference in controller.references.items():
            known += _of_part(reference, ("reference", name), f"{_named(name)}.", n)
        for name, model in controller.models.items():
            known += _of_robot(model, ("model", name), f"{_named(name)}.", swept)
    return tuple(known)


def _named(path: str) -> str:
    """The name in sweeps of what a controller holds: without that of a controller in a loop."""
    return path.removeprefix("controller.")


def _of_part(part: Any, place: Part, prefix: str, n: int, path: str = "") -> Iterator[Parameter]:
    for key, each in declared(type(part)).items():
        value = getattr(part, key)
        if value is not None:
            value = np.asarray(value, dtype=float)
            value = np.broadcast_to(value, (n,)) if each.of_joints else value
            yield Parameter(place, path + key, prefix + key, value, each, tuple(range(value.size)))


def _of_robot(dynamics: Any, place: Part, prefix: str, swept: Collection[str]) -> Iterator[Parameter]:
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(robot, Robot):
        return

    def parameter(key: str, name: str, value: Any, each: Coefficient) -> Parameter:
        value = np.asarray(value, dtype=float)
        varies = name in swept or not value.ndim
        return Parameter(place, key, name, value, each, tuple(i for i, x in enumerate(value.flat) if varies or x != 0))

    yield parameter("gravity", f"{prefix}gravity", robot.edits.gravity, _GRAVITY)
    for i, payload in enumerate(robot.edits.payloads):
        for key, each in _PAYLOAD.items():
            name = f"{prefix}payload_{key}:{payload.frame}"
            yield parameter(f"{i} {key}", name, getattr(payload, key), each)
    drives = dict(robot.edits.armature)
    given = {"armature": [drives.get(joint, 0.0) for joint in robot.joint_names], "mass_scale": robot.edits.mass_scale}
    for key, each in _WHEN_SWEPT.items():
        if f"{prefix}{key}" in swept:
            yield parameter(key, f"{prefix}{key}", given[key], each)
    named = {name for name in swept if name.startswith(prefix) and name.rpartition(".")[2] in _OF_LINK}
    links = _of_links(robot) if named else {}
    for name in sorted(named):
        link, _, key = name.removeprefix(prefix).rpartition(".")
        if link in links:
            yield parameter(f"{key} {link}", name, links[link][key], _OF_LINK[key])


def names_of(effects: Sequence[Effect]) -> list[str]:
    """Their names, those of a kind numbered: "spring 1" and "spring 2"; both parts of an effect share one."""
    kinds = [(type(each), each.name) for each in effects]
    return [
        f"{each.name} {kinds[: i + 1].count(kind)}" if kinds.count(kind) > 1 else each.name
        for i, (each, kind) in enumerate(zip(effects, kinds, strict=True))
    ]


def link_parameters(dynamics: Any) -> tuple[str, ...]:
    """Names of the masses and inertias of its links, as "panda_link3.mass"; they are parameters where swept."""
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(robot, Robot):
        return ()
    return tuple(f"{link}.{key}" for link in _of_links(robot) for key in _OF_LINK)


def sweepable_parameters(
    dynamics: Any, effects: Iterable[Effect], controller: Controller | None
) -> tuple[Parameter, ...]:
    """The parameters that may be swept, those of links and of the controller's models included."""
    prefixed = [("", dynamics)]
    prefixed += [(f"{_named(name)}.", model) for name, model in (controller.models if controller else {}).items()]
    swept = [f"{prefix}{name}" for prefix, of in prefixed for name in (*_WHEN_SWEPT, *link_parameters(of))]
    return tuple(each for each in parameters(dynamics, effects, controller, swept) if each.declared.swept)


def _of_links(robot: Robot) -> dict[str, dict[str, Any]]:
    """Mass and inertia of each link that states some, by link, edited."""
    inertias = {}
    for link in tree_of(robot.description, replace(robot.edits, payloads=(), mass_scale="1")).links:
        for body in link.inertials:
            xx, xy, xz, yy, yz, zz = map(float, body.moments)
            inertias[link.name] = {"mass": float(body.mass), "inertia": [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]}
    return inertias


Values = Mapping[Part, Mapping[str, Any]]


def split(known: Iterable[Parameter], values: Any) -> dict[Part, dict[str, Any]]:
    """The values of parameters, one row after the other, by part and attribute."""
    parts: dict[Part, dict[str, Any]] = {}
    start = 0
    for each in known:
        inputs = values[start : start + each.size]
        own = np.zeros(each.value.size, dtype=inputs.dtype).view(type(inputs))
        own[list(each.entries)] = inputs
        parts.setdefault(each.part, {})[each.key] = own.reshape(each.value.shape) if each.value.ndim else own[0]
        start += each.size
    return parts


def joined(known: Iterable[Parameter]) -> np.ndarray:
    """The values of all parameters, one row after the other."""
    return np.concatenate([*(each.value.ravel()[list(each.entries)] for each in known), np.zeros(0)])


def described(robot: Described, values: Mapping[str, Any]) -> Numbered:
    """A robot with other gravity, payloads, armature, factor on its masses, and masses and inertias of links."""
    payloads = tuple(
        with_values(each, {key: _literal(values[f"{i} {key}"]) for key in _PAYLOAD if f"{i} {key}" in values})
        for i, each in enumerate(robot.edits.payloads)
    )
    edits = {"payloads": payloads} | {key: _literal(values[key]) for key in ("gravity", "mass_scale") if key in values}
    if "armature" in values:
        drives = zip(robot.joint_names, _literal(values["armature"]), strict=True)
        edits["armature"] = tuple((dict(robot.edits.armature) | dict(drives)).items())
    for key, edited in (("mass", robot.edits.masses), ("inertia", robot.edits.inertias)):
        own = {name.partition(" ")[2]: _literal(x) for name, x in values.items() if name.startswith(f"{key} ")}
        edits[{"mass": "masses", "inertia": "inertias"}[key]] = tuple((dict(edited) | own).items())
    return Numbered(robot.description, replace(robot.edits, **edits), robot.joint_names)


def _literal(values: Any) -> Any:
    """A number, or nested tuples of an array."""
    return tuple(map(_literal, values)) if np.ndim(values) else values


def with_numbers(dynamics: Any, values: Mapping[str, Any]) -> Any:
    """The robot of a dynamics with other gravity and payloads; itself without any."""
    if not values:
        return dynamics
    robot = getattr(dynamics, "robot", dynamics)
    return Robot(robot.description, described(robot, values).edits)


def rows(known: Iterable[Parameter], name: str) -> np.ndarray:
    """The rows of the parameters of a name, those of one after those of the other, (k, size)."""
    ends = np.cumsum([0, *(each.size for each in known)])
    return np.array([np.arange(a, a + each.size) for each, a in zip(known, ends, strict=False) if each.name == name])


def with_parameters(plant: Plant, controller: Controller | None, given: Mapping[str, Any]) -> tuple[Plant, Any]:
    """A plant and its controller with other values of parameters, each (size,) by name; numbers that were checked."""
    known = parameters(plant.dynamics, plant.effects, controller, given)
    values = joined(known)
    for name, value in given.items():
        values[rows(known, name)] = value
    changed = {each.part for each in known if each.name in given}
    of = {part: each for part, each in split(known, values).items() if part in changed}
    effects = [with_values(each, of.get(("effect", i), {})) for i, each in enumerate(plant.effects)]
    if controller is not None:
        replaced = dict(of.get(CONTROLLER, {}))
        replaced |= {name: with_numbers(each, of.get(("model", name), {})) for name, each in controller.models.items()}
        controller = with_values(controller, replaced)
    return Plant(with_numbers(plant.dynamics, of.get(ROBOT, {})), effects), controller


def over_runs(plant: Plant, controller: Controller | None, given: Mapping[str, Any]) -> tuple[tuple[Effect, ...], Any]:
    """Effects and controller with arrays over runs, (B, size) by name, as their coefficients: to read, not to run."""
    of: dict[Part, dict[str, Any]] = {}
    for each in parameters(plant.dynamics, plant.effects, controller):
        if each.name in given:
            of.setdefault(each.part, {})[each.key] = given[each.name]
    effects = tuple(with_values(each, of.get(("effect", i), {})) for i, each in enumerate(plant.effects))
    return effects, None if controller is None else with_values(controller, of.get(CONTROLLER, {}))
