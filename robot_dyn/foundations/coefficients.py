"""Declared coefficients: the parameters of an effect, controller or reference, each with unit, sign and meaning.

    damping: CoefficientField = field(metadata=coefficient("N m s/rad", symbol="b", minimum=0, stated="damping"))

The declaration determines how values are checked, whether values by joint name or "urdf" are accepted, and the name in
scenes and sweeps. It also makes the coefficient an input of machine code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass, replace
from functools import cache, cached_property
from inspect import getattr_static
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, final, overload

import numpy as np

from robot_dyn.foundations.errors import EffectError, RobotDynError, nearest, shorten, shown
from robot_dyn.foundations.validate import instance, number, numbers, truth

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    CoefficientInput = ArrayLike | Mapping[str, ArrayLike]  # numbers, values by joint name, or "urdf"

URDF = "urdf"  # value of a coefficient that is replaced by the value in the robot's file
URDF_SOFT = "urdf_soft"  # position of a stop that is replaced by the soft limit in the robot's file
_KEY = "robot_dyn.foundations.coefficients"
JOINTS = ((), ("n",))  # one number for all joints, or one number for each joint
ROWS = (("k",), ("n", "k"))  # a list of numbers for all joints, or one for each joint

Checked = float | np.ndarray | Mapping[str, float] | Mapping[str, np.ndarray] | str
Owner = TypeVar("Owner")  # an effect, controller or reference


class HasJointNames(Protocol):
    """An arm with named joints."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        ...


class CoefficientField(Protocol):
    """The type of a field that is a coefficient: any input is accepted, and laws read numbers.

    Values by joint name and "urdf" become numbers when a part is placed on an arm.
    """

    def __get__(self, part: object, kind: type | None = None) -> np.ndarray: ...

    def __set__(self, part: object, values: CoefficientInput) -> None: ...


class OptionalCoefficientField(Protocol):
    """The type of a field that is a coefficient or None."""

    def __get__(self, part: object, kind: type | None = None) -> np.ndarray | None: ...

    def __set__(self, part: object, values: CoefficientInput | None) -> None: ...


@overload
def default(value: None) -> OptionalCoefficientField: ...
@overload
def default(value: CoefficientInput) -> CoefficientField: ...
def default(value: object) -> object:
    """Return the default of a coefficient unchanged; its type is that of the field, as for `dataclasses.field`."""
    return value


