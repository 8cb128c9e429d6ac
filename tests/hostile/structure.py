"""Links and joints that form no tree, or none that moves."""

from __future__ import annotations

from tests.hostile.kinds import BODY, CHILD, ELBOW, PARENT, Kind, altered, inside, joint, text

NO_MOTION = ("no joint moves", "make a joint revolute, continuous or prismatic")
NO_NAME = ("has no name", 'write name="')
KINDS = [
    Kind("no robot name", altered('<robot name="arm">', "<robot>"), ("<robot> in line 1", *NO_NAME)),
    Kind("a blank robot name", altered('"arm"', '" "'), ("<robot> in line 1", *NO_NAME)),
    Kind("a link without name", text(inside("<link/>")), ("<link> in line 28", *NO_NAME)),
    Kind("no links", text('<robot name="arm"/>'), ("robot", "no <link>", "add at least one link")),
    Kind("a link alone", text(f'<robot name="brick"><link name="brick">{BODY}</link></robot>'), NO_MOTION),
    Kind("a link defined twice", text(inside('<link name="fore"/>')), ("link 'fore'", "defined twice", "rename")),
    Kind(
        "a link defined twice but for blanks", text(inside('<link name=" fore "/>')), ("link 'fore'", "defined twice")
    ),
    Kind(
        "a joint defined twice",
        text(inside('<link name="hand"/>' + joint("elbow", "fore", "hand"))),
        ("joint 'elbow'", "defined twice", "rename or remove"),
    ),
    Kind(
        "two trees",
        text(inside('<link name="table"/><link name="leg"/>' + joint("bolt", "table", "leg"))),
        ("robot", "2 roots", "'base', 'table'", "join them"),
    ),
    Kind(
        "a cycle beside the root",
        text(inside('<link name="a"/><link name="b"/>' + joint("ab", "a", "b") + joint("ba", "b", "a"))),
        ("link 'a'", "own ancestor", "a → b → a", "remove one joint"),
    ),
    Kind(
        "a joint from a link to itself",
        text(inside('<link name="a"/>' + joint("aa", "a", "a"))),
        ("link 'a'", "own ancestor", "a → a", "remove one joint"),
    ),
    Kind(
        "all links in a cycle",
        text(inside(joint("back", "fore", "base"))),
        ("link 'base'", "own ancestor", "base → fore → upper → base", "remove one joint"),
    ),
    Kind(
        "a link with two parents",
        text(inside(joint("strut", "base", "fore"))),
        ("link 'fore'", "two parents", "'upper' and 'base'", "remove one joint"),
    ),
    Kind(
        "a parent that is not defined",
        altered(PARENT, '<parent link="uper"/>'),
        ("joint 'elbow'", "parent link 'uper'", "not defined", "nearest: upper"),
    ),
    Kind(
        "a child that is not defined",
        altered(CHILD, '<child link="gripper"/>'),
        ("joint 'elbow'", "child link 'gripper'", "not defined", "nearest: upper"),
    ),
    Kind("no parent", altered(PARENT, ""), ("joint 'elbow'", "has no parent link", "add <parent link=")),
    Kind("no child", altered(CHILD, ""), ("joint 'elbow'", "has no child link", "add <child link=")),
    Kind(
        "a child of blanks", altered(CHILD, '<child link=" "/>'), ("joint 'elbow'", "has no child link", "add <child")
    ),
    Kind(
        "two parent elements",
        altered(PARENT, PARENT + '<parent link="base"/>'),
        ("joint 'elbow'", "2 <parent> elements", "keep one"),
    ),
] + [
    Kind(f"a joint of {word}", altered(ELBOW, f'<joint name="elbow"{kind}>'), ("joint 'elbow'", *said, "revolute"))
    for word, kind, said in (
        ("no type", "", ("has no type", "write one of")),
        ("unknown type", ' type="hinge"', ("unknown type 'hinge'", "write one of")),
        ("type floating", ' type="floating"', ("is floating", "only joints with one degree of freedom")),
        ("type planar", ' type="planar"', ("is planar", "only joints with one degree of freedom")),
    )
]
