"""Every effect that `robot_dyn.effects` lists, with the example of its docstring; tests of all effects read these."""

from __future__ import annotations

from inspect import getdoc, isabstract, isclass
from typing import Any

import robot_dyn as rd
from robot_dyn.effects import Effect

EFFECTS: dict[str, type[Effect]] = {
    name: kind
    for name, kind in ((name, getattr(rd.effects, name)) for name in rd.effects.__all__)
    if isclass(kind) and issubclass(kind, Effect) and kind is not Effect and not isabstract(kind)
}


def arguments(thing: Any) -> dict[str, Any]:
    """The arguments in the example of a class or function, by name; of an arm with two joints and a link "tip"."""
    lines = (getdoc(thing) or "").partition("Example:\n")[2].splitlines()
    call = " ".join(line.strip().removeprefix(">>> ").removeprefix("... ") for line in lines)
    opening = f"rd.effects.{thing.__name__}("
    assert call.startswith(opening), f"{thing.__name__}: end its docstring with Example:, >>> {opening}…)"
    return eval(call.replace(opening, "dict(", 1), {"rd": rd})


def example(name: str) -> Effect:
    """The effect of the example of a class."""
    return EFFECTS[name](**arguments(EFFECTS[name]))
