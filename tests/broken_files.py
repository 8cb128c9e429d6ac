"""URDF files, each broken in one way: what is changed, the finding that must name it, and whether M can be restored."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

LINKS = {  # mass, centre and edges of a box, its moments by the closed form
    "base": (4.0, (0.0, 0.0, 0.05), (0.2, 0.2, 0.1)),
    "upper": (2.0, (0.15, 0.0, 0.0), (0.3, 0.08, 0.06)),
    "fore": (1.2, (0.12, 0.0, 0.0), (0.24, 0.06, 0.05)),
    "hand": (0.4, (0.0, 0.0, 0.06), (0.05, 0.07, 0.12)),
}
JOINTS = {
    "shoulder": ("base", "upper", "0 0 0.1", "1.5707963267948966 0 0", "0 0 1", "revolute"),
    "elbow": ("upper", "fore", "0.3 0 0", "0 0 0.3", "0 0 1", "revolute"),
    "wrist": ("fore", "hand", "0.24 0 0", "0 1.5707963267948966 0", "0 0 1", "revolute"),
}
HEAD = '<?xml version="1.0"?>\n<robot name="rig">\n'


def _link(name: str) -> str:
    m, c, (x, y, z) = LINKS[name]
    moments = [m / 12 * (y * y + z * z), m / 12 * (x * x + z * z), m / 12 * (x * x + y * y)]
    origin, size = " ".join(map(str, c)), f"{x} {y} {z}"
    return f"""  <link name="{name}">
    <inertial>
      <origin xyz="{origin}" rpy="0 0 0"/>
      <mass value="{m}"/>
      <inertia ixx="{moments[0]:.12f}" ixy="0" ixz="0" iyy="{moments[1]:.12f}" iyz="0" izz="{moments[2]:.12f}"/>
    </inertial>
    <collision><origin xyz="{origin}"/><geometry><box size="{size}"/></geometry></collision>
  </link>
"""


def _joint(name: str) -> str:
    parent, child, xyz, rpy, axis, kind = JOINTS[name]
    return f"""  <joint name="{name}" type="{kind}">
    <origin xyz="{xyz}" rpy="{rpy}"/>
    <parent link="{parent}"/>
    <child link="{child}"/>
    <axis xyz="{axis}"/>
    <limit lower="-2.5" upper="2.5" effort="40" velocity="3"/>
  </joint>
