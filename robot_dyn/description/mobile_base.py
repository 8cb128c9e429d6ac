"""Robots that stand, roll or fly by themselves, recognised by the names in their file.

No number of a URDF says whether its base is bolted down: a hand has the tree of a quadruped. The names do.
"""

from __future__ import annotations

import re

from robot_dyn.description.structure import Structure

_WORLD = ("world", "map", "odom")  # root links of a file that places its base itself
_BASE = re.compile(r"(?i:footprint|flying|quadrotor|hexarotor|drone)")
_PARTS = re.compile(
    r"(?i:foot(?!print)|feet|thigh|ankle|knee|shank|wheel|caster|propeller|rotor_?\d)"
    r"|(?i:leg|toe|shin|calf)[sS]?(?![a-z])"  # no part of a longer word, such as allegro
)


def stands_on(robot: Structure) -> tuple[str, ...]:
    """Names of the links by which a robot stands on its own; none for an arm or a hand.

    Either a link is named after a base that moves (footprint, flying, drone, …), or at least two bodies at the ends of
    different branches have a link named after a part of a leg, a wheel or a rotor. A root link called `world` says that
    the file fixes its base on purpose.
    """
    if robot.root.lower() in _WORLD:
        return ()
    if base := next(filter(_BASE.search, robot.links), ""):
        return (base,)
    named = {joint: hit for joint, links in robot.bodies.items() if (hit := next(filter(_PARTS.search, links), None))}
    inner = {ancestor for joint in named for ancestor in robot.ancestors(joint)}
    outer = tuple(link for joint, link in named.items() if joint not in inner)
    return outer if len(outer) > 1 else ()
