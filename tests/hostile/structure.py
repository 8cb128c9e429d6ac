"""Links and joints that form no tree, or none that moves, and joints that follow nothing or without bound."""

from __future__ import annotations

from tests.hostile.kinds import AXIS, BODY, CHILD, ELBOW, PARENT, Make, altered, arm, chain, inside, joint, text, welded


def mimicking(elbow: str, shoulder: str = "") -> Make:
    return text(arm((ELBOW, ELBOW + elbow), (AXIS, AXIS + shoulder)))


def following(ratios: tuple[str, ...], offsets: tuple[str, ...] = ()) -> Make:
    """A chain of joints, each following the one before."""

    def mimic(i: int) -> str:
        offset = offsets[i - 1] if offsets else "0"
        return f'<mimic joint="j{i - 1}" multiplier="{ratios[i - 1]}" offset="{offset}"/>' if i else ""

    return text(chain(len(ratios) + 1, len(ratios) + 1, mimic))


KINDS: dict[str, Make] = {
    "no robot name": altered('<robot name="arm">', "<robot>"),
    "a blank robot name": altered('"arm"', '" "'),
    "a link without name": text(inside("<link/>")),
    "no links": text('<robot name="arm"/>'),
    "a link alone": text(f'<robot name="brick"><link name="brick">{BODY}</link></robot>'),
    "a link defined twice": text(inside('<link name="fore"/>')),
    "a link defined twice but for blanks": text(inside('<link name=" fore "/>')),
    "a joint defined twice": text(inside('<link name="hand"/>' + joint("elbow", "fore", "hand"))),
    "two trees": text(inside('<link name="table"/><link name="leg"/>' + joint("bolt", "table", "leg"))),
    "a cycle beside the root": text(
        inside('<link name="a"/><link name="b"/>' + joint("ab", "a", "b") + joint("ba", "b", "a"))
    ),
    "a joint from a link to itself": text(inside('<link name="a"/>' + joint("aa", "a", "a"))),
    "all links in a cycle": text(inside(joint("back", "fore", "base"))),
    "a link with two parents": text(inside(joint("strut", "base", "fore"))),
    "a parent that is not defined": altered(PARENT, '<parent link="uper"/>'),
    "a child that is not defined": altered(CHILD, '<child link="gripper"/>'),
    "no parent": altered(PARENT, ""),
    "no child": altered(CHILD, ""),
    "a child of blanks": altered(CHILD, '<child link=" "/>'),
    "two parent elements": altered(PARENT, PARENT + '<parent link="base"/>'),
    "a joint of no type": altered(ELBOW, '<joint name="elbow">'),
    "a joint of unknown type": altered(ELBOW, '<joint name="elbow" type="hinge">'),
    "a joint of type floating": altered(ELBOW, '<joint name="elbow" type="floating">'),
    "a joint of type planar": altered(ELBOW, '<joint name="elbow" type="planar">'),
    "a mimic of an unknown joint": mimicking('<mimic joint="sholder"/>'),
    "a mimic of itself": mimicking('<mimic joint="elbow"/>'),
    "two joints that mimic each other": mimicking('<mimic joint="shoulder"/>', '<mimic joint="elbow"/>'),
    "a mimic of a fixed joint": text(welded("weld").replace(ELBOW, ELBOW + '<mimic joint="weld"/>')),
    "a mimic multiplier of nan": mimicking('<mimic joint="shoulder" multiplier="nan"/>'),
    "a mimic multiplier of 1e200": mimicking('<mimic joint="shoulder" multiplier="1e200"/>'),
    "a mimic offset of 1e200": mimicking('<mimic joint="shoulder" offset="-1e200"/>'),
    "multipliers whose product is too large": following(("1e7", "1e7")),
    "multipliers whose product overflows but for a zero at its end": following(("0", *["1e12"] * 30)),
    "offsets that grow along a chain whose multipliers cancel out": following(
        ("1e-12",) * 14 + ("1e12",) * 14, ("1e12",) * 28
    ),
    "offsets of which a multiplier makes one too large": following(("1e-6", "1e6"), ("1e12", "0")),
    "multipliers whose product vanishes": following(("1e-200", "1e-200")),
    "the largest multiplier and offset": mimicking('<mimic joint="shoulder" multiplier="1e12" offset="1e12"/>'),
    "a multiplier of 0": mimicking('<mimic joint="shoulder" multiplier="0"/>'),
    "a mimic on a fixed joint": text(welded("weld", '<mimic joint="nobody"/>')),
}
