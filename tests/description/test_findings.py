"""Findings: what a file hardly means is named with its place, its value and a remedy, and nothing else is."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import EffectError, SceneError
from tests.chains import body, chain
from tests.description.test_catalog import REFUSED, of_catalog
from tests.hostile.kinds import BODY, LIMIT, MOMENTS, POINT, inside, joint
from tests.hostile.kinds import arm as altered
from tests.snapshots import assert_text

# What of the catalog stands, rolls or flies, by the knowledge of these machines. Upper bodies on a pelvis, hands,
# arms and test stands of one finger do not.
MOBILE = {
    "a1", "alexander", "anymal_b", "anymal_b_kinova", "anymal_c", "b1", "b1_z1", "bolt", "borinot_flying_arm_2",
    "centauro", "g1_29dof_rev_1_0", "g1_29dof_with_hand_rev_1_0", "go1", "go2", "hextilt_flying_arm_5", "human",
    "hyq_no_sensors", "icub", "icub_reduced", "iris", "laikago", "pr2", "quadruped", "romeo", "romeo_laas_small",
    "romeo_small", "simple_humanoid", "simple_humanoid_classical", "solo", "solo12", "talos_full_v2",
    "talos_full_v2_box", "talos_reduced", "talos_reduced_box", "talos_reduced_corrected", "tiago", "tiago_dual",
    "tiago_no_hand", "tiago_pro",
}  # fmt: skip
NO_LIMITS = {"double_pendulum", "double_pendulum_continuous", "double_pendulum_simple", "iris", "romeo"}


def findings(text: str, tmp_path: Path, **changes) -> tuple[str, ...]:
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return rd.load(path).with_(**changes).findings


@pytest.fixture(scope="module")
def catalog() -> dict[str, tuple[str, ...]]:
    """The findings about each robot of the catalog."""
    return {name: of_catalog(name).findings for name in rd.list_robots() if name not in REFUSED}


def holds(catalog: dict[str, tuple[str, ...]], words: str) -> set[str]:
    return {name for name, found in catalog.items() if any(words in each for each in found)}


def test_the_mobile_robots_of_the_catalog_and_no_others_are_told_to_be_welded(catalog) -> None:
    assert holds(catalog, "floating bases are not supported") == MOBILE


def test_limits_of_zero_in_the_catalog(catalog) -> None:
    assert holds(catalog, "the effort limit is 0") == holds(catalog, "the velocity limit is 0") == NO_LIMITS
    assert holds(catalog, "the lower and upper limits are equal") == {"double_pendulum", "double_pendulum_simple"}


def test_impossible_inertias_of_the_catalog_are_found_before_links_are_merged(catalog) -> None:
    """Merged with the links they are fixed to, the sensor mount of the PR2 and the feet of the HyQ look sound."""
    moving = {"allegro_left_hand", "allegro_right_hand", "hyq_no_sensors", "pr2", "romeo_laas_small", "romeo_small"}
    idle = {"anymal_b", "anymal_b_kinova", "anymal_c", "b1", "b1_z1", "go1", "tiago", "tiago_dual", "tiago_no_hand"}
    assert holds(catalog, "correct the inertia of this link") == moving | idle
    assert holds(catalog, "no effect while it is fixed to the world") == idle | {"hyq_no_sensors", "romeo_laas_small"}
    assert sum("'sensor_mount_link'" in each for each in catalog["pr2"]) == 1


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova", "xarm7", "cart_pole", "skew_tree", "light_tip"])
def test_a_sound_arm_has_no_findings(catalog, name: str) -> None:
    assert catalog[name] == ()


@pytest.mark.parametrize(("factor", "found"), [(0.999, False), (1.001, True)])
def test_an_inertia_is_beyond_reach_from_ten_times_the_longest_distance_between_joints(
    tmp_path: Path, factor: float, found: bool
) -> None:
    """½ tr I = factor · m (10 L)², with m = 1.5 kg and L = 0.7 m of the file; the moments are those of a ball."""
    moment = 2 / 3 * factor * 1.5 * (10 * 0.7) ** 2
    text = altered((MOMENTS, f'ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"'))
    told = findings(text, tmp_path)
    assert len(told) == found
    assert not found or "neighbouring joints of this robot are at most 0.7 m apart" in told[0]
    assert findings(text, tmp_path, inertias={"upper": np.eye(3) * 0.01}) == ()


@pytest.mark.parametrize(("factor", "joints", "found"), [(1.999, 3, False), (2.001, 3, True), (5.0, 2, False)])
def test_a_centre_of_mass_is_beyond_reach_from_twice_the_longest_distance_on_arms_of_three_joints(
    tmp_path: Path, factor: float, joints: int, found: bool
) -> None:
    """L = 0.7 m of the file; a pendulum of two joints may have a weight anywhere."""
    hand = f'<link name="hand">{BODY}</link>' + joint("wrist", "fore", "hand") if joints == 3 else ""
    text = inside(hand).replace('<origin xyz="0 0 0.1" rpy', f'<origin xyz="0 0 {0.7 * factor}" rpy')
    told = findings(text, tmp_path)
    assert len(told) == found
    assert not found or told[0].startswith("link 'upper': its centre of mass is 1.4 m from the origin of the link")


@pytest.mark.parametrize(("offset", "warns"), [(0.009, False), (0.011, True)])
def test_the_joints_of_a_gimbal_do_not_tell_its_size(tmp_path: Path, offset: float, warns: bool) -> None:
    """Of 1 kg with ½ tr I = 0.015 kg m² some is 0.12 m away: more than 10 times 11 mm, but nothing of a gimbal."""
    text = chain(*[body(moments=0.01)] * 2, at=("0 0 0", f"0 0 {offset}"), axes=("0 0 1", "0 1 0"))
    assert bool(findings(text, tmp_path)) == warns


WELDED = '<link name="hand"><inertial><mass value="{}"/><inertia {}/></inertial></link>' + joint(
    "wrist", "fore", "hand", kind="fixed"
)
ROUND = 'ixx="0.015" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"'
FLAT = 'ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.01"'


DOUBTFUL = {
    "a flat inertia": inside(WELDED.format(1, FLAT)),
    "a mass of 9e-13 kg": inside(WELDED.format(9e-13, 'ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"')),
    "a joint 10.1 km away": altered(('xyz="0.4 0 0"', 'xyz="6.06e3 8.08e3 0"')),
    "a centre of mass 10.1 km away": altered(('xyz="0 0 0.1"', 'xyz="0 -1.01e4 0"')),
    "a mimic joint of a mimic joint": inside(
        f'<link name="a">{POINT}</link><link name="b">{POINT}</link>'
        + joint("first", "fore", "a", '<origin xyz="1 1 1"/><mimic joint="elbow" multiplier="-101"/>')
        + joint("second", "fore", "b", '<origin xyz="1 1 1"/><mimic joint="first" multiplier="100"/>')
    ),
    "an inertia without a mass": inside(WELDED.format(0, ROUND)),
    "an effort limit of 0": altered((LIMIT, LIMIT.replace('effort="9"', 'effort="0"'))),
    "a velocity limit of 0": altered(('velocity="3"', 'velocity="0"')),
    "limits that are equal": altered((LIMIT, LIMIT.replace('"-1"', '"1"'))),
    "a mass point at the end": inside(f'<link name="tip">{POINT}</link>' + joint("wrist", "fore", "tip")),
}


@pytest.mark.parametrize("case", DOUBTFUL)
def test_each_finding_names_place_value_and_remedy(case: str, tmp_path: Path) -> None:
    (found,) = findings(DOUBTFUL[case], tmp_path)
    assert_text("findings", case, found)


@pytest.mark.parametrize("far", ['xyz="9.9e3 0 0"', 'xyz="-5e3 -5e3 0"'])
def test_what_lies_within_the_bounds_is_no_finding(far: str, tmp_path: Path) -> None:
    light = inside(WELDED.format(2e-12, 'ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"'))
    assert findings(light.replace('xyz="0.4 0 0"', far), tmp_path) == ()


def test_moments_that_rounding_left_behind_are_those_of_a_point(tmp_path: Path) -> None:
    """1e-20 kg m² at 1.5 kg is a radius of gyration of 1e-10 m: a sign there says nothing."""
    rounding = 'ixx="-1e-20" ixy="0" ixz="0" iyy="1e-20" iyz="0" izz="3e-20"'
    assert findings(altered((MOMENTS, rounding)), tmp_path) == ()
    assert "indefinite" in findings(altered((MOMENTS, rounding.replace("e-20", "e-5"))), tmp_path)[0]


def test_moments_without_mass_count_and_are_told_of_links_that_move(tmp_path: Path) -> None:
    """M of the arm grows by Jᵀ I J, J the angular Jacobian of the link; at the base they have no effect."""
    text = inside(WELDED.format(0, ROUND))
    with pytest.warns(ModelWarning, match="'hand': has moments of inertia"):
        robot = rd.Robot.from_text(text)
    q = np.array([0.3, -0.4])
    grown = robot.M(q) - rd.Robot.from_text(inside("")).M(q)
    J = robot.jacobian(q, "hand", expressed_in="body")[3:]
    np.testing.assert_allclose(grown, J.T @ np.diag([0.015, 0.02, 0.01]) @ J, rtol=0, atol=1e-15)  # of M of 1 kg m²
    fixed = WELDED.format(0, ROUND).replace('parent link="fore"', 'parent link="base"')
    assert findings(inside(fixed), tmp_path) == ()


def test_edits_cure_what_they_can(tmp_path: Path) -> None:
    tip = inside(f'<link name="tip">{POINT}</link>' + joint("wrist", "fore", "tip"))
    massless = inside('<link name="tip"/>' + joint("wrist", "fore", "tip"))
    ball = rd.Payload("tip", 0.1, inertia=np.eye(3) * 1e-4)
    for text in (tip, massless):
        assert len(findings(text, tmp_path)) == 1
        for changes in ({"lock": {"wrist": 0.2}}, {"payload": ball}, {"armature": {"wrist": 0.01}}):
            assert findings(text, tmp_path, **changes) == (), changes
    for inertial in (WELDED.format(0, ROUND), WELDED.format(1, FLAT), WELDED.format(9e-13, ROUND)):
        assert len(findings(inside(inertial), tmp_path)) == 1
        stated = {"masses": {"hand": 0.5}, "inertias": {"hand": np.diag([0.015, 0.02, 0.01])}}
        assert findings(inside(inertial), tmp_path, **stated) == ()
    idle = altered((LIMIT, LIMIT.replace('effort="9"', 'effort="0"')))
    assert findings(idle, tmp_path, lock={"shoulder": 0.1}) == ()


LEG = "<link name='{0}'>" + BODY + "</link>"


@pytest.mark.parametrize(
    ("root", "ends", "welded"),
    [
        ("base", ("left_foot", "right_foot"), True),
        ("base", ("UPPER_LEG_L", "UPPER_LEG_R"), True),
        ("base", ("wheel1", "wheel2", "caster"), True),
        ("base", ("rotor_0", "rotor_1"), True),
        ("base_footprint", ("hand",), True),
        ("base", ("one_foot",), False),  # a leg on a test stand
        ("world", ("left_foot", "right_foot"), False),  # the file itself fixes it
        ("palm", ("allegro_finger_1", "allegro_finger_2"), False),
        ("base", ("elegant_hand", "telegripper"), False),
    ],
)
def test_names_of_legs_wheels_and_rotors_on_two_branches_tell_a_mobile_base(
    root: str, ends: tuple[str, ...], welded: bool, tmp_path: Path
) -> None:
    links = "".join(LEG.format(end) for end in ends)
    joints = "".join(joint(f"j{i}", root, end) for i, end in enumerate(ends))
    text = f"<robot name='r'><link name='{root}'/>{links}{joints}</robot>"
    found = findings(text, tmp_path)
    assert [each.split(":")[0] for each in found] == ([f"link '{root}'"] if welded else [])
    assert all("legs, wheels or rotors" in each for each in found)


# --- an effort limit of 0


def no_effort(tmp_path: Path) -> rd.Robot:
    (tmp_path / "arm.urdf").write_text(altered((LIMIT, LIMIT.replace('effort="9"', 'effort="0"'))))
    return rd.load(tmp_path / "arm.urdf")


def test_an_effort_limit_of_zero_is_a_finding_without_a_warning(tmp_path: Path) -> None:
    """M, C, N and runs do not depend on it, and often motors.csv or the user states it: warnings are errors here.

    The finding stays in `info`, `Robot.findings` and the doctor. A velocity limit of 0 next to it warns alone.
    """
    robot = no_effort(tmp_path)
    assert len(robot.findings) == len(rd.info(robot).findings) == 1 and robot.announced_findings == ()
    checkup = rd.tools.doctor.check_urdf(tmp_path / "arm.urdf")
    assert [(x.kind, x.where) for x in checkup.findings if x.kind == "limit_zero"] == [
        ("limit_zero", "joint 'shoulder'")
    ]
    with pytest.warns(ModelWarning) as caught:
        both = rd.Robot.from_text(altered((LIMIT, LIMIT.replace('effort="9" velocity="2"', 'effort="0" velocity="0"'))))
    assert len(caught) == 1 and len(both.findings) == 2 and both.announced_findings == both.findings[1:]
    assert not any(finding in robot.findings for finding in rd.compare(robot, samples=1).notes)


def test_an_effort_limit_of_zero_in_the_file_never_drops_the_arm_in_silence(tmp_path: Path) -> None:
    robot = no_effort(tmp_path)
    with pytest.raises(EffectError, match=r"an effort limit of 0 for 'shoulder', .* give limits by joint"):
        rd.Plant(robot, [rd.effects.EffortLimit("urdf")])
    stated = rd.Plant(robot, [rd.effects.EffortLimit({"shoulder": 5.0, "elbow": 8.0})])
    assert stated.actuation(np.array([7.0, 9.0])).tolist() == [5.0, 8.0]
    meant = rd.Plant(robot, [rd.effects.EffortLimit([0.0, 8.0])])  # a drive that is off, said so by the user
    assert meant.actuation(np.array([7.0, 9.0])).tolist() == [0.0, 8.0]
    held = robot.with_(lock={"shoulder": 0.3})
    assert rd.Plant(held, [rd.effects.EffortLimit("urdf")]).actuation(np.array([9.0])).tolist() == [8.0]


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
@pytest.mark.parametrize("more", ["", 'limit_N_m = "urdf"'])
def test_a_scene_says_so_too(more: str, tmp_path: Path) -> None:
    no_effort(tmp_path)
    scene = f'robot = "arm.urdf"\nduration_s = 1.0\n[[effect]]\nkind = "effort_limit"\n{more}\n'
    (tmp_path / "scene.toml").write_text(scene)
    with pytest.raises(SceneError, match="an effort limit of 0 for 'shoulder'"):
        rd.read_scene(tmp_path / "scene.toml")
