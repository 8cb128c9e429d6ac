"""Differences of two descriptions: 0 for one robot in two files, closed forms for one change, obstacles named."""

from __future__ import annotations

from dataclasses import astuple
from math import cos, pi
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import robot_dyn as rd
from robot_dyn.foundations import QueryError, rotation, rotation_rpy, rpy_of
from robot_dyn.tools.doctor import Basis, Obstacle, RobotDifference
from robot_dyn.tools.doctor.coordinate_map import JointMap, laid_bodies
from tests.command import run

GRAVITY = float(-rd.load("planar_2r").gravity[2])  # [m/s²]
ROUNDED = 1e-9  # [N m]: rewritten angles and axes have the rounding of float64, times the length and weight of an arm


def diff(a: rd.Robot, b: rd.Robot, **options: object) -> RobotDifference:
    return rd.tools.doctor.diff_robots(a, b, samples=50, **options)  # pyright: ignore[reportArgumentType]


def tree(name: str) -> etree._Element:
    return etree.fromstring(rd.load(name).description.text)


def robot(root: etree._Element) -> rd.Robot:
    return rd.Robot.from_text(etree.tostring(root))


def joint(root: etree._Element, name: str) -> etree._Element:
    return root.xpath(f"joint[@name='{name}']")[0]


def rezeroed(root: etree._Element, name: str, sign: int, c: float) -> None:
    """Turn the frame of a joint by c about its axis, and its axis by the sign: then q_new = s (q − c)."""
    element = joint(root, name)
    origin, axis = element.find("origin"), element.find("axis")
    d = np.array(axis.get("xyz").split(), dtype=float)
    R = rotation_rpy(np.array((origin.get("rpy") or "0 0 0").split(), dtype=float)) @ rotation(d / np.linalg.norm(d), c)
    origin.set("rpy", " ".join(map(repr, map(float, rpy_of(R)))))
    axis.set("xyz", " ".join(map(repr, map(float, sign * d))))
    limit = element.find("limit")
    if limit is not None and limit.get("lower"):
        ends = sorted(sign * (float(limit.get(side)) - c) for side in ("lower", "upper"))
        limit.set("lower", repr(ends[0]))
        limit.set("upper", repr(ends[1]))


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova", "skew_tree", "mimic_chain", "cart_pole"])
def test_a_robot_does_not_differ_from_its_file_in_another_order(name: str) -> None:
    root = tree(name)
    shuffled = [*root]
    np.random.default_rng(1).shuffle(shuffled)  # pyright: ignore[reportArgumentType]
    root[:] = shuffled
    difference = diff(rd.load(name), robot(root), tolerance=0.0)
    assert difference.agrees and not difference.differences
    assert {row.difference for row in difference.largest} == {0.0}
    assert all((x.a, x.sign, x.offset) == (x.b, 1, 0.0) for x in difference.joints)


def test_another_order_of_q_is_reported_and_compared_by_name() -> None:
    """Two pendulums on one base: the reader orders the branches by their names."""

    def two(first: str, second: str) -> rd.Robot:
        arms = "".join(
            f'<link name="{name}_l"><inertial><origin xyz="0 0 -{r}"/><mass value="1"/><inertia ixx="0.1" ixy="0"'
            f' ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link><joint name="{name}" type="continuous">'
            f'<parent link="base"/><child link="{name}_l"/><origin xyz="{r} 0 0"/><axis xyz="0 1 0"/></joint>'
            for name, r in ((first, 1.0), (second, 2.0))
        )
        return rd.Robot.from_text(f'<robot name="two"><link name="base"/>{arms}</robot>')

    a, b = two("left", "right"), two("z", "m")
    assert a.joint_names != tuple({"z": "left", "m": "right"}[name] for name in b.joint_names)
    difference = diff(a, b, joints={"left": "z", "right": "m"})
    assert difference.order == (("left", "right"), ("right", "left"))
    assert difference.agrees and not difference.differences


