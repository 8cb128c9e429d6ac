"""Chains that cost digits: long, stretched, of masses and lengths far apart, of axes that coincide, far from the base.

Each is the text of a URDF whose decimals are exact, so that balls of them are the truth.
`python -m tests.campaigns.hard.chains` writes them into urdf/hard.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np


class Body(NamedTuple):
    """A link behind its joint: axis, offset of the next joint and of the centre of mass in [m], mass, moments."""

    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    length: tuple[float, float, float] = (0.5, 0.0, 0.0)
    mass: float = 1.0
    radius: float = 0.1
    kind: str = "revolute"


def text(name: str, bodies: list[Body], base: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    """A chain of bodies on a base that stands at a point of its root link."""
    parts, at = [f'<robot name="{name}"><link name="world"/>'], base
    for i, each in enumerate(bodies):
        com = " ".join(repr(x / 2) for x in each.length)
        span = float(np.hypot(*each.length[:2])) + abs(each.length[2])
        along, across = each.mass * each.radius**2 / 2, each.mass * (3 * each.radius**2 + span**2) / 12
        moments = [across] * 3
        moments[int(np.argmax(np.abs(each.length)))] = along
        ixx, iyy, izz = (repr(x) for x in moments)
        parent = f"link{i}" if i else "world"
        parts.append(
            f'<link name="link{i + 1}"><inertial><origin xyz="{com}"/><mass value="{each.mass!r}"/>'
            f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial></link>'
            f'<joint name="joint{i + 1}" type="{each.kind}"><origin xyz="{" ".join(map(repr, at))}"/>'
            f'<parent link="{parent}"/><child link="link{i + 1}"/><axis xyz="{" ".join(map(repr, each.axis))}"/>'
            '<limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/></joint>'
        )
        at = each.length
    return "".join([*parts, "</robot>"])


def planar(n: int) -> list[Body]:
    """N links about one horizontal axis."""
    return [Body((0.0, 1.0, 0.0), (0.5, 0.0, 0.0))] * n


def spatial(n: int) -> list[Body]:
    """N links, each axis across the one before."""
    axes = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
    return [Body(axes[i % 3], ((0.4, 0.05, 0.0), (0.3, 0.0, 0.1), (0.0, 0.35, 0.02))[i % 3]) for i in range(n)]


def ratio(factor: float) -> list[Body]:
    """Six links, each `factor` times as heavy as the one before."""
    return [each._replace(mass=float(factor**i)) for i, each in enumerate(spatial(6))]


def light_tip(mass: float) -> list[Body]:
    """Five links and a tip of hardly any mass and size: its inertia is mass · 1e-6 m²."""
    return [*spatial(5), Body((0.0, 0.0, 1.0), (1e-3, 0.0, 0.0), mass, 1e-3)]


def coincident(angle: float, thin: float) -> list[Body]:
    """Four axes through one point, a small angle apart; links between them of so many kilograms and metres."""
    turned = [(float(np.sin(k * angle)), 0.0, float(np.cos(k * angle))) for k in range(4)]
    near = [Body(axis, (0.0, 0.0, thin), thin, thin) for axis in turned[:3]]
    return [*near, Body(turned[3], (0.5, 0.0, 0.0), 2.0)]


def carousel(length: float) -> list[Body]:
    """Six links on a beam that turns about the base, so many metres away."""
    return [Body((0.0, 0.0, 1.0), (length, 0.0, 0.0), 10.0), *spatial(6)]


def sized(scale: float) -> list[Body]:
    """Six links of so many metres."""
    return [each._replace(length=tuple(x * scale for x in each.length), radius=0.1 * scale) for each in spatial(6)]


def tapered(first: float, last: float, power: int) -> list[Body]:
    """Six links from one length to another, of masses that grow as a power of it."""
    sizes = np.geomspace(first, last, 6)
    return [
        each._replace(
            length=tuple(float(x * s) for x in each.length), radius=float(0.1 * s), mass=float((s / first) ** power)
        )
        for each, s in zip(spatial(6), sizes, strict=True)
    ]


def alternating(n: int) -> list[Body]:
    """Joints that turn and joints that slide, in turn."""
    return [each._replace(kind="prismatic" if i % 2 else "revolute") for i, each in enumerate(spatial(n))]


CHAINS: dict[str, str] = {
    **{f"planar, {n} joints": text("planar", planar(n)) for n in (2, 7, 16)},
    **{f"spatial, {n} joints": text("spatial", spatial(n)) for n in (3, 7, 16)},
    **{f"mass ratio {10.0**k:g}": text("ratio", ratio(10.0 ** (k / 5))) for k in (-8, -4, 4, 8)},
    **{f"tip of {10.0**k:g} kg": text("tip", light_tip(10.0**k)) for k in (-3, -6, -10)},
    **{
        f"axes {angle:g} rad apart, {thin:g} kg between": text("axes", coincident(angle, thin))
        for angle, thin in ((1e-3, 0.1), (1e-5, 1e-2), (1e-7, 1e-3), (1e-9, 1e-3), (1e-9, 1e-5))
    },
    **{f"links of {s:g} m": text("sized", sized(s)) for s in (1e-6, 1e3)},
    "from 1 km to 1 µm": text("tapered", tapered(1e3, 1e-6, 1)),
    "from 1 km to 1 µm, of one density": text("tapered", tapered(1e3, 1e-6, 3)),
    **{f"at the end of a beam of {x:.0f} m": text("carousel", carousel(x)) for x in (1e2, 1e4, 5e6)},
    "turning and sliding": text("alternating", alternating(8)),
    **{f"base {x:.0f} m away": text("far", spatial(6), (x, -x / 2, x / 3)) for x in (1e2, 1e4, 5e6)},
}

LONG: dict[str, str] = {
    f"{name}, {n} joints": text(name, of(n))
    for name, of in (("planar", planar), ("spatial", spatial))
    for n in (32, 64)
}

FOLDER = Path(__file__).parents[3] / "urdf" / "hard"


def file_of(name: str) -> Path:
    """Where a chain is kept."""
    plain = re.sub(r"[^a-z0-9.+-]+", "_", name.replace("µ", "u").lower()).strip("_")
    return FOLDER / f"{plain}.urdf"


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for each, written in (CHAINS | LONG).items():
        file_of(each).write_text(written.replace("><", ">\n<") + "\n")
