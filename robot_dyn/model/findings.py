"""Findings: doubtful values in a valid robot description, each with its remedy in one sentence.

`urdf.py` refuses meaningless files; findings report valid but probably unintended values. docs/reference/findings.md
lists criteria and reasons. Each function yields the findings of one kind.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import hypot
from typing import Any

import numpy as np

from robot_dyn.description.coordinate_limits import position_limits, speed_limits
from robot_dyn.description.couplings import resolve
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.description.inertia import implausibility
from robot_dyn.description.markup import parse
from robot_dyn.description.other_programs import ARMATURE, STIFFNESS, of_coordinates, statements
from robot_dyn.description.structure import StatedLink, Structure, stands_on, structure_of
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.errors import shorten
from robot_dyn.model.conditioning import MIN_DIGITS, NearlySingular, Regularity

LONGEST = 1e4  # [m]; also for multipliers of mimic joints: sums with such a length have rounding errors of 1e-12 m
LIGHTEST = 1e-12  # [kg]
_OTHER_PROGRAMS = b"otorInertia", b"rotor_inertia", b"tiffness"  # one occurs in any element `for_other_programs` reads
_LISTED = 6  # maximum number of names in a finding


def findings_of(description: Description, edits: Edits, regularity: Regularity) -> tuple[str, ...]:
    """Return the findings about a description and about the robot with its edits: location, problem and remedy."""
    kinds = (
        massless_bodies, moments_without_mass, impossible_inertias, tiny_masses, inertias_beyond_reach,
        centres_beyond_reach, long_lengths, large_ratios, welded_base, zero_efforts, zero_speeds, equal_limits,
        followers_beyond_limits, impossible_inertias_of_the_base,
    )  # fmt: skip
    robot = structure_of(description, edits)
    of_kinds = (finding for kind in kinds for finding in kind(robot))
    joint = None if regularity.near else regularity.joint
    singular, near = no_inertia_about_axis(robot, joint), hardly_any_inertia(regularity.near)
    return (*reading_findings(description), *singular, *of_kinds, *near, *for_other_programs(robot, description))


def reading_findings(description: Description) -> tuple[str, ...]:
    """Return findings on estimated inertias, and on assumptions and omissions made while reading the file."""
    return (*estimated_links(description), *description.findings)


def estimated_links(description: Description) -> Iterator[str]:
    """Report links whose inertia was estimated from shapes."""
    if names := [*description.estimated]:
        yield (
            f"{_named('link', names)}: mass or inertia is estimated from shapes, so torques are rough; replace the"
            " estimates by measured values where you have them"
        )


def impossible_inertias(robot: Structure) -> Iterator[str]:
    """Report moving links, before merging, with impossible mass and moments."""
    for name, link in robot.links.items():
        if name not in robot.base and (why := _why_impossible(link)):
            yield f"link {name!r}: {why}; correct the inertia of this link: its numbers, their order or signs"


def impossible_inertias_of_the_base(robot: Structure) -> Iterator[str]:
    """Report links fixed to the world with impossible mass and moments."""
    for name in robot.base:
        if why := _why_impossible(robot.links[name]):
            yield (
                f"link {name!r}: {why}; correct the inertia of this link, which has no effect while it is fixed to the"
                " world"
            )


def massless_bodies(robot: Structure) -> Iterator[str]:
    """Report moving bodies whose links have neither mass nor moments."""
    for joint in robot.bodies:
        if not _has_mass(robot, joint):
            yield (
                f"link {robot.joints[joint].child!r} moves but has no mass; add an <inertial>, or make its joint fixed"
            )


def moments_without_mass(robot: Structure) -> Iterator[str]:
    """Report moving links with moments of inertia but no mass, which is unphysical; programs differ on them."""
    for name, link in robot.links.items():
        if name not in robot.base and link.mass == 0 and any(link.moments):
            most = np.abs(np.linalg.eigvalsh(link.inertia)).max()
            yield (
                f"link {name!r}: has moments of inertia up to {most:.3g} kg m² but no mass; they are used here, and"
                " MuJoCo drops them; add a mass, or remove its <inertial>"
            )


def inertias_beyond_reach(robot: Structure) -> Iterator[str]:
    """Report moving links with ½ tr I > m (10 L)², L the longest distance between neighbouring joints: a wrong unit."""
    for name, link in robot.links.items():
        tiny = link.mass < LIGHTEST  # reported separately
        if name not in robot.base and not tiny and (radius := robot.radius_beyond_reach(link.mass, link.inertia)):
            yield (
                f"link {name!r}: for {link.mass:g} kg, its inertia needs mass at least {radius:.3g} m from the centre,"
                f" but neighbouring joints of this robot are at most {robot.longest_link:.3g} m apart; correct"
                " the inertia or its unit"
            )


def centres_beyond_reach(robot: Structure) -> Iterator[str]:
    """Report moving links with |c| > 2 L and 0.3 m, L as above: a centre of mass in a wrong frame or unit."""
    for name, link in robot.links.items():
        if name not in robot.base and link.mass >= LIGHTEST and (distance := robot.beyond_reach(link.com)):
            yield (
                f"link {name!r}: its centre of mass is {distance:.3g} m from the origin of the link, but neighbouring"
                f" joints of this robot are at most {robot.longest_link:.3g} m apart; give it in the frame of the link,"
                " in metres"
            )


def no_inertia_about_axis(robot: Structure, joint: str | None) -> Iterator[str]:
    """Report a joint whose bodies have mass only on its axis, so that M is singular."""
    # a massless body may join two coincident axes; it is then reported as the cause instead
    if joint is not None and all(_has_mass(robot, other) for other in robot.bodies):
        yield (
            f"joint {joint!r}: the bodies it moves have mass but no inertia about its axis, so M is singular; add"
            " moments of inertia to its link, or armature to the joint"
        )


def hardly_any_inertia(near: NearlySingular | None) -> Iterator[str]:
    """Report a mass matrix so nearly singular that rounding destroys most digits of forward dynamics."""
    if near is not None:
        yield (
            f"joint {near.joint!r}: M is nearly singular, κ = {near.condition:.1e}, so forward dynamics may have only"
            f" {near.digits:.0f} correct digits; correct the inertia it moves, or add armature (queries warn below"
            f" {MIN_DIGITS} digits; rd.accuracy.warn_below(robot, None) turns this off)"
        )


def tiny_masses(robot: Structure) -> Iterator[str]:
    """Report links with a positive mass too small for any part of an arm."""
    for name, link in robot.links.items():
        if 0 < link.mass < LIGHTEST:
            yield f"link {name!r}: its mass of {link.mass:g} kg is below {LIGHTEST:g} kg; correct it or its unit"


def long_lengths(robot: Structure) -> Iterator[str]:
    """Report joint origins and centres of mass so far from their link's frame that digits are lost."""
    lengths = [(f"link {name!r}: its centre of mass", link.com) for name, link in robot.links.items()]
    lengths += [(f"joint {name!r}: its origin", joint.xyz) for name, joint in robot.joints.items()]
    for item, xyz in lengths:
        if (length := hypot(*xyz)) > LONGEST:
            yield f"{item} is {length:g} m away, over {LONGEST:g} m, which loses digits; correct it or its unit"


