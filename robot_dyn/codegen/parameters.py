"""Parameters of a plant and its controller: values that are inputs p of machine code, not constants.

They are coefficients of effects, gains, coefficients of references other than polynomials, gravity and payloads.
Changing one requires no compilation, and each may differ between runs. Armature, the scale of all masses, and mass,
inertia and scale of a single link are inputs only if they are swept; lengths are constants of the code.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.control.controller import Controller
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.coefficients import Coefficient, declared, with_values
from robot_dyn.lagrange.tree import Described, tree_of
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics

Part = tuple[
    str | int, ...
]  # ("effect", i), ("controller",), ("reference", attribute), ("robot",) or ("model", attribute)
ROBOT: Part = ("robot",)
CONTROLLER: Part = ("controller",)
_GRAVITY = Coefficient("m/s²", shapes=((3,),))
_WHEN_SWEPT = {
    "armature": Coefficient("kg m²", minimum=0),
    "mass_scale": Coefficient(shapes=((),), exclusive_minimum=0),
}
_OF_LINK = {
    "mass": Coefficient("kg", shapes=((),), exclusive_minimum=0),
    "inertia": Coefficient("kg m²", shapes=((3, 3),)),
    "mass_scale": Coefficient(shapes=((),), exclusive_minimum=0),
}
_EDIT_OF = {"mass": "masses", "inertia": "inertias", "mass_scale": "mass_scales"}
_PAYLOAD = {
    "mass": Coefficient("kg", shapes=((),), minimum=0),
    "com": Coefficient("m", shapes=((3,),)),
    "inertia": Coefficient("kg m²", shapes=((3, 3),), can_vary=False),
}


@final
@dataclass(frozen=True, eq=False)
class Parameter:
    """A value, or one value for each joint.

    Attributes:
        part: Part that it belongs to.
        key: Attribute of the part.
        name: Public name, such as "kp" or "payload_mass:tool0".
        value: Value in the part, for each joint if it is a coefficient of joints.
        declared: Unit, sign and shape.
        entries: Indices of the entries, row by row, that are inputs; the others are 0.
    """

    part: Part
    key: str
    name: str
    value: np.ndarray
    declared: Coefficient
    entries: tuple[int, ...]

    @property
    def place(self) -> tuple[Part, str, tuple[int, ...]]:
        """Key of its input in machine code: parameters with equal keys share the input."""
        return self.part, self.key, self.entries

    @property
    def size(self) -> int:
        """Number of entries that are inputs."""
        return len(self.entries)


@final
@dataclass(frozen=True)
class Numbered:
    """A robot with other numbers, of any arithmetic.

    Attributes:
        description: File of the robot.
        edits: Edits of the robot, with gravity and payloads in these numbers.
        joint_names: Names of the joints, in the order of q.
    """

    description: Description
    edits: Edits
    joint_names: tuple[str, ...]


def parameters(
    dynamics: Dynamics, effects: Iterable[Effect], controller: Controller | None, swept: Collection[str] = ()
) -> tuple[Parameter, ...]:
    """Return all parameters of a plant and its controller; all entries of swept ones are inputs.

    Otherwise zeros of gravity and payloads are constants: with gravity along z, the angle of a vertical first joint
    does not matter, and its sine is not computed.
    """
    n = dynamics.n
    models = {f"{_named(name)}.mass_scale" for name in (controller.models if controller else ())}
    result = [*_of_robot(dynamics, ROBOT, "", {*swept} - models)]  # not of a link called "model"
    effects = tuple(effects)
    for i, name in enumerate(names_of(effects)):
        result += _of_part(effects[i], ("effect", i), f"{name}.", n)
    return (*result, *(() if controller is None else parameters_of_controller(controller, swept)))


def parameters_of_controller(controller: Controller, swept: Collection[str] = ()) -> tuple[Parameter, ...]:
    """Return the parameters of a controller, its parts, references and models."""
    n, result = controller.n, []
    result += _of_part(controller, CONTROLLER, "", n)
    for path, label, part in controller.parts:
        result += _of_part(part, CONTROLLER, label, n, f"{path}.")
    for name, reference in controller.references.items():
        result += _of_part(reference, ("reference", name), f"{_named(name)}.", n)
    for name, model in controller.models.items():
        result += _of_robot(model, ("model", name), f"{_named(name)}.", swept)
    return tuple(result)


def _named(path: str) -> str:
    """Return the name in sweeps of an attribute of a controller, without the prefix of a controller in a loop."""
    return path.removeprefix("controller.")


def _of_part(part: object, place: Part, prefix: str, n: int, path: str = "") -> Iterator[Parameter]:
    for key, coefficient in declared(type(part)).items():
        value = getattr(part, key)
        if value is not None:
            value = np.asarray(value, dtype=float)
            value = np.broadcast_to(value, (n,)) if coefficient.is_per_joint else value
            yield Parameter(place, path + key, prefix + key, value, coefficient, tuple(range(value.size)))


def _of_robot(dynamics: Dynamics, place: Part, prefix: str, swept: Collection[str]) -> Iterator[Parameter]:
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(robot, Robot):
        return

    def parameter(key: str, name: str, value: ArrayLike, coefficient: Coefficient) -> Parameter:
        value = np.asarray(value, dtype=float)
        varies = name in swept or not value.ndim
        return Parameter(
            place, key, name, value, coefficient, tuple(i for i, x in enumerate(value.flat) if varies or x != 0)
        )

    yield parameter("gravity", f"{prefix}gravity", robot.edits.gravity, _GRAVITY)
    for i, payload in enumerate(robot.edits.payloads):
        for key, coefficient in _PAYLOAD.items():
            name = f"{prefix}payload_{key}:{payload.frame}"
            yield parameter(f"{i} {key}", name, getattr(payload, key), coefficient)
    drives = dict(robot.edits.armature)
    values = {"armature": [drives.get(joint, 0.0) for joint in robot.joint_names], "mass_scale": robot.edits.mass_scale}
    for key, coefficient in _WHEN_SWEPT.items():
        if f"{prefix}{key}" in swept:
            yield parameter(key, f"{prefix}{key}", values[key], coefficient)
    selected = {name for name in swept if name.startswith(prefix) and name.rpartition(".")[2] in _OF_LINK}
    links = _of_links(robot) if selected else {}
    for name in sorted(selected):
        link, _, key = name.removeprefix(prefix).rpartition(".")
        if link in links:
            yield parameter(f"{key} {link}", name, links[link][key], _OF_LINK[key])


def names_of(effects: Sequence[Effect]) -> list[str]:
    """Return the names of effects, numbered within a kind, as in "spring 1"; both parts of an effect share one."""
    kinds = [(type(effect), effect.name) for effect in effects]
    return [
        f"{effect.name} {kinds[: i + 1].count(kind)}" if kinds.count(kind) > 1 else effect.name
        for i, (effect, kind) in enumerate(zip(effects, kinds, strict=True))
    ]


def link_parameters(dynamics: Dynamics) -> tuple[str, ...]:
    """Return the names of masses, inertias and scales of all links, such as "panda_link3.mass": parameters if swept."""
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(robot, Robot):
        return ()
    return tuple(f"{link}.{key}" for link in _of_links(robot) for key in _OF_LINK)


def variable_parameters(
    dynamics: Dynamics, effects: Iterable[Effect], controller: Controller | None
) -> tuple[Parameter, ...]:
    """Return the parameters that may be swept, including those of links and of the controller's models."""
    prefixed = [("", dynamics)]
    prefixed += [(f"{_named(name)}.", model) for name, model in (controller.models if controller else {}).items()]
    swept = [f"{prefix}{name}" for prefix, arm in prefixed for name in (*_WHEN_SWEPT, *link_parameters(arm))]
    return tuple(x for x in parameters(dynamics, effects, controller, swept) if x.declared.can_vary)


