"""Files that load: sound ones with something odd left out or added, and ones whose bodies cannot exist."""

from __future__ import annotations

import re
from math import inf

from tests.hostile.kinds import ARM, AXIS, ELBOW, LIMIT, MOMENTS, POINT, Kind, altered, arm, inside, joint, text

SHOULDER = '"shoulder" type="revolute"'
NOT_OWN = (
    '<gazebo reference="nobody"><joint name="elbow"/></gazebo><transmission name="t"><joint name="x"/></transmission>'
)
MESH = """<link name="base"><visual><geometry><mesh filename="package://../../nowhere.dae" scale="nan"/></geometry>
  <material name="unknown"/></visual><collision><geometry><cylinder radius="-1"/></geometry></collision></link>"""
STUCK = ("SingularError", "joint 'wrist' carries no inertia", "give its link a mass", "lock it")
KINDS = [
    Kind("the sound arm", text(ARM), upper=(1, 2)),
    Kind("a revolute joint without limit", altered(LIMIT, ""), upper=(inf, 2)),
    Kind("an upper limit alone", altered(LIMIT, '<limit upper="1"/>'), upper=(1, 2)),
    Kind("a prismatic joint without axis",
         text(arm((AXIS, ""), (SHOULDER, SHOULDER.replace("revolute", "prismatic"))))),
    Kind("a continuous joint with exchanged limits",
         text(arm((SHOULDER, '"shoulder" type="continuous"'), ('lower="-1"', 'lower="7"'))), upper=(inf, 2)),
    Kind("a mesh that is missing and shapes without meaning", altered('<link name="base"/>', MESH), upper=(1, 2)),
    Kind("elements of another simulator", text(inside(NOT_OWN)), upper=(1, 2)),
    Kind("a link without inertial at the tip", text(inside('<link name="tip"/>' + joint("wrist", "fore", "tip"))),
         warned=("ModelWarning: arm: link 'tip'", "no mass", "add an <inertial>"), stuck=STUCK),
    Kind("a point mass on the axis at the tip",
         text(inside(f'<link name="tip">{POINT}</link>' + joint("wrist", "fore", "tip"))),
         warned=("joint 'wrist'", "no inertia about its axis", "add moments of inertia to its link"), stuck=STUCK),
    Kind("a massless link in the midst", altered(ARM[ARM.index("    <inertial>") : ARM.index("  </link>")], ""),
         warned=("ModelWarning: arm: link 'upper'", "no mass", "add an <inertial>")),
    Kind(
        "no masses at all",
        text(
            re.sub(r"<inertial>.*?</inertial>", "", ARM.replace(ELBOW, ELBOW.replace("revolute", "fixed")), flags=re.S)
        ),
        warned=("ModelWarning: arm: link 'upper'", "no mass", "add an <inertial>"),
        stuck=("SingularError", "joint 'shoulder' carries no inertia"),
    ),
    Kind("an indefinite inertia", altered(MOMENTS, MOMENTS.replace('izz="0.01"', 'izz="-0.01"')),
         warned=("ModelWarning: arm: link 'upper'", "indefinite", "-0.01", "correct the inertia")),
    Kind("an inertia that breaks the triangle inequality",
         altered(MOMENTS, MOMENTS.replace('izz="0.01"', 'izz="0.05"')),
         warned=("ModelWarning: arm: link 'upper'", "triangle inequality", "0.05", "correct the inertia")),
]  # fmt: skip
