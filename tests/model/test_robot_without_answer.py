"""What has no answer: forward dynamics where M is singular, results that are too large for a float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import OverflowedError, SingularError
from tests.hostile.kinds import BODY, POINT, joint
from tests.queries import general

INERTIA = ((0.02, 0.001, -0.002), (0.001, 0.03, 0.003), (-0.002, 0.003, 0.04))


Z = '<axis xyz="0 0 1"/>'


def arm(links: dict[str, str], *joints: str) -> rd.Robot:
    """The robot of links (name → content) and joints."""
    parts = [f'<link name="{name}">{content}</link>' for name, content in links.items()]
    return rd.Robot.from_text(f'<robot name="arm">{"".join(parts + list(joints))}</robot>')


def point_mass(xyz: str) -> str:
    return POINT.replace("<inertial>", f'<inertial><origin xyz="{xyz}"/>')


# --- where M is singular


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
def test_a_zero_on_the_diagonal_of_M_decides_that_it_is_singular() -> None:
    """Three parallel axes and a point mass on the last: M = m (l₁₂ᵀ l₁₂ …) with M₃₃ = 0, of rank 1.

    Which of the first two pivots is positive is lost in rounding; the third joint carries no inertia at any q.
    """
    links = {"base": "", "l0": "", "l1": "", "l2": point_mass("0 0 0")}
    offset = '<origin xyz="0 0.1 0"/>'
    robot = arm(links, joint("j0", "base", "l0"), joint("j1", "l0", "l1"), joint("j2", "l1", "l2", offset))
    assert robot.joint_without_inertia == "j2"
    assert robot.findings[0].startswith("link 'l0' moves but has no mass")
    assert_allclose(robot.M(np.array([0.3, 0.9, -0.4])), np.pad(np.full((2, 2), 0.01), (0, 1)), rtol=0, atol=1e-17)
    with pytest.raises(SingularError, match="'j2' carries no inertia"):
        robot.forward_dynamics(np.zeros(3), np.zeros(3), np.zeros(3))


def test_massless_tip_has_no_forward_dynamics_until_it_is_held_or_loaded():
    with pytest.warns(ModelWarning, match="link 'pointer'"):
        robot = rd.load("massless_tip")
    q, v, tau = general(robot, 9)
    assert np.isfinite(robot.inverse_dynamics(q, v, tau)).all()
    for x in (q, q.tolist(), [q, q]):
        with pytest.raises(SingularError, match="'pointer_joint'"):
            robot.forward_dynamics(x, v, tau)
    assert np.isfinite(robot.with_(lock={"pointer_joint": 0.2}).forward_dynamics(q[:1], v[:1], tau[:1])).all()
    loaded = robot.with_(payload=rd.Payload("pointer", 0.1, inertia=INERTIA))
    assert_allclose(loaded.inverse_dynamics(q, v, loaded.forward_dynamics(q, v, tau)), tau, rtol=1e-12)


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
def test_M_that_is_singular_where_the_mass_lies_on_the_outer_axis():
    """M = diag(m l² sin² q₂, m l²) for a point mass on the z axis at q₂ = 0."""
    links = {"base": "", "yoke": "", "bob": point_mass("0 0 0.5")}
    robot = arm(links, joint("pan", "base", "yoke", Z), joint("tilt", "yoke", "bob", '<axis xyz="0 1 0"/>'))
    v, tau = np.array([0.3, -0.4]), np.array([0.6, 0.7])
    assert_allclose(robot.M(np.array([0.7, 0.9])), np.diag([0.25 * np.sin(0.9) ** 2, 0.25]), rtol=0, atol=1e-16)
    for tilt in (0.9, 0.1, -0.1, 2.0):
        q = np.array([0.7, tilt])
        assert_allclose(robot.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau, rtol=1e-10)
    for q in (np.array([0.7, 0.0]), [0.7, 0.0], [[0.7, 0.9], [0.7, 0.0]]):
        with pytest.raises(SingularError, match="'pan' carries no inertia at this q"):
            robot.forward_dynamics(q, v, tau)


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
@pytest.mark.parametrize(("l1", "l2"), [(0.3, 0.7), (0.67, 0.34), (0.83, 0.92)])
def test_M_that_is_singular_where_the_arm_is_straight(l1: float, l2: float):
    """M has det M = m² l₁² l₂² sin² q₂ for a point mass at the tip alone; rounding decides how ABA fails at q₂ = 0."""
    links = {"base": "", "upper": "", "lower": point_mass(f"{l2} 0 0")}
    elbow = joint("elbow", "upper", "lower", f'<origin xyz="{l1} 0 0"/>{Z}')
    robot = arm(links, joint("shoulder", "base", "upper", Z), elbow)
    v, tau = np.array([0.3, -0.4]), np.array([0.6, 0.7])
    q = np.array([0.2, 0.9])
    assert_allclose(robot.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau, rtol=1e-10)
    with pytest.raises(SingularError, match=r"forward dynamics.* joint '(shoulder|elbow)' carries"):
        robot.forward_dynamics(np.array([0.2, 0.0]), v, tau)


# --- what overflows


@pytest.mark.parametrize("name", ["ur5", "panda", "skew_tree"])
@pytest.mark.parametrize("form", [np.asarray, np.ndarray.tolist])
def test_arguments_too_large_for_float64_raise(name: str, form: Any):
    """A force quadratic in v, 1e200² > 1.8e308; the argument that the user gave is named."""
    robot = rd.load(name)
    q, v, a = general(robot, 10)
    fast = 1e200 * v
    for method in ("coriolis_torque", "coriolis_transpose", "kinetic_energy"):
        with pytest.raises(OverflowedError, match="q, v are so large"):
            getattr(robot, method)(form(q), form(fast))
    with pytest.raises(OverflowedError, match="q, v, a are so large"):
        robot.inverse_dynamics(form(q), form(fast), form(a))
    with pytest.raises(OverflowedError, match="q, v, tau are so large"):
        robot.forward_dynamics(form(q), form(fast), form(a))
    with pytest.raises(OverflowedError, match="q, v are so large"):
        robot.momentum(form(q), form(np.full(robot.n, 1e308)))


def test_overflow_is_seen_where_position_and_velocity_are_orthogonal():
    """C of a slide at 1e200 m on a shaft at 1e200 rad/s overflows although q · v = 0."""
    robot = rd.load("skew_tree")
    with pytest.raises(OverflowedError, match="q, v are so large"):
        robot.C(np.array([0, 0, 1e200, 0, 0]), np.array([1e200, 0, 0, 0, 0]))
    with pytest.raises(OverflowedError, match=r"q (is|are) so large"):
        robot.M(np.array([0, 0, 1e200, 0, 0]))


def test_huge_arguments_with_a_finite_answer_are_answered_without_a_warning():
    """sin(1e200) is a number; pytest turns NumPy's warnings into errors."""
    robot = rd.load("ur5")
    q, v, a = general(robot, 11)
    far = 1e200 * q
    assert_array_equal(robot.M(far), robot.M(far.tolist()))
    assert_array_equal(robot.N(far), robot.N(far.tolist()))
    assert_array_equal(robot.C(far, v), robot.C(far.tolist(), v))
    assert np.isfinite(robot.M(np.full(robot.n, 1.7e308))).all()
    assert np.isfinite(robot.inverse_dynamics(q, v, 1e200 * a)).all()
    assert np.isfinite(robot.forward_dynamics(q, v, 1e200 * a)).all()


