"""Right angles that a file states with too few digits, and angles that only look like them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.model import completed
from robot_dyn.scene import of_scene, parse_scene

ARM = """<robot name="arm"><link name="base"/>
<link name="tip"><inertial><mass value="1.5"/><origin xyz="0.1 0.2 0.3" rpy="1.57079632679 0 0"/>
<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0.01" ixz="0.02" iyz="0.03"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<origin xyz="1.57079632679 0 0" rpy="{rpy}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def arm(rpy: str) -> rd.Robot:
    return rd.Robot.from_text(ARM.format(rpy=rpy))


def rpy_of(robot: rd.Robot) -> list[list[float]]:
    origins = (joint.find("origin") for joint in robot.description.element.iterfind("joint"))
    return [[float(x) for x in origin.get("rpy", "0 0 0").split()] for origin in origins if origin is not None]


def test_right_angles_of_the_ur5_become_exact() -> None:
    """All five, each listed by its joint; others, and all that is not an angle, stay as they are."""
    given = rd.load("ur5")
    robot, changes = completed(given)
    before, after = rpy_of(given), rpy_of(robot)
    changed = [k for k, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]]
    assert len(changed) == len(changes) == 5
    assert all("taken as right angles" in str(change) for change in changes)
    for k in changed:
        for x, y in zip(before[k], after[k], strict=True):
            assert y == round(x / (math.pi / 2)) * (math.pi / 2) if x != y else True
            assert abs(x - y) < 1e-9
    assert completed(robot) == (robot, ())
    q = np.linspace(0.2, 1.1, 6)
    assert not np.array_equal(given.M(q), robot.M(q))
    assert np.allclose(given.M(q), robot.M(q), rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("literal", "right"),
    [("1.570796326", 1), ("1.570796327", 1), ("-1.57079632679", -1), ("3.14159265359", 2), ("4.712388980384", 3)],
)
def test_one_unit_of_the_last_digit_of_a_right_angle_is_it(literal: str, right: int) -> None:
    robot, (change,) = completed(arm(f"0 {literal} 0.3"))
    assert rpy_of(robot) == [[0.0, right * math.pi / 2, 0.3]]
    assert str(change).startswith(f"joint 'elbow': rpy 0 {literal} 0.3 taken as right angles")


@pytest.mark.parametrize(
    "literal",
    ["1.5718", "1.571796327", "1.5707", "1.57079633", "1.570796329", "1.570796326794897", "0.000000001e0", "0", "1.2"],
)
def test_an_angle_that_is_only_near_is_left_alone(literal: str) -> None:
    """1e-3 off, too few digits, more than one unit off, all digits there, an exponent, no right angle at all."""
    given = arm(f"{literal} 0 0")
    robot, changes = completed(given)
    assert robot is given
    assert changes == ()


def test_masses_and_translations_are_not_angles() -> None:
    """The same literal as a coordinate of a joint, and in a link's inertial frame, stays."""
    robot, _ = completed(arm("1.57079632679 0 0"))
    text = robot.description.xml.decode()
    assert text.count('rpy="1.57079632679 0 0"') == 1
    assert 'xyz="1.57079632679 0 0"' in text


def test_right_angles_are_named_wherever_machine_code_runs(tmp_path) -> None:
    """By the summary and the run file of runs in machine code, of the plant or of a model; by no interpreted run."""
    given, q = arm("0 1.57079632679 0.3"), [0.2]
    words = "rpy of elbow taken as exact multiples of π/2 (changed by at most 5e-12 rad)"
    options = {"q0": q, "duration_s": 0.01, "integrator": "rk4", "estimate_error": False}
    run = rd.simulate(given, **options, engine="compiled")
    assert f"\nright angles, in machine code: {words}\n" in run.summary
    assert rd.load_run(rd.save_run(run, tmp_path / "run")).about["right_angles"] == words
    runs = rd.rollouts(given, q, duration_s=0.01, integrator="rk4")
    assert runs.about["right_angles"] == words and words in runs[0].summary
    interpreted = rd.simulate(given, **options, engine="interpreted")
    exact = rd.simulate(completed(given)[0], **options, engine="compiled")
    for other in (interpreted, exact):
        assert "right_angles" not in other.about and "right angles" not in other.summary
    law = rd.control.PDGravity(given, rd.control.hold([0.3]), 5.0, 1.0)
    run = rd.simulate(completed(given)[0], **options, engine="compiled", controller=law)
    assert run.about["right_angles"] == words


def test_explain_names_right_angles(tmp_path) -> None:
    path = tmp_path / "scene.toml"
    (tmp_path / "arm.urdf").write_text(ARM.format(rpy="0 1.57079632679 0.3"))
    path.write_text('robot = "arm.urdf"\nduration_s = 0.1\n')
    assert "  edited there: rpy of elbow taken as exact multiples of π/2" in repr(
        of_scene(parse_scene(path.read_text(), "scene.toml"), rd.read_scene(path))
    )
