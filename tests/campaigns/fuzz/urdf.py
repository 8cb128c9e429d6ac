"""URDFs: the textbook robots and one with shapes, with elements and attributes changed, and with damaged text.

What is accepted answers M, C, N and forward dynamics with finite numbers, or names why it does not. Every file is
checked, too, and some of what loads is drawn.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lxml import etree

import robot_dyn as rd
from robot_dyn.foundations import OverflowedError, SingularError
from robot_dyn.tools.doctor.literals import NUMBERS as NUMBERS_OF
from robot_dyn.view import drawing
from tests.broken_files import SOUND
from tests.campaigns.fuzz.bytes import damage, damage_text

TEXTBOOK = Path(__file__).parents[3] / "urdf"
NUMBERS = ["0", "-1", "1e-320", "1e13", "nan", "inf", "1e-30", "3", "", "0 0", "1 2 3", "٣", "0x10", "1_0", "9" * 400]
NUMBERS += ["1e12", "-1e12", "1e300", "-1e300", "1e-300", "1e-160", "5e-324", "-0.0", "1e6", "0,5", "1.5708", "90", "a"]
EDGES = ["0", "1e-320", "5e-324", "1e-160", "1e-300", "1e12", "-1e12", "1e-9", "1", "-1", "1.5707963267948966"]
WORDS = [
    "world", "base", "", "a b", "é", "\u202e", "x" * 5000, "revolute", "continuous", "prismatic", "fixed", "floating",
]  # fmt: skip


def seeds(folder: Path) -> list[str]:
    """The files of urdf/, and one whose links have shapes."""
    return [*(path.read_text() for path in sorted(TEXTBOOK.glob("*.urdf"))), SOUND]


def mutate(rng: np.random.Generator, seed: str) -> bytes:
    """A file with damaged bytes, lines, or elements and attributes."""
    if rng.random() < 0.15:
        return damage(rng, seed.encode())
    if rng.random() < 0.15:
        return damage_text(rng, seed).encode("utf-8", "surrogatepass")
    root = etree.fromstring(seed.encode())
    if rng.random() < 0.4:
        _to_the_edge(rng, root)
    for _ in range(int(rng.integers(0 if rng.random() < 0.3 else 1, 5))):
        _change(rng, root)
    return etree.tostring(root)


def _to_the_edge(rng: np.random.Generator, root: etree._Element) -> None:
    """Many numbers replaced by a few that are valid, and at the ends of what floats or the file's limits hold."""
    few = rng.choice(EDGES, 2)
    elements = [each for each in root.iter() if each.tag in NUMBERS_OF]
    tags = rng.choice([*NUMBERS_OF], 3)
    for element in elements:
        for key in NUMBERS_OF[element.tag] if element.tag in tags else ():
            if (text := element.get(key)) is not None:
                words = [str(rng.choice(few)) if rng.random() < 0.6 else word for word in text.split()]
                element.set(key, " ".join(words))


def _change(rng: np.random.Generator, root: etree._Element) -> None:
    """One element removed, doubled, moved or renamed, or one attribute changed."""
    elements = [each for each in root.iter() if isinstance(each.tag, str) and each is not root]
    if not elements:
        return
    one, other = (elements[int(rng.integers(len(elements)))] for _ in range(2))
    parent = one.getparent()
    match int(rng.integers(7)):
        case 0:
            parent.remove(one)
        case 1:
            parent.append(etree.fromstring(etree.tostring(one)))
        case 2 if one not in other.iterancestors() and one is not other:
            other.append(one)
        case 3:
            one.tag = other.tag
        case 4:
            one.text = str(rng.choice(["5", "text", "\n"]))
        case _ if one.attrib:
            key = list(one.attrib)[int(rng.integers(len(one.attrib)))]
            named = key in ("name", "link", "joint", "type", "filename")
            words = one.get(key).split()
            if named or not words or rng.random() < 0.3:
                words = [""]
            words[int(rng.integers(len(words)))] = str(rng.choice(WORDS if named else NUMBERS))
            one.set(key, " ".join(words))
        case _:
            one.set(str(rng.choice(["name", "value", "xyz", "mass"])), "1")


def attempt(mutant: bytes, folder: Path) -> str:
    path = folder / "mutant.urdf"
    path.write_bytes(mutant)
    rd.tools.doctor.check_urdf(path)
    robot = rd.load(str(path))
    if len(mutant) % 4 == 0:
        drawing(robot, inertia=True)
    q = np.linspace(0.3, -0.4, robot.n)
    try:
        numbers = [robot.M(q), robot.C(q, q), robot.N(q), rd.Lagrangian(robot).N(q), robot.forward_dynamics(q, q, q)]
    except (SingularError, OverflowedError):  # said by name
        return "accepted"
    return "accepted" if all(np.isfinite(x).all() for x in numbers) else "foreign: a number that is not finite"
