"""URDFs of chains of links, by the bodies that they carry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def body(mass: object = 1.0, com: str = "0 0 0", moments: object = 1.0, ixy: object = 0) -> str:
    """The <inertial> of a body whose moments, one or three, are those about its axes."""
    ixx, iyy, izz = moments if isinstance(moments, tuple) else [moments] * 3
    inertia = f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="{ixy}" ixz="0" iyz="0"/>'
    return f'<inertial><origin xyz="{com}"/><mass value="{mass}"/>{inertia}</inertial>'


def chain(*bodies: str, at: Sequence[str] = ("0 0 0",), axes: Sequence[str] = ("0 0 1",), **more: Any) -> str:
    """The text of links l1, l2, … with these contents, each turning about an axis of the one before it.

    Args:
        bodies: Contents of the links.
        at: Origins of the joints in the link before: the first ones, of which the last is that of all others.
        axes: Axes of the joints, by the same rule.
        more: `names` of the joints in place of j1, j2, …, and `last`, what the last joint holds besides.
    """
    names = more.get("names", [f"j{i + 1}" for i in range(len(bodies))])
    parts = ['<link name="l0"/>']
    for i, content in enumerate(bodies):
        origin, axis = (values[min(i, len(values) - 1)] for values in (at, axes))
        parts.append(
            f'<link name="l{i + 1}">{content}</link><joint name="{names[i]}" type="continuous"><origin xyz="{origin}"/>'
            f'<axis xyz="{axis}"/><parent link="l{i}"/><child link="l{i + 1}"/>'
        )
        parts.append(more.get("last", "") * (i == len(bodies) - 1) + "</joint>")
    return f'<robot name="chain">{"".join(parts)}</robot>'