def _of_links(robot: Robot) -> dict[str, dict[str, Any]]:
    """Return the edited mass, inertia and scale of each link that states them, by link."""
    inertias, scales = {}, dict(robot.edits.mass_scales)
    for link in tree_of(robot.description, replace(robot.edits, payloads=(), mass_scale="1", mass_scales=())).links:
        for body in link.inertials:
            xx, xy, xz, yy, yz, zz = map(float, body.moments)
            inertia = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
            scale = scales.get(link.name, 1.0)
            inertias[link.name] = {"mass": float(body.mass), "inertia": inertia, "mass_scale": scale}
    return inertias


Values = Mapping[Part, Mapping[str, Scalar]]  # by part and attribute, also symbols


def split(parameters: Iterable[Parameter], values: Array) -> dict[Part, dict[str, Scalar]]:
    """Split values of parameters, row after row, into values by part and attribute."""
    parts: dict[Part, dict[str, Scalar]] = {}
    start = 0
    for parameter in parameters:
        inputs = values[start : start + parameter.size]
        own = np.zeros(parameter.value.size, dtype=inputs.dtype).view(type(inputs))
        own[list(parameter.entries)] = inputs
        parts.setdefault(parameter.part, {})[parameter.key] = (
            own.reshape(parameter.value.shape) if parameter.value.ndim else own[0]
        )
        start += parameter.size
    return parts


