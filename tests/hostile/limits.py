"""Files of immense size, depth or count, and robots at the limits of what is taken."""

from __future__ import annotations

import random
import re

from tests.hostile.kinds import AXIS, BODY, ELBOW, MASS, Kind, arm, chain, inside, joint, text

LONG = "x" * (8 << 20)  # characters


def links(count: int, more: str = "") -> str:
    return f'<robot name="crowd">{"".join(f"""<link name="l{i}"/>""" for i in range(count))}{more}</robot>'


def alike() -> str:
    """Names of the same letters in another order: the worst there is for a search of the nearest."""
    order = random.Random(1)
    names = ["".join(order.choices("ab", k=199)) for _ in range(1001)]
    every = "".join(f'<link name="{name}"/>' for name in names)
    return f'<robot name="crowd">{every}{joint("j", "c" + names[0][1:], names[1])}</robot>'


def star(joints: int) -> str:
    limbs = "".join(f'<link name="l{i}">{BODY}</link>{joint(f"j{i}", "hub", f"l{i}")}' for i in range(joints))
    return f'<robot name="star"><link name="hub"/>{limbs}</robot>'


def backwards(robot: str) -> str:
    """The same robot with its elements in the opposite order."""
    elements = re.findall(r"<link.*?</link>|<joint.*?</joint>", robot)
    return f'<robot name="backwards">{"".join(reversed(elements))}</robot>'


def mimics(ratio: str) -> str:
    """A chain of the most joints that may move, of which each follows the one before."""
    return chain(250, 250, lambda i: f'<mimic joint="j{i - 1}" multiplier="{ratio}"/>' if i else "")


KINDS = [
    Kind("33 levels", text("<robot name='a'>" + "<a>" * 32 + "</a>" * 32 + "</robot>"), ("line 1", "deeper than 32")),
    Kind("100 000 levels", text(lambda: "<robot name='a'>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>"),
         ("line 1", "nest")),
    Kind("more than 16 MiB", text(lambda: inside(f"<!--{' ' * 2**24}-->")), ("is larger than 16 MiB", "keep meshes")),
    Kind("an attribute of 12 MiB", text(lambda: inside(f"<link name='{'x' * (12 << 20)}'/>")),
         ("line 29", "a text", "exceeds the limits of the parser", "remove it")),
    Kind("a link name of 8 MiB", text(lambda: inside(f"<link name='{LONG}'/>")), ("link: rename 'xxxx", "256 char")),
    Kind("a parent of 8 MiB", text(lambda: inside(joint("grip", LONG, "fore"))),
         ("joint 'grip'", "parent link 'xxxx", "not defined", "known: base, fore, upper")),
    Kind("a mimic of 8 MiB", text(lambda: arm((ELBOW, f"{ELBOW}<mimic joint='{LONG}'/>"))),
         ("joint 'elbow'", "mimics 'xxxx", "not defined", "known: shoulder, elbow")),
    Kind("a number of 8 MiB", text(lambda: arm((MASS, f'<mass value="{"1" * (8 << 20)}"/>'))),
         ("link 'upper'", "<mass> value", "at most 64 characters", "'1111", "correct it")),
    Kind("a list of a million numbers", text(lambda: arm((AXIS, f'<axis xyz="{"1 " * 1_000_000}"/>'))),
         ("joint 'shoulder'", "<axis> xyz must be three numbers", "'1 1 1", "correct it")),
    Kind("300 000 attributes", text(lambda: inside("<link" + "".join(f" a{i}='1'" for i in range(300_000)) + "/>")),
         ("<link> in line 28", "has no name", "write name=")),
    Kind("500 000 elements", text(lambda: f"<robot name='a'>{'<a/>' * 500_000}</robot>"), ("robot", "no <link>")),
    Kind("400 000 links", text(lambda: links(400_000)), ("robot: has 400000 links", "at most 1001", "split it")),
    Kind("1001 links and no joint", text(lambda: links(1001)), ("robot: has 1001 roots", "'l0', 'l1'", "join them")),
    Kind("1001 links and a misspelt one, all names alike", text(alike),
         ("joint 'j'", "parent link 'c", "not defined")),
    Kind("1000 links in a cycle",
         text(lambda: chain(999, 999).replace("</robot>", joint("back", "l999", "l0") + "</robot>")),
         ("link 'l0'", "own ancestor: l0 → l999", "→ …", "→ l0; remove one joint")),
    Kind("1001 joints", text(lambda: chain(1001, 1)),
         ("robot: has 1001 joints", "more than the maximum of 1000", "split it")),
    Kind("1000 joints in a chain", text(lambda: chain(1000, 1))),
    Kind("1000 joints in a chain, backwards", text(lambda: backwards(chain(1000, 1)))),
    Kind("1000 joints that move", text(lambda: chain(1000, 1000)),
         ("1000 joints move", "more than the maximum of 250", "memory", "cube", "make some fixed or split")),
    Kind("251 joints that move", text(star(251)), ("251 joints move", "maximum of 250", "make some fixed")),
    Kind("250 joints that move, in a chain", text(chain(250, 250))),
    Kind("250 joints that move, on one link", text(star(250))),
    Kind("250 joints, each following the one before", text(mimics("0.9"))),
    Kind("250 joints, each following the one before twice as far", text(mimics("2")),
         ("joint 'j40'", "chain of mimics multiplies by 1.09951e+12", "correct a multiplier")),
    Kind("1000 joints, following in a circle",
         text(lambda: chain(1000, 1000, lambda i: f'<mimic joint="j{(i - 1) % 1000}"/>')),
         ("joint 'j0'", "mimics itself", "j0 → j999", "→ …", "→ j0; remove one <mimic>")),
]  # fmt: skip
