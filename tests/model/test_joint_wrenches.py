"""Wrenches through joints and fixed frames: an independent Newton–Euler over the links of a URDF, and closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

import robot_dyn as rd
from robot_dyn.effects import Force
from robot_dyn.foundations import DescriptionError, QueryError
from robot_dyn.foundations.arithmetic import apply
from robot_dyn.model.newton_euler import JointWrenches
from robot_dyn.simulation.results.joint_wrenches import KNOWN_ON_LINKS
from tests.effect_examples import EFFECTS
from tests.user_parts import Push

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
E = rd.effects
ROUNDING = 1e-12  # of the largest force or torque: sums in another order
G = 9.80665
BODY = rd.Payload("tool0", 1.5, (0.03, -0.02, 0.1), ((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.025)))


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def origin(element: Any) -> tuple[np.ndarray, np.ndarray]:
    place = element.find("origin")
    xyz, (x, y, z) = (np.array(place.get(key).split(), float) for key in ("xyz", "rpy"))
    a, b, c = np.eye(3)
    return turn(c, z) @ turn(b, y) @ turn(a, x), xyz


def newton_euler(
    arm: rd.Robot, q: dict[str, float], v: dict[str, float], a: dict[str, float],
    payload: rd.Payload | None = None, scale: float = 1.0,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Σ m (c̈ − g) and its moment of each subtree, in child axes by joint; "" for the root link."""
    file = etree.fromstring(arm.description.xml)
    links = {link.get("name"): link for link in file.iterfind("link")}
    joints = {joint.find("child").get("link"): joint for joint in file.iterfind("joint")}
    motion: dict[str, Any] = {}

    def moved(link: str) -> Any:
        if link in motion:
            return motion[link]
        if link not in joints:
            motion[link] = (np.eye(3), *np.zeros((4, 3)))
            return motion[link]
        joint = joints[link]
        R, p, w, dw, acc = moved(joint.find("parent").get("link"))
        turned, xyz = origin(joint)
        r = R @ xyz
        acc, p, R = acc + np.cross(dw, r) + np.cross(w, np.cross(w, r)), p + r, R @ turned
        if (kind := joint.get("type")) != "fixed":
            name, axis = joint.get("name"), np.array(joint.find("axis").get("xyz").split(), float)
            axis /= np.linalg.norm(axis)
            z = R @ axis
            if kind == "prismatic":
                r = z * q[name]
                acc = acc + np.cross(dw, r) + np.cross(w, np.cross(w, r)) + 2 * np.cross(w, z * v[name]) + z * a[name]
                p = p + r
            else:
                dw, w = dw + np.cross(w, z * v[name]) + z * a[name], w + z * v[name]
                R = R @ turn(axis, q[name])
        motion[link] = R, p, w, dw, acc
        return motion[link]

    def bodies(link: str) -> list[Any]:
        if (inertial := links[link].find("inertial")) is None:
            own = []
        else:
            turned, com = origin(inertial)
            stated = inertial.find("inertia")
            xx, xy, xz, yy, yz, zz = (float(stated.get(f"i{key}")) for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
            moments = turned @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turned.T
            own = [(float(inertial.find("mass").get("value")) * scale, com, moments * scale)]
        if payload is not None and payload.frame == link:
            own.append((payload.mass, np.array(payload.com), np.array(payload.inertia)))
        return own

    total: dict[str, np.ndarray] = {}
    for name in links:
        R, p, w, dw, acc = moved(name)
        for mass, com, moments in bodies(name):
            c, J = R @ com, R @ moments @ R.T
            f = mass * (acc + np.cross(dw, c) + np.cross(w, np.cross(w, c)) - arm.gravity)
            tau = J @ dw + np.cross(w, J @ w)
            above = name
            while True:
                Ra, pa, *_ = moved(above)
                key = joints[above].get("name") if above in joints else ""
                F = np.concatenate([Ra.T @ f, Ra.T @ (tau + np.cross(p + c - pa, f))])
                total[key] = total.get(key, 0.0) + F
                if above not in joints:
                    break
                above = joints[above].find("parent").get("link")
    return total


def full(arm: rd.Robot, x: np.ndarray, *, rates: bool) -> dict[str, float]:
    """Values of all joints that are not fixed, with followers and locked joints."""
    values = arm.couplings.velocity(x) if rates else arm.couplings.position(x)
    locked = dict(arm.edits.lock)
    for mimic in arm.description.element.iterfind("joint/mimic"):
        if (source := mimic.get("joint")) in locked:
            name = mimic.getparent().get("name")
            locked[name] = locked[source] * float(mimic.get("multiplier")) + float(mimic.get("offset"))
    moving = dict(zip(list(arm.model.names)[1:], values.tolist(), strict=True))
    return {name: 0.0 if rates else value for name, value in locked.items()} | moving


@pytest.mark.parametrize(
    ("name", "edits", "options"),
    [
        ("ur5", {"payload": BODY, "armature": 0.3}, {"payload": BODY}),
        ("ur5", {"mass_scale": 1.3, "gravity": (1.0, -2.0, 3.0)}, {"scale": 1.3}),
        ("panda", {"lock": {"panda_joint4": -1.1, "panda_finger_joint1": 0.02}}, {}),
        ("urdf/mimic_chain.urdf", {}, {}),
        ("skew_tree", {}, {}),
    ],
)
def test_wrenches_are_those_of_an_independent_newton_euler(name: str, edits: Any, options: Any) -> None:
    arm = rd.load(name).with_(**edits)
    rng = np.random.default_rng(2)
    q, v, a = rng.normal(size=(3, 4, arm.n))
    found = arm.joint_wrenches(q, v, a)
    for i in range(4):
        positions, speeds, rates = (full(arm, x[i], rates=x is not q) for x in (q, v, a))
        expected = newton_euler(arm, positions, speeds, rates, **options)
        rows = [expected.get(joint, np.zeros(6)) for joint in found.joints]
        size = max(map(np.abs, (*rows, expected[""])), key=np.max).max()
        np.testing.assert_allclose(found.at_joints[i], rows, rtol=0, atol=ROUNDING * size)
        np.testing.assert_allclose(found.at_base[i], expected[""], rtol=0, atol=ROUNDING * size)
        np.testing.assert_array_equal(arm.joint_wrenches(q[i], v[i], a[i]).at_joints, found.at_joints[i])


@pytest.mark.parametrize("name", ["ur5", "panda", "urdf/mimic_chain.urdf", "cart_pole"])
def test_component_on_the_axis_is_inverse_dynamics_without_armature(name: str) -> None:
    """Summed over followers by their ratios, Sᵀ τ, in mimic chains."""
    arm = rd.load(name).with_(armature=0.3)
    q, v, a = np.random.default_rng(3).normal(size=(3, 5, arm.n))
    wrenches = arm.joint_wrenches(q, v, a)
    on_axes = []
    for joint in arm.model.names[1:]:
        element = arm.description.element.find(f"joint[@name='{joint}']")
        axis = np.array(element.find("axis").get("xyz").split(), float)
        part = wrenches[joint][:, :3] if element.get("type") == "prismatic" else wrenches[joint][:, 3:]
        on_axes.append(part @ axis / np.linalg.norm(axis))
    expected = arm.inverse_dynamics(q, v, a) - a * arm.armature
    np.testing.assert_allclose(
        np.array(on_axes).T @ arm.couplings.S, expected, rtol=0, atol=ROUNDING * np.abs(expected).max()
    )


def test_a_welded_tool_weighs_on_its_fixed_joint() -> None:
    """M g up, and r × m g, at rest, for a wrist that points in any direction."""
    tool = """<link name="body"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="sensor"
    type="fixed"><parent link="tool0"/><child link="body"/><origin xyz="0 0 0.05" rpy="0.3 0.1 0"/></joint></robot>"""
    arm = rd.Robot.from_text(rd.load("ur5").description.xml.decode().replace("</robot>", tool))
    q = np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4])
    rest = np.zeros(6)
    wrenches = arm.joint_wrenches(q, rest, rest)
    up = arm.placement(q, "body")[:3, :3].T @ [0, 0, 2 * G]
    expected = np.concatenate([up, np.cross([0, 0, 0.1], up)])
    np.testing.assert_allclose(wrenches["sensor"], expected, rtol=0, atol=ROUNDING * 2 * G)
    np.testing.assert_allclose(wrenches.at_base[:3], [0, 0, arm.total_mass * G], rtol=0, atol=ROUNDING * 200)