def test_a_changed_mass_costs_its_weight_times_its_lever() -> None:
    """The planar arm stretched out: ΔN = (δ g r1, δ g r2), ΔM = (δ r1², δ r2²) with r = 1.4 m and 0.4 m."""
    arm, delta = rd.load("planar_2r"), 0.3
    difference = rd.tools.doctor.diff_robots(arm, arm.with_(masses={"bar_2": 1.5 + delta}))
    N = [row for row in difference.largest if row.quantity == "N"]
    # the ascent ends where the gradient is 1e-5 of the value
    np.testing.assert_allclose([abs(row.difference) for row in N], [delta * GRAVITY * r for r in (1.4, 0.4)], rtol=1e-6)
    assert abs(cos(N[0].q[0])) == pytest.approx(1.0, abs=1e-3)
    M = next(row for row in difference.largest if row.quantity == "M")
    assert (M.joint, M.column, M.unit) == ("joint_1", "joint_1", "kg m²")
    assert M.difference == pytest.approx(delta * 1.4**2, rel=1e-6) and abs(cos(M.q[1])) == pytest.approx(1.0, abs=1e-3)
    assert [(x.joint, x.quantity, x.a, x.b) for x in difference.differences] == [("joint_2", "mass", (1.5,), (1.8,))]
    worst = difference.worst
    assert worst is not None and not difference.agrees
    (share,) = worst.shares
    assert share.link == "bar_2" and share.value == pytest.approx(worst.difference, rel=1e-9)


def test_every_reported_value_is_that_of_the_two_robots_at_its_posture() -> None:
    """An arm against itself with payload, axes reversed and zeros moved: s_j N_b,j(s q + o); the shares add up."""
    a, root = rd.load("ur5"), tree("ur5")
    for k, name in enumerate(a.joint_names):
        rezeroed(root, name, -1, 0.1 * k)
    b = robot(root).with_(payload=rd.Payload("tool0", 2.0, (0.1, 0.0, 0.05)), armature=0.3)
    difference = diff(a, b, offsets={"wrist_3_joint": 0.5})
    maps = {x.a: x for x in difference.joints}
    s, o = (np.array([getattr(maps[name], x) for name in a.joint_names]) for x in ("sign", "offset"))
    assert s.tolist() == [-1] * 6
    np.testing.assert_allclose(o, 0.1 * np.arange(6), atol=1e-9)  # q_b = −(q_a − c)
    for row in difference.largest:
        q, j = np.array(row.q), a.joint_names.index(row.joint)
        if row.quantity == "N":
            values = a.N(q)[j], s[j] * b.N(s * q + o)[j]
        else:
            k = a.joint_names.index(row.column)
            values = a.M(q)[j, k], s[j] * s[k] * b.M(s * q + o)[j, k]
        np.testing.assert_allclose((row.a, row.b), values, rtol=0, atol=ROUNDED)
        assert sum(share.value for share in row.shares) == pytest.approx(row.difference, abs=ROUNDED)
        assert np.all(q >= a.lower) and np.all(q <= a.upper)
    worst = difference.worst
    assert worst is not None
    assert worst.effort_fraction == abs(worst.difference) / a.effort_limit[a.joint_names.index(worst.joint)]


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova", "skew_tree", "xarm7"])
def test_signs_and_zero_offsets_are_found_from_the_axes(name: str) -> None:
    """All joints but the last of each chain, beyond which no axis depends on o; then N and M do not differ."""
    a, root, rng = rd.load(name), tree(name), np.random.default_rng(5)
    carriers = {stated.child: joint_name for joint_name, stated in a_structure(a).joints.items()}
    inner = {carrier for x in a.joint_names for carrier in moving_above(a, carriers, x)}
    changes = {x: (int(rng.choice([-1, 1])), float(rng.uniform(-1.2, 1.2))) for x in a.joint_names if x in inner}
    for x, (s, c) in changes.items():
        rezeroed(root, x, s, c)
    difference = diff(a, robot(root), tolerance=ROUNDED)
    maps = {x.a: x for x in difference.joints}
    for x, (s, c) in changes.items():
        assert (maps[x].sign, maps[x].basis) == (s, Basis.AXES)
        assert maps[x].offset == pytest.approx(-s * c, abs=1e-9)
    assert difference.agrees