def joined(parameters: Iterable[Parameter]) -> np.ndarray:
    """Return the values of all parameters, row after row."""
    return np.concatenate(
        [*(parameter.value.ravel()[list(parameter.entries)] for parameter in parameters), np.zeros(0)]
    )


def described(robot: Described, values: Mapping[str, Scalar]) -> Numbered:
    """Return a robot with other gravity, payloads, armature, mass scale, and masses, inertias and scales of links."""
    payloads = tuple(
        with_values(payload, {key: _literal(values[f"{i} {key}"]) for key in _PAYLOAD if f"{i} {key}" in values})
        for i, payload in enumerate(robot.edits.payloads)
    )
    edits = {"payloads": payloads} | {key: _literal(values[key]) for key in ("gravity", "mass_scale") if key in values}
    if "armature" in values:
        drives = zip(robot.joint_names, _literal(values["armature"]), strict=True)
        edits["armature"] = tuple((dict(robot.edits.armature) | dict(drives)).items())
    for key, edit in _EDIT_OF.items():
        own = {name.partition(" ")[2]: _literal(x) for name, x in values.items() if name.startswith(f"{key} ")}
        edits[edit] = tuple((dict(getattr(robot.edits, edit)) | own).items())
    return Numbered(robot.description, replace(robot.edits, **edits), robot.joint_names)


def _literal(values: Any) -> Any:
    """Return a number, or the nested tuples of an array."""
    return tuple(map(_literal, values)) if np.ndim(values) else values


def with_numbers(dynamics: Dynamics, values: Mapping[str, Scalar]) -> Dynamics:
    """Return the robot of a dynamics object with other numbers; the object itself if there are none."""
    if not values:
        return dynamics
    robot: Any = getattr(dynamics, "robot", dynamics)
    return Robot(robot.description, described(robot, values).edits)


def rows(parameters: Iterable[Parameter], name: str) -> np.ndarray:
    """Return the rows of the parameters of one name, one parameter per line, (k, size)."""
    ends = np.cumsum([0, *(parameter.size for parameter in parameters)])
    pairs = zip(parameters, ends, strict=False)
    return np.array([np.arange(a, a + parameter.size) for parameter, a in pairs if parameter.name == name])


def with_parameters(
    plant: Plant, controller: Controller | None, new_values: Mapping[str, ArrayLike]
) -> tuple[Plant, Controller | None]:
    """Return a plant and its controller with other values of parameters, each (size,) by name; not checked here."""
    declared_parameters = parameters(plant.dynamics, plant.effects, controller, new_values)
    values = joined(declared_parameters)
    for name, value in new_values.items():
        values[rows(declared_parameters, name)] = value
    changed = {parameter.part for parameter in declared_parameters if parameter.name in new_values}
    by_part = {part: attributes for part, attributes in split(declared_parameters, values).items() if part in changed}
    effects = [with_values(effect, by_part.get(("effect", i), {})) for i, effect in enumerate(plant.effects)]
    if controller is not None:
        replaced = dict(by_part.get(CONTROLLER, {}))
        models = controller.models.items()
        replaced |= {name: with_numbers(model, by_part.get(("model", name), {})) for name, model in models}
        controller = with_values(controller, replaced)
    return Plant(with_numbers(plant.dynamics, by_part.get(ROBOT, {})), effects), controller


def over_runs(
    plant: Plant, controller: Controller | None, values: Mapping[str, Array]
) -> tuple[tuple[Effect, ...], Controller | None]:
    """Return effects and controller whose coefficients are arrays over runs, (B, size) by name; for reading only."""
    by_part: dict[Part, dict[str, Array]] = {}
    for parameter in parameters(plant.dynamics, plant.effects, controller):
        if parameter.name in values:
            by_part.setdefault(parameter.part, {})[parameter.key] = values[parameter.name]
    effects = tuple(with_values(effect, by_part.get(("effect", i), {})) for i, effect in enumerate(plant.effects))
    return effects, None if controller is None else with_values(controller, by_part.get(CONTROLLER, {}))