def large_ratios(robot: Structure) -> Iterator[str]:
    """Report mimic joints with a multiplier so large that digits are lost."""
    for name in robot.mimics:
        source, ratio, _ = resolve(name, robot.mimics, FLOAT64)
        if abs(ratio) > LONGEST:
            yield (
                f"joint {name!r}: moves {ratio:g} times as far as {source!r}, over {LONGEST:g}, which loses digits;"
                " correct the multiplier of its <mimic>"
            )


def zero_efforts(robot: Structure) -> Iterator[str]:
    """Report effort limits of 0, usually values that were never filled in. Only comparisons of torques use them."""
    return _zero_limits(robot, "effort", "N m or N")


def zero_speeds(robot: Structure) -> Iterator[str]:
    """Report velocity limits of 0, usually values that were never filled in."""
    return _zero_limits(robot, "velocity", "rad/s or m/s")


def _zero_limits(robot: Structure, limit: str, unit: str) -> Iterator[str]:
    if names := [name for name in robot.free if getattr(robot.joints[name], limit) == 0]:
        yield (
            f"{_joints(names)}: the {limit} limit is 0, which allows no {limit}; give the limit in {unit}, or remove"
            " the attribute"
        )


def equal_limits(robot: Structure) -> Iterator[str]:
    """Report joints whose lower and upper limits are equal."""
    if names := [name for name in robot.free if robot.joints[name].lower == robot.joints[name].upper]:
        yield f"{_joints(names)}: the lower and upper limits are equal; correct them, or make the joint fixed"


