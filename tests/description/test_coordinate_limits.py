"""A coordinate takes the positions and speeds that its joint and all joints that follow it allow."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.control import inverse_kinematics
from robot_dyn.tools.motors import point_to_point

INERTIAL = '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>'


def slide(name: str, limits: str, mimic: str = "", axis: str = "0 0 1", speed: float = 1.0) -> str:
    """A link that slides on the base, with its joint."""
    return (
        f'<link name="l_{name}">{INERTIAL}</link><joint name="{name}" type="prismatic"><parent link="base"/>'
        f'<child link="l_{name}"/><axis xyz="{axis}"/><limit {limits} effort="50" velocity="{speed}"/>{mimic}</joint>'
    )


def follows(source: str, multiplier: float, offset: float = 0.0) -> str:
    return f'<mimic joint="{source}" multiplier="{multiplier}" offset="{offset}"/>'


def arm_of(*slides: str) -> rd.Robot:
    return rd.Robot.from_text(f'<robot name="gripper"><link name="base"/>{"".join(slides)}</robot>')


RANGE = 'lower="-0.1" upper="0.1"'
LEVER = slide("drive", RANGE), slide("f", RANGE, follows("drive", -2, 0.01), axis="0 0 -1")


@pytest.mark.parametrize(
    ("followers", "lower", "upper", "speed"),
    [
        ((), -0.1, 0.1, 1.0),
        # |-2 q + 0.01| <= 0.1 and |-2 v| <= 1
        ((slide("f", RANGE, follows("drive", -2, 0.01)),), -0.045, 0.055, 0.5),
        # a follower of the follower: 3 (-2 q + 0.01) - 0.03 = -6 q within [-0.12, 0.3], and 6 v within 1
        (
            (
                slide("f", 'lower="-1" upper="1"', follows("drive", -2, 0.01)),
                slide("g", 'lower="-0.12" upper="0.3"', follows("f", 3, -0.03)),
            ),
            -0.05,
            0.02,
            1 / 6,
        ),
        # a follower that moves less, and a faster one
        ((slide("f", RANGE, follows("drive", 0.5), speed=3.0),), -0.1, 0.1, 1.0),
        # two followers, each of which narrows one side
        (
            (
                slide("f", 'lower="-0.04" upper="0.2"', follows("drive", 1)),
                slide("g", 'lower="-0.05" upper="0.2"', follows("drive", -1)),
            ),
            -0.04,
            0.05,
            1.0,
        ),
    ],
)
def test_limits_are_the_intersection_over_all_tied_joints(
    followers: tuple[str, ...], lower: float, upper: float, speed: float
) -> None:
    arm = arm_of(slide("drive", RANGE), *followers)
    limits = arm.lower[0], arm.upper[0], arm.velocity_limit[0]
    assert np.allclose(limits, (lower, upper, speed), rtol=1e-14), limits
    assert arm.effort_limit[0] == 50
    assert arm.findings == ()


def test_an_unlimited_joint_gets_the_limits_of_its_follower() -> None:
    turning = (
        f'<link name="l">{INERTIAL}</link><joint name="drive" type="continuous"><parent link="base"/><child link="l"/>'
        '<axis xyz="0 0 1"/></joint>'
    )
    arm = arm_of(turning, slide("f", 'lower="0" upper="0.2"', follows("drive", 0.1)))
    assert (arm.lower[0], arm.upper[0], arm.velocity_limit[0]) == pytest.approx((0.0, 2.0, 10.0), rel=1e-14)
    assert rd.info(arm).narrowed == {"drive": ("f",)}


@pytest.mark.parametrize(
    ("mimic", "limits"),
    [
        (follows("drive", -1), 'lower="0" upper="0.5"'),  # a point: the other knuckle states the range of the first
        (follows("drive", 1, 0.7), 'lower="0" upper="0.5"'),  # empty
        (follows("drive", 1), 'lower="0" upper="0.04"'),  # below a tenth of the range
        (follows("drive", -1, 0.04), 'lower="0" upper="0.5"'),  # 0 to 0.04 of 0.5
        (follows("drive", 0.5, -1.0), 'lower="0" upper="0.5"'),  # from 2 on
    ],
)
def test_a_follower_that_would_leave_hardly_any_range_narrows_nothing_and_is_reported(mimic: str, limits: str) -> None:
    with pytest.warns(rd.ModelWarning):
        arm = arm_of(slide("drive", 'lower="0" upper="0.5"'), slide("f", limits, mimic))
    assert (arm.lower[0], arm.upper[0]) == (0.0, 0.5)
    (finding,) = arm.findings
    assert "'f'" in finding
    assert rd.info(arm).narrowed == {}


def test_a_locked_joint_and_its_followers_have_no_limits() -> None:
    arm = arm_of(*LEVER, slide("other", RANGE)).with_(lock={"drive": 0.02})
    assert arm.joint_names == ("other",)
    assert (arm.lower[0], arm.upper[0]) == (-0.1, 0.1)


def test_stops_plans_and_inverse_kinematics_keep_a_follower_within_its_limits() -> None:
    arm = arm_of(*LEVER)

    def follower(q: np.ndarray) -> np.ndarray:
        return -2 * q[..., 0] + 0.01

    bound = 0.1 + 1e-9  # events are located to far better than a nanometre
    stopped = rd.simulate(rd.Plant(arm, [rd.effects.RigidStops("urdf", "urdf")]), [0.0], duration_s=1.0)
    assert np.abs(follower(stopped.q)).max() <= bound
    assert np.abs(follower(stopped.q)).max() == pytest.approx(0.1, abs=1e-9)
    plan = point_to_point(arm, [0.0], [0.05], acceleration=1.0, jerk=10.0)
    t = np.linspace(0.0, plan.duration_s, 2001)
    assert np.abs(-2 * plan.reference.at(t)[1]).max() <= 1.0 + 1e-12
    with pytest.raises(rd.RobotDynError):
        point_to_point(arm, [0.0], [0.09], acceleration=1.0, jerk=10.0)
    # at q = 0.09 the follower would be at 0.17
    answer = inverse_kinematics(arm, arm.placement([0.09], "l_f"), frame="l_f")
    assert arm.lower[0] <= answer.q[0] <= arm.upper[0]
    assert answer.limited_by


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("name", ["panda", "pr2"])
def test_catalog_grippers_keep_the_limits_of_their_drives(name: str) -> None:
    """Both fingers of the Panda state one range; the knuckles of the PR2, which turn against each other, do too."""
    arm = rd.load(name)
    assert rd.info(arm).narrowed == {}
