"""Other frames and fewer numbers: the linkage that is compiled has the M, C and N of the one that the file states."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.codegen import Trace
from robot_dyn.codegen.trace.base_parameters import regrouped
from robot_dyn.codegen.trace.origins import slid
from robot_dyn.lagrange import Linkage, composite_body, magnitudes, newton_euler
from robot_dyn.lagrange.recursions.kinetic_energy import kinetic_energy
from robot_dyn.model import with_exact_right_angles
from robot_dyn.scene import of_scene, parse_scene
from tests.long import third
from tests.random_trees import RandomTree, trees


def assert_same(given: Linkage, made: Linkage, seed: int) -> None:
    """M, M a + C v + N, N and K, to 1e-12 of the terms added into them: some hundred roundings."""
    n = given.couplings.S.shape[1]
    rng = np.random.default_rng(seed)
    q, (v, a) = rng.uniform(-np.pi, np.pi, n), rng.normal(size=(2, n))
    size = magnitudes(given, q)
    assert np.all(np.abs(composite_body(made, q) - composite_body(given, q)) <= 1e-12 * size.M)
    for rates in ((v, a), (v, 0 * a), (0 * v, 0 * a)):
        difference = newton_euler(made, q, *rates) - newton_euler(given, q, *rates)
        assert np.all(np.abs(difference) <= 1e-12 * size.inverse_dynamics(*rates))
    energy = kinetic_energy(made, q, v) - kinetic_energy(given, q, v)
    assert abs(energy) <= 1e-12 * np.abs(v) @ size.M @ np.abs(v)


def assert_unchanged(robot: rd.Robot, seed: int) -> None:
    """With armature as well, which is of the joint and stays there."""
    linkage = rd.Lagrangian(robot.with_(armature={robot.joint_names[-1]: 0.05})).linkage
    for change in (slid, regrouped, lambda linkage: regrouped(slid(linkage))):
        assert_same(linkage, change(linkage), seed)


@pytest.mark.parametrize(
    "name", ["ur5", "panda", "kinova", *third(["cart_pole", "mimic_chain", "skew_tree", "planar_2r"])]
)
def test_the_equations_stay_the_same(name: str) -> None:
    for seed in range(5):
        assert_unchanged(rd.load(name), seed)


@settings(max_examples=40)
@given(trees(), st.integers(0, 2**32 - 1))
def test_of_random_trees_too(tree: RandomTree, seed: int) -> None:
    """Any axis, branches, couplings, up to twelve joints."""
    assert_unchanged(tree.robot, seed)


def test_bodies_that_turn_have_no_mass_left() -> None:
    """Of ten numbers seven are left, or less: m, m c along the axis and one moment across it are exactly 0."""
    linkage = regrouped(slid(Trace(with_exact_right_angles(rd.load("panda"))[0]).lagrangian.linkage))
    for body, inertia in zip(linkage.bodies, linkage.inertias, strict=True):
        if body.revolute:
            axis = int(np.argmax([abs(float(x.constant)) for x in body.axis]))
            zeros = [inertia[0, 0], inertia[3 + (axis + 1) % 3, (axis + 2) % 3]]
            assert all(x == 0 for x in zeros)
            assert any(inertia[3 + k, 3 + k] == 0 for k in range(3) if k != axis)
        else:
            assert all(x == 0 for x in inertia[3:, 3:].flat)


def test_origins_slide_to_where_distances_vanish() -> None:
    """UR5: shoulder offset 0.13585 and elbow offset −0.1197 lie along parallel axes, so both go on to the wrist."""
    linkage = rd.Lagrangian(with_exact_right_angles(rd.load("ur5"))[0]).linkage
    count = [sum(np.count_nonzero(body.pose.p) for body in each.bodies) for each in (linkage, slid(linkage))]
    assert count[1] <= count[0] - 2
    before, after = (each.at(np.zeros(6)).in_base.values() for each in (linkage, slid(linkage)))
    for body, (R, p), (S, r) in zip(linkage.bodies, before, after, strict=True):
        assert np.array_equal(R, S)
        assert np.allclose(np.cross(R @ body.axis, r - p), 0, atol=1e-14)  # moved along the axis, if at all


@pytest.mark.parametrize("name", ["ur5", "kinova", "panda", "skew_tree"])
def test_rounding_does_not_grow(name: str) -> None:
    """Against longdouble, M in units of √M_ii: at most twice the worst of 200 states."""
    lagrangian, exact = rd.Lagrangian(rd.load(name)), rd.Lagrangian(rd.load(name), np.longdouble)
    if np.finfo(np.longdouble).eps > 1e-18:
        pytest.skip("longdouble is float64 here")
    worst = {}
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (200, lagrangian.n))
    truth = exact.M(q)
    d = np.sqrt(np.diagonal(truth, axis1=-2, axis2=-1))
    for what, linkage in (("stated", lagrangian.linkage), ("made", regrouped(slid(lagrangian.linkage)))):
        error = np.array([composite_body(linkage, each) for each in q]) - truth
        worst[what] = np.max(np.abs(error) / (d[:, :, None] * d[:, None, :]))
    assert worst["made"] <= 2 * worst["stated"] + 4 * np.finfo(float).eps


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
    robot, changes = with_exact_right_angles(given)
    before, after = rpy_of(given), rpy_of(robot)
    changed = [k for k, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]]
    assert len(changed) == len(changes) == 5
    assert all("taken as right angles" in str(change) for change in changes)
    for k in changed:
        for x, y in zip(before[k], after[k], strict=True):
            assert y == round(x / (math.pi / 2)) * (math.pi / 2) if x != y else True
            assert abs(x - y) < 1e-9
    assert with_exact_right_angles(robot) == (robot, ())
    q = np.linspace(0.2, 1.1, 6)
    assert not np.array_equal(given.M(q), robot.M(q))
    assert np.allclose(given.M(q), robot.M(q), rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("literal", "right"),
    [("1.570796326", 1), ("1.570796327", 1), ("-1.57079632679", -1), ("3.14159265359", 2), ("4.712388980384", 3)],
)
def test_one_unit_of_the_last_digit_of_a_right_angle_is_it(literal: str, right: int) -> None:
    robot, (change,) = with_exact_right_angles(arm(f"0 {literal} 0.3"))
    assert rpy_of(robot) == [[0.0, right * math.pi / 2, 0.3]]
    assert str(change).startswith(f"joint 'elbow': rpy 0 {literal} 0.3 taken as right angles")


@pytest.mark.parametrize(
    "literal",
    ["1.5718", "1.571796327", "1.5707", "1.57079633", "1.570796329", "1.570796326794897", "0.000000001e0", "0", "1.2"],
)
def test_an_angle_that_is_only_near_is_left_alone(literal: str) -> None:
    """1e-3 off, too few digits, more than one unit off, all digits there, an exponent, no right angle at all."""
    given = arm(f"{literal} 0 0")
    robot, changes = with_exact_right_angles(given)
    assert robot is given
    assert changes == ()


def test_masses_and_translations_are_not_angles() -> None:
    """The same literal as a coordinate of a joint, and in a link's inertial frame, stays."""
    robot, _ = with_exact_right_angles(arm("1.57079632679 0 0"))
    text = robot.description.xml.decode()
    assert text.count('rpy="1.57079632679 0 0"') == 1
    assert 'xyz="1.57079632679 0 0"' in text


