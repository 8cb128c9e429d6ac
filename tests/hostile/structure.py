"""Links and joints that form no tree, or none that moves."""

from __future__ import annotations

from tests.hostile.kinds import BODY, CHILD, ELBOW, PARENT, Make, altered, inside, joint, text

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
}
