"""What surrounds an arm on a page: gravity points down on the screen and is named; a robot is shown without a run."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.view import document_of
from robot_dyn.view.scenery import scenery, upright
from tests.browser import opened
from tests.command import run, said
from tests.long import long

G = 9.80665


@pytest.mark.parametrize("seed", range(5))
def test_the_scene_is_turned_so_that_gravity_is_down(seed: int) -> None:
    """R g/‖g‖ = −z, R a rotation, and the least one: its axis is level. Rounding: 1e-14."""
    g = np.random.default_rng(seed).normal(size=3) * 10.0**seed
    R = upright(tuple(g))
    np.testing.assert_allclose(R @ g / np.linalg.norm(g), [0, 0, -1], atol=1e-14)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) > 0
    assert np.trace(R) == pytest.approx(1 - 2 * g[2] / np.linalg.norm(g), abs=1e-13)  # 1 + 2 cos of the angle g, −z


@pytest.mark.parametrize("g", [(0, 0, -G), (0, 0, -1e-9), (0.0, 0.0, 0.0)])
def test_the_base_stands_as_it_is_in_gravity_along_its_axis_and_in_none(g) -> None:
    np.testing.assert_array_equal(upright(g), np.eye(3))


@pytest.mark.parametrize("g", [(0, 0, G), (1e-9, 0, G), (0, -1e-13, 1)])
def test_a_robot_that_hangs_from_a_ceiling_hangs(g) -> None:
    """Up to the one direction in which the least rotation jumps."""
    np.testing.assert_allclose(upright(g) @ g / np.linalg.norm(g), [0, 0, -1], atol=1e-12)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_a_plane_is_seen_from_its_front_whatever_its_size(size: float) -> None:
    """Level and upright planes: at least 40° from their edge; below the camera's own 19° one sees nothing of them."""
    rng = np.random.default_rng(2)
    for normal in np.eye(3):
        points = size * rng.uniform(-1, 1, (100, 3)) * (1 - normal)
        seen = scenery(points)
        assert abs(seen.camera @ normal) > np.sin(np.deg2rad(40))
        assert np.linalg.norm(points - seen.center, axis=1).max() <= seen.radius * (1 + 1e-12)
        assert seen.floor == points[:, 2].min()


def labels(robot: rd.Robot) -> str:
    run = rd.simulate(robot, q0=[0.3, -0.5], duration_s=0.01, estimate_error=False)
    return document_of((run,), (), None, False, "full")["gravity"]


def test_gravity_is_said_and_so_is_its_absence() -> None:
    arm = rd.load("planar_2r")
    assert labels(arm) == "↓ gravity 9.807 m/s²"
    assert labels(arm.with_(gravity=(0, 0, 0))) == "no gravity"
    with pytest.warns(rd.ModelWarning, match="no torque"):
        assert "without torque on any joint" in labels(arm.with_(gravity=(0, 2.0, 0)))


@pytest.mark.parametrize("gravity", [*long([pytest.param((0.0, 0.0, -G))]), (4.0, 1.0, 3.0)])
def test_what_falls_goes_down_on_the_screen(browser, gravity) -> None:
    """The base is turned, and all links with it; the arrow points down, and the camera stands upright."""
    arm = rd.load("planar_2r").with_(gravity=gravity)
    run_ = rd.simulate(arm, q0=[0.3, -0.5], duration_s=0.05, estimate_error=False)
    with opened(browser, rd.replay(run_)) as view:
        view.ask("(replay.seek(0), 0)")
        base, down = view.placement("run"), np.array(gravity) / np.linalg.norm(gravity)
        np.testing.assert_allclose(base[:3, :3] @ down, [0, 0, -1], atol=1e-6)  # single precision
        np.testing.assert_allclose(view.placement("gravity")[:3, 2], [0, 0, -1], atol=1e-6)
        tip = view.placement(view.path("tip"))
        np.testing.assert_allclose(tip, base @ arm.placement(run_.q[0], "tip"), atol=2e-6)
        on_screen = "(z => new MeshCat.THREE.Vector3(0, z, 0).project(viewer.camera).y)"
        assert view.ask(f"{on_screen}(0) > {on_screen}(-0.1)")  # the viewer's y is up
        assert f"gravity {np.linalg.norm(gravity):.4g} m/s²" in view.ask("document.body.innerText")


def test_a_robot_is_shown_without_a_run(browser) -> None:
    """Links stand where Pinocchio puts them; there is no slider of time and no plot; sliders have q."""
    arm, q = rd.load("ur5"), np.linspace(-0.7, 0.9, 6)
    with opened(browser, rd.show(arm, q), offline=True) as view:
        view.stands(arm, q, "forearm_link")
        assert not view.page.locator("#controls").is_visible() and view.page.locator(".plot, .price").count() == 0
        assert view.ask("sliders.q") == pytest.approx(list(q))
    with rd.show(arm).serve() as server, opened(browser, server.url) as view:
        view.ask("(replay.seek(0), 0)")
        view.stands(arm, 0 * q, "forearm_link")


@pytest.mark.parametrize("q", [[0.1], np.zeros((2, 6)), ["a"] * 6, [np.nan] * 6, [1e300] * 6])
def test_what_is_not_one_configuration_is_refused(q, tmp_path) -> None:
    with pytest.raises(rd.RobotDynError, match="q must"):
        rd.show(rd.load("ur5"), q).save(tmp_path / "x.html")
    assert not list(tmp_path.iterdir())


def test_the_command_shows_a_robot(tmp_path) -> None:
    page = tmp_path / "arm.html"
    assert f"written: {page}" in said("show", "planar_2r", "--q", "joint_1=0.4", "--html", page)
    assert page.read_bytes().startswith(b"<!DOCTYPE html>")
    done = run("show", "planar_2r", "--q", "1,2,3", "--html", tmp_path / "b.html")
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "--q needs 2 numbers" in done.stderr


ODD = {  # what a page must survive: sizes, and names in any script
    "tiny": ("1e-6", "r"),
    "huge": ("5e3", "r"),
    "names": ("1", "机器人 «ß» ⅷ &lt;b&gt; ${meshcat} $data"),
}


@pytest.mark.parametrize("case", ["names", *long(["tiny", "huge"])])
def test_odd_robots_are_seen(browser, tmp_path, case: str) -> None:
    """With the robot hidden the picture differs, as it does for an arm of 1 m; nothing is complained of."""
    size, name = ODD[case]
    length = float(size)
    at, moment = f'<origin xyz="{length / 2} 0 0"/>', length**2
    text = f"""<robot name="{name}"><link name="base"/><link name="ärm {name}">
      <inertial>{at}<mass value="1"/>
        <inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/></inertial>
      <visual>{at}<geometry><box size="{size} {length / 9} {length / 9}"/></geometry></visual></link>
      <joint name="j" type="continuous"><parent link="base"/><child link="ärm {name}"/><axis xyz="0 1 0"/></joint>
      </robot>"""
    (tmp_path / "r.urdf").write_text(text, encoding="utf-8")
    with opened(browser, rd.show(rd.load(tmp_path / "r.urdf"), [0.3])) as view:
        shown = view.picture()
        view.ask("(viewer.set_property(['run'], 'visible', false), 0)")
        assert (np.abs(shown - view.picture()).sum(axis=2) > 30).mean() > 0.01
        assert view.page.title() == rd.load(tmp_path / "r.urdf").name
