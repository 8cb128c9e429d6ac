"""Random robots: URDF trees of 1–12 joints with any axis, turned and offset inertial frames, branches and mimics."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.description import check

_KINDS = ("revolute", "revolute", "continuous", "prismatic", "fixed")


def _number(low: float, high: float) -> st.SearchStrategy[str]:
    """A literal of four decimals, as files have them."""
    return st.floats(low, high).map(lambda x: f"{x:.4f}")


def _triple(low: float, high: float) -> st.SearchStrategy[str]:
    return st.tuples(*[_number(low, high)] * 3).map(" ".join)


_AXES = st.one_of(
    st.sampled_from(["1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 -2 0"]),
    st.tuples(*[st.integers(-9, 9)] * 3).filter(any).map(lambda axis: " ".join(map(str, axis))),
)


@st.composite
def _inertial(draw: st.DrawFn) -> str:
    """A uniform box somewhere on the link, in axes of its own: a body that can exist."""
    mass = draw(st.floats(0.2, 9.0))
    x, y, z = (draw(st.floats(0.05, 0.6)) for _ in range(3))
    moments = (mass / 12 * s for s in (y * y + z * z, x * x + z * z, x * x + y * y))
    ixx, iyy, izz = (f"{moment:.9f}" for moment in moments)
    return (
        f'<inertial><origin xyz="{draw(_triple(-0.4, 0.4))}" rpy="{draw(_triple(-3.1, 3.1))}"/>'
        f'<mass value="{mass:.6f}"/><inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>'
    )


@dataclass(frozen=True)
class RandomTree:
    """The text of a URDF; its repr is the text, so that a failing example can be kept as a file."""

    urdf: str

    def __repr__(self) -> str:
        return self.urdf

    @property
    def robot(self) -> rd.Robot:
        return rd.Robot(check(self.urdf.encode(), "random tree"))


@st.composite
def trees(draw: st.DrawFn, most_joints: int = 12, mimics: bool = True) -> RandomTree:
    """A random tree with one joint that moves at least."""
    count = draw(st.integers(1, most_joints))
    kinds = [draw(st.sampled_from(_KINDS)) for _ in range(count)]
    kinds[0] = "revolute" if kinds[0] == "fixed" else kinds[0]
    moving = [i for i, kind in enumerate(kinds) if kind != "fixed"]
    followers: dict[int, int] = {}
    if mimics and len(moving) > 1:  # each follows an earlier one, which may itself follow
        for i in moving[1:]:
            if draw(st.integers(0, 3)) == 0:
                followers[i] = draw(st.sampled_from([j for j in moving if j < i]))
    parts = [f'<link name="link_0">{draw(_inertial())}</link>']
    for i, kind in enumerate(kinds):
        chain = draw(st.booleans())
        parent = i if chain else draw(st.integers(0, i))
        parts.append(f'<link name="link_{i + 1}">{draw(_inertial())}</link>')
        mimic = ""
        if i in followers:
            ratio, offset = draw(_number(-2, 2)), draw(_number(-1, 1))
            mimic = f'<mimic joint="joint_{followers[i]}" multiplier="{ratio}" offset="{offset}"/>'
        parts.append(
            f'<joint name="joint_{i}" type="{kind}">'
            f'<origin xyz="{draw(_triple(-0.5, 0.5))}" rpy="{draw(_triple(-3.1, 3.1))}"/>'
            f'<parent link="link_{parent}"/><child link="link_{i + 1}"/><axis xyz="{draw(_AXES)}"/>'
            f'<limit lower="-1.5" upper="1.5" effort="10" velocity="2"/>{mimic}</joint>'
        )
    return RandomTree('<robot name="random_tree">' + "\n".join(parts) + "</robot>")