def followers_beyond_limits(robot: Structure) -> Iterator[str]:
    """Report followers that leave their own limits while the joint they follow is within its limits."""
    for of_joints, kind in ((position_limits(robot), "position"), (speed_limits(robot), "velocity")):
        for source, limit in of_joints.items():
            for name, (low, high) in limit.exceeded.items():
                yield (
                    f"joint {name!r}: follows {source!r} beyond its own {kind} limits, [{low:g}, {high:g}], which are"
                    f" not enforced: they would leave {source!r} hardly any range; correct its <limit> or <mimic>"
                )


def for_other_programs(robot: Structure, description: Description) -> Iterator[str]:
    """Report rotors and springs that the file states for other programs and that no edit has added."""
    if not any(word in description.text for word in _OTHER_PROGRAMS):
        return
    stated = of_coordinates(robot, statements(parse(description.text, description.source)[0]))
    armature = {
        name: x[ARMATURE] for name, x in stated.items() if x.get(ARMATURE) and name not in dict(robot.edits.armature)
    }
    stiffness = {name: x[STIFFNESS] for name, x in stated.items() if x.get(STIFFNESS)}
    for numbers, quantity, units, remedy in (
        (
            armature,
            "a reflected rotor inertia of {}, which M does not contain",
            ("kg m²", "kg"),
            'with_(armature="urdf") adds it',
        ),
        (
            stiffness,
            "a spring of {}, which has no effect",
            ("N m/rad", "N/m"),
            'the effect Spring("urdf", rest="urdf") adds it',
        ),
    ):
        if numbers:
            by_unit: dict[str, list[float]] = {}
            for name, value in numbers.items():
                by_unit.setdefault(units[robot.joints[name].kind == "prismatic"], []).append(value)
            largest = " and ".join(f"{max(values):.3g} {unit}" for unit, values in by_unit.items())
            largest = f"{'up to ' if len(numbers) > 1 else ''}{largest}"
            yield f"{_joints(numbers)}: the file states, for other programs only, {quantity.format(largest)}; {remedy}"


def welded_base(robot: Structure) -> Iterator[str]:
    """Report a legged, wheeled or flying robot whose root link is fixed to the world."""
    if signs := stands_on(robot):
        yield (
            f"link {robot.root!r}: the base of a robot with legs, wheels or rotors"
            f" ({', '.join(map(repr, signs[:_LISTED]))}) is fixed to the world, because floating bases are not"
            " supported; results apply to the robot on a stand"
        )


def _why_impossible(link: StatedLink) -> str | None:
    return implausibility(link.mass, np.zeros(3), link.inertia)


def _has_mass(robot: Structure, joint: str) -> bool:
    """Return True if the body that a joint carries has mass or moments, including payloads and armature."""
    links, edits = robot.bodies[joint], robot.edits
    stated = any(robot.links[name].mass or any(robot.links[name].moments) for name in links)
    carried = any(load.frame in links and (load.mass or np.any(load.inertia)) for load in edits.payloads)
    return stated or carried or dict(edits.armature).get(joint, 0.0) > 0


def _joints(names: Iterable[Any]) -> str:
    return _named("joint", names)


def _named(kind: str, names: Iterable[Any]) -> str:
    names = list(names)
    shown = ", ".join(repr(shorten(name)) for name in names[:_LISTED])
    more = f", … ({len(names)} in all)" if len(names) > _LISTED else ""
    return f"{kind}{'s' if len(names) > 1 else ''} {shown}{more}"
