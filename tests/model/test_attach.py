"""A gripper attached to an arm: the same robot as Pinocchio's appended models, as one file, and with its edits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd
from robot_dyn.foundations import EditError, SceneError

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
XYZ, RPY = (0.1, -0.02, 0.03), (0.3, -0.4, 1.2)
ROUNDING = 1e-13  # of the largest entry: sums in another order
PAIRS = [
    ("ur5", "allegro_right_hand", "tool0"),
    ("panda", "finger_edu", "panda_link8"),
    ("xarm7", "allegro_left_hand", "link7"),
    ("ur10", "planar_2r", "tool0"),
    ("kinova", "skew_tree", "j2s6s200_end_effector"),
]
ARM = """<robot name="rig"><link name="base"/>
<link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>"""
FINGER = """<link name="{0}palm"/>
<link name="{0}finger"><inertial><origin xyz="0.03 0 0.01"/><mass value="0.2"/>
<inertia ixx="0.0001" iyy="0.0002" izz="0.0002" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="{1}finger.stl"/></geometry></visual></link>
<joint name="{0}slide" type="prismatic"><parent link="{0}palm"/><child link="{0}finger"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.1" effort="5" velocity="1"/></joint>"""
JOINT = '<joint name="mount" type="fixed"><parent link="arm"/><child link="g_palm"/><origin xyz="0.4 0 0"/></joint>'


def of_text(text: str, source: str = "rig") -> rd.Robot:
    return rd.Robot.from_text(text, source=source)


@pytest.mark.parametrize(("arm", "gripper", "frame"), PAIRS)
def test_an_arm_with_a_gripper_is_the_model_that_pinocchio_appends(arm: str, gripper: str, frame: str) -> None:
    a, g = rd.load(arm), rd.load(gripper)
    both = a.attach(g, frame=frame, prefix="g_", xyz=XYZ, rpy=RPY)
    tool = g.model.copy()
    for i in range(1, tool.njoints):
        tool.names[i] = f"g_{tool.names[i]}"
    for k, one in enumerate(tool.frames):
        tool.frames[k].name = f"g_{one.name}"
    here = a.model.getFrameId(frame)
    place = pin.SE3(pin.rpy.rpyToMatrix(*RPY), np.array(XYZ))
    model = pin.appendModel(a.model, tool, here, place)
    model.gravity = both.model.gravity
    names = list(model.names)[1:]
    order = [names.index(name) for name in list(both.model.names)[1:]]
    assert both.n == a.n + g.n
    assert set(both.joint_names) == {*a.joint_names, *(f"g_{name}" for name in g.joint_names)}
    rng = np.random.default_rng(5)
    for _ in range(3):
        q = both.random_configuration(rng)
        full = both.couplings.S @ q + both.couplings.s0 if not both.couplings.trivial else q
        theirs = np.empty_like(full)
        theirs[order] = full
        M = pin.crba(model, model.createData(), theirs)[np.ix_(order, order)]
        ours = pin.crba(both.model, both.model.createData(), full)
        np.testing.assert_allclose(ours, M, rtol=0, atol=ROUNDING * np.abs(M).max())
        N = pin.computeGeneralizedGravity(model, model.createData(), theirs)[order]
        np.testing.assert_allclose(
            pin.computeGeneralizedGravity(both.model, both.model.createData(), full), N,
            rtol=0, atol=ROUNDING * np.abs(N).max(),
        )  # fmt: skip
    rng = np.random.default_rng(6)
    q, v, acc = (both.random_configuration(rng) for _ in range(3))
    np.testing.assert_allclose(
        rd.Lagrangian(both).inverse_dynamics(q, v, acc), both.inverse_dynamics(q, v, acc),
        rtol=0, atol=1e-11 * np.abs(both.inverse_dynamics(q, v, acc)).max(),
    )  # fmt: skip


def test_two_texts_are_the_same_robot_as_one_written_by_hand(tmp_path: Path) -> None:
    one = of_text(ARM + FINGER.format("g_", "") + JOINT + "</robot>")
    two = of_text(ARM + "</robot>").attach(
        of_text('<robot name="g">' + FINGER.format("", "") + "</robot>"), frame="arm", prefix="g_", xyz=(0.4, 0, 0)
    )
    again = rd.load(two.to_urdf(tmp_path / "both.urdf"))
    q, v, a = np.array([0.7, 0.02]), np.array([1.0, -0.3]), np.array([0.4, 2.0])
    assert one.joint_names == two.joint_names == again.joint_names
    for robot in (two, again):
        assert np.array_equal(one.inverse_dynamics(q, v, a), robot.inverse_dynamics(q, v, a))
        assert np.array_equal(one.upper, robot.upper)


