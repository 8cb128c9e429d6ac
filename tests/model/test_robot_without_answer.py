"""States without an answer: M is singular, results overflow, or rounding hides a position or a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import OverflowedError, SingularError, midpoint
from tests.hostile.kinds import BODY, POINT, joint
from tests.queries import general
from tests.user_parts import Push

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


ARM = rd.load("ur5")
NEAR = np.array([0.3, -0.2, 0.5, 0.7, -0.4, 0.9])
NARROW = {"Lagrangian": rd.Lagrangian(ARM, np.float32), "machine code": rd.Compiled(ARM, dtype="float32")}
# what cannot be held, by what cannot hold it: the distance to the nearest number is 2⁻¹¹ and more
HIDDEN: dict[str, tuple[Any, Any]] = {
    "float64 in float32": (NARROW["Lagrangian"], NEAR + 1e12),
    "float64 in machine code of float32": (NARROW["machine code"], NEAR + 1e12),
    "longdouble in float64": (rd.Lagrangian(ARM), NEAR.astype(np.longdouble) + np.longdouble(2) ** 56),
    "longdouble in Pinocchio": (ARM, NEAR.astype(np.longdouble) + np.longdouble(2) ** 56),
    "integers in Pinocchio": (ARM, [10**17 + 1] * 6),
    "of a plant": (rd.Plant(NARROW["Lagrangian"]), NEAR + 1e12),
}


@pytest.mark.parametrize("case", HIDDEN)
def test_a_position_that_rounding_hides_is_refused(case: str) -> None:
    """M is a function of the angle; rounded by more than 1e-3 rad it is that of another configuration."""
    dynamics, q = HIDDEN[case]
    with pytest.raises(OverflowedError, match="q of joint 'shoulder_pan_joint' is so large that"):
        dynamics.M(q)


@pytest.mark.parametrize("name", NARROW)
def test_in_a_batch_the_row_that_rounding_hides_has_no_answer(name: str) -> None:
    q = np.tile(NEAR, (20, 1))
    q[7, 2] = 1e12 + 0.3
    answer = NARROW[name].M(q, errors="nan")
    assert np.isnan(answer[7]).all()
    assert np.array_equal(np.delete(answer, 7, axis=0), NARROW[name].M(np.delete(q, 7, axis=0)))
    with pytest.raises(OverflowedError, match="in row 7 of the batch"):
        NARROW[name].M(q)


@pytest.mark.parametrize("name", NARROW)
@pytest.mark.parametrize("far", [8e3, 1e12])
def test_a_float32_is_one_angle_however_large(name: str, far: float) -> None:
    """What float32 holds is not rounded: 64 u of float32 for M, whose terms are of one sign but for a few."""
    q = (NEAR + far).astype(np.float32)
    exact = midpoint(rd.Lagrangian(ARM, rd.accuracy.Ball(200)).M(q))
    for given in (q, q.astype(float)):
        difference = np.abs(NARROW[name].M(given) - exact).max()
        assert difference < 64 * np.finfo(np.float32).eps / 2 * np.abs(exact).max()


@pytest.mark.parametrize("rows", [0, 1, 20])
def test_a_time_that_rounding_hides_is_refused_by_machine_code(rows: int) -> None:
    """float32 tells 1e9 s to 64 s; what it holds, 2^30 s, it takes."""
    plant = rd.Compiled(rd.Plant(ARM, [Push(lambda t, q, v: 0 * v + t)]), dtype="float32")
    q = np.tile(NEAR, (rows, 1) if rows else 1).astype(np.float32)

    def torque(t: float) -> Any:
        return plant.torque(np.full(rows, t) if rows else t, q, 0 * q)

    with pytest.raises(OverflowedError, match="t is so large that float32 does not resolve"):
        torque(1e9 + 0.5)
    assert (torque(2.0**30) == np.float32(2**30)).all()