def test_frame_and_at_turn_and_move_a_wrench() -> None:
    """f_A = R f, τ_A = R τ + (p − p_A) × R f; external forces are taken from every joint that carries their link."""
    arm = rd.load("ur5")
    q, v, a = np.random.default_rng(4).normal(size=(3, 2, arm.n))
    F = np.array([3.0, -2.0, 1.0, 0.1, 0.2, -0.3])
    free, moved = arm.joint_wrenches(q, v, a), arm.joint_wrenches(q, v, a, frame="base_link", at="elbow_joint")
    held = arm.joint_wrenches(q, v, a, external={"wrist_1_link": F}, frame="base_link", at="wrist_1_link")
    at_wrist = arm.joint_wrenches(q, v, a, frame="base_link", at="wrist_1_link")
    p_at = arm.placement(q, "elbow_joint")[:, :3, 3]
    for joint in free.joints:
        g = arm.placement(q, joint)
        f, tau = (apply(g[:, :3, :3], part) for part in (free[joint][:, :3], free[joint][:, 3:]))
        expected = np.concatenate([f, tau + np.cross(g[:, :3, 3] - p_at, f)], axis=1)
        np.testing.assert_allclose(moved[joint], expected, rtol=0, atol=ROUNDING * 1e3)
    carriers = "world_joint", "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint"
    expected = np.array([F * (joint in carriers) for joint in free.joints])
    pulled = at_wrist.at_joints - held.at_joints
    np.testing.assert_allclose(pulled, np.broadcast_to(expected, pulled.shape), rtol=0, atol=ROUNDING * 1e3)
    np.testing.assert_allclose(at_wrist.at_base - held.at_base, [F, F], rtol=0, atol=ROUNDING * 1e3)


