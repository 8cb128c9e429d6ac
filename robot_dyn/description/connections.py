"""Connections of links and joints: one tree with one root; every chain of mimic joints ends at a moving joint."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.foundations.errors import nearest, shorten

LARGEST = 1e12  # limit of lengths, masses, moments and ratios, beyond which the equations of motion overflow

Refuse = Callable[[str, str], NoReturn]  # where and why


def one_tree(links: list[str], robot: etree._Element, refuse: Refuse) -> None:
    """Refuse a robot without exactly one root, with two parents of a link, or with a cycle."""
    parent_of: dict[str, str] = {}
    joint_of: dict[str, str] = {}
    for joint in robot.iterfind("joint"):
        parent, child, name = joint.find("parent").get("link"), joint.find("child").get("link"), joint.get("name")
        if child in parent_of:
            both = f"{parent_of[child]!r} by joint {joint_of[child]!r} and {parent!r} by joint {name!r}"
            remedy = "remove one of the joints; a <mimic> in the other can make one joint follow another"
            refuse(f"link {child!r}", f"has two parents, {both}; {remedy}")
        parent_of[child], joint_of[child] = parent, name
    roots = [link for link in links if link not in parent_of]
    if len(roots) > 1:
        listed = ", ".join(repr(root) for root in roots[:5])
        refuse("robot", f"has {len(roots)} roots: {listed}; join them to one root by joints")
    reached = set(roots)
    for link in links:
        path: list[str] = []
        while link not in reached:
            if link in path:
                loop = _loop([*path[path.index(link) :], link])
                refuse(f"link {link!r}", f"is its own ancestor: {loop}; remove one joint of the loop")
            path.append(link)
            link = parent_of[link]
        reached.update(path)


def mimics(robot: etree._Element, refuse: Refuse) -> None:
    """Refuse a mimic joint whose source is undefined, fixed or its own follower, and chains that grow without bound."""
    kinds = {joint.get("name"): joint.get("type") for joint in robot.iterfind("joint")}
    couplings = {joint.get("name"): joint.find("mimic") for joint in robot.iterfind("joint[mimic]")}
    for follower, coupling in couplings.items():
        where, source = f"joint {follower!r}", coupling.get("joint")
        if source not in kinds:
            refuse(where, f"mimics {shorten(source)!r}, which is not defined; {nearest(source, kinds)}")
        if kinds[source] == "fixed":
            refuse(where, f"mimics {source!r}, which is fixed and never moves; make {follower!r} fixed too")
    for follower in couplings:
        where, chain, ratio, offset = f"joint {follower!r}", {follower: None}, 1.0, 0.0  # a dict: quick to look up
        while (name := next(reversed(chain))) in couplings:
            offset += ratio * float(couplings[name].get("offset"))
            ratio *= float(couplings[name].get("multiplier"))
            source = couplings[name].get("joint")
            if source in chain:
                refuse(where, f"mimics itself: {_loop([*chain, source])}; remove one <mimic>")
            if abs(ratio) > LARGEST:
                refuse(where, f"its chain of mimics multiplies by {ratio:g}; correct a multiplier")
            if abs(offset) > LARGEST:
                refuse(where, f"its chain of mimics adds up to an offset of {offset:g}; correct an offset")
            chain[source] = None


def _loop(names: list[str]) -> str:
    """Return the names along a loop, closed by the first one; a long loop is abbreviated."""
    shown = names if len(names) <= 8 else [*names[:6], "…", names[-1]]
    return " → ".join(shorten(name) for name in shown)