def test_values_given_for_one_joint_change_no_other_joint() -> None:
    """Neither a sign against the axes nor an offset moves the proposals of the other joints."""
    a, root = rd.load("ur5"), tree("ur5")
    for k, x in enumerate(a.joint_names):
        rezeroed(root, x, (-1) ** k, 0.3 * k)
    b = robot(root)
    names = {x: x for x in a.joint_names}

    def maps(**given: dict[str, float]) -> dict[str, JointMap]:
        laid, obstacles = laid_bodies(a, b, names, given.get("signs", {}), given.get("offsets", {}))
        assert not {row.joint for row in obstacles} & {joint for values in given.values() for joint in values}
        return {body.map.a: body.map for body in laid}

    proposed = maps()
    for x, (_, _, s, o, _) in ((x, astuple(proposed[x])) for x in a.joint_names[::2]):
        for given in ({"signs": {x: -s}}, {"signs": {x: s}}, {"offsets": {x: o + 0.4}}):
            s_given, o_given = given.get("signs", {}).get(x, s), given.get("offsets", {}).get(x, o)
            assert maps(**given) == proposed | {x: JointMap(x, x, s_given, o_given, Basis.GIVEN)}


def test_equal_q_is_compared_without_proposals() -> None:
    """The second file turns the shoulder lift the other way: its torques at equal q are those of another posture."""
    a, root = rd.load("ur5"), tree("ur5")
    rezeroed(root, "shoulder_lift_joint", -1, 0.0)
    b = robot(root)
    assert diff(a, b, tolerance=ROUNDED).agrees
    same = diff(a, b, same_q=True)
    assert not same.agrees and not same.unmapped
    assert {(x.sign, x.offset, x.basis) for x in same.joints} == {(1, 0.0, Basis.GIVEN)}
    assert [x.b for x in same.differences if x.joint == "shoulder_lift_joint" and x.unit == "deg"] == [(180.0,)]
    for row in (x for x in same.largest if x.quantity == "N"):
        j = a.joint_names.index(row.joint)
        np.testing.assert_allclose((row.a, row.b), (a.N(row.q)[j], b.N(row.q)[j]), rtol=0, atol=ROUNDED)
    assert diff(a, b, same_q=True, signs={"shoulder_lift_joint": -1}, tolerance=ROUNDED).agrees


def a_structure(a: rd.Robot):
    from robot_dyn.description import structure_of

    return structure_of(a.description, a.edits)


def moving_above(a: rd.Robot, carriers: dict[str, str], name: str) -> list[str]:
    """Return the nearest moving joint above a joint; none at the base."""
    structure = a_structure(a)
    above = [x for x in structure.ancestors(name) if x in structure.moving]
    return above[:1]


def test_a_turned_base_is_an_offset_of_the_first_joint_and_a_raised_base_costs_nothing() -> None:
    a, root = rd.load("ur5"), tree("ur5")
    origin = joint(root, "shoulder_pan_joint").find("origin")
    origin.set("rpy", f"0 0 {pi}")
    x, y, z = map(float, origin.get("xyz").split())
    origin.set("xyz", f"{x} {y} {z + 0.5}")
    difference = diff(a, robot(root), tolerance=ROUNDED)
    assert difference.joints[0].offset == pytest.approx(pi) and difference.agrees
    assert [(x.joint, x.b) for x in difference.differences if "axis" in x.quantity] == [
        ("shoulder_pan_joint", (pytest.approx(0.5),))
    ]