@pytest.mark.parametrize("follower", [False, True])
@pytest.mark.parametrize(
    "name", ["kinetic_energy", "coriolis_torque", "coriolis_transpose", "inverse_dynamics", "regressor"]
)
def test_products_of_four_numbers_that_overflow_are_refused(name: str, follower: bool) -> None:
    """A slide at 4e99 m that turns at 5e99 rad/s: m q² v² is 4e398, as an array, as a list and by `errors`."""
    body = BODY.replace("<inertial>", '<inertial><origin xyz="0.1 0.2 0.3"/>')
    limits = '<axis xyz="1 0 0"/><limit lower="-1e120" upper="1e120" effort="1" velocity="1"/>'
    tilts = '<axis xyz="0 1 0"/>'
    joints = [
        joint("turn", "base", "l1", Z, "continuous"),
        joint("tilt", "l1", "l2", tilts, "continuous"),
        joint("slide", "l2", "l3", limits, "prismatic"),
        joint("follow", "l1", "l4", f'{tilts}<mimic joint="tilt" multiplier="-1"/>', "continuous"),
    ][: 4 if follower else 3]
    robot = arm({"base": ""} | {f"l{i + 1}": body for i in range(len(joints))}, *joints)
    q, v = np.array([0.3, 0.7, 4.5e99]), np.array([4e99, 5e99, 3e99])
    given = [q, v, v][: 3 if name in ("inverse_dynamics", "regressor") else 2]
    for state in (given, [x.tolist() for x in given]):
        with pytest.raises(OverflowedError):
            getattr(robot, name)(*state)
        assert np.isnan(getattr(robot, name)(*state, errors="nan")).all()


@pytest.mark.parametrize("name", ["kinetic_energy", "momentum", "jacobian"])
def test_a_wrong_way_with_errors_is_refused_at_one_state_as_well(name: str) -> None:
    robot, state = rd.load("ur5"), np.full(6, 0.3)
    with pytest.raises(rd.RobotDynError, match="errors"):
        getattr(robot, name)(state, "tool0" if name == "jacobian" else state, errors="nonsense")
