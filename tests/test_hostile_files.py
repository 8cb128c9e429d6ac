"""Each broken or hostile file, loaded in a process of its own, is refused by name or loads with what is wrong said."""

from __future__ import annotations

import codecs
import gzip
import json
import os
import random
import re
import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import pytest

SECONDS = 20
LONGEST_MESSAGE = 1500  # characters besides the path: what still fits a terminal
SECRET = "the content of another file"
REMEDY = re.compile(
    r"\b(give|needs|write|correct|remove|rename|keep|add|make|join|expand|exchange|save|check|shorten|split|merge"
    r"|known|nearest|looked for|at most|only)\b"
)

CHILD = """
import json, math, resource, sys, warnings
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
resource.setrlimit(resource.RLIMIT_CPU, (18, 18))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
import robot_dyn

def forward_dynamics(robot):
    still = [0.0] * robot.n
    try:
        a = robot.forward_dynamics([0.5] * robot.n, still, still)
    except robot_dyn.RobotDynError as error:
        return f"{type(error).__name__}: {error}"
    return "ok" if all(map(math.isfinite, a)) else f"not finite: {a}"

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    try:
        robot = robot_dyn.load(json.loads(sys.argv[1]))
    except robot_dyn.RobotDynError as error:
        report = {"outcome": "refused", "kind": type(error).__name__, "message": str(error)}
    else:
        report = {"outcome": "loaded", "forward_dynamics": forward_dynamics(robot), "upper": list(robot.upper)}
        few = 1 < robot.n < 10
        report["held"] = robot.with_(lock={robot.joint_names[0]: 0.5}).n if few else None
report["warnings"] = [f"{type(w.message).__name__}: {w.message}" for w in caught]
print(json.dumps(report))
"""


@dataclass(frozen=True)
class Kind:
    """One kind of file.

    Attributes:
        id: What is wrong with it.
        make: Writes it at a path of the test's own and returns the path to load.
        refused: Fragments of the refusal; empty if it loads.
        warned: Fragments of its one ModelWarning; empty if it loads in silence.
        stuck: Fragments of the error of forward dynamics; empty if that answers.
        upper: Upper limits of the loaded joints, where they are the point.
    """

    id: str
    make: Callable[[Path], Path]
    refused: tuple[str, ...] = ()
    warned: tuple[str, ...] = ()
    stuck: tuple[str, ...] = ()
    upper: tuple[float, ...] | None = None


# --- how the files are made

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial>
      <origin xyz="0 0 0.1" rpy="0.1 0.2 0.3"/>
      <mass value="1.5"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/>
    </inertial>
  </link>
  <link name="fore">
    <inertial><mass value="2.5"/><inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.02"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.7" rpy="0 0 0.7"/>
    <parent link="base"/>
    <child link="upper"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="2"/>
    <dynamics damping="0.1" friction="0.2"/>
  </joint>
  <joint name="elbow" type="revolute">
    <origin xyz="0.4 0 0"/>
    <parent link="upper"/>
    <child link="fore"/>
    <axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="8" velocity="3"/>
  </joint>
