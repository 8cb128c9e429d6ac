"""Former names of what is public: they work for one release, with a DeprecationWarning that tells the new name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, TypeVar, final
from warnings import warn

_NOWHERE: Any = object()
Function = TypeVar("Function", bound=Callable[..., Any])
Made = TypeVar("Made")


def tell(former: str, name: str, *, up: int) -> None:
    """Warn that `former` is now `name`; the line shown is `up` calls above this function."""
    warn(f"{former} is now {name}; the former name goes with the next release", DeprecationWarning, stacklevel=up + 1)


def arguments(**names: str) -> Callable[[Function], Function]:
    """A decorator: the function takes the keyword arguments `former=new` by their former names as well.

    Raises:
        TypeError: In a call that gives both.
    """

    def decorate(function: Function) -> Function:
        @wraps(function)
        def call(*args: Any, **options: Any) -> Any:
            for former in names.keys() & options.keys():
                name, what = names[former], function.__qualname__.removesuffix(".__init__")
                if name in options:
                    raise TypeError(f"{what} got {name} twice: {former} is its former name")
                tell(f"{former} of {what}", name, up=2)
                options[name] = options.pop(former)
            return function(*args, **options)

        return call  # pyright: ignore[reportReturnType]

    return decorate


@final
class Attribute:
    """An attribute or method under its former name, in the body of its class: `former = Attribute("new")`."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __set_name__(self, owner: type, former: str) -> None:
        self.former = former

    def __get__(self, instance: Any, owner: type) -> Any:
        if instance is None:
            return self
        tell(f"{owner.__name__}.{self.former}", self.name, up=2)
        for each in owner.__mro__:  # super().former() in a class that defines it asks for the next definition
            found = vars(each).get(self.name, _NOWHERE)
            if found is not _NOWHERE and not isinstance(found, _Adopted) and self.name not in vars(instance):
                return found.__get__(instance, owner) if hasattr(found, "__get__") else found
        return getattr(instance, self.name)


def fields(**names: str) -> Callable[[type[Made]], type[Made]]:
    """A decorator of a dataclass: fields `former=new` are taken and read by their former names as well."""

    def decorate(made: type[Made]) -> type[Made]:
        made.__init__ = arguments(**names)(made.__init__)
        for former, name in names.items():
            attribute = Attribute(name)
            attribute.__set_name__(made, former)
            setattr(made, former, attribute)
        return made

    return decorate


@final
class _Adopted:
    """What a class outside this library defines under a former name."""

    def __init__(self, former: str) -> None:
        self.former = former

    def __get__(self, instance: Any, owner: type) -> Any:
        return self if instance is None else getattr(instance, self.former)


def adopt(made: type, names: Mapping[str, str]) -> None:
    """Let a class that defines the former of some names have the new ones too; for `__init_subclass__` of an ABC."""
    defined = vars(made).keys() | vars(made).get("__annotations__", {}).keys()
    for former, name in names.items():
        if former in defined and name not in defined:
            tell(f"{made.__name__}.{former}", name, up=4)
            setattr(made, name, _Adopted(former))


def module_names(module: dict[str, Any], **names: str) -> Callable[[str], Any]:
    """`__getattr__` of a module, whose globals are given, that knows `former=new`."""

    def get(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module['__name__']!r} has no attribute {name!r}")
        tell(name, names[name], up=2)
        return module[names[name]]

    return get
