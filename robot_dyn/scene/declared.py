"""Effects in a scene whose keys are the coefficients that their classes declare: name and unit, defaults, "urdf"."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import Parameter, getdoc, signature
from math import isinf
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, Field, create_model

from robot_dyn.coefficients import URDF, Coefficient, declared
from robot_dyn.effects.effect import Effect
from robot_dyn.model.robot import Robot
from robot_dyn.scene.schema import Part, PerJoint, Stated, per_joint

_SPELLED = {" ": "_", "/": "_per_", "²": "2", "(": "", ")": ""}


class Acting(Part):
    """An effect of the plant."""

    term: ClassVar[str] = ""
    """Its equation in a few signs."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The effects of this table."""
        raise NotImplementedError


class Declared(Acting):
    """An effect made of the coefficients that its classes declare."""

    model_config = ConfigDict(use_attribute_docstrings=False)  # to look for texts in a source that is not there is slow

    make: ClassVar[Callable[..., Any]]
    keys: ClassVar[Mapping[str, tuple[str, Coefficient]]] = {}
    """By key: the argument, and what is declared of it."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        arguments = {
            name: per_joint(name, getattr(self, key), robot, elsewhere=each.elsewhere)
            for key, (name, each) in self.keys.items()
            if getattr(self, key) is not None
        }
        made = type(self).make(**arguments)
        return made if isinstance(made, tuple) else (made,)


def declared_part(
    kind: str, *classes: type[Effect], make: Callable[..., Any] | None = None, text: str = ""
) -> type[Declared]:
    """The part of a scene that describes effects of some classes.

    Args:
        kind: Its name in scenes.
        *classes: What it makes.
        make: What makes them of their coefficients; the one class unless given.
        text: What it is; the text of the class unless given.
    """
    make = make or classes[0]
    keys, defaults = keys_of(make, *classes), signature(make).parameters
    fields: dict[str, Any] = {"kind": (Literal[kind], ...)}  # pyright: ignore[reportInvalidTypeForm]
    for key, (name, each) in keys.items():
        default = defaults[name].default
        default = (URDF if each.stated else ...) if default is Parameter.empty else default
        none = f"; joints left out have {'none' if isinf(each.elsewhere) else f'{each.elsewhere:g}'}"
        none = none if each.elsewhere else ""
        fields[key] = (Stated if each.stated else PerJoint, Field(default, description=f"{each.symbol}{none}."))
    text = text or (getdoc(classes[0]) or "").partition("\n\nAttributes:")[0]
    part = create_model(kind, __base__=Declared, __doc__=text, **fields)
    part.make, part.keys = staticmethod(make), keys
    part.term = " ".join(each.term for each in classes).replace(" −", " − ").replace("−  ", "− ")
    return part


def keys_of(make: Callable[..., Any], *classes: type) -> dict[str, tuple[str, Coefficient]]:
    """The keys of the coefficients that classes declare and `make` takes, with the argument of each."""
    known = {name: each for kind in reversed(classes) for name, each in declared(kind).items()}
    return {key_of(name, known[name].unit): (name, known[name]) for name in signature(make).parameters if name in known}


def key_of(name: str, unit: str) -> str:
    """A name and its unit, as "damping_N_m_s_per_rad"."""
    spelled = "".join(_SPELLED.get(letter, letter) for letter in unit)
    return f"{name}_{spelled}" if spelled else name
