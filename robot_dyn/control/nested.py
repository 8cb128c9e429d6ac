"""Controllers in a controller, as in a loop or in a sum of two rates."""

from __future__ import annotations

from typing import Any

from robot_dyn.control.controller import Controller, Nested
from robot_dyn.errors import ControlError, shown


def check_sampled(name: str, controller: Any) -> None:
    """ControlError if it is not a sampled controller that a loop may hold."""
    if not isinstance(controller, Controller):
        raise ControlError(f"{name} must be a controller, such as rd.PD(…, period_s=1e-3), got {shown(controller)}")
    if controller.outermost:
        raise ControlError(
            f"{name} must not be a {type(controller).__name__}: give the controller in it, and put the loop around all"
        )
    if not controller.period_s > 0:
        raise ControlError(f"{name} acts continuously, and a loop samples: give {controller.name} a period_s")


def nested(of: Controller, attribute: str, label: str) -> tuple[Nested, ...]:
    """A controller that is an attribute of another, and what is in it."""
    part: Controller = getattr(of, attribute)
    below = (Nested(f"{attribute}.{path}", f"{label}{own}", each) for path, own, each in part.parts)
    return Nested(attribute, label, part), *below
