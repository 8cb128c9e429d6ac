"""Builders of hostile files: each writes one at a path and returns the path to load."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

Make = Callable[[Path], Path]
SECRET = "the content of another file"


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
MASS = '<mass value="1.5"/>'
AXIS = '<axis xyz="0 0 1"/>'
LIMIT = '<limit lower="-1" upper="1" effort="9" velocity="2"/>'
MOMENTS = 'ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"'
ELBOW = '<joint name="elbow" type="revolute">'
PARENT, CHILD = '<parent link="upper"/>', '<child link="fore"/>'


def text(content: str | bytes | Callable[[], str | bytes], encoding: str = "utf-8") -> Make:
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


def altered(old: str, new: str) -> Make:
    """The sound arm with one piece exchanged."""
    return text(arm((old, new)))


def inside(element: str) -> str:
    """The sound arm with one more element in it."""
    return arm(("</robot>", element + "</robot>"))


def joint(name: str, parent: str, child: str, more: str = "", kind: str = "revolute") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}</joint>'


def welded(name: str, more: str = "") -> str:
    """The sound arm with a hand, fixed to it by a joint of that name."""
    return inside('<link name="hand"/>' + joint(name, "fore", "hand", more, kind="fixed"))


def chain(joints: int, moving: int, more: Callable[[int], str] = lambda i: "") -> str:
    """A chain of which the last joints move."""
    links = "".join(f'<link name="l{i}">{BODY}</link>' for i in range(joints + 1))
    kinds = ["fixed"] * (joints - moving) + ["revolute"] * moving
    joined = "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}", more(i), kind) for i, kind in enumerate(kinds))
    return f'<robot name="chain">{links}{joined}</robot>'


def beside(secret_to_text: Callable[[Path], str]) -> Make:
    """A file that reaches for another one, which holds `SECRET`."""

    def make(path: Path) -> Path:
        secret = path.with_name("secret.txt")
        secret.write_text(SECRET)
        path.write_text(secret_to_text(secret))
        return path

    return make
