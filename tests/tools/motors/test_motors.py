"""rd.tools.motors.read_motors: columns, units, and the side of the gear."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd


def _file(folder: Path, text: str) -> Path:
    path = folder / "motors.csv"
    path.write_text(text)
    return path


def test_values_at_the_motor_and_at_the_joint_agree(tmp_path: Path) -> None:
    """Torque times the ratio, speed divided by it, the rotor's inertia times its square."""
    motors = rd.tools.motors.read_motors(
        _file(
            tmp_path,
            "joint,peak [N m],continuous [N m],speed [rpm],gear_ratio,rotor_inertia [kg cm^2],at\n"
            "a,150,60,30,100,1.5,joint\n"
            "b,1.5,0.6,3000,100,1.5,motor\n"
            "c,7,,,,,\n",
        )
    )
    assert motors.peak == pytest.approx({"a": 150.0, "b": 150.0, "c": 7.0})
    assert motors.continuous == pytest.approx({"a": 60.0, "b": 60.0})
    assert motors.speed == pytest.approx({"a": np.pi, "b": np.pi})
    assert motors.armature == pytest.approx({"a": 1.5, "b": 1.5})


@pytest.mark.parametrize("blank", ["", "   ", ",", ",,,", " , "])
def test_lines_without_text_are_skipped_whatever_their_commas(tmp_path: Path, blank: str) -> None:
    motors = rd.tools.motors.read_motors(_file(tmp_path, f"joint,peak [N m],at\na,1,\n{blank}\nb,2,\n{blank}\n"))
    assert motors.peak == {"a": 1.0, "b": 2.0}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("joint,peak\na,1\n", "no valid unit"),
        ("joint,peek [N m]\na,1\n", "peek"),
        ("joint,peak [N m],gear_ratio\na,1,100\n", "'at'"),
        ("joint,peak [N m]\na,-1\n", "line 2: peak must be a positive number"),
        ("joint,peak [N m]\na,1,2\n", "3 entries for 2"),
        ("joint,peak [N m]\na,1\na,2\n", "twice; keep one line, or give a speed in each"),
        ("joint,peak [N m],speed [rad/s]\na,2,0\na,3,4\n", "must not increase with speed"),
        ("joint,peak [N m],speed [rad/s]\na,2,5\na,1,4\n", "must increase from point to point"),
        ("joint,peak [N m],speed [rpm]\na,2,3000\n", "set at to motor and give the gear ratio"),
        ("joint,peak [N m],speed [rpm],at\na,2,0,joint\na,0,30,motor\n", "has another at in its first line"),
        ("joint,peak [N m],speed [rpm]\na,2,0\n", "speed must be a positive number"),
        ("joint,peak [N m]\n", "contains no motors"),
        ("joint,peak [N m],rotor_inertia [kg m^2]\na,1,2\n", "need a gear_ratio"),
        ("joint,peak [N m],gear_ratio,at\na,1,0.01,motor\n", "gear_ratio is the speed of the motor"),
        ("joint,peak [N m],continuous [N m]\na,56,150\n", "continuous torque 150 exceeds the peak 56"),
        ("joint,peak [N m],continuous [N m],speed [rad/s]\na,5,4,0\na,1,2,3\n", "line 3: the continuous torque"),
        ("joint,peak [N m],brake [N m]\na,150,1.5\n", "give both at the joint"),
        ("joint,peak [N m],brake [N m],at,gear_ratio\na,1.5,150,motor,100\n", "give both at the motor"),
        ("joint,peak [N m],efficiency,at,gear_ratio\na,1,1.2,motor,100\n", "at most 1"),
        ("joint,peak [N m],efficiency [%],at,gear_ratio\na,1,0.8,motor,100\n", "leaves almost no torque"),
        ("joint,peak [N m],efficiency,at,gear_ratio\na,1,-0.8,motor,100\n", "positive number"),
    ],
)
def test_a_file_that_does_not_say_what_it_means_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(rd.RobotDynError, match=said):
        rd.tools.motors.read_motors(_file(tmp_path, text))


def test_a_rotor_that_the_arm_lacks_is_refused_and_one_that_it_has_is_taken(tmp_path: Path) -> None:
    pytest.importorskip("toppra")
    motors = rd.tools.motors.read_motors(
        _file(tmp_path, "joint,peak [N m],gear_ratio,rotor_inertia [kg m^2],at\nelbow_joint,90,100,1e-4,joint\n")
    )
    robot, points = rd.load("ur5"), np.array([[0.1] * 6, [0.5] * 6])
    limits = {"velocity": 3.0, "effort": 150.0}
    with pytest.raises(rd.RobotDynError, match="with_"):
        rd.tools.motors.path(robot, points, motors=motors, **limits)
    assert rd.tools.motors.path(robot.with_(armature=motors.armature), points, motors=motors, **limits).largest <= 1.001


def test_limits_on_the_wrong_side_of_a_gear_are_findings(tmp_path: Path) -> None:
    """A joint's torque and speed stated as a motor's, with a ratio of 100; those at the joint have no finding."""
    arm, plan = rd.load("ur5"), rd.control.quintic(np.zeros(6), np.full(6, 0.2), 3.0)
    for at, expected in (("motor", 2), ("joint", 0)):
        text = f"joint,peak [N m],speed [rad/s],gear_ratio,at\nelbow_joint,150,3,100,{at}\n"
        motors = rd.tools.motors.read_motors(_file(tmp_path, text))
        findings = rd.tools.motors.budget(plan, arm, motors=motors).findings
        assert len([finding for finding in findings if "gear_ratio" in finding]) == expected


@pytest.mark.parametrize("column", ["continuous [N m]", "brake [N m]", "speed [rad/s]"])
def test_an_unknown_joint_of_a_file_is_refused_with_the_file(tmp_path: Path, column: str) -> None:
    motors = rd.tools.motors.read_motors(_file(tmp_path, f"joint,peak [N m],{column}\nelbow,5,3\n"))
    with pytest.raises(rd.RobotDynError, match=r"motors\.csv: no joint 'elbow'"):
        rd.tools.motors.budget(rd.control.quintic(np.zeros(6), np.ones(6), 3.0), rd.load("ur5"), motors=motors)
