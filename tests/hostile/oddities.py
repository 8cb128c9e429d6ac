"""Files that load: sound ones with something odd left out or added, and ones whose bodies cannot exist."""

from __future__ import annotations

import re

from tests.hostile.kinds import ARM, AXIS, ELBOW, LIMIT, MOMENTS, POINT, Make, altered, arm, inside, joint, text

SHOULDER = '"shoulder" type="revolute"'
NOT_OWN = (
    '<gazebo reference="nobody"><joint name="elbow"/></gazebo><transmission name="t"><joint name="x"/></transmission>'
)
MESH = """<link name="base"><visual><geometry><mesh filename="package://../../nowhere.dae" scale="nan"/></geometry>
  <material name="unknown"/></visual><collision><geometry><cylinder radius="-1"/></geometry></collision></link>"""
KINDS: dict[str, Make] = {
    "the sound arm": text(ARM),
    "a revolute joint without limit": altered(LIMIT, ""),
    "an upper limit alone": altered(LIMIT, '<limit upper="1"/>'),
    "a prismatic joint without axis": text(arm((AXIS, ""), (SHOULDER, SHOULDER.replace("revolute", "prismatic")))),
    "a continuous joint with exchanged limits": text(
        arm((SHOULDER, '"shoulder" type="continuous"'), ('lower="-1"', 'lower="7"'))
    ),
    "a mesh that is missing and shapes without meaning": altered('<link name="base"/>', MESH),
    "elements of another simulator": text(inside(NOT_OWN)),
    "a link without inertial at the tip": text(inside('<link name="tip"/>' + joint("wrist", "fore", "tip"))),
    "a point mass on the axis at the tip": text(
        inside(f'<link name="tip">{POINT}</link>' + joint("wrist", "fore", "tip"))
    ),
    "a massless link in the midst": altered(ARM[ARM.index("    <inertial>") : ARM.index("  </link>")], ""),
    "no masses at all": text(
        re.sub(r"<inertial>.*?</inertial>", "", ARM.replace(ELBOW, ELBOW.replace("revolute", "fixed")), flags=re.S)
    ),
    "an indefinite inertia": altered(MOMENTS, MOMENTS.replace('izz="0.01"', 'izz="-0.01"')),
    "an inertia that breaks the triangle inequality": altered(MOMENTS, MOMENTS.replace('izz="0.01"', 'izz="0.05"')),
}
