"""URDFs: the textbook and hard-case robots with elements and attributes changed, and with damaged text.

What is accepted answers M, N and forward dynamics with finite numbers, or names why it does not.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lxml import etree

import robot_dyn as rd
from robot_dyn.errors import OverflowedError, SingularError
from tests.fuzz.bytes import damage, damage_text

TEXTBOOK = Path(__file__).parents[2] / "urdf"
NUMBERS = ["0", "-1", "1e-320", "1e13", "nan", "inf", "1e-30", "3", "", "0 0", "1 2 3", "٣", "0x10", "1_0", "9" * 400]
WORDS = [
    "world",
    "base",
    "",
    "a b",
    "é",
    "\u202e",
    "x" * 5000,
    "revolute",
    "continuous",
    "prismatic",
    "fixed",
    "floating",
]


def seeds(folder: Path) -> list[str]:
    """The files of urdf/."""
    return [path.read_text() for path in sorted(TEXTBOOK.glob("*.urdf"))]


def mutate(rng: np.random.Generator, seed: str) -> bytes:
    """A file with damaged bytes, lines, or elements and attributes."""
    if rng.random() < 0.15:
        return damage(rng, seed.encode())
    if rng.random() < 0.15:
        return damage_text(rng, seed).encode("utf-8", "surrogatepass")
    root = etree.fromstring(seed.encode())
    for _ in range(int(rng.integers(1, 5))):
        _change(rng, root)
    return etree.tostring(root)


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
            table = WORDS if key in ("name", "link", "joint", "type", "filename") else NUMBERS
            one.set(key, table[int(rng.integers(len(table)))])
        case _:
            one.set(str(rng.choice(["name", "value", "xyz", "mass"])), "1")


def attempt(mutant: bytes, folder: Path) -> str:
    """Load it, and ask it."""
    path = folder / "mutant.urdf"
    path.write_bytes(mutant)
    robot = rd.load(str(path))
    q = np.linspace(0.3, -0.4, robot.n)
    try:
        numbers = [robot.M(q), robot.C(q, q), robot.N(q), rd.Lagrangian(robot).N(q), robot.forward_dynamics(q, q, q)]
    except (SingularError, OverflowedError):  # said by name
        return "accepted"
    return "accepted" if all(np.isfinite(x).all() for x in numbers) else "foreign: a number that is not finite"