def test_a_moved_axis_is_reported_once_with_its_distance() -> None:
    """The elbow 2 mm lower and turned by 1°: the joints beyond it are compared in its frame."""
    root = tree("ur5")
    origin = joint(root, "elbow_joint").find("origin")
    x, y, z = map(float, origin.get("xyz").split())
    origin.set("xyz", f"{x + 0.002} {y} {z}")
    difference = diff(rd.load("ur5"), robot(root))
    places = [(x.joint, x.quantity, x.b) for x in difference.differences if "axis" in x.quantity]
    assert [(name, b) for name, _, b in places] == [("elbow_joint", (pytest.approx(0.002),))]
    assert not difference.unmapped and difference.worst is not None and difference.worst.difference != 0


def test_a_joint_without_counterpart_is_named_and_no_torque_is_compared() -> None:
    a, root = rd.load("ur5"), tree("ur5")
    joint(root, "elbow_joint").set("name", "knee")
    for mimic in root.iter("transmission"):
        root.remove(mimic)
    b = robot(root)
    difference = diff(a, b)
    named = {(x.file, x.joint, x.obstacle) for x in difference.unmapped}
    assert named == {("a", "elbow_joint", Obstacle.MISSING), ("b", "knee", Obstacle.MISSING)}
    assert not difference.largest and difference.worst is None and not difference.agrees
    assert diff(a, b, joints={"elbow_joint": "knee"}).agrees


def test_values_are_compared_of_mapped_joints_only_and_the_others_are_named() -> None:
    """Beyond a joint without counterpart no value is compared; a changed limit before it is found."""
    a, root = rd.load("ur5"), tree("ur5")
    joint(root, "elbow_joint").set("name", "knee")
    joint(root, "shoulder_pan_joint").find("limit").set("effort", "7")
    for element in root.xpath("transmission"):
        root.remove(element)
    difference = diff(a, robot(root))
    mapped = tuple(x.a for x in difference.joints)
    assert mapped == ("shoulder_pan_joint", "shoulder_lift_joint")
    assert difference.not_compared == (a.joint_names[2:], ("knee", *a.joint_names[3:]))
    assert [(x.joint, x.quantity, x.b) for x in difference.differences] == [
        ("shoulder_pan_joint", "effort limit", (7,))
    ]
    assert diff(a, a).not_compared == ((), ())


@pytest.mark.parametrize("c", [4.0, -4.0, pi, -pi, 3.1415927])
@pytest.mark.parametrize("sign", [1, -1])
def test_whole_turns_of_an_offset_are_chosen_by_the_limits(c: float, sign: int) -> None:
    """Axes show o modulo 2π; only at o = −s c do the shifted limits of b agree with those of a."""
    a, root = rd.load("ur5"), tree("ur5")
    rezeroed(root, "shoulder_lift_joint", sign, c)
    difference = diff(a, robot(root), tolerance=1e-4)
    assert difference.joints[1].offset == pytest.approx(-sign * c, abs=1e-6) and difference.agrees
    assert not [x for x in difference.differences if x.quantity == "position limits"]


def test_the_offset_of_a_joint_without_limits_is_the_smallest() -> None:
    a, root = rd.load("ur5"), tree("ur5")
    rezeroed(root, "shoulder_lift_joint", 1, 4.0)
    joint(root, "shoulder_lift_joint").set("type", "continuous")
    assert diff(a, robot(root)).joints[1].offset == pytest.approx(2 * pi - 4.0, abs=1e-9)


def test_another_ratio_of_a_follower_is_reported() -> None:
    root = tree("mimic_chain")
    mimic = next(root.iter("mimic"))
    name, ratio = mimic.getparent().get("name"), 2 * float(mimic.get("multiplier") or 1)
    mimic.set("multiplier", repr(ratio))
    difference = diff(rd.load("mimic_chain"), robot(root))
    (row,) = (x for x in difference.differences if x.joint == name and "ratio" in x.quantity)
    assert row.b[0] == pytest.approx(2 * row.a[0]) and not difference.unmapped


def changed(kind: str) -> etree._Element:
    root = tree("ur5")
    element = joint(root, "elbow_joint")
    if kind == "type":
        element.set("type", "prismatic")
    elif kind == "axis":
        element.find("axis").set("xyz", "1 0 0")
    else:
        element.find("parent").set("link", "shoulder_link")
    return root


