"""Loads on bearings: closed forms of a pendulum and of an arm at rest, an independent Newton–Euler, limits, runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
import pytest

import robot_dyn as rd
from robot_dyn.foundations import PlanError, QueryError
from robot_dyn.tools.motors import Motors, budget, read_motors
from robot_dyn.tools.motors.motor_budget.bearing_loads import LOADS, BearingLoads
from tests.command import run as ran
from tests.model.test_joint_wrenches import BODY, full, newton_euler

E = rd.effects
G = 9.80665
ROUNDING = 1e-12  # of the largest load: sums in another order
ROD = rd.load("simple_pendulum")
MASS, ARM = ROD.total_mass, float(np.linalg.norm(ROD.model.inertias[1].lever))
INERTIA = float(ROD.M([0.0])[0, 0])
UR5 = rd.load("ur5")
POSTURE = np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4])


def loads(result: Any, joint: int = 0) -> BearingLoads:
    bearing = result.joints[joint].bearing
    assert bearing is not None
    return bearing


def still(q: np.ndarray) -> rd.control.PiecewisePolynomial:
    return rd.control.PiecewisePolynomial([0.0, 1.0], q[None, None])


def test_a_pendulum_that_turns_steadily_pulls_with_its_weight_and_its_centripetal_force() -> None:
    """Load m g + m l w² at the bottom, at a node or between two: (w Δt)²/8 for the 2e-5 s between them."""
    w, T = 3.0, 0.4
    lowest = float(ROD.placement(np.zeros(1), ROD.frame_names[-1])[2, 3])
    assert lowest <= 0 and abs(ROD.N([0.0])[0]) < ROUNDING  # q = 0 hangs
    for start, allowed in ((-w * T / 2, ROUNDING), (-w * T / 2.137, 1e-9)):
        motion = rd.control.PiecewisePolynomial([0.0, T], [[[start], [w]]])
        bearing = loads(budget(motion, ROD, effort=np.inf, velocity=np.inf))
        assert bearing.radial == pytest.approx(MASS * (G + ARM * w**2), rel=allowed)
        assert bearing.radial_at_s == pytest.approx(-start / w, abs=1e-4)
        assert bearing.axial == pytest.approx(0.0, abs=ROUNDING * MASS * G)


def test_an_arm_at_rest_bears_the_weight_that_each_joint_carries_and_its_moment() -> None:
    """Axial and radial force add up to m g, tilting moment and torsion to m g r; torsion is the torque of gravity."""
    result = budget(still(POSTURE), UR5)
    model, data = UR5.model, UR5.model.createData()
    pin.centerOfMass(model, data, POSTURE)
    pin.computeSubtreeMasses(model, data)
    for i in range(6):
        bearing, origin = loads(result, i), data.oMi[i + 1].translation
        weight = data.mass[i + 1] * G
        reach = float(np.linalg.norm((data.oMi[i + 1].act(data.com[i + 1]) - origin)[:2]))
        assert np.hypot(bearing.axial, bearing.radial) == pytest.approx(weight, rel=ROUNDING)
        assert np.hypot(bearing.tilting, bearing.torsion) == pytest.approx(weight * reach, rel=1e-11)
        assert bearing.torsion == pytest.approx(abs(UR5.N(POSTURE)[i]), abs=ROUNDING * 100)
    assert loads(result).axial == pytest.approx(data.mass[1] * G, rel=ROUNDING)  # the first axis is vertical


@pytest.mark.parametrize(
    ("name", "edits", "options"),
    [
        ("ur5", {"armature": 0.3}, {}),
        ("ur5", {"payload": BODY}, {"payload": BODY}),
        ("ur5", {"gravity": (1.0, -2.0, 3.0)}, {}),
        ("cart_pole", {}, {}),
        ("urdf/mimic_chain.urdf", {}, {}),
    ],
)
def test_loads_of_a_motion_are_those_of_an_independent_newton_euler(name: str, edits: Any, options: Any) -> None:
    """At the time of each load; and none of 20 other times has a larger one."""
    arm = rd.load(name).with_(**edits)
    q = np.random.default_rng(5).uniform(-1, 1, (4, arm.n))
    motion = rd.control.via_points([0.0, 0.4, 0.9, 1.3], q)
    result = budget(motion, arm, effort=np.inf, velocity=np.inf)
    elements = {joint.get("name"): joint for joint in arm.description.element.iterfind("joint")}
    axes = [np.array(elements[joint].find("axis").get("xyz").split(), float) for joint in arm.joint_names]

    def expected(t: float) -> np.ndarray:
        q, v, a = (full(arm, x[0], rates=k > 0) for k, x in enumerate(motion.at(np.array([t]))))
        wrenches = newton_euler(arm, q, v, a, **options)
        rows = []
        for joint, axis in zip(arm.joint_names, axes, strict=True):
            z = axis / np.linalg.norm(axis)
            F = wrenches[joint].reshape(2, 3)
            axial, torsion = np.abs(F @ z)
            radial, tilting = np.linalg.norm(np.cross(F, z), axis=1)
            rows.append([axial, radial, tilting, torsion])
        return np.array(rows)

    largest = np.array([[getattr(loads(result, i), load) for load in LOADS] for i in range(arm.n)])
    size = largest.max()
    for i in range(arm.n):
        for k, load in enumerate(LOADS):
            at = getattr(loads(result, i), f"{load}_at_s")
            # times are rounded to 1e-12 s, in which a load of 200 N changes by 1e-9 N
            assert expected(at)[i, k] == pytest.approx(largest[i, k], rel=ROUNDING, abs=1e-11 * size)
    dense = np.array([expected(t) for t in np.linspace(0.0, 1.3, 20)])
    # refined to 2e-5 of a node spacing of 6e-4 s: a maximum between is missed by less than 1e-8 of it
    assert (dense.max(axis=0) <= largest + 1e-8 * size).all()


def chain(turned: float) -> rd.Robot:
    """Two links on joints about z; the frame of the second joint is turned about its axis."""
    body = """<inertial><origin xyz="0.1 0.05 0.2"/><mass value="2"/>
    <inertia ixx="0.02" iyy="0.025" izz="0.01" ixy="0.001" ixz="0" iyz="0"/></inertial>"""
    limit = '<limit lower="-9" upper="9" effort="99" velocity="9"/>'
    second = f'<origin rpy="0 0 {turned}" xyz="0.3 0 0.1"/>'
    return rd.Robot.from_text(
        f"""<robot name="chain"><link name="base"/><link name="a">{body}</link><link name="b">{body}</link>
        <joint name="one" type="revolute"><parent link="base"/><child link="a"/><origin rpy="0.4 1.1 0" xyz="0 0 0"/>
        <axis xyz="0 0 1"/>{limit}</joint>
        <joint name="two" type="revolute"><parent link="a"/><child link="b"/>{second}
        <axis xyz="0 0 1"/>{limit}</joint></robot>"""
    )


def test_loads_do_not_depend_on_the_angle_of_the_joint_frame_about_its_axis() -> None:
    motion = rd.control.quintic([0.2, -0.3], [1.1, 0.9], 0.7)
    turned = rd.control.quintic([0.2, -1.1], [1.1, 0.1], 0.7)
    one, other = budget(motion, chain(0.0)), budget(turned, chain(0.8))
    for i in range(2):
        for load in LOADS:
            assert getattr(loads(one, i), load) == pytest.approx(getattr(loads(other, i), load), rel=1e-11)


def test_torsion_and_the_force_along_a_slide_are_the_load_side_of_the_drive() -> None:
    """τ without armature and friction; a rotor in the motors changes no load."""
    motion = rd.control.quintic(POSTURE, POSTURE + 0.5, 0.8)
    rotor = Motors(dict.fromkeys(UR5.joint_names, 150.0), {}, {}, dict.fromkeys(UR5.joint_names, 0.3))
    result = budget(motion, rd.Plant(UR5, [E.ViscousFriction(2.0), E.DryFriction(3.0)]), motors=rotor)
    t = result.demand.split.t
    q, v, a = motion.at(t)
    tau = np.abs(UR5.inverse_dynamics(q, v, a)).max(axis=0)
    # the load peaks elsewhere than the motor: between its times by less than (1e-3 s)² τ̈ / 8
    np.testing.assert_allclose([loads(result, i).torsion for i in range(6)], tau, rtol=1e-5)
    cart = rd.load("cart_pole")
    slide = loads(budget(still(np.array([0.1, 0.0])), rd.Plant(cart, [E.Spring(50.0, 0.0)]), effort=9.0, velocity=9.0))
    assert slide.radial == pytest.approx(cart.total_mass * G, rel=0.5)
    assert slide.axial == pytest.approx(0.0, abs=1e-12)  # the spring is between parent and child


def test_an_external_wrench_counts_while_it_acts() -> None:
    """Load m g − F_z on the first, vertical axis, from 0.3 s to 0.45 s."""
    push = E.ExternalWrench("tool0", [0.0, 0.0, -70.0, 0.0, 0.0, 0.0], start_s=0.3, end_s=0.45)
    free, pushed = (loads(budget(still(POSTURE), plant)) for plant in (UR5, rd.Plant(UR5, [push])))
    assert pushed.axial == pytest.approx(free.axial + 70.0, rel=ROUNDING)
    assert 0.3 <= pushed.axial_at_s < 0.45


def test_a_swinging_pendulum_bears_most_at_the_bottom_and_a_coarse_record_is_reported() -> None:
    """Load m g + m l w² with w² = 2 m g l (1 − cos θ) / I; 1e-6 for the steps and the nearest sample."""
    angle = 1.2
    w2 = 2 * MASS * G * ARM * (1 - np.cos(angle)) / INERTIA
    fine = budget(rd.simulate(rd.Plant(ROD), [angle], duration_s=1.0))
    assert loads(fine).radial == pytest.approx(MASS * (G + ARM * w2), rel=1e-5)
    coarse = budget(rd.simulate(rd.Plant(ROD), [angle], duration_s=1.0, record_every_s=0.24))
    assert loads(coarse).radial < 0.98 * loads(fine).radial
    assert len(coarse.findings) > len(fine.findings)


def test_impacts_are_impulses_and_in_no_load() -> None:
    """The force stays below m √((g + l w²)² + (g + l w̄)²), the rod in free motion; the impacts are a finding."""
    run = rd.simulate(rd.Plant(ROD, [E.RigidStops([-0.4], [0.4], 0.9)]), [0.0], [3.0], duration_s=0.6)
    result = budget(run, effort=np.inf, velocity=np.inf)
    struck = sum("strikes" in event.name for event in run.events)
    assert struck >= 2 and sum(f"({struck})" in finding for finding in result.findings) == 1
    w2, swing = float((run.v**2).max()), MASS * G * ARM / INERTIA
    assert loads(result).radial <= MASS * np.hypot(G + ARM * w2, G + ARM * swing)
    assert not any("between samples" in finding for finding in result.findings)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    heads = ",".join(["t [s]", *(f"{name} [rad]" for name in UR5.joint_names)])
    rows = ("0," + ",".join(map(str, POSTURE)), "1," + ",".join(map(str, POSTURE + 0.2)))
    (tmp_path / "plan.csv").write_text("\n".join([heads, *rows]) + "\n")
    (tmp_path / "motors.csv").write_text(
        "joint,at,gear_ratio,peak [N m],bearing axial [N],bearing radial [kN],bearing tilting [Nm]\n"
        "shoulder_pan_joint,motor,100,3,150,,\nshoulder_lift_joint,joint,,300,,0.9,500\n"
    )
    return tmp_path


def test_limits_of_bearings_are_judged(files: Path) -> None:
    """By the largest used fraction; the gear ratio does not multiply them."""
    motors = read_motors(files / "motors.csv")
    assert motors.bearing == {
        "shoulder_pan_joint": {"axial": 150.0}, "shoulder_lift_joint": {"radial": 900.0, "tilting": 500.0}
    }  # fmt: skip
    result = budget(rd.control.from_samples(UR5, files / "plan.csv"), UR5, motors=motors)
    pan, lift, elbow = (loads(result, i) for i in range(3))
    assert pan.used == pytest.approx(pan.axial / 150.0) and pan.used > 1 and elbow.used == 0
    assert lift.used == pytest.approx(max(lift.radial / 900, lift.tilting / 500))
    assert [joint.too_small for joint in result.joints[:2]] == [("bearing",), ()] and not result.fits
    assert result.joints[1].headroom["bearing"] == pytest.approx(1 - lift.used)


def test_the_largest_payload_is_the_mass_that_the_bearing_bears() -> None:
    """A pendulum at rest: radial load (M + m) g."""
    bears = Motors({ROD.joint_names[0]: 1e4}, {}, {}, {}, bearing={ROD.joint_names[0]: {"radial": (MASS + 2.5) * G}})
    most = rd.tools.motors.max_payload(budget(still(np.zeros(1)), ROD, motors=bears), ROD.frame_names[-1])
    assert most.mass == pytest.approx(2.5, rel=1e-8) and (most.limit, most.at_s) == ("radial load", 0.0)


def test_any_payload_fits_where_it_loads_no_limited_bearing() -> None:
    """A mass at rest on the axis of the pendulum has no moment about it."""
    bears = Motors({ROD.joint_names[0]: 1e4}, {}, {}, {}, bearing={ROD.joint_names[0]: {"torsion": 1e4}})
    place = -ROD.placement(np.zeros(1), ROD.frame_names[-1])[:3, 3]
    most = rd.tools.motors.max_payload(budget(still(np.zeros(1)), ROD, motors=bears), ROD.frame_names[-1], place)
    assert most.mass == np.inf and (most.limit, most.joint) == ("", "")


def test_the_command_judges_bearings_and_writes_their_loads(files: Path) -> None:
    done = ran("budget", "ur5", files / "plan.csv", "--limits", files / "motors.csv", "--csv", files / "b.csv")
    assert done.returncode == 1 and "tilting [N m]" in done.stdout
    head, first = (line.split(",") for line in (files / "b.csv").read_text(encoding="utf-8").splitlines()[:2])
    stated = dict(zip(head, first, strict=True))
    plan, motors = rd.control.from_samples(UR5, files / "plan.csv"), read_motors(files / "motors.csv")
    result = budget(plan, UR5, motors=motors)
    assert float(stated["axial"]) == pytest.approx(loads(result).axial, rel=1e-12)


@pytest.mark.long
def test_the_page_of_a_budget_has_the_loads_on_bearings_and_their_limits(files: Path) -> None:
    plan, motors = rd.control.from_samples(UR5, files / "plan.csv"), read_motors(files / "motors.csv")
    budget(plan, UR5, motors=motors).save(files / "b.html")
    text = (files / "b.html").read_text(encoding="utf-8")
    assert "tilting [N m]" in text and "used of bearing" in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("joint,peak [N m],bearing axial [lbf]\na,1,2\n", "bearing_axial \\[N\\]"),
        ("joint,peak [N m],bearing force [N]\na,1,2\n", "bearing force"),
        ("joint,peak [N m],bearing axial [N]\na,1,0\n", "bearing_axial must be a positive number, got 0"),
        ("joint,peak [N m],speed [rad/s],bearing radial [N]\na,2,1,5\na,0,3,6\n", "has another bearing_radial"),
    ],
)
def test_wrong_limits_of_bearings_are_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "motors.csv").write_text(text)
    with pytest.raises(PlanError, match=said):
        read_motors(tmp_path / "motors.csv")


def test_unknown_loads_are_left_out_and_refused_with_limits() -> None:
    arm = rd.load("planar_2r")
    limits = Motors(dict.fromkeys(arm.joint_names, 99.0), {}, {}, {}, bearing={arm.joint_names[0]: {"axial": 5.0}})
    plant = rd.Plant(arm, [E.CarriedPayload(rd.Payload("tip", 1.0), start_s=0.1)])
    run = rd.simulate(plant, [0.3, 0.2], duration_s=0.02)
    motion = rd.control.quintic([0.1, 0.4], [0.5, -0.2], 0.9)
    for args in ((motion, plant), (run,)):
        result = budget(*args, effort=99.0, velocity=99.0)
        assert result.joints[0].bearing is None and any("bearings" in part for part in result.left_out)
        with pytest.raises(QueryError, match="bearing of"):
            budget(*args, motors=limits)