@final
@dataclass(frozen=True)
class Coefficient:
    """The declaration of a coefficient.

    Attributes:
        unit: Unit for a revolute joint, such as "N m s/rad"; "" if dimensionless.
        symbol: Symbol in the equation, such as "b".
        shapes: Allowed shapes; a string stands for any length.
        minimum, exclusive_minimum: Inclusive and exclusive lower bound; None for no bound.
        infinite: True if ±inf is allowed.
        fill_value: Value for joints that are not named.
        stated: Attribute of a `Robot` that "urdf" refers to; "" if a URDF cannot state this coefficient.
        can_vary: True if it may vary from run to run in `rollouts`.
    """

    unit: str = ""
    symbol: str = ""
    shapes: tuple[tuple[int | str, ...], ...] = JOINTS
    minimum: float | None = None
    exclusive_minimum: float | None = None
    infinite: bool = False
    fill_value: float = 0.0
    stated: str = ""
    can_vary: bool = True

    def __post_init__(self) -> None:
        for name in ("unit", "symbol", "stated"):
            instance(name, getattr(self, name), str, "give a text, such as 'N m'", error=EffectError)
        for name in ("infinite", "can_vary"):
            truth(name, getattr(self, name), error=EffectError)
        for name in ("minimum", "exclusive_minimum"):
            if getattr(self, name) is not None:
                number(name, getattr(self, name), error=EffectError)
        number("fill_value", self.fill_value, error=EffectError, infinite=True)
        shapes = self.shapes
        if not isinstance(shapes, tuple) or not all(isinstance(x, tuple) for x in shapes) or not shapes:
            raise EffectError(f"shapes must be tuples, such as ((), ('n',)), got {shown(shapes)}")

    @property
    def is_per_joint(self) -> bool:
        """True if the coefficient is one number for all joints or one per joint."""
        return self.shapes == JOINTS

    @property
    def is_list(self) -> bool:
        """True if the coefficient is one list for all joints or one per joint."""
        return self.shapes == ROWS

    def checked(self, name: str, values: object, *, error: type[RobotDynError], allow_unresolved: bool) -> Checked:
        """Return the checked numbers, as a frozen copy or as a float.

        If `allow_unresolved`, values by joint name and "urdf" are returned unchanged; `on` resolves them for an arm.

        Raises:
            RobotDynError: If the numbers have the wrong shape or sign, or are not finite; its class is `error`.
        """
        if allow_unresolved and (self.is_per_joint or self.is_list) and isinstance(values, Mapping):
            if not values:
                raise error(f"{name} names no joint; give values by joint, or one number for all joints")
            if self.is_per_joint:
                return values
            rows = replace(self, shapes=(("k",),))
            options: dict[str, Any] = {"error": error, "allow_unresolved": False}
            return {joint: np.asarray(rows.checked(f"{name} of {joint}", x, **options)) for joint, x in values.items()}
        if allow_unresolved and self.stated and isinstance(values, str) and values == URDF:
            return URDF
        if allow_unresolved and self.stated in ("lower", "upper") and isinstance(values, str) and values == URDF_SOFT:
            return URDF_SOFT
        if allow_unresolved and self.stated and isinstance(values, str):
            raise error(f'{name} must be real numbers or "{URDF}", got {shorten(values)!r}')
        array = numbers(
            name,
            values,
            *self.shapes,
            error=error,
            least=self.minimum,
            above=self.exclusive_minimum,
            infinite=self.infinite,
        )
        return float(array) if self.shapes == ((),) else array

    def on(
        self, name: str, values: ArrayLike | Mapping[str, float], dynamics: HasJointNames
    ) -> ArrayLike | Mapping[str, float]:
        """Return the numbers for the joints of an arm: "urdf", and numbers by joint name, become arrays (n,).

        Raises:
            EffectError: If a joint is unknown, the file states no value, or the number of joints differs.
        """
        names = dynamics.joint_names
        if isinstance(values, Mapping):
            for joint in values.keys() - set(names):
                raise EffectError(f"{name}: no joint {joint!r}; {nearest(str(joint), names)}")
            return values if self.is_list else [values.get(joint, self.fill_value) for joint in names]
        if values is URDF or values is URDF_SOFT:
            return self._stated(name, values, dynamics)
        if self.is_per_joint and np.ndim(values) and np.shape(values) != (len(names),):
            length = np.shape(values)[0]
            count = f"{length} joint{'s' if length > 1 else ''}"
            raise EffectError(
                f"{name} has values for {count}, but the arm has {len(names)}; give one number for all joints, or one"
                " for each joint"
            )
        return values

    def _stated(self, name: str, values: str, dynamics: Any) -> np.ndarray:
        try:
            stated = getattr(dynamics, f"soft_{self.stated}" if values is URDF_SOFT else self.stated)
        except AttributeError:
            raise EffectError(f"{name}={values!r} needs a Robot, got {type(dynamics).__name__}") from None
        if np.all(stated == self.fill_value):
            raise EffectError(
                f"{name}={values!r} has no effect: the file of {dynamics.name} states no value for any joint; give"
                " numbers, or remove the effect"
            )
        return stated