@pytest.mark.parametrize(
    ("kind", "obstacle"), [("type", Obstacle.TYPE), ("axis", Obstacle.AXIS), ("carrier", Obstacle.CARRIER)]
)
def test_a_joint_of_another_type_axis_or_carrier_prevents_the_comparison(kind: str, obstacle: Obstacle) -> None:
    difference = diff(rd.load("ur5"), robot(changed(kind)))
    assert (difference.unmapped[0].joint, difference.unmapped[0].obstacle) == ("elbow_joint", obstacle)
    assert not difference.largest


def test_names_that_differ_in_a_prefix_are_matched() -> None:
    a, root = rd.load("panda"), tree("panda")
    for element in root.iter("joint"):
        element.set("name", f"left_{element.get('name')}")
        for mimic in element.iterfind("mimic"):
            mimic.set("joint", f"left_{mimic.get('joint')}")
    for element in root.xpath("transmission"):
        root.remove(element)
    assert diff(a, robot(root)).agrees


def test_links_that_are_fixed_to_each_other_are_compared_as_one_body() -> None:
    """A payload of the wrist, or a link fixed there: the same robot."""
    a = rd.load("planar_2r").with_(payload=rd.Payload("bar_2", 0.7, (0.8, 0.1, 0.0), np.diag([1e-3, 2e-3, 2.5e-3])))
    root = tree("planar_2r")
    root.append(
        etree.fromstring(
            '<link name="tool"><inertial><mass value="0.7"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0"'
            ' izz="2.5e-3"/></inertial></link>'
        )
    )
    root.append(
        etree.fromstring(
            '<joint name="mount" type="fixed"><parent link="bar_2"/><child link="tool"/><origin xyz="0.8 0.1 0"/>'
            "</joint>"
        )
    )
    difference = diff(a, robot(root), tolerance=ROUNDED)
    assert difference.agrees and not difference.differences


def test_a_urdf_and_the_mjcf_that_mujoco_writes_of_it_agree(tmp_path: Path) -> None:
    """MuJoCo rounds the numbers of its files to 6 digits: 1e-5 of 60 N m."""
    mujoco = pytest.importorskip("mujoco")
    from robot_dyn.accuracy import bare_urdf

    for name in ("ur5", "kinova"):
        arm = rd.load(name)
        model = mujoco.MjModel.from_xml_string(etree.tostring(bare_urdf(arm), encoding="unicode"))
        mujoco.mj_saveLastXML(str(tmp_path / f"{name}.xml"), model)
        difference = diff(arm, rd.load(tmp_path / f"{name}.xml").with_(gravity=arm.gravity), tolerance=2e-3)
        assert difference.agrees and not difference.unmapped


@pytest.mark.parametrize(
    "options",
    [
        {"joints": {"elbow": "elbow_joint"}},
        {"joints": {"elbow_joint": "elbow"}},
        {"joints": {"elbow_joint": "wrist_1_joint", "wrist_1_joint": "wrist_1_joint"}},
        {"joints": ["elbow_joint"]},
        {"signs": {"elbow_joint": 2}},
        {"signs": {"elbow": 1}},
        {"offsets": {"elbow_joint": float("nan")}},
        {"tolerance": -1.0},
    ],
)
def test_arguments_that_are_not_allowed_are_refused(options: dict[str, object]) -> None:
    arm = rd.load("ur5")
    with pytest.raises(QueryError):
        diff(arm, arm, **options)


def test_the_command_exits_with_1_above_the_tolerance(tmp_path: Path) -> None:
    path = rd.load("planar_2r").with_(masses={"bar_2": 1.6}).to_urdf(tmp_path / "other.urdf")

    def code(*arguments: str) -> int:
        return run("diff-robots", *arguments, "--samples", "20").returncode

    assert code("planar_2r", "planar_2r") == 0
    assert code("planar_2r", str(path)) == 1
    assert code("planar_2r", str(path), "--tolerance", "2", "--same-q") == 0  # 0.1 kg · g · 1.4 m = 1.37 N m
