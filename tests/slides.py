"""Arms of blocks that slide, whose motions have closed forms."""

from __future__ import annotations

import robot_dyn as rd

BLOCK = """<link name="{link}"><inertial><mass value="{mass!r}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{joint}" type="prismatic"><parent link="{parent}"/><child link="{link}"/><axis xyz="{axis}"/>
<limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/></joint>
"""


def slides(*blocks: tuple[str, str, str, float], axes: tuple[str, ...] = ()) -> rd.Robot:
    """Return the arm of blocks (joint, parent, link, mass) that slide along x, or along their axes, from "base"."""
    axes = axes or ("1 0 0",) * len(blocks)
    parts = [
        BLOCK.format(joint=joint, parent=parent, link=link, mass=mass, axis=axis)
        for (joint, parent, link, mass), axis in zip(blocks, axes, strict=True)
    ]
    return rd.Robot.from_text(f'<robot name="slides"><link name="base"/>{"".join(parts)}</robot>')
