"""What a file states for other programs is reported, acts only when asked for by name, and then by its own equation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")

INERTIAL = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial>'
MIMIC = '<mimic joint="j" multiplier="-2" offset="0.3"/>'


def robot(*, j: str = "", k: str = "", more: str = "") -> rd.Robot:
    """Joint j about z, and k beside it, which follows it if it says so."""
    joints = "".join(
        f'<link name="l_{name}">{INERTIAL}</link><joint name="{name}" type="revolute"><parent link="base"/>'
        f'<child link="l_{name}"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="9"/>{inside}'
        "</joint>"
        for name, inside in (("j", j), ("k", k))
    )
    return rd.Robot.from_text(f'<robot name="two"><link name="base"/>{joints}{more}</robot>')


def transmission(rotor: str, gear: str = "", joint: str = "j") -> str:
    actuator = f'<actuator name="m">{gear}{rotor}</actuator>'
    return f'<transmission name="t_{joint}"><joint name="{joint}"/>{actuator}</transmission>'


ROS = transmission(
    "<motorInertia>3e-5</motorInertia>", "<mechanicalReduction>113.90625</mechanicalReduction>"
)  # the numbers of a published arm
DRAKE = transmission('<drake:rotor_inertia value="3e-5"/>', '<drake:gear_ratio value="113.90625"/>')
REFLECTED = 113.90625**2 * 3e-5


@pytest.mark.parametrize(
    ("stated", "armature"),
    [
        ({"more": ROS}, [REFLECTED, 0.0]),
        ({"more": DRAKE}, [REFLECTED, 0.0]),
        ({"k": '<dynamics rotor_inertia="3e-5" gear_ratio="100"/>'}, [0.0, 0.3]),
        ({"more": transmission("<motorInertia>0.25</motorInertia>")}, [0.25, 0.0]),
        # k moves twice as fast as j: s² J
        ({"k": MIMIC, "more": transmission("<motorInertia>0.25</motorInertia>", joint="k")}, [1.0]),
    ],
)
def test_a_stated_rotor_is_reported_and_adds_its_reflected_inertia_to_M_when_asked(
    stated: dict[str, str], armature: list[float]
) -> None:
    arm = robot(**stated)
    assert np.allclose(arm.stated_armature, armature, rtol=1e-14)
    q = np.zeros(arm.n)
    M = arm.M(q)
    with_rotors = arm.with_(armature="urdf")
    assert np.allclose(with_rotors.M(q) - M, np.diag(armature), rtol=1e-12, atol=1e-14)
    assert any("rotor" in finding for finding in arm.findings)
    assert not any("rotor" in finding for finding in with_rotors.findings)
    assert {item.quantity for item in rd.info(arm).other_programs} == {"armature"}


def test_a_stated_spring_acts_when_asked() -> None:
    spring = "<gazebo reference='j'><springStiffness>5</springStiffness><springReference>0.1</springReference></gazebo>"
    arm = robot(k='<dynamics stiffness="2"/>', more=spring)
    plant = rd.Plant(arm, [rd.effects.Spring("urdf", rest="urdf")])
    (effect,) = plant.effects
    assert np.allclose(effect.stiffness, [5.0, 2.0])
    assert np.allclose(effect.rest, [0.1, 0.0])
    assert not arm.N(np.array([0.4, 0.2])).any()
    with pytest.raises(rd.RobotDynError):  # the file's springs would act about other positions
        rd.Plant(arm, [rd.effects.Spring("urdf")])


def test_springs_of_a_joint_and_its_follower_act_like_both() -> None:
    """E = ½ 5 (q − 0.1)² + ½ 3 (−2 q + 0.3 − 0.7)², so dE/dq = 5 (q − 0.1) − 6 (−2 q − 0.4)."""
    arm = robot(
        j='<dynamics spring_stiffness="5" spring_reference="0.1"/>',
        k=MIMIC + '<dynamics spring_stiffness="3" spring_reference="0.7"/>',
    )
    for q in (-0.7, 0.0, 0.9):
        torque = -arm.stated_stiffness * (q - arm.stated_rest)
        assert torque[0] == pytest.approx(-(5 * (q - 0.1) - 6 * (-2 * q - 0.4)), rel=1e-13)


@pytest.mark.parametrize(
    ("stated", "stiffness", "rest"),
    [
        ({"j": '<dynamics spring_stiffness="5" spring_reference="0.1"/>'}, [5.0, 0.0], [0.1, 0.0]),
        ({"k": '<dynamics stiffness="2"/>'}, [0.0, 2.0], [0.0, 0.0]),
        ({"more": '<gazebo reference="k"><springStiffness>3</springStiffness></gazebo>'}, [0.0, 3.0], [0.0, 0.0]),
        # k = -2 j + 0.3: 4 s at the joint, about the position at which k is at rest
        ({"k": MIMIC + '<dynamics spring_stiffness="3" spring_reference="0.7"/>'}, [12.0], [-0.2]),
        ({"j": '<dynamics stiffness="1"/>', "k": MIMIC + '<dynamics stiffness="1"/>'}, [5.0], [0.12]),
    ],
)
def test_a_stated_spring_is_reported_with_its_stiffness_and_rest(
    stated: dict[str, str], stiffness: list[float], rest: list[float]
) -> None:
    arm = robot(**stated)
    np.testing.assert_allclose(arm.stated_stiffness, stiffness, rtol=1e-14)
    np.testing.assert_allclose(arm.stated_rest, rest, rtol=1e-14, atol=1e-15)
    assert any("spring" in finding for finding in arm.findings)


@pytest.mark.parametrize(
    ("stated", "lower", "upper"),
    [
        ({"j": '<safety_controller k_velocity="9" soft_lower_limit="-0.3"/>'}, [-0.3, -np.inf], [np.inf, np.inf]),
        ({"k": '<safety_controller k_velocity="9" soft_upper_limit="0.4"/>'}, [-np.inf, -np.inf], [np.inf, 0.4]),
        ({"j": '<safety_controller k_velocity="9"/>'}, [-np.inf, -np.inf], [np.inf, np.inf]),
        ({}, [-np.inf, -np.inf], [np.inf, np.inf]),
    ],
)
def test_soft_limits_that_the_file_does_not_state_are_infinite(
    stated: dict[str, str], lower: list[float], upper: list[float]
) -> None:
    arm = robot(**stated)
    assert arm.soft_lower.tolist() == lower and arm.soft_upper.tolist() == upper


def test_soft_limits_are_those_of_the_safety_controller() -> None:
    arm = robot(j='<safety_controller k_velocity="9" soft_lower_limit="-0.3" soft_upper_limit="0.2"/>')
    assert arm.soft_lower.tolist() == [-0.3, -np.inf]
    assert arm.soft_upper.tolist() == [0.2, np.inf]
    assert (arm.lower[0], arm.upper[0]) == (-3.0, 3.0)
    stops = rd.effects.RigidStops("urdf_soft", "urdf_soft")
    run = rd.simulate(rd.Plant(arm, [stops]), [0.0, 0.0], [1.0, 0.5], duration_s=1.0)
    assert run.q[:, 0].max() == pytest.approx(0.2, abs=1e-9)
    assert run.q[-1, 1] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize(
    ("soft", "lower", "upper"),
    [
        ('soft_lower_limit="-0.3" soft_upper_limit="0.2"', -0.3, 0.2),
        ('soft_lower_limit="-4" soft_upper_limit="0.2"', -3.0, 0.2),  # the hard limit is narrower
        ('soft_upper_limit="0.2"', -3.0, 0.2),
    ],
)
def test_soft_limits_narrow_the_position_limits_on_request(
    soft: str, lower: float, upper: float, tmp_path: Path
) -> None:
    """For planners: both intervals hold. `to_urdf` keeps the element, so a reader may ask again."""
    arm = robot(j=f'<safety_controller k_velocity="9" {soft}/>')
    narrow = arm.with_(mass_scale=1.1).with_soft_limits()
    assert (narrow.lower[0], narrow.upper[0]) == (lower, upper) and narrow.lower[1] == arm.lower[1]
    assert narrow.edits.mass_scale == 1.1 and narrow.with_soft_limits().upper[0] == upper
    for name, written in (("arm", arm), ("narrow", narrow)):
        again = rd.load(written.to_urdf(tmp_path / name))
        assert np.array_equal(again.upper, written.upper) and np.array_equal(again.soft_upper, arm.soft_upper)
    assert "safety_controller" not in arm.with_(lock={"j": 0.1}).to_urdf(tmp_path / "locked").read_text()


@pytest.mark.parametrize(
    "soft",
    [
        'soft_lower_limit="0.3" soft_upper_limit="-0.2"', 'soft_lower_limit="4"', 'soft_upper_limit="-4"',
        'soft_lower_limit="x"',
    ],
)  # fmt: skip
def test_soft_limits_without_a_position_are_refused(soft: str) -> None:
    with pytest.raises(rd.RobotDynError, match="'j'"):
        robot(j=f'<safety_controller k_velocity="9" {soft}/>').with_soft_limits()


@pytest.mark.parametrize("side", ["lower", "upper"])
@pytest.mark.parametrize("text", ["abc", "nan", "1,5", ""])
def test_a_soft_limit_that_is_no_number_is_named_at_load_and_refused(side: str, text: str) -> None:
    arm = robot(j=f'<safety_controller k_velocity="9" soft_{side}_limit="{text}"/>')
    assert [x for x in arm.findings if f"soft_{side}_limit" in x and "'j'" in x and "not a number" in x]
    with pytest.raises(rd.RobotDynError, match=f"'j'.*soft_{side}_limit"):
        arm.with_soft_limits()


def test_the_first_of_two_safety_controllers_counts() -> None:
    soft = '<safety_controller k_velocity="9" soft_upper_limit="{}"/>'
    arm = robot(j=soft.format(0.2) + soft.format(0.1))
    assert arm.soft_upper[0] == arm.with_soft_limits().upper[0] == 0.2
    assert any("2 <safety_controller>" in finding for finding in arm.findings)


def test_what_a_file_does_not_state_is_refused() -> None:
    arm = robot()
    assert arm.statements == ()
    with pytest.raises(rd.RobotDynError):
        arm.with_(armature="urdf")
    with pytest.raises(rd.RobotDynError):
        arm.with_soft_limits()
    for effect in (rd.effects.Spring("urdf"), rd.effects.RigidStops("urdf_soft", "urdf_soft")):
        with pytest.raises(rd.RobotDynError):
            rd.Plant(arm, [effect])
    with pytest.raises(rd.RobotDynError):
        rd.effects.Spring("urdf_soft")


@pytest.mark.parametrize("text", ["", "x", "1,5", "${J}"])
def test_a_statement_that_is_no_number_is_reported_and_refused(text: str) -> None:
    arm = robot(more=transmission(f"<motorInertia>{text}</motorInertia>"))
    (item,) = arm.statements
    assert np.isnan(item.value)
    with pytest.raises(rd.RobotDynError):
        arm.with_(armature="urdf")


SCENE = """
robot = "two.urdf"
duration_s = 0.5

[start]
v = [1.0, 1.0]

[[effect]]
kind = "armature"
inertia_kg_m2 = "urdf"

[[effect]]
kind = "rigid_stops"
lower_rad = "urdf_soft"
upper_rad = "urdf_soft"
"""


def test_scenes_ask_for_rotors_and_soft_limits_by_the_same_words(tmp_path: Path) -> None:
    soft = '<safety_controller k_velocity="9" soft_lower_limit="-0.3" soft_upper_limit="0.2"/>'
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "two.urdf").write_bytes(robot(j=soft, k=soft, more=ROS).description.text)
    setup = rd.read_scene(tmp_path / "scene.toml")
    run = rd.simulate(setup)
    assert np.allclose(setup.plant.dynamics.armature, [REFLECTED, 0.0])
    assert np.allclose(run.q.max(axis=0), 0.2, atol=1e-9)
    (tmp_path / "two.urdf").write_bytes(robot().description.text)
    with pytest.raises(rd.RobotDynError):
        rd.read_scene(tmp_path / "scene.toml")