TOOLS = {
    "one link": """<link name="plate"><inertial><origin xyz="0.01 0.02 0.05" rpy="0.3 0.1 -0.2"/><mass value="0.7"/>
<inertia ixx="0.002" iyy="0.003" izz="0.004" ixy="0.0003" ixz="-0.0002" iyz="0.0001"/></inertial></link>""",
    "fixed links": """<link name="plate"><inertial><origin xyz="0 0 0.01"/><mass value="0.2"/>
<inertia ixx="0.001" iyy="0.001" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="torch"><inertial><origin xyz="0.1 0 0.2"/><mass value="0.5"/>
<inertia ixx="0.004" iyy="0.003" izz="0.002" ixy="0.0001" ixz="0" iyz="0"/></inertial></link><link name="nozzle"/>
<joint name="bolt" type="fixed"><parent link="plate"/><child link="torch"/><origin xyz="0 0.03 0.1" rpy="0.4 0.2 1"/>
</joint><joint name="end" type="fixed"><parent link="torch"/><child link="nozzle"/><origin xyz="0 0 0.3"/></joint>""",
}


@pytest.mark.parametrize("arm", ["ur5", "panda", "xarm7", "kinova", "planar_2r"])
@pytest.mark.parametrize("kind", TOOLS)
def test_a_tool_without_joints_is_that_of_one_file_merged_by_hand(arm: str, kind: str, tmp_path: Path) -> None:
    """M, N and the placements of the tool's frames; in a scene and after `to_urdf` too."""
    bare = rd.load(arm)
    frame = bare.frame_names[-1]
    (tmp_path / "tool.urdf").write_text(f'<robot name="tool">{TOOLS[kind]}</robot>')
    mount = f"""<joint name="mount" type="fixed"><parent link="{frame}"/><child link="plate"/>
<origin xyz="{" ".join(map(str, XYZ))}" rpy="{" ".join(map(str, RPY))}"/></joint></robot>"""
    file = bare.description.text.decode().rpartition("</robot>")[0]
    merged = of_text(file + TOOLS[kind] + mount, bare.description.source)
    both = bare.attach(tmp_path / "tool.urdf", frame=frame, xyz=XYZ, rpy=RPY)
    (tmp_path / "scene.toml").write_text(
        f'robot = "{arm}"\nduration_s = 0.02\n[[attach]]\nrobot = "tool.urdf"\nframe = "{frame}"\n'
        f'xyz_m = {list(XYZ)}\nrpy_rad = {list(RPY)}\n[[effect]]\nkind = "gravity"\n'
    )
    of_scene = rd.read_scene(tmp_path / "scene.toml").plant.dynamics
    q = np.random.default_rng(3).uniform(-1, 1, bare.n)
    for robot in (both, of_scene, rd.load(both.to_urdf(tmp_path / "both.urdf")), rd.Lagrangian(both)):
        np.testing.assert_allclose(robot.M(q), merged.M(q), rtol=0, atol=1e-12 * np.abs(merged.M(q)).max())
        np.testing.assert_allclose(robot.N(q), merged.N(q), rtol=0, atol=1e-12 * max(np.abs(merged.N(q)).max(), 1.0))
        for link in {*merged.frame_names} - {*bare.frame_names}:
            np.testing.assert_allclose(robot.placement(q, link), merged.placement(q, link), rtol=0, atol=1e-12)
    assert both.n == bare.n and both.total_mass == pytest.approx(bare.total_mass + 0.7, rel=1e-14)


def test_a_file_of_a_gripper_is_attached_like_the_robot_that_load_returns(tmp_path: Path) -> None:
    arm, gripper = rd.load("ur5"), rd.load("planar_2r")
    both = arm.attach("planar_2r", frame="tool0", prefix="g_")
    assert both.description.xml == arm.attach(gripper, frame="tool0", prefix="g_").description.xml
    (tmp_path / "bad.urdf").write_text(
        '<robot name="bad"><link name="t"><inertial><mass value="1"/></inertial></link></robot>'
    )
    with pytest.warns(rd.ModelWarning, match="g_t|'t'"):
        arm.attach(tmp_path / "bad.urdf", frame="tool0", prefix="g_")


