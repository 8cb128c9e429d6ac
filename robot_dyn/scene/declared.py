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

_SEVERAL = Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD
_BY_KEYWORD = Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY
_SPELLED = {" ": "_", "/": "_per_", "²": "2", "(": "", ")": ""}


class Declared(Part):
    """A table made of the coefficients that classes declare."""

    model_config = ConfigDict(use_attribute_docstrings=False)  # searching for docstrings in a missing source is slow

    factory: ClassVar[Callable[..., Any]]
    """The class or function that is called with the coefficients."""
    keys: ClassVar[Mapping[str, tuple[str, Coefficient | None]]] = {}
    """By field: the argument, and what is declared of it."""

    def call(self, robot: Robot) -> Any:
        """Return what the factory returns for the values of the table."""
        values = [(name, getattr(self, field), known) for field, (name, known) in self.keys.items()]
        values += [(name, value, _UNDECLARED) for name, value in (self.model_extra or {}).items()]
        stated = [(name, value, known) for name, value, known in values if value is not None or known is None]
        return type(self).factory(**{name: _argument(name, value, robot, known) for name, value, known in stated})


_UNDECLARED = Coefficient(shapes=((), ("k",), ("k", "m")))


def _argument(name: str, value: Any, robot: Robot, known: Coefficient | None) -> Any:
    """Return a number, an array for a list, an array (n,) for a value by joint; texts and truth values as they are."""
    if known is None:
        return value
    if known.of_joints or isinstance(value, dict):
        return per_joint(name, value, robot, elsewhere=known.elsewhere)
    if isinstance(value, list):
        return numbers(name, value, ("k",), ("k", "m"), error=SceneError)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return number(name, value, error=SceneError) if is_number else value


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
    """The part of a scene whose keys are the arguments of a class or function; coefficients are spelled with units.

    Raises:
        SceneError: If an argument that it needs cannot be a key.
    """
    parameters = signature(factory).parameters
    keys = _keys_of(factory, *((factory,) if isinstance(factory, type) else ()), undeclared=_UNDECLARED)
    keys.pop("kind", None)
    needed = [
        name for name, each in parameters.items() if each.default is Parameter.empty and each.kind not in _SEVERAL
    ]
    if lost := [name for name in needed if name not in dict(keys.values())]:
        raise SceneError(f"effects: {lost[0]!r} of {kind!r} cannot be a key of a scene; rename it or give it a default")
    fields: dict[str, Any] = {}
    for k, (key, (name, known)) in enumerate(keys.items()):  # fields by number: pydantic needs many names for itself
        default = None if name not in needed else URDF if known.stated else ...
        fields[f"argument_{k}"] = (_type(known), Field(default, alias=key))
    others = "allow" if any(each.kind is Parameter.VAR_KEYWORD for each in parameters.values()) else "forbid"
    is_kind: Any = (Literal[kind], ...)  # pyright: ignore[reportInvalidTypeForm]
    part = create_model(kind, __base__=base, __cls_kwargs__={"extra": others}, kind=is_kind, **fields)
    part.factory, part.keys = staticmethod(factory), dict(zip(fields, keys.values(), strict=True))
    return part


def _keys_of(
    factory: Callable[..., Any], *classes: type, signal: str = SIGNAL, undeclared: Coefficient | None = None
) -> dict[str, tuple[str, Coefficient]]:
    """The keys of the arguments of `factory` that classes declare, or of all, with what is declared of each."""
    stated = {name: known for kind in reversed(classes) for name, known in declared(kind).items()}
    known = {name: replace(known, unit=known.unit.replace(SIGNAL, signal)) for name, known in stated.items()}
    names = [name for name, each in signature(factory).parameters.items() if each.kind in _BY_KEYWORD]
    found = [(name, each) for name in names if (each := known.get(name, undeclared))]
    return {_key(name, each.unit): (name, each) for name, each in found}


def _key(name: str, unit: str) -> str:
    """A name and its unit, as "damping_N_m_s_per_rad"."""
    spelled = "".join(_SPELLED.get(letter, letter) for letter in unit)
    return f"{name}_{spelled}" if spelled else name
