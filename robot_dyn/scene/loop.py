"""Blocks of the loop of a controller in a scene; their keys are what their classes declare, in the unit of the line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from inspect import getdoc
from typing import Annotated, Any, ClassVar, Literal, Union

from pydantic import ConfigDict, Field, create_model

from robot_dyn.coefficients import Coefficient, declared
from robot_dyn.control.digital_loop.block import SIGNAL, Block, Differences, Noise, Quantisation, RateLimit, name_of
from robot_dyn.control.digital_loop.loop import LINES
from robot_dyn.control.digital_loop.low_pass import LowPass
from robot_dyn.model.robot import Robot
from robot_dyn.scene.declared import key_of
from robot_dyn.scene.schema import Part, PerJoint, per_joint

_UNITS: dict[str, str] = dict(zip(LINES, ("rad", "rad/s", "N m"), strict=True))


class BlockPart(Part):
    """A block of a line of a loop."""

    model_config = ConfigDict(use_attribute_docstrings=False)  # to look for texts in a source that is not there is slow

    make: ClassVar[type[Block]]
    keys: ClassVar[Mapping[str, tuple[str, Coefficient | None]]] = {}
    """By key: the argument, and what is declared of it."""

    def build(self, robot: Robot) -> Block:
        """The block."""
        given = {name: (getattr(self, key), each) for key, (name, each) in self.keys.items()}
        return self.make(
            **{name: x if each is None else per_joint(name, x, robot) for name, (x, each) in given.items()}
        )


def _part(line: str, of: Any) -> type[BlockPart]:
    """The part of a scene that describes a block in a line."""
    known, keys = declared(of), dict[str, tuple[str, Coefficient | None]]()
    made: dict[str, Any] = {"kind": (Literal[name_of(of)], ...)}  # pyright: ignore[reportInvalidTypeForm]
    for each in fields(of):
        own = known.get(each.name)
        key = each.name if own is None else key_of(each.name, own.unit.replace(SIGNAL, _UNITS[line]))
        keys[key] = each.name, own
        default = ... if each.default is MISSING else each.default
        form, text = (Literal[1, 2], "Order.") if own is None else (PerJoint, f"{own.symbol}.")
        made[key] = form, Field(default, description=text)
    text = (getdoc(of) or "").partition("\n\nAttributes:")[0]
    part = create_model(f"{of.__name__}Of{line.title()}", __base__=BlockPart, __doc__=text, **made)
    part.make, part.keys = of, keys
    return part


_CLASSES: dict[str, tuple[type[Block], ...]] = {
    "position": (Noise, Quantisation, LowPass),
    "velocity": (Differences, Noise, Quantisation, LowPass),
    "actuation": (LowPass, Quantisation, RateLimit, Noise),
}
BLOCKS = {line: tuple(_part(line, each) for each in classes) for line, classes in _CLASSES.items()}
PositionBlock, VelocityBlock, ActuationBlock = (
    Annotated[Union[BLOCKS[line]], Field(discriminator="kind")]  # pyright: ignore  # noqa: UP007
    for line in LINES
)