</robot>
"""
BODY = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
POINT = '<inertial><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
MASS, AXIS, LIMIT = (
    '<mass value="1.5"/>',
    '<axis xyz="0 0 1"/>',
    '<limit lower="-1" upper="1" effort="9" velocity="2"/>',
)
MOMENTS = 'ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"'
ELBOW = '<joint name="elbow" type="revolute">'


def text(content: str | bytes | Callable[[], str | bytes], encoding: str = "utf-8") -> Callable[[Path], Path]:
    """A file with this content; a large one is given as a function."""

    def make(path: Path) -> Path:
        made = content() if callable(content) else content
        path.write_bytes(made.encode(encoding) if isinstance(made, str) else made)
        return path

    return make


def arm(*changes: tuple[str, str]) -> str:
    """The sound arm with pieces exchanged, each of which occurs once."""
    made = ARM
    for old, new in changes:
        assert made.count(old) == 1, old
        made = made.replace(old, new)
    return made


def altered(old: str, new: str) -> Callable[[Path], Path]:
    return text(arm((old, new)))


def inside(element: str) -> str:
    """The sound arm with one more element in it."""
    return arm(("</robot>", element + "</robot>"))


def joint(name: str, parent: str, child: str, more: str = "", kind: str = "revolute") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}</joint>'


def mimicking(elbow: str, shoulder: str = "") -> Callable[[Path], Path]:
    """The sound arm with <mimic> elements."""
    return text(arm((ELBOW, ELBOW + elbow), (AXIS, AXIS + shoulder)))


def chain(joints: int, more: Callable[[int], str] = lambda i: "") -> str:
    links = "".join(f'<link name="l{i}">{BODY}</link>' for i in range(joints + 1))
    joined = "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}", more(i)) for i in range(joints))
    return f'<robot name="chain">{links}{joined}</robot>'


def links(count: int, more: str = "") -> str:
    return f'<robot name="crowd">{"".join(f"""<link name="l{i}"/>""" for i in range(count))}{more}</robot>'


def alike() -> str:
    """Names of the same letters in another order: the worst there is for a search of the nearest."""
    order = random.Random(1)
    names = ["".join(order.choices("ab", k=199)) for _ in range(60_000)]
    every = "".join(f'<link name="{name}"/>' for name in dict.fromkeys(names))
    return f'<robot name="crowd">{every}{joint("j", "c" + names[0][1:], names[1])}</robot>'


def doctype(declaration: str, robot: str = ARM) -> str:
    return f"<!DOCTYPE robot {declaration}>{robot}"


def laughs() -> str:
    """Entities that would grow to 10⁹ words."""
    grow = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 10))
    return f'[<!ENTITY e0 "lol">{grow}]'


def beside(secret_to_text: Callable[[Path], str]) -> Callable[[Path], Path]:
    """A file that reaches for another one."""

    def make(path: Path) -> Path:
        secret = path.with_name("secret.txt")
        secret.write_text(SECRET)
        path.write_text(secret_to_text(secret))
        return path

    return make


def missing(path: Path) -> Path:
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def unix_socket(path: Path) -> Path:
    here = Path.cwd()
    os.chdir(path.parent)  # the name of a socket has 107 bytes at most
    try:
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(path.name)
    finally:
        os.chdir(here)
    return path


def link_to(target: str) -> Callable[[Path], Path]:
    def make(path: Path) -> Path:
        path.symlink_to(target)
        return path

    return make


def sparse(path: Path) -> Path:
    with path.open("wb") as stream:
        stream.truncate(64 << 30)
    return path


def at(path: str) -> Callable[[Path], Path]:
    return lambda _: Path(path)


# --- the kinds

PATHS = [
    Kind("a missing file", missing, ("no file", "looked for")),
    Kind("a folder", folder, ("is a folder", "give the path of a URDF file")),
    Kind("a FIFO that nobody writes to", fifo, ("no regular file", "give the path")),
    Kind("a socket", unix_socket, ("no regular file", "give the path")),
    Kind("an endless device", at("/dev/zero"), ("no regular file", "give the path")),
    Kind("an empty device", at("/dev/null"), ("no regular file", "give the path")),
    Kind("a link to an endless device", link_to("/dev/zero"), ("no regular file", "give the path")),
    Kind("a dangling link", link_to("nowhere"), ("no file", "looked for")),
    Kind("a link to itself", link_to("robot.urdf"), ("no file", "looked for")),
    Kind("a file that fails when read", at("/proc/self/mem"), ("cannot be read", "Input/output error", "check")),
    Kind("a path longer than the system takes", lambda path: path.with_name("x" * 300 + ".urdf"), ("xxx",)),
    Kind("a path in the home of nobody", at("~no_such_user/robot.urdf"), ("~no_such_user",)),
    Kind("a file of 64 GiB of zeros", sparse, ("larger than 16 MiB", "keep meshes")),
    Kind("a path through a file", lambda path: text(ARM)(path) / "robot.urdf", ("no file", "looked for")),
]

NOT_XML = ("is not well-formed XML", "correct the file")
NOT_TEXT = [
    Kind("nothing", text(""), ("is empty", "give a URDF file")),
    Kind("blanks", text(" \n\t \r\n"), ("is empty", "give a URDF file")),
    Kind("a byte order mark alone", text(codecs.BOM_UTF8), NOT_XML),
    Kind("zeros", text(bytes(1000)), NOT_XML),
    Kind("noise", text(random.Random(1).randbytes(4096)), NOT_XML),
    Kind("a compressed robot", text(gzip.compress(ARM.encode())), NOT_XML),
    Kind("JSON", text('{"robot": {"links": []}}'), NOT_XML),
    Kind("YAML", text("robot:\n  name: arm\n"), NOT_XML),
    Kind("a robot cut off", text(ARM[:700]), NOT_XML),
    Kind("a tag that is not closed", altered('</link>\n  <link name="fore">', '<link name="fore">'), NOT_XML),
    Kind("two robots in one file", text(ARM + ARM), NOT_XML),
    Kind("an attribute given twice", altered(MASS, '<mass value="1.5" value="2.5"/>'), (*NOT_XML, "value")),
    Kind("an ampersand in a name", altered('<child link="fore"/>', '<child link="f&b"/>'), NOT_XML),
    Kind("an entity without declaration", altered(MASS, '<mass value="&heavy;"/>'), (*NOT_XML, "heavy")),
    Kind("a raw control character", altered(MASS, '<mass value="1\x1b[2J"/>'), NOT_XML),
    Kind("a Latin-1 file that calls itself UTF-8", text(inside("<!-- é -->"), "latin-1"), (*NOT_XML, "encoding")),
    Kind("an encoding nobody knows", text('<?xml version="1.0" encoding="klingon"?>' + ARM), (*NOT_XML, "klingon")),
    Kind("an encoding that is another one", text('<?xml version="1.0" encoding="UTF-16"?>' + ARM), NOT_XML),
    Kind("HTML", text("<!DOCTYPE html><html><body><p>404</p></body></html>"), ("<!DOCTYPE", "remove the declaration")),
    Kind("HTML without document type", text("<html><body/></html>"), ("<html>", "<robot>", "give a URDF file")),
    Kind("another format", text('<sdf version="1.7"><model name="arm"/></sdf>'), ("<sdf>", "give a URDF file")),
    Kind("a robot of another namespace", altered("<robot ", '<robot xmlns="urn:x" '), ("urn:x", "give a URDF file")),
    Kind("a robot of a long namespace", altered("<robot ", f'<robot xmlns="urn:{"x" * 5000}" '), ("urn:x", "give")),
]

NO_DOCTYPE = ("<!DOCTYPE", "remove the declaration")
GREEDY = [
    Kind("a document type that declares nothing", text("<!DOCTYPE robot>" + ARM), NO_DOCTYPE),
    Kind(
        "a document type in UTF-16",
        text('<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE robot []>' + ARM, "utf-16"),
        NO_DOCTYPE,
    ),
    Kind(
        "a document type in UTF-7",
        text(b'<?xml version="1.0" encoding="UTF-7"?>' + doctype('[<!ENTITY m "1.5">]').replace("<", "+ADw-").encode()),
        NO_DOCTYPE,
    ),
    Kind("entities that grow in a text", text(doctype(laughs(), "<robot name='a'>&e9;</robot>")), ("entity",)),
    Kind("entities that grow in an attribute", text(doctype(laughs(), "<robot name='&e9;'/>")), ("entity",)),
    Kind(
        "entities that grow in the last attribute", text(doctype(laughs(), inside("<link name='&e9;'/>"))), ("entity",)
    ),
    Kind(
        "one long entity used often",
        text(lambda: doctype(f'[<!ENTITY a "{"a" * 100_000}">]', inside(f"<link name='{'&a;' * 100_000}'/>"))),
        NO_DOCTYPE,
    ),
    Kind("an entity in a number", text(doctype('[<!ENTITY m "1.5">]', arm((MASS, '<mass value="&m;"/>')))), NO_DOCTYPE),
    Kind(
        "an entity of another file",
        beside(
            lambda secret: doctype(f'[<!ENTITY x SYSTEM "{secret.as_uri()}">]', inside("<link name='l'>&x;</link>"))
        ),
        NO_DOCTYPE,
    ),
    Kind(
        "an entity of the password file",
        text(doctype('[<!ENTITY x SYSTEM "file:///etc/passwd">]', "<robot name='a'>&x;</robot>")),
        NO_DOCTYPE,
    ),
    Kind("a document type of another file", beside(lambda secret: doctype(f'SYSTEM "{secret.as_uri()}"')), NO_DOCTYPE),
    Kind("a document type of the network", text(doctype('SYSTEM "http://127.0.0.1:9/robot.dtd"')), NO_DOCTYPE),
    Kind(
        "parameter entities",
        beside(lambda secret: doctype(f'[<!ENTITY % x SYSTEM "{secret.as_uri()}"> %x;]')),
        NO_DOCTYPE,
    ),
    Kind("a parameter entity that holds itself", text(doctype('[<!ENTITY % x "&#37;x;"> %x;]')), ("entity",)),
    Kind(
        "a default attribute by document type",
        text(doctype('[<!ATTLIST mass value CDATA "1.5">]', arm((MASS, "<mass/>")))),
        NO_DOCTYPE,
    ),
    Kind(
        "100 000 levels",
        text(lambda: "<robot name='a'>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>"),
        ("line 1",),
    ),
    Kind("33 levels", text("<robot name='a'>" + "<a>" * 32 + "</a>" * 32 + "</robot>"), ("deeper than 32",)),
    Kind("more than 16 MiB", text(lambda: inside(f"<!--{' ' * 2**24}-->")), ("larger than 16 MiB", "keep meshes")),
    Kind("an attribute of 12 MiB", text(lambda: inside(f"<link name='{'x' * (12 << 20)}'/>")), ("imit",)),
    Kind("a link name of 8 MiB", text(lambda: inside(f"<link name='{'x' * (8 << 20)}'/>")), ("link", "'xxxx", "256")),
    Kind(
        "a joint type of 8 MiB",
        text(lambda: inside(joint("grip", "fore", "hand", kind="x" * (8 << 20)))),
        (
            "joint 'grip'",
            "unknown type 'xxxx",
            "write one of",
        ),
    ),
    Kind(
        "a parent of 8 MiB",
        text(lambda: inside(joint("grip", "x" * (8 << 20), "fore"))),
        (
            "joint 'grip'",
            "parent link 'xxxx",
            "not defined",
        ),
    ),
    Kind(
        "a mimic of 8 MiB",
        text(lambda: arm((ELBOW, f"{ELBOW}<mimic joint='{'x' * (8 << 20)}'/>"))),
        (
            "joint 'elbow'",
            "mimics 'xxxx",
            "not defined",
        ),
    ),
    Kind(
        "a number of 8 MiB",
        text(lambda: arm((MASS, f'<mass value="{"1" * (8 << 20)}"/>'))),
        (
            "link 'upper'",
            "<mass> value",
            "'1111",
            "correct it",
        ),
    ),
    Kind(
        "a list of a million numbers",
        text(lambda: arm((AXIS, f'<axis xyz="{"1 " * 1_000_000}"/>'))),
        (
            "joint 'shoulder'",
            "<axis> xyz must be three numbers",
            "'1 1 1",
            "correct it",
        ),
    ),
    Kind("a tag of 40 000 letters", text(f"<{'x' * 40_000}/>"), ("<xxxx", "<robot>", "give a URDF file")),
    Kind(
        "300 000 attributes",
        text(lambda: inside("<link" + "".join(f" a{i}='1'" for i in range(300_000)) + "/>")),
        ("<link> in line", "has no name", "write name="),
    ),
    Kind(
        "4 000 000 elements", text(lambda: "<robot name='a'>" + "<a/>" * 4_000_000 + "</robot>"), ("robot", "no <link>")
    ),
    Kind("400 000 links", text(lambda: links(400_000)), ("robot", "400000 roots", "join them")),
    Kind(
        "400 000 links and 999 joints",
        text(lambda: links(400_000, "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(999)))),
        ("robot", "399001 roots", "join them"),
    ),
    Kind(
        "400 000 links and a misspelt one",
        text(lambda: links(400_000, joint("j", "l_399999", "l1"))),
        ("joint 'j'", "parent link 'l_399999'", "not defined"),
    ),
    Kind(
        "60 000 links and a misspelt one, all names alike",
        text(alike),
        ("joint 'j'", "parent link 'c", "not defined"),
    ),
    Kind("1001 joints", text(lambda: chain(1001)), ("robot", "1001 joints", "at most 1000")),
    Kind("4000 joints", text(lambda: chain(4000)), ("robot", "4000 joints", "at most 1000")),
    Kind(
        "1000 joints on one link",
        text(
            lambda: (
                '<robot name="star"><link name="hub"/>'
                + "".join(f'<link name="l{i}">{BODY}</link>{joint(f"j{i}", "hub", f"l{i}")}' for i in range(1000))
                + "</robot>"
            )
        ),
    ),
    Kind(
        "999 fixed joints in a chain, and one that moves", text(lambda: chain(1000).replace("revolute", "fixed", 999))
    ),
    Kind("1000 joints in a chain", text(lambda: chain(1000))),
    Kind(
        "1000 joints in a chain written backwards",
        text(
            lambda: re.sub(
                r"(<robot[^>]*>)(.*)(</robot>)",
                lambda m: m[1] + "".join(reversed(re.findall(r"<link.*?</link>|<joint.*?</joint>", m[2]))) + m[3],
                chain(1000),
            )
        ),
    ),
    Kind(
        "1000 joints, each mimicking the one before",
        text(lambda: chain(1000, lambda i: f'<mimic joint="j{i - 1}" multiplier="0.9"/>' if i else "")),
    ),
    Kind(
        "1000 joints, mimicking in a circle",
        text(lambda: chain(1000, lambda i: f'<mimic joint="j{(i - 1) % 1000}"/>')),
        ("joint 'j0'", "mimics itself", "j0 → j999", "remove one <mimic>"),
    ),
]

TREES = [
    Kind("no robot name", altered('<robot name="arm">', "<robot>"), ("<robot> in line 1", "no name", 'write name="')),
    Kind("a blank robot name", altered('"arm"', '" "'), ("<robot> in line 1", "no name", 'write name="')),
    Kind("no links", text('<robot name="arm"/>'), ("robot", "no <link>", "one link at least")),
    Kind("a link without name", text(inside("<link/>")), ("<link> in line 28", "no name", 'write name="')),
    Kind("a joint without name", altered('<joint name="elbow" ', "<joint "), ("<joint> in line 21", "no name")),
    Kind("a link defined twice", text(inside('<link name="fore"/>')), ("link 'fore'", "defined twice", "rename")),
    Kind(
        "a link defined twice but for blanks", text(inside('<link name=" fore "/>')), ("link 'fore'", "defined twice")
    ),
    Kind(
        "a joint defined twice",
        text(inside('<link name="hand"/>' + joint("elbow", "fore", "hand"))),
        (
            "joint 'elbow'",
            "defined twice",
            "rename or remove",
        ),
    ),
    Kind("two roots", text(inside('<link name="table"/>')), ("robot", "2 roots", "'base', 'table'", "join them")),
    Kind(
        "a cycle beside the root",
        text(inside('<link name="a"/><link name="b"/>' + joint("ab", "a", "b") + joint("ba", "b", "a"))),
        ("link 'a'", "own ancestor", "a → b → a", "remove one joint"),
    ),
    Kind(
        "a joint from a link to itself",
        text(inside('<link name="a"/>' + joint("aa", "a", "a"))),
        (
            "link 'a'",
            "own ancestor",
            "a → a",
            "remove one joint",
        ),
    ),
    Kind(
        "all links in a cycle",
        text(inside(joint("back", "fore", "base"))),
        (
            "own ancestor",
            "base → fore → upper → base",
            "remove one joint",
        ),
    ),
    Kind(
        "a link with two parents",
        text(inside(joint("strut", "base", "fore"))),
        (
            "link 'fore'",
            "two parents",
            "'upper' and 'base'",
            "remove one joint",
        ),
    ),
    Kind(
        "two joints between the same links",
        text(inside(joint("twin", "upper", "fore"))),
        (
            "link 'fore'",
            "two parents",
            "remove one joint",
        ),
    ),
    Kind(
        "a parent that is not defined",
        altered('<parent link="upper"/>', '<parent link="uper"/>'),
        (
            "joint 'elbow'",
            "parent link 'uper'",
            "not defined",
            "nearest: upper",
        ),
    ),
    Kind(
        "a child that is not defined",
        altered('<child link="fore"/>', '<child link="gripper"/>'),
        (
            "joint 'elbow'",
            "child link 'gripper'",
            "not defined",
            "nearest: upper",
        ),
    ),
    Kind("no parent element", altered('<parent link="upper"/>', ""), ("joint 'elbow'", "parent", "base, fore, upper")),
    Kind("no child element", altered('<child link="fore"/>', ""), ("joint 'elbow'", "child", "base, fore, upper")),
    Kind("a parent without link", altered('<parent link="upper"/>', "<parent/>"), ("joint 'elbow'", "parent", "known")),
    Kind(
        "two parent elements",
        altered('<parent link="upper"/>', '<parent link="upper"/><parent link="base"/>'),
        (
            "joint 'elbow'",
            "2 <parent>",
            "keep one",
        ),
    ),
    Kind(
        "a line break in a name",
        altered('<link name="base"/>', '<link name="ba&#10;se"/>'),
        ("link", r"'ba\nse'", "control"),
    ),
    Kind(
        "a terminal command in a name", altered('name="elbow"', 'name="&#x9b;2Jelbow"'), ("joint", r"\x9b2J", "control")
    ),
    Kind("a change of writing direction in a name", altered('"arm"', '"a&#x202e;mr"'), ("robot", r"\u202e", "control")),
    Kind("a name of 300 letters", altered('"arm"', f'"{"a" * 300}"'), ("robot", "'aaaa", "256 characters")),
    Kind(
        "macros not expanded",
        text(inside('<xacro:arm xmlns:xacro="http://www.ros.org/wiki/xacro" side="left"/>')),
        (
            "robot",
            "xacro macros",
            "expand the file first",
        ),
    ),
    Kind("macros of no namespace", text(inside('<xacro:arm side="left"/>')), ("xacro",)),
    Kind("a link alone", text(f'<robot name="brick"><link name="brick">{BODY}</link></robot>'), ("no joint moves",)),
    Kind("fixed joints alone", text(ARM.replace("revolute", "fixed")), ("no joint moves",)),
]

JOINTS = [
    Kind(f"a joint of {word}", altered(ELBOW, f'<joint name="elbow"{kind}>'), ("joint 'elbow'", *said, "revolute"))
    for word, kind, said in (
        ("no type", "", ("unknown type", "None", "write one of")),
        ("empty type", ' type=""', ("unknown type ''", "write one of")),
        ("unknown type", ' type="hinge"', ("unknown type 'hinge'", "write one of")),
        ("type in capitals", ' type="Revolute"', ("unknown type 'Revolute'", "write one of")),
        ("type floating", ' type="floating"', ("is floating", "only joints of one degree of freedom")),
        ("type planar", ' type="planar"', ("is planar", "only joints of one degree of freedom")),
    )
] + [
    Kind(f"a joint with {word}", altered(old, new), ("joint 'shoulder'", *said))
    for word, old, new, said in (
        ("zero axis", AXIS, '<axis xyz="0 0 0"/>', ("<axis>", "'0 0 0'", "unit vector")),
        ("an axis of 1e-200", AXIS, '<axis xyz="0 0 1e-200"/>', ("<axis>", "'0 0 1e-200'", "unit vector")),
        ("an axis of 1e300", AXIS, '<axis xyz="0 1e300 1e300"/>', ("<axis>", "'0 1e300 1e300'", "unit vector")),
        ("an axis of two numbers", AXIS, '<axis xyz="0 1"/>', ("<axis> xyz", "three numbers", "'0 1'", "correct it")),
        ("an axis that is nan", AXIS, '<axis xyz="0 0 nan"/>', ("<axis> xyz", "'nan'", "correct it")),
        ("an axis with commas", AXIS, '<axis xyz="0,0,1"/>', ("<axis> xyz", "'0,0,1'", "correct it")),
        ("two axes", AXIS, AXIS + AXIS, ("2 <axis>", "keep one")),
        ("an origin of two numbers", 'xyz="0 0 0.7"', 'xyz="0 0.7"', ("<origin> xyz", "'0 0.7'", "correct it")),
        ("an empty origin", 'xyz="0 0 0.7"', 'xyz=""', ("<origin> xyz", "three numbers", "''", "correct it")),
        ("an infinite turn", 'rpy="0 0 0.7"', 'rpy="0 0 inf"', ("<origin> rpy", "'inf'", "correct it")),
        ("a turn in terms of pi", 'rpy="0 0 0.7"', 'rpy="0 0 pi/2"', ("<origin> rpy", "'pi/2'", "correct it")),
        ("two origins", AXIS, AXIS + "<origin/>", ("2 <origin>", "keep one")),
        ("two limits", LIMIT, LIMIT + LIMIT, ("2 <limit>", "keep one")),
        ("an infinite limit", 'upper="1"', 'upper="inf"', ("<limit> upper", "'inf'", "correct it")),
        ("a limit of nan", 'lower="-1"', 'lower="nan"', ("<limit> lower", "'nan'", "correct it")),
        ("limits exchanged", 'lower="-1"', 'lower="1.5"', ("lower limit 1.5", "upper 1", "exchange them")),
        ("a lower limit alone, above 0", LIMIT, '<limit lower="1"/>', ("lower limit 1", "upper 0", "exchange them")),
        ("negative effort", 'effort="9"', 'effort="-9"', ("<limit> effort", "-9", "below 0", "correct it")),
        ("negative velocity", 'velocity="2"', 'velocity="-2"', ("<limit> velocity", "-2", "below 0", "correct it")),
        ("negative damping", 'damping="0.1"', 'damping="-0.1"', ("damping", "-0.1", "below 0", "correct it")),
        ("friction that is nan", 'friction="0.2"', 'friction="nan"', ("<dynamics> friction", "'nan'", "correct it")),
        ("two dynamics", LIMIT, LIMIT + "<dynamics/>", ("2 <dynamics>", "keep one")),
    )
]

TIES = [
    Kind(
        "a mimic of an unknown joint",
        mimicking('<mimic joint="sholder"/>'),
        (
            "joint 'elbow'",
            "mimics 'sholder'",
            "not defined",
            "nearest: shoulder",
        ),
    ),
    Kind("a mimic of nothing", mimicking("<mimic/>"), ("joint 'elbow'", "mimics ''", "known: ")),
    Kind("a mimic of itself", mimicking('<mimic joint="elbow"/>'), ("joint 'elbow'", "elbow → elbow", "remove one")),
    Kind(
        "two joints that mimic each other",
        mimicking('<mimic joint="shoulder"/>', '<mimic joint="elbow"/>'),
        (
            "mimics itself",
            "shoulder → elbow → shoulder",
            "remove one <mimic>",
        ),
    ),
    Kind(
        "a mimic of a fixed joint",
        text(
            inside('<link name="hand"/>' + joint("weld", "fore", "hand", kind="fixed")).replace(
                ELBOW, ELBOW + '<mimic joint="weld"/>'
            )
        ),
        ("joint 'elbow'", "mimics 'weld'", "fixed", "make 'elbow' fixed"),
    ),
    Kind(
        "a mimic multiplier of nan",
        mimicking('<mimic joint="shoulder" multiplier="nan"/>'),
        (
            "joint 'elbow'",
            "<mimic> multiplier",
            "'nan'",
            "correct it",
        ),
    ),
    Kind(
        "a mimic offset without end",
        mimicking('<mimic joint="shoulder" offset="-inf"/>'),
        (
            "joint 'elbow'",
            "<mimic> offset",
            "'-inf'",
            "correct it",
        ),
    ),
    Kind("two mimics", mimicking('<mimic joint="shoulder"/>' * 2), ("joint 'elbow'", "2 <mimic>", "keep one")),
    Kind(
        "mimic multipliers that overflow",
        text(chain(3, lambda i: f'<mimic joint="j{i - 1}" multiplier="1e200"/>' if i else "")),
        ("joint 'j2'", "multiplier"),
    ),
]

NUMBERS = [
    Kind(
        f"a mass of {number or 'nothing'}",
        altered(MASS, f'<mass value="{number}"/>'),
        (
            "link 'upper'",
            "<mass> value",
            number[:40],
            "correct it",
        ),
    )
    for number in (
        "nan",
        "-nan",
        "NaN",
        "inf",
        "-inf",
        "Infinity",
        "1e999",
        "-1",
        "-1e-9",
        "1,5",
        "1_000",
        "0x10",
        "0x1p4",
        "1d3",
        "",
        "1.5 kg",
        "1 5",
        "--1",
        "1e",
        ".",
        "+",
        "${mass}",
        "$(arg mass)",
        "١٢",
        "１．５",
        "½",
        "1e99999",
        "0" * 65,
    )
] + [
    Kind(f"a link with {word}", altered(old, new), ("link 'upper'", *said))
    for word, old, new, said in (
        ("a mass without value", MASS, "<mass/>", ("<mass> has no value", 'write value="')),
        ("a mass as text", MASS, "<mass>1.5</mass>", ("<mass> has no value", 'write value="')),
        ("no mass", MASS, "", ("both <mass> and <inertia>", "add the one")),
        ("no inertia", f"<inertia {MOMENTS}/>", "", ("both <mass> and <inertia>", "add the one")),
        ("two masses", MASS, MASS + MASS, ("2 <mass>", "keep one")),
        ("two inertials", MASS, f"{MASS}</inertial><inertial>", ("2 <inertial>", "keep one")),
        ("a moment missing", ' izz="0.01"', "", ("<inertia> has no izz", 'write izz="')),
        (
            "a product that is nan",
            MOMENTS,
            MOMENTS.replace('iyz="0"', 'iyz="nan"'),
            ("<inertia> iyz", "'nan'", "correct"),
        ),
        ("two centres", MASS, MASS + "<origin/>", ("2 <origin>", "keep one")),
        ("a centre of four numbers", 'xyz="0 0 0.1"', 'xyz="0 0 0.1 0"', ("<origin> xyz", "'0 0 0.1 0'", "correct it")),
        ("a centre at infinity", 'xyz="0 0 0.1"', 'xyz="0 0 -inf"', ("<origin> xyz", "'-inf'", "correct it")),
    )
]

WARNED = [
    Kind(
        "a link without inertial at the tip",
        text(inside('<link name="tip"/>' + joint("wrist", "fore", "tip"))),
        warned=("ModelWarning: arm: link 'tip'", "no mass", "give it an <inertial>"),
        stuck=("SingularError", "joint 'wrist' carries no inertia", "give its link a mass or lock it"),
    ),
    Kind(
        "a massless link in the midst",
        altered(ARM[ARM.index("    <inertial>") : ARM.index("  </link>")], ""),
        warned=("ModelWarning: arm: link 'upper'", "no mass", "give it an <inertial>"),
    ),
    Kind(
        "a point mass on the axis at the tip",
        text(inside(f'<link name="tip">{POINT}</link>' + joint("wrist", "fore", "tip"))),
        stuck=("SingularError", "joint 'wrist' carries no inertia", "give its link a mass or lock it"),
    ),
    Kind(
        "no masses at all",
        text(
            re.sub(r"<inertial>.*?</inertial>", "", ARM.replace(ELBOW, ELBOW.replace("revolute", "fixed")), flags=re.S)
        ),
        warned=("ModelWarning: arm: link 'upper'", "no mass"),
        stuck=("SingularError", "joint 'shoulder' carries no inertia"),
    ),
    Kind(
        "an indefinite inertia",
        altered(MOMENTS, MOMENTS.replace('izz="0.01"', 'izz="-0.01"')),
        warned=("ModelWarning: arm: link 'upper'", "indefinite", "-0.01", "correct the inertia"),
    ),
    Kind(
        "an inertia that breaks the triangle inequality",
        altered(MOMENTS, MOMENTS.replace('izz="0.01"', 'izz="0.05"')),
        warned=("ModelWarning: arm: link 'upper'", "triangle inequality", "0.05", "correct the inertia"),
    ),
]

IMMENSE = [
    Kind("a mass of 1e308", altered(MASS, '<mass value="1e308"/>'), ("link 'upper'", "1e308")),
    Kind("an inertia of 1e308", altered(MOMENTS, MOMENTS.replace("0.02", "1e308")), ("link 'upper'", "1e308")),
    Kind("an arm of 1e200 m", altered('xyz="0.4 0 0"', 'xyz="1e200 0 0"'), ("joint 'elbow'", "1e200")),
    Kind(
        "a centre of mass at 1e200 m",
        altered('xyz="0 0 0.1"', 'xyz="1e200 0 0.1"'),
        ("link 'upper'", "1e200"),
    ),
    Kind("a turn of 1e308 rad", altered('rpy="0 0 0.7"', 'rpy="0 0 1e308"')),
    Kind("a mass of 1e-320", altered(MASS, '<mass value="1e-320"/>')),
    Kind("a mass of 1e-9999", altered(MASS, '<mass value="1e-9999"/>')),
]

SOUND = [
    Kind("the sound arm", text(ARM), upper=(1, 2)),
    Kind("the sound arm in a file whose name is no text", lambda path: text(ARM)(path.with_name("arm-\udcff.urdf"))),
    Kind("the sound arm in UTF-16", text('<?xml version="1.0" encoding="UTF-16"?>' + ARM, "utf-16")),
    Kind("the sound arm after a byte order mark", text(ARM, "utf-8-sig")),
    Kind(
        "a mimic on a fixed joint",
        text(inside('<link name="hand"/>' + joint("weld", "fore", "hand", '<mimic joint="nobody"/>', kind="fixed"))),
    ),
    Kind("a mimic with multiplier 0", mimicking('<mimic joint="shoulder" multiplier="0"/>')),
    Kind("a revolute joint without limit", altered(LIMIT, ""), upper=(inf, 2)),
    Kind("a limit that says nothing", altered(LIMIT, "<limit/>"), upper=(inf, 2)),
    Kind("an upper limit alone", altered(LIMIT, '<limit upper="1"/>'), upper=(1, 2)),
    Kind(
        "a prismatic joint without axis",
        text(arm((AXIS, ""), ('"shoulder" type="revolute"', '"shoulder" type="prismatic"'))),
    ),
    Kind(
        "a continuous joint with exchanged limits",
        text(arm(('"shoulder" type="revolute"', '"shoulder" type="continuous"'), ('lower="-1"', 'lower="7"'))),
        upper=(inf, 2),
    ),
    Kind("letters of all scripts in names", text(ARM.replace("elbow", "肘 Ж 🦾 é").replace("fore", "ذراع"))),
    Kind("markup of a terminal in a name", text(ARM.replace("fore", "[red]x[/red]").replace("elbow", "[/]%s{0}\\"))),
    Kind(
        "markup of XML in names",
        text(ARM.replace("fore", "&lt;/robot&gt;&quot;&amp;").replace("elbow", "&apos;]]&gt;")),
    ),
    Kind(
        "names that only look alike",
        text(ARM.replace('"upper"', '"\u00e9"').replace('"fore"', '"e\u0301"')),
        upper=(1, 2),
    ),
    Kind("the first joint named like Pinocchio's world", text(ARM.replace("shoulder", "universe")), upper=(1, 2)),
    Kind("the last joint named like Pinocchio's world", text(ARM.replace("elbow", "universe")), upper=(1, 2)),
    Kind("the first link named like Pinocchio's world", text(ARM.replace('"base"', '"universe"')), upper=(1, 2)),
    Kind("the last link named like Pinocchio's world", text(ARM.replace('"fore"', '"universe"')), upper=(1, 2)),
    Kind(
        "a fixed joint named like Pinocchio's world",
        text(inside('<link name="hand"/>' + joint("universe", "fore", "hand", kind="fixed"))),
        upper=(1, 2),
    ),
    Kind("a joint named like Pinocchio's root", text(ARM.replace("elbow", "root_joint")), upper=(1, 2)),
    Kind(
        "links named like their joints",
        text(ARM.replace('"upper"', '"shoulder"').replace('"fore"', '"elbow"')),
        upper=(1, 2),
    ),
    Kind(
        "a fixed joint named like a link",
        text(inside('<link name="hand"/>' + joint("fore", "fore", "hand", kind="fixed"))),
        upper=(1, 2),
    ),
    Kind(
        "a mesh that is missing",
        text(
            arm(
                (
                    '<link name="base"/>',
                    """<link name="base"><visual><geometry>
        <mesh filename="package://../../nowhere.dae" scale="nan"/></geometry><material name="unknown"/></visual>
        <collision><geometry><cylinder radius="-1"/></geometry></collision></link>""",
                )
            )
        ),
    ),
    Kind(
        "an element of another simulator",
        text(
            inside(
                '<gazebo reference="nobody"><joint name="elbow"/></gazebo>'
                '<transmission name="t"><joint name="x"/></transmission>'
            )
        ),
    ),
    Kind(
        "an inclusion of another file",
        beside(
            lambda secret: inside(
                f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{secret.as_uri()}" parse="text"/>'
            )
        ),
    ),
    Kind("a style sheet of the network", text('<?xml-stylesheet href="http://127.0.0.1:9/x.xsl"?>' + ARM)),
    Kind("a version from the future", altered('"arm"', '"arm" version="99.x"')),
    Kind("comments in all places", text(ARM.replace("<", "<!-- - --><").removeprefix("<!-- - -->"))),
]

TABLE = PATHS + NOT_TEXT + GREEDY + TREES + JOINTS + TIES + NUMBERS + WARNED + IMMENSE + SOUND


# --- the law


def load_in_child(path: Path) -> dict[str, Any]:
    """What became of a file, loaded under limits of memory and time."""
    child = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(str(path))],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert (child.returncode, child.stderr) == (0, ""), f"exit {child.returncode}: {child.stderr[-2000:]}"
    assert SECRET not in child.stdout
    assert child.stdout.count("\n") == 1, child.stdout[:2000]
    return json.loads(child.stdout)


def check_says(message: str, fragments: tuple[str, ...]) -> None:
    lacking = [fragment for fragment in fragments if fragment not in message]
    assert not lacking, f"lacks {lacking}: {message[:1000]}"


def check_refusal(kind: Kind, path: Path, report: dict[str, Any]) -> None:
    """It names the file, what is wrong with it and a remedy, in one printable line."""
    assert report["outcome"] == "refused", report
    assert report["kind"] in ("DescriptionError", "CatalogError")
    assert report["warnings"] == []
    check_says(report["message"], (str(path), *kind.refused))
    said = report["message"].replace(str(path), "")
    assert len(said) < LONGEST_MESSAGE, f"{len(said)} characters: {said[:300]} …"
    assert said.isprintable(), repr(said)
    assert REMEDY.search(said), f"no remedy: {said}"


def check_loading(kind: Kind, report: dict[str, Any]) -> None:
    """It warns of what cannot exist, and forward dynamics answers or names the joint."""
    assert report["outcome"] == "loaded", report
    assert len(report["warnings"]) == bool(kind.warned), report["warnings"]
    check_says("".join(report["warnings"]), kind.warned)
    check_says(report["forward_dynamics"], kind.stuck or ("ok",))
    assert report["held"] in (None, len(report["upper"]) - 1)
    if kind.upper is not None:
        assert tuple(report["upper"]) == kind.upper


def test_table_is_wide() -> None:
    assert len(TABLE) >= 40
    assert len({kind.id for kind in TABLE}) == len(TABLE)


@pytest.mark.parametrize("kind", TABLE, ids=[kind.id for kind in TABLE])
def test_hostile_file_is_refused_by_name_in_bounded_time(kind: Kind, tmp_path: Path) -> None:
    path = kind.make(tmp_path / "robot.urdf")
    report = load_in_child(path)
    if kind.refused:
        check_refusal(kind, path, report)
    else:
        check_loading(kind, report)