def test_edits_of_both_robots_are_kept() -> None:
    arm = of_text(ARM + "</robot>").with_(armature=0.1, payload=rd.Payload("arm", 0.5), mass_scale=1.1)
    gripper = of_text('<robot name="g">' + FINGER.format("", "") + "</robot>")
    heavy = gripper.with_(masses={"finger": 0.3}, payload=rd.Payload("finger", 0.1), mass_scale=2.2, armature=0.01)
    both = arm.attach(heavy, frame="arm", prefix="g_")
    assert both.total_mass == pytest.approx(arm.total_mass + heavy.total_mass, rel=1e-15)
    assert both.armature.tolist() == [0.1, 0.01]
    two = rd.load("planar_2r")
    locked = arm.attach(two.with_(lock={two.joint_names[1]: 0.4}), frame="arm", prefix="g_")
    free = arm.attach(two, frame="arm", prefix="g_")
    assert locked.joint_names == free.joint_names[:2]
    assert locked.M([0.3, 0.2]) == pytest.approx(free.M([0.3, 0.2, 0.4])[:2, :2], rel=1e-14)


def test_meshes_of_both_files_are_found(tmp_path: Path) -> None:
    import trimesh

    for folder in ("arms", "hands"):
        (tmp_path / folder).mkdir()
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "hands" / "finger.stl")
    (tmp_path / "arms" / "rig.urdf").write_text(ARM + "</robot>")
    (tmp_path / "hands" / "hand.urdf").write_text('<robot name="g">' + FINGER.format("", "") + "</robot>")
    both = rd.load(tmp_path / "arms" / "rig.urdf").attach(
        rd.load(tmp_path / "hands" / "hand.urdf"), frame="arm", prefix="g_"
    )
    address = both.description.text.decode().partition('filename="')[2].partition('"')[0]
    assert (tmp_path / "arms" / address).resolve() == (tmp_path / "hands" / "finger.stl").resolve()
    assert str(tmp_path) not in both.description.text.decode()


WRONG = {
    "clash": ({"frame": "tool0"}, "ur5", "prefix="),
    "unknown frame": ({"frame": "tool1"}, "planar_2r", "tool0"),
    "own frame": ({"frame": "bar_2"}, "planar_2r", "link of the gripper"),
    "moving base": ({"frame": "tool0", "prefix": "g_"}, "go1", "fixed base"),
    "place": ({"frame": "tool0", "prefix": "g_", "xyz": (0.0, np.nan, 0.0)}, "planar_2r", "xyz"),
    "prefix": ({"frame": "tool0", "prefix": 1}, "planar_2r", "prefix"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_gripper_that_cannot_be_attached_is_refused_with_a_remedy(case: str) -> None:
    options, gripper, remedy = WRONG[case]
    with pytest.raises(EditError, match=remedy):
        rd.load("ur5").attach(rd.load(gripper), **options)


def test_the_joint_of_the_mount_has_a_name_of_no_other_joint() -> None:
    """A tool whose own joint is named like the mount, in a URDF that is read again."""
    tool = '<robot name="t"><link name="w"/><link name="tip">{}</link>{}</robot>'
    joint = '<joint name="w_attachment" type="fixed"><parent link="w"/><child link="tip"/></joint>'
    body = '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    finger = joint.replace("fixed", "prismatic").replace(
        "/></j", '/><limit lower="0" upper="1" effort="9" velocity="9"/></j'
    )
    both = rd.load("ur5").attach(rd.Robot.from_text(tool.format(body, finger)), frame="tool0", prefix="g_")
    assert "g_w_attachment" in both.joint_names
    assert rd.Robot.from_text(both.description.xml).joint_names == both.joint_names


def test_gravity_of_the_gripper_alone_is_refused() -> None:
    arm, gripper = rd.load("ur5"), rd.load("planar_2r")
    with pytest.raises(EditError):
        arm.attach(gripper.with_(gravity=(0, 0, -1.62)), frame="tool0", prefix="g_")
    moon = arm.with_(gravity=(0, 0, -1.62)).attach(gripper, frame="tool0", prefix="g_")
    assert moon.edits.gravity == (0.0, 0.0, -1.62)


def test_a_scene_attaches_like_python(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    table = '[[attach]]\nrobot = "planar_2r"\nframe = "tool0"\nprefix = "g_"\nxyz_m = [0.1, -0.02, 0.03]\n'
    path.write_text(
        f'robot = "ur5"\nduration_s = 0.02\n{table}rpy_rad = [0.3, -0.4, 1.2]\n[[effect]]\nkind = "gravity"\n'
    )
    arm = rd.read_scene(path).plant.dynamics
    theirs = rd.load("ur5").attach(rd.load("planar_2r"), frame="tool0", prefix="g_", xyz=XYZ, rpy=RPY)
    q = np.linspace(-1, 1, 8)
    assert np.array_equal(arm.M(q), theirs.M(q)) and np.array_equal(arm.N(q), theirs.N(q))
    path.write_text(path.read_text().replace("tool0", "tool9"))
    with pytest.raises(SceneError, match="line 3"):
        rd.read_scene(path)