"""


SOUND = HEAD + "".join(map(_link, LINKS)) + "".join(map(_joint, JOINTS)) + "</robot>\n"


def _of(name: str, old: str, new: str, kind: str = "link") -> Callable[[str], str]:
    """A replacement within one link or joint."""

    def change(text: str) -> str:
        start = text.index(f'<{kind} name="{name}"')
        end = text.index(f"</{kind}>", start)
        made = re.sub(old, new, text[start:end], count=1)
        assert made != text[start:end], f"nothing to break: {old}"
        return text[:start] + made + text[end:]

    return change


def _inertia(name: str, factor: float) -> Callable[[str], str]:
    def change(text: str) -> str:
        def scaled(match: re.Match[str]) -> str:
            return re.sub(r'="([0-9.]+)"', lambda x: f'="{float(x[1]) * factor:.12g}"', match[0])

        start = text.index(f'<link name="{name}"')
        return text[:start] + re.sub(r"<inertia [^>]*>", scaled, text[start:], count=1)

    return change


class Broken(NamedTuple):
    """A way to break the sound file.

    Attributes:
        change: Of its text.
        kind: Of the finding that names it.
        where: The link or joint of that finding.
        restored: Whether the file still says what M was.
    """

    change: Callable[[str], str]
    kind: str
    where: str
    restored: bool = False


BROKEN: dict[str, Broken] = {
    "negative moment": Broken(_of("fore", 'ixx="', 'ixx="-'), "inertia_impossible", "link 'fore'"),
    "triangle inequality": Broken(_of("hand", r'izz="[^"]*"', 'izz="0.05"'), "inertia_impossible", "link 'hand'"),
    "kg mm²": Broken(_inertia("upper", 1e6), "inertia_shape", "link 'upper'", True),
    "g mm²": Broken(_inertia("hand", 1e9), "inertia_shape", "link 'hand'", True),
    "g m²": Broken(_inertia("fore", 1e3), "inertia_shape", "link 'fore'", True),
    "mass in grams": Broken(_of("upper", 'value="2.0"', 'value="2000"'), "mass_density", "link 'upper'", True),
    "mass of a feather": Broken(_of("upper", 'value="2.0"', 'value="0.0002"'), "mass_density", "link 'upper'"),
    "no inertial": Broken(_of("hand", r"(?s)<inertial>.*</inertial>", ""), "mass_missing", "link 'hand'"),
    "no inertial of the base": Broken(
        _of("base", r"(?s)<inertial>.*</inertial>", ""), "inertial_missing", "link 'base'"
    ),
    "misspelt inertial": Broken(
        lambda text: _of("fore", "</inertial>", "</inertail>")(_of("fore", "<inertial>", "<inertail>")(text)),
        "unknown_element", "link 'fore'", True,
    ),
    "misspelt origin": Broken(_of("elbow", "<origin", "<orgin", "joint"), "unknown_element", "joint 'elbow'", True),
    "misspelt attribute": Broken(_of("fore", "<mass value", "<mass vlaue"), "unknown_attribute", "link 'fore'", True),
    "misspelt rpy": Broken(_of("wrist", "rpy=", "RPY=", "joint"), "unknown_attribute", "joint 'wrist'", True),
    "decimal comma": Broken(_of("fore", 'value="1.2"', 'value="1,2"'), "decimal_comma", "link 'fore'", True),
    "line break": Broken(_of("upper", 'xyz="0.15 0.0', 'xyz="0.15\n0.0'), "line_break", "link 'upper'", True),
    "few digits of π/2": Broken(
        _of("shoulder", "1.5707963267948966", "1.5708", "joint"), "near_right_angle", "joint 'shoulder'", True
    ),
    "1.57": Broken(_of("wrist", "1.5707963267948966", "1.57", "joint"), "near_right_angle", "joint 'wrist'", True),
    "degrees": Broken(
        _of("shoulder", 'rpy="1.5707963267948966 0 0"', 'rpy="90 0 0"', "joint"), "degrees", "joint 'shoulder'", True
    ),
    "limits in degrees": Broken(
        _of("elbow", 'lower="-2.5" upper="2.5"', 'lower="-120" upper="120"', "joint"), "degrees", "joint 'elbow'", True
    ),
    "crossed limits": Broken(
        _of("elbow", 'lower="-2.5" upper="2.5"', 'lower="2.5" upper="-2.5"', "joint"), "limits_crossed",
        "joint 'elbow'", True,
    ),
    "no limit": Broken(_of("wrist", "<limit[^>]*>", "", "joint"), "limit_missing", "joint 'wrist'"),
    "no effort": Broken(_of("wrist", 'effort="40" ', "", "joint"), "limit_missing", "joint 'wrist'"),
    "effort 0": Broken(_of("elbow", 'effort="40"', 'effort="0"', "joint"), "limit_zero", "joint 'elbow'"),
    "weak joint": Broken(_of("elbow", 'effort="40"', 'effort="0.5"', "joint"), "effort_gravity", "joint 'elbow'"),
    "origin in mm": Broken(_of("elbow", 'xyz="0.3 0 0"', 'xyz="300 0 0"', "joint"), "origin_far", "joint 'elbow'"),
    "no axis": Broken(_of("wrist", "<axis[^>]*>", "", "joint"), "axis_missing", "joint 'wrist'"),
    "negative velocity": Broken(
        _of("elbow", 'velocity="3"', 'velocity="-3"', "joint"), "limit_negative", "joint 'elbow'", True
    ),
    "equal limits": Broken(_of("elbow", 'lower="-2.5"', 'lower="2.5"', "joint"), "limits_equal", "joint 'elbow'"),
    "soft limits crossed": Broken(
        _of("elbow", "<limit", '<safety_controller soft_lower_limit="1" soft_upper_limit="-1"/><limit', "joint"),
        "soft_limits", "joint 'elbow'",
    ),
    "soft limits equal": Broken(
        _of("elbow", "<limit", '<safety_controller soft_lower_limit="0" soft_upper_limit="0"/><limit', "joint"),
        "soft_limits", "joint 'elbow'",
    ),
    "soft limits outside": Broken(
        _of("elbow", "<limit", '<safety_controller soft_lower_limit="-1" soft_upper_limit="2.6"/><limit', "joint"),
        "soft_limits", "joint 'elbow'",
    ),
    "shape in mm": Broken(
        _of("hand", 'box size="0.05 0.07 0.12"', 'box size="50 70 120"'), "shape_in_mm", "link 'hand'"
    ),
    "centre far away": Broken(_of("upper", 'xyz="0.15', 'xyz="1.5'), "com_outside", "link 'upper'"),
    "mesh missing": Broken(
        _of("hand", "<box[^>]*>", '<mesh filename="package://nowhere/hand.stl"/>'), "shape_missing", "link 'hand'"
    ),
    "a name twice": Broken(lambda text: text.replace('"fore"', '"upper"'), "name_twice", "link 'upper'"),
    "blanks in a name": Broken(
        _of("elbow", 'child link="fore"', 'child link="fore "', "joint"), "name_blanks", "joint 'elbow'", True
    ),
    "a mimic of nothing": Broken(
        _of("wrist", "<axis", '<mimic joint="elbo"/><axis', "joint"), "refused", "joint 'wrist'"
    ),
    "xacro left": Broken(_of("fore", 'value="1.2"', 'value="${m}"'), "xacro", "link 'fore'"),
    "masses out of proportion": Broken(
        lambda text: _of("hand", "<collision.*</collision>", "")(
            _of("hand", 'value="0.4"', 'value="0.00001"')(_inertia("hand", 2.5e-5)(text))
        ),
        "mass_ratio", "link 'hand'",
    ),
    "late declaration": Broken(lambda text: f"<!-- exported -->\n{text}", "format", "file", True),
}  # fmt: skip
