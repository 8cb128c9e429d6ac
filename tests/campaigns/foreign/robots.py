"""Departures from URDF: links, limits, the elements of other programs."""

from __future__ import annotations

from tests.campaigns.foreign.files import ARM, Foreign, arm, inside
from tests.hostile.kinds import BODY, LIMIT, MOMENTS, PARENT, POINT, joint

SAFETY = '<safety_controller k_velocity="-1" soft_lower_limit="nan"/>'
CAPSULE = """<link name="tool"><visual><geometry><capsule radius="1"/></geometry></visual>
  <visual><geometry><mesh filename="http://x/y.stl"/></geometry></visual></link>"""
NO_MOMENTS = 'ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"'
BASE = '  <link name="base"/>\n'
ROOT = ("parent link 'base' is not defined", "taken as the root", "add <link")
ONE_BODY = """<ros2_control name="a" type="system"><joint name="elbow"><command_interface name="position"/></joint>
  </ros2_control><transmission name="t"><joint name="elbow"/><actuator name="m"/></transmission>
  <gazebo reference="fore"><mu1>0.2</mu1></gazebo><gazebo><plugin filename="x.so"/></gazebo>
  <mujoco><compiler meshdir="."/></mujoco><drake:acceleration xmlns:drake="http://drake.mit.edu"/>
  <sensor name="s"><parent link="nowhere"/></sensor><loop_joint name="l" type="revolute"/>"""


def taken(key: str, value: str) -> str:
    """The limits of the shoulder without one, and with another text instead."""
    return LIMIT.replace(f'{key}="2"' if key == "velocity" else f'{key}="9"', value)


FILES = [
    Foreign("a root that is not defined", ARM.replace(BASE, ""), (("joint 'shoulder'", *ROOT),)),
    Foreign("world, not defined", inside(joint("mount", "world", "base", kind="fixed")),
            (("joint 'mount'", "parent link 'world' is not defined", "taken as the root"),)),
    Foreign("a root not defined of two joints",
            inside('<link name="leg"/>' + joint("l", "base", "leg", kind="fixed")).replace(BASE, ""),
            (("joint 'shoulder'", *ROOT),)),
    Foreign("a parent misspelt", arm((PARENT, '<parent link="uper"/>')),
            refused=("'uper' is not defined", "nearest: upper")),
    Foreign("two parents not defined", arm((PARENT, '<parent link="uper"/>')).replace(BASE, ""),
            refused=("joint 'shoulder'", "'base' is not defined")),
    Foreign("world floating", inside(joint("mount", "world", "base", kind="floating")),
            refused=("joint 'mount'", "is floating")),
    Foreign("limits exchanged", arm(('lower="-1"', 'lower="1.5"')),
            (("joint 'shoulder'", "lower limit 1.5 is above its upper 1", "ignored"),),
            sound=arm((LIMIT, '<limit effort="9" velocity="2"/>'))),
    Foreign("a lower limit alone, above 0", arm((LIMIT, '<limit lower="1" effort="9" velocity="2"/>')),
            (("lower limit 1 is above its upper 0", "ignored"),),
            sound=arm((LIMIT, '<limit effort="9" velocity="2"/>'))),
    Foreign("an effort limit of -1", arm((LIMIT, taken("effort", 'effort="-1"'))),
            (("joint 'shoulder'", "effort limit -1 is negative", "ignored"),),
            sound=arm((LIMIT, taken("effort", "")))),
    Foreign("a velocity limit below 0, and crossed limits",
            arm((LIMIT, '<limit lower="2" upper="1" effort="9" velocity="-0.5"/>')),
            (("velocity limit -0.5 is negative",), ("lower limit 2 is above its upper 1",)),
            sound=arm((LIMIT, '<limit effort="9"/>'))),
    Foreign("a limit that is not a number", arm((LIMIT, taken("effort", 'effort="nan"'))),
            refused=("effort", "'nan'")),
    Foreign("two inertials of a link, the second one light", ARM.replace("</inertial>", "</inertial>" + POINT, 1),
            (("link 'upper'", "2 <inertial> elements", "the first is taken", "keep one"),)),
    Foreign("two limits of a joint", arm((LIMIT, LIMIT + '<limit lower="0" upper="0.1" effort="1" velocity="1"/>')),
            (("joint 'shoulder'", "2 <limit> elements", "the first is taken", "keep one"),)),
    Foreign("a mass without inertia", arm((f"<inertia {MOMENTS}/>", "")),
            (("link 'upper'", "no <inertia>", "taken as 0", "add it"),), sound=arm((MOMENTS, NO_MOMENTS))),
    Foreign("products of inertia left out", arm((MOMENTS, 'ixx="0.02" iyy="0.02" izz="0.01"')),
            (("link 'upper'", "no ixy, ixz, iyz", "taken as 0"),)),
    Foreign("a link beside the arm", inside(f'<link name="table">{BODY}</link>'),
            (("link 'table'", "no joint connects it", "left out", "connect it by a joint"),)),
    Foreign("links beside a root that is not defined, which may be misspelt",
            inside('<link name="table"/>').replace(BASE, ""), refused=("'base' is not defined",)),
    Foreign("elements of other programs", inside(ONE_BODY)),
    Foreign("a version of the format", ARM.replace("<robot ", '<robot version="1.0" ')),
    Foreign("elements of ROS 1 in a joint",
            ARM.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><calibration rising="0"/>' + SAFETY),
            (("joint 'elbow'", "soft_lower_limit", "'nan'", "not a number"),)),
    Foreign("a capsule and a mesh of the network", inside(CAPSULE + joint("t", "fore", "tool", kind="fixed"))),
    Foreign("links after joints", ARM.replace(BASE, "").replace("</robot>", BASE + "</robot>")),
    Foreign("a closed loop", inside(joint("strut", "base", "fore")), refused=("link 'fore'", "two parents")),
    Foreign("a robot without name", ARM.replace(' name="arm"', "", 1), refused=("<robot>", "has no name")),
    Foreign("SDF", '<sdf version="1.7"><model name="arm"/></sdf>', refused=("is SDF, not URDF", "converters lose")),
    Foreign("MJCF", '<mujoco model="arm"><worldbody/></mujoco>', refused=("is MJCF, not URDF", ".xml")),
    Foreign("a ball joint", arm(('name="elbow" type="revolute"', 'name="elbow" type="ball"')),
            refused=("'ball'", "revolute")),
    Foreign("a page of the web", "<!DOCTYPE html><html></html>",
            refused=("is a web page", "download the file itself")),
]  # fmt: skip
