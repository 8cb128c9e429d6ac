"""Tables of a scene whose keys are the declared coefficients of classes: name and unit, defaults, "urdf"."""

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
from robot_dyn.scene.messages import named_by_key
from robot_dyn.scene.schema import NotNegative, Number, Part, PerJoint, Stated, Vector3, per_joint

_SEVERAL = Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD
_BY_KEYWORD = Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY
_WHOLE = {"rad/s": "rad_s", "rad/s/s": "rad_s2", "m/s": "m_s"}  # units of speeds need no "per"
_SPELLED = {" ": "_", "/": "_per_", "²": "2", "(": "", ")": ""}


class Declared(Part):
    """A table of the declared coefficients of classes."""

    model_config = ConfigDict(use_attribute_docstrings=False)  # searching for docstrings in a missing source is slow

    factory: ClassVar[Callable[..., Any]]
    """The class or function that is called with the coefficients."""
    keys: ClassVar[Mapping[str, tuple[str, Coefficient | None]]] = {}
    """Name of the argument and declaration, by field."""

    def call(self, robot: Robot) -> Any:
        """Call the factory with the values of the table and return its result."""
        values = [(name, getattr(self, field), form) for field, (name, form) in self.keys.items()]
        values += [(name, value, _UNDECLARED) for name, value in (self.model_extra or {}).items()]
        arguments = [(name, value, form) for name, value, form in values if value is not None or form is None]
        with named_by_key(self.key_by_name()):
            return type(self).factory(**{name: _argument(name, value, robot, form) for name, value, form in arguments})

    @classmethod
    def key_by_name(cls) -> dict[str, str]:
        """Return the key of each argument of the factory, by the name of the argument."""
        return {name: cls.model_fields[field].alias or field for field, (name, _) in cls.keys.items()}


_UNDECLARED = Coefficient(shapes=((), ("k",), ("k", "m")))


def _argument(name: str, value: Any, robot: Robot, form: Coefficient | None) -> Any:
    """Return a number, an array for a list, an array (n,) for a value by joint; texts and truth values unchanged."""
    if form is None or (form.is_list and isinstance(value, dict)):
        return value
    if form.is_per_joint or isinstance(value, dict):
        return per_joint(name, value, robot, elsewhere=form.fill_value)
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
    """Create the table of a scene that describes objects of one or more classes.

    Args:
        base: Base class of the table.
        kind: Name in scenes.
        *classes: The classes that declare coefficients.
        factory: Function that is called with the coefficients; by default the only class.
        text: Description; by default the description of the factory.
        signal: The unit that replaces `SIGNAL` in the units of the coefficients.
        others: Arguments that are not coefficients, with type and default or pydantic field.
    """
    factory, others = factory or classes[0], others or {}
    keys, parameters = _keys_of(factory, *classes, signal=signal), signature(factory).parameters
    fields: dict[str, Any] = {"kind": (Literal[kind], ...), **others}  # pyright: ignore[reportInvalidTypeForm]
    for key, (name, form) in keys.items():
        default = parameters[name].default
        default = (URDF if form.stated else ...) if default is Parameter.empty else default
        none = f"; omitted joints have {'none' if isinf(form.fill_value) else f'{form.fill_value:g}'}"
        none = none if form.fill_value else ""
        fields[key] = (_type(form), Field(default, description=f"{form.symbol}{none}."))
    text = text or (getdoc(factory) or kind).partition("\n\nAttributes:")[0]
    part = create_model(kind, __base__=base, __doc__=text, **fields)
    part.factory, part.keys = staticmethod(factory), keys | {name: (name, None) for name in others}
    return part


def _type(form: Coefficient) -> Any:
    """Return the type of a key: a value by joint, three numbers, one number, or anything for other shapes."""
    if form.is_per_joint:
        return Stated if form.stated else PerJoint
    if form.shapes == ((3,),):
        return Vector3
    return Any if form.shapes != ((),) else Number if form.minimum is None else NotNegative


def callable_part(base: type[Table], kind: str, factory: Callable[..., Any]) -> type[Table]:
    """Create the table of a scene whose keys are the arguments of a class or function, coefficients with units.

    Raises:
        SceneError: If a required argument cannot be a key.
    """
    parameters = signature(factory).parameters
    keys = _keys_of(factory, *((factory,) if isinstance(factory, type) else ()), undeclared=_UNDECLARED)
    keys.pop("kind", None)
    needed = [name for name, x in parameters.items() if x.default is Parameter.empty and x.kind not in _SEVERAL]
    if lost := [name for name in needed if name not in dict(keys.values())]:
        raise SceneError(f"effects: {lost[0]!r} of {kind!r} cannot be a key of a scene; rename it or give it a default")
    fields: dict[str, Any] = {}
    for k, (key, (name, form)) in enumerate(keys.items()):  # fields by number: pydantic reserves many names
        default = None if name not in needed else URDF if form.stated else ...
        fields[f"argument_{k}"] = (_type(form), Field(default, alias=key))
    others = "allow" if any(x.kind is Parameter.VAR_KEYWORD for x in parameters.values()) else "forbid"
    is_kind: Any = (Literal[kind], ...)  # pyright: ignore[reportInvalidTypeForm]
    part = create_model(kind, __base__=base, __cls_kwargs__={"extra": others}, kind=is_kind, **fields)
    part.factory, part.keys = staticmethod(factory), dict(zip(fields, keys.values(), strict=True))
    return part


def _keys_of(
    factory: Callable[..., Any], *classes: type, signal: str = SIGNAL, undeclared: Coefficient | None = None
) -> dict[str, tuple[str, Coefficient]]:
    """Return name and declaration, by key, of the arguments of `factory` that classes declare; or of all arguments."""
    stated = {name: form for kind in reversed(classes) for name, form in declared(kind).items()}
    forms = {name: replace(form, unit=form.unit.replace(SIGNAL, signal)) for name, form in stated.items()}
    names = [name for name, x in signature(factory).parameters.items() if x.kind in _BY_KEYWORD]
    pairs = [(name, form) for name in names if (form := forms.get(name, undeclared))]
    return {_key(name, form.unit): (name, form) for name, form in pairs}


def _key(name: str, unit: str) -> str:
    """Return a name with its unit, such as "viscous_N_m_s_per_rad"; unchanged if it ends with the unit."""
    spelled = _WHOLE.get(unit) or "".join(_SPELLED.get(letter, letter) for letter in unit)
    return name if not spelled or name.endswith(f"_{spelled}") else f"{name}_{spelled}"