def test_right_angles_are_named_wherever_machine_code_runs(tmp_path) -> None:
    """By the summary and the run file of runs in machine code, of the plant or of a model; by no interpreted run."""
    given, q = arm("0 1.57079632679 0.3"), [0.2]
    words = "rpy of elbow taken as exact multiples of π/2 (changed by at most 5e-12 rad)"
    options = {"q0": q, "duration_s": 0.01, "method": "RK4", "estimate_error": False}
    run = rd.simulate(given, **options, engine="compiled")
    assert f"\nright angles, in machine code: {words}\n" in run.summary
    assert rd.read(run.save(tmp_path / "run")).metadata["right_angles"] == words
    runs = rd.rollouts(given, q, duration_s=0.01, method="RK4")
    assert runs.metadata["right_angles"] == words and words in runs[0].summary
    interpreted = rd.simulate(given, **options, engine="interpreted")
    exact = rd.simulate(with_exact_right_angles(given)[0], **options, engine="compiled")
    for other in (interpreted, exact):
        assert "right_angles" not in other.metadata and "right angles" not in other.summary
    law = rd.control.PDGravity(given, rd.control.hold([0.3]), kp=5.0, kd=1.0)
    run = rd.simulate(with_exact_right_angles(given)[0], **options, engine="compiled", controller=law)
    assert run.metadata["right_angles"] == words


def test_explain_names_right_angles(tmp_path) -> None:
    path = tmp_path / "scene.toml"
    (tmp_path / "arm.urdf").write_text(ARM.format(rpy="0 1.57079632679 0.3"))
    path.write_text('robot = "arm.urdf"\nduration_s = 0.1\n')
    assert "  edited there: rpy of elbow taken as exact multiples of π/2" in repr(
        of_scene(parse_scene(path.read_text(), "scene.toml"), rd.read_scene(path))
    )
