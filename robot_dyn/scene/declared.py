"""Tables of a scene whose keys are the coefficients that classes declare: name and unit, defaults, "urdf"."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from inspect import Parameter, getdoc, signature
from math import isinf
from typing import Any, ClassVar, Literal, TypeVar

from pydantic import ConfigDict, Field, create_model

from robot_dyn.control.digital_loop.block import SIGNAL
from robot_dyn.foundations.coefficients import URDF, Coefficient, declared
from robot_dyn.foundations.errors import SceneError
from robot_dyn.foundations.validate import number, numbers
from robot_dyn.model.robot import Robot
from robot_dyn.scene.schema import NotNegative, Number, Part, PerJoint, Stated, Vector3, per_joint

_SPELLED = {" ": "_", "/": "_per_", "²": "2", "(": "", ")": ""}


class Declared(Part):
    """A table made of the coefficients that classes declare."""

    model_config = ConfigDict(use_attribute_docstrings=False)  # searching for docstrings in a missing source is slow

    factory: ClassVar[Callable[..., Any]]
    """The class or function that is called with the coefficients."""
    keys: ClassVar[Mapping[str, tuple[str, Coefficient | None]]] = {}
    """By key: the argument, and what is declared of it."""

    def call(self, robot: Robot) -> Any:
        """Return what the factory returns for the values of the table."""
        arguments, parameters = dict[str, Any](), signature(type(self).factory).parameters
        for key, (name, known) in self.keys.items():
            if key in self.model_fields_set or parameters[name].default is Parameter.empty:
                arguments[name] = _argument(name, getattr(self, key), robot, known)
        return type(self).factory(**arguments)


def _argument(key: str, value: Any, robot: Robot, known: Coefficient | None) -> Any:
    """Return a number, an array for a list, an array (n,) for a value by joint; texts and truth values as they are."""
    of_joints = known is not None and known.of_joints and value is not None
    if of_joints or isinstance(value, dict):
        return per_joint(key, value, robot, elsewhere=0.0 if known is None else known.elsewhere)
    if isinstance(value, list):
        return numbers(key, value, ("k",), ("k", "m"), error=SceneError)
    return number(key, value, error=SceneError) if isinstance(value, float) else value


Table = TypeVar("Table", bound=Declared)


def declared_part(
    base: type[Table],
    kind: str,
    *classes: type,
    factory: Callable[..., Any] | None = None,
    text: str = "",
    signal: str = "",
    others: Mapping[str, Any] | None = None,
) -> type[Table]:
    """The part of a scene that describes objects of some classes.

    Args:
        base: Its base class.
        kind: Its name in scenes.
        *classes: The classes that declare coefficients.
        factory: Called with the coefficients; the only class unless given.
        text: Its description; that of the first class unless given.
        signal: The unit that stands for `SIGNAL` in the units of the coefficients.
        others: Arguments that are not coefficients, each with its type and default or pydantic field.
    """
    factory, others = factory or classes[0], others or {}
    keys, parameters = _keys_of(factory, *classes, signal=signal), signature(factory).parameters
    fields: dict[str, Any] = {"kind": (Literal[kind], ...), **others}  # pyright: ignore[reportInvalidTypeForm]
    for key, (name, each) in keys.items():
        default = parameters[name].default
        default = (URDF if each.stated else ...) if default is Parameter.empty else default
        none = f"; joints left out have {'none' if isinf(each.elsewhere) else f'{each.elsewhere:g}'}"
        none = none if each.elsewhere else ""
        fields[key] = (_type(each), Field(default, description=f"{each.symbol}{none}."))
    text = text or (getdoc(factory) or kind).partition("\n\nAttributes:")[0]
    part = create_model(kind, __base__=base, __doc__=text, **fields)
    part.factory, part.keys = staticmethod(factory), keys | {name: (name, None) for name in others}
    return part


def _type(known: Coefficient) -> Any:
    """Return the type of a key: a value by joint, three numbers, one, or any for other shapes."""
    if known.of_joints:
        return Stated if known.stated else PerJoint
    if known.shapes == ((3,),):
        return Vector3
    return Any if known.shapes != ((),) else Number if known.least is None else NotNegative


def callable_part(base: type[Table], kind: str, factory: Callable[..., Any]) -> type[Table]:
    """The part of a scene whose keys are the arguments of a class or function; coefficients are spelled with units."""
    classes = (factory,) if isinstance(factory, type) else ()
    known = _keys_of(factory, *classes)
    coefficients = {name for name, _ in known.values()}
    others = {
        name: (Any, ... if parameter.default is Parameter.empty else None)
        for name, parameter in signature(factory).parameters.items()
        if name not in coefficients and parameter.kind not in (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    }
    if kept := [key for key in (*known, *others) if key.startswith("_") or key == "kind" or hasattr(base, key)]:
        raise SceneError(f"effects: {kept[0]!r} of {kind!r} is a name that tables of scenes need; rename the argument")
    return declared_part(base, kind, *classes, factory=factory, others=others)


def _keys_of(factory: Callable[..., Any], *classes: type, signal: str = SIGNAL) -> dict[str, tuple[str, Coefficient]]:
    """The keys of the coefficients that classes declare and `factory` takes, with the argument of each."""
    stated = {name: known for kind in reversed(classes) for name, known in declared(kind).items()}
    known = {name: replace(known, unit=known.unit.replace(SIGNAL, signal)) for name, known in stated.items()}
    names = [name for name in signature(factory).parameters if name in known]
    return {_key(name, known[name].unit): (name, known[name]) for name in names}


def _key(name: str, unit: str) -> str:
    """A name and its unit, as "damping_N_m_s_per_rad"."""
    spelled = "".join(_SPELLED.get(letter, letter) for letter in unit)
    return f"{name}_{spelled}" if spelled else name