@pytest.mark.parametrize("engine", ["compiled", "interpreted"])
def test_wrenches_of_a_run_balance_its_actuation_and_its_effects(engine: str) -> None:
    """On each axis: u plus the torques of friction and springs; the external wrench counts while it acts.

    1e-9 N m: a run records the wrench of 37 N in base axes, by the right angles of the file, which it rounds to 5e-12.
    """
    arm = rd.load("ur5")
    push = E.ExternalWrench("tool0", [30.0, -20.0, 10.0, 1.0, 2.0, -3.0], start_s=0.05, end_s=0.1, expressed_in="body")
    plant = rd.Plant(arm, [E.ViscousFriction(0.5), push, E.Spring(2.0, 0.1), E.ViscousFriction(0.1)])
    run = rd.simulate(plant, np.full(6, 0.3), np.full(6, 0.2), duration_s=0.2, record_every_s=0.01, engine=engine)
    wrenches = run.joint_wrenches()
    axes = {joint.get("name"): joint.find("axis") for joint in arm.description.element.iterfind("joint")}
    on_axes = [wrenches[name][:, 3:] @ np.array(axes[name].get("xyz").split(), float) for name in arm.joint_names]
    inner = sum(torque for name, torque in (run.effect_torques or {}).items() if name != "external_wrench")
    np.testing.assert_allclose(np.array(on_axes).T, run.u + inner, rtol=0, atol=1e-9)
    assert run.joint_wrenches(frame="base_link", at="tool0")["ee_fixed_joint"].shape == (len(run.t), 6)


def test_impacts_at_stops_are_in_no_sample() -> None:
    """The load side of each joint is u plus the torques of stops and friction, which are finite between impacts."""
    arm = rd.load("planar_2r")
    plant = rd.Plant(arm, [E.RigidStops([-0.5, -0.2], [0.5, 0.5], 0.3), E.ViscousFriction(0.1)])
    run = rd.simulate(plant, [0.4, 0.1], [1.0, -0.6], duration_s=0.4, engine="interpreted", estimate_error=False)
    wrenches = run.joint_wrenches()
    axes = [np.array(joint.get("xyz").split(), float) for joint in arm.description.element.iterfind("joint/axis")]
    on_axes = np.array([wrenches[name][:, 3:] @ axis for name, axis in zip(arm.joint_names, axes, strict=False)]).T
    exerted = sum((run.effect_torques or {}).values(), start=run.u)
    assert any("stop" in event.name for event in run.events)
    np.testing.assert_allclose(on_axes, exerted, rtol=0, atol=1e-11 * np.abs(exerted).max())


def test_every_effect_of_the_library_acts_at_joints_or_on_links() -> None:
    forces = {kind.name for kind in EFFECTS.values() if issubclass(kind, Force)}
    assert forces - KNOWN_ON_LINKS <= {"line_spring_damper"}


def test_effects_with_unknown_forces_on_links_are_refused() -> None:
    arm = rd.load("planar_2r")
    for effect in (Push(lambda t, q, v: 0 * v), E.CarriedPayload(rd.Payload("tip", 1.0))):
        run = rd.simulate(rd.Plant(arm, [effect]), [0.3, 0.2], duration_s=0.02)
        with pytest.raises(QueryError, match=effect.name):
            run.joint_wrenches()


@pytest.mark.parametrize(
    "wrong", [{"frame": "hand"}, {"at": 3}, {"external": {"hand": np.zeros(6)}}, {"external": {"tip": [1.0, 2.0]}},
              {"external": [1.0]}, {"external": {"tip": np.zeros((3, 6))}}, {"q": np.zeros(3)}],
)  # fmt: skip
def test_wrong_arguments_of_wrenches_are_refused(wrong: Any) -> None:
    arm, rest = rd.load("planar_2r"), np.zeros((2, 2))
    with pytest.raises(QueryError):
        arm.joint_wrenches(**({"q": rest, "v": rest, "a": rest} | wrong))
    with pytest.raises(QueryError):
        arm.joint_wrenches(rest, rest, rest)["hand"]


def test_too_many_joints_are_refused() -> None:
    links = "".join(f'<link name="l{i}"/>' for i in range(251))
    joints = "".join(
        f'<joint name="j{i}" type="{"fixed" if i else "continuous"}"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 0 1"/></joint>' for i in range(250)
    )  # fmt: skip
    with pytest.raises(DescriptionError, match="250 joints, fixed ones included"):
        rd.Robot.from_text(f'<robot name="long">{links}{joints}</robot>').joint_wrenches([0.0], [0.0], [0.0])


def test_wrenches_of_no_states_are_empty() -> None:
    none = np.zeros((0, 2))
    wrenches = rd.load("planar_2r").joint_wrenches(none, none, none, at="tip")
    assert isinstance(wrenches, JointWrenches) and wrenches.at_base.shape == (0, 6)
