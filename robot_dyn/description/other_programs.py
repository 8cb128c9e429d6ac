"""Rotors, gears, springs and soft limits that a URDF states for other programs.

None of it acts unless an effect or edit asks for it. The elements are <transmission> of ROS control and of Drake,
<gazebo>, <safety_controller>, and more attributes of <dynamics> than URDF defines.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isfinite
from typing import final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.couplings import resolve
from robot_dyn.description.markup import number_of
from robot_dyn.description.structure import Structure
from robot_dyn.foundations.arithmetic import FLOAT64

ARMATURE, STIFFNESS, REST, DAMPING, LOWER, UPPER = (
    "armature",
    "stiffness",
    "rest",
    "damping",
    "soft_lower",
    "soft_upper",
)

_LISTED = 6  # maximum number of joints in a line
# the quantity of each name, in elements of a joint or a <gazebo> about it
_NAMES = {
    "rotor_inertia": ARMATURE,
    "stiffness": STIFFNESS,
    "spring_stiffness": STIFFNESS,
    "springStiffness": STIFFNESS,
    "spring_reference": REST,
    "springReference": REST,
    "dampingFactor": DAMPING,
    "soft_lower_limit": LOWER,
    "soft_upper_limit": UPPER,
}
_USE = {
    ARMATURE: 'arm.with_(armature="urdf")',
    STIFFNESS: 'rd.effects.Spring("urdf", rest=…)',
    REST: 'rd.effects.Spring(…, rest="urdf")',
    DAMPING: "rd.effects.ViscousFriction",
    LOWER: 'arm.with_soft_limits(), or stops with lower="urdf_soft"',
    UPPER: 'arm.with_soft_limits(), or stops with upper="urdf_soft"',
}
_UNITS = {
    ARMATURE: "kg m²",
    STIFFNESS: "N m/rad or N/m",
    REST: "rad or m",
    DAMPING: "N m s/rad or N s/m",
    LOWER: "rad or m",
    UPPER: "rad or m",
}


@final
@dataclass(frozen=True)
class Statement:
    """A number that the file states for another program.

    Attributes:
        joint: Name of the joint.
        quantity: "armature", "stiffness", "rest", "damping", "soft_lower" or "soft_upper".
        value: In SI units; nan if the text is not a number. Armature is n² J of a rotor inertia J and a gear ratio n.
        element: The element that states it.
    """

    joint: str
    quantity: str
    value: float
    element: str


def in_words(stated: Iterable[Statement]) -> Iterator[str]:
    """Return one line for each quantity: its values by joint, the element, and how to use it."""
    grouped: dict[tuple[str, str], list[Statement]] = {}
    for item in stated:
        grouped.setdefault((item.quantity, item.element), []).append(item)
    for (quantity, element), items in grouped.items():
        values = [f"{x.joint} {x.value:g}" if isfinite(x.value) else f"{x.joint} not a number" for x in items[:_LISTED]]
        more = f", … ({len(items)} in all)" if len(items) > _LISTED else ""
        unit, use = _UNITS[quantity], _USE[quantity]
        yield f"{quantity} in {unit} by <{element}>: {', '.join(values)}{more}; not used; to use it: {use}"


def statements(robot: etree._Element) -> tuple[Statement, ...]:
    """Return the numbers that a file states for other programs, in its order."""
    return tuple(_statements(robot))


def _statements(robot: etree._Element) -> Iterator[Statement]:
    for element in robot:
        tag = _local(element)
        if tag == "transmission":
            yield from _transmission(element)
        elif tag == "joint":
            name = (element.get("name") or "").strip()
            for tag in ("dynamics", "safety_controller"):  # the first of each counts, as in the reader of URDF
                if (child := next((x for x in element if _local(x) == tag), None)) is not None:
                    yield from _attributes(name, child)
        elif tag == "gazebo" and (name := (element.get("reference") or "").strip()):
            for child in element.iter():
                if (quantity := _NAMES.get(_local(child))) is not None:
                    yield Statement(name, quantity, number_of(child.text), f"gazebo> <{_local(child)}")


def _transmission(element: etree._Element) -> Iterator[Statement]:
    """Yield the reflected inertia n² J of each joint of a transmission that states a rotor inertia."""
    parts = {_local(child): child for child in element.iter()}
    rotor = next((parts[name] for name in ("motorInertia", "rotor_inertia") if name in parts), None)
    gear = next((parts[name] for name in ("mechanicalReduction", "gear_ratio") if name in parts), None)
    if rotor is None:
        return
    n = 1.0 if gear is None else _content(gear)
    names = [(child.get("name") or "").strip() for child in element if _local(child) == "joint"]
    for name in names if len(names) == 1 else ():
        yield Statement(name, ARMATURE, n * n * _content(rotor), f"transmission> <{_local(rotor)}")


def _attributes(joint: str, element: etree._Element) -> Iterator[Statement]:
    for key, text in element.attrib.items():
        if (quantity := _NAMES.get(key)) is not None:
            gear = number_of(element.get("gear_ratio", "1")) if quantity == ARMATURE else 1.0
            yield Statement(joint, quantity, gear * gear * number_of(text), f"{_local(element)} {key}")


def _content(element: etree._Element) -> float:
    """Return the number of an element: its attribute `value`, as Drake writes it, or its text."""
    return number_of(element.get("value", element.text))


def _local(element: etree._Element) -> str:
    """Return the tag without its namespace or undeclared prefix; "" for a comment."""
    return element.tag.rpartition("}")[2].rpartition(":")[2] if isinstance(element.tag, str) else ""


def of_coordinates(robot: Structure, stated: tuple[Statement, ...]) -> dict[str, dict[str, float]]:
    """Return the stated numbers of each coordinate, by joint, then by quantity; unstated ones are left out.

    Where several elements state one quantity of a joint, the last one counts. A follower at s q + s₀ adds s² times its
    armature and its stiffness; springs with different rest positions act like one. Soft limits are those of the joint
    itself.
    """
    of_joints: dict[str, dict[str, float]] = {name: {} for name in robot.moving}
    for item in stated:
        if item.joint in of_joints:
            of_joints[item.joint][item.quantity] = item.value
    result: dict[str, dict[str, float]] = {name: {} for name in robot.free}
    for joint, numbers in of_joints.items():
        source, ratio, offset = resolve(joint, robot.mimics, FLOAT64)
        ratio, offset = float(ratio), float(offset)
        own = result[source]
        if ARMATURE in numbers:
            own[ARMATURE] = own.get(ARMATURE, 0.0) + ratio**2 * numbers[ARMATURE]
        if k := ratio**2 * numbers.get(STIFFNESS, 0.0):
            before, rest = own.get(STIFFNESS, 0.0), (numbers.get(REST, 0.0) - offset) / ratio
            own |= {STIFFNESS: before + k, REST: (before * own.get(REST, 0.0) + k * rest) / (before + k)}
        if joint == source:
            own |= {name: numbers[name] for name in (LOWER, UPPER) if name in numbers}
    return result