def coefficient(
    unit: str = "",
    *,
    symbol: str = "",
    shapes: tuple[tuple[int | str, ...], ...] = JOINTS,
    minimum: float | None = None,
    exclusive_minimum: float | None = None,
    infinite: bool = False,
    fill_value: float = 0.0,
    stated: str = "",
    can_vary: bool = True,
) -> Mapping[str, Coefficient]:
    """Return metadata that declares a dataclass field as a coefficient; for the arguments, see `Coefficient`."""
    form = {"shapes": shapes, "minimum": minimum, "exclusive_minimum": exclusive_minimum, "infinite": infinite}
    return {_KEY: Coefficient(unit, symbol, **form, fill_value=fill_value, stated=stated, can_vary=can_vary)}


@cache
def declared(kind: type) -> Mapping[str, Coefficient]:
    """Return the coefficients that a class declares, by name."""
    return {field.name: field.metadata[_KEY] for field in _fields(kind) if _KEY in field.metadata}


@cache
def defaults(kind: type) -> Mapping[str, object]:
    """Return the default values of a class's coefficients by name; those without a default are left out."""
    names = declared(kind)
    return {x.name: x.default for x in _fields(kind) if x.name in names and x.default is not MISSING}


def _fields(kind: type) -> tuple[Field[Any], ...]:
    return fields(kind) if is_dataclass(kind) else ()


def check_coefficients(part: object, error: type[RobotDynError], *, allow_unresolved: bool = False) -> None:
    """Check and freeze the coefficients of a part under construction; see `Coefficient.checked`."""
    for name, declared_as in declared(type(part)).items():
        value = getattr(part, name)
        if value is None and defaults(type(part)).get(name, 0) is None:
            continue  # optional
        object.__setattr__(part, name, declared_as.checked(name, value, error=error, allow_unresolved=allow_unresolved))


def with_values(part: Owner, values: Mapping[str, object]) -> Owner:
    """Return a copy of a part with other coefficients. They are not checked, so they may be symbols.

    A name may be a path into a nested part, such as "controller.kp" or "position.0.resolution".
    """
    if not values:
        return part
    inside = _by_head(values)
    changed = _without_caches(part) if declared(type(part)).keys() & values.keys() else copy(part)
    for name, value in values.items():
        if "." not in name:
            object.__setattr__(changed, name, value)
    for head, below in inside.items():
        object.__setattr__(changed, head, _within(getattr(changed, head), below, with_values))
    return changed


def _without_caches(part: Owner) -> Owner:
    """Return a copy of a part without its cached properties, which may depend on its coefficients."""
    changed, caches = object.__new__(type(part)), cached_properties(part)
    vars(changed).update({name: x for name, x in vars(part).items() if name not in caches})
    return changed


def cached_properties(part: object) -> tuple[str, ...]:
    """Return the names of the cached properties of a part that have been evaluated."""
    kind = type(part)
    return tuple(name for name in getattr(part, "__dict__", ()) if _is_cached(kind, name))


@cache
def _is_cached(kind: type, name: str) -> bool:
    return isinstance(getattr_static(kind, name, None), cached_property)


def rebuilt(part: Owner, values: Mapping[str, object]) -> Owner:
    """Return a copy of a part with other coefficients; its constructor checks them."""
    inside = {head: _within(getattr(part, head), below, rebuilt) for head, below in _by_head(values).items()}
    instance_: Any = part
    return replace(instance_, **{name: value for name, value in values.items() if "." not in name}, **inside)


def value_at(part: object, path: str) -> ArrayLike | None:
    """Return the coefficient of a part at a path; None if it is optional and has no value."""
    value: Any = part
    for name in path.split("."):
        value = value[int(name)] if isinstance(value, tuple) else getattr(value, name)
    return value


def _by_head(values: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """Group values inside nested parts by the attribute of the part, then by the rest of the path."""
    parts: dict[str, dict[str, object]] = {}
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if rest:
            parts.setdefault(head, {})[rest] = value
    return parts


def _within(part: Any, values: dict[str, object], change: Callable[[Any, Mapping[str, object]], Any]) -> Any:
    if not isinstance(part, tuple):
        return change(part, values)
    inside = _by_head(values)
    return tuple(change(x, inside[str(k)]) if str(k) in inside else x for k, x in enumerate(part))
