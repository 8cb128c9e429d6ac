"""The replay page in a real browser: what stands in its scene is what the run, and Pinocchio, say."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
import pytest

import robot_dyn as rd
from robot_dyn.description import structure_of
from robot_dyn.foundations import QueryError
from robot_dyn.queries import format_duration
from robot_dyn.view import document_of
from tests.browser import opened, until
from tests.command import run as command

UR5_Q = np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4])


@pytest.fixture(scope="module")
def fall():
    """UR5 under friction, with a push at its hand for a while and stops that some joints reach."""
    arm = rd.load("ur5")
    push = rd.effects.ExternalWrench("ee_link", [20.0, 0, 10, 0, 2, 0], start_s=0.2, end_s=0.7)
    effects = [rd.effects.ViscousFriction(1.0), push, *rd.effects.joint_stops(arm.lower * 0 - 1.2, arm.upper * 0 + 2.2)]
    return rd.simulate(rd.Plant(arm, effects), q0=UR5_Q, duration_s=1.0, record_every_s=0.005, estimate_error=False)


@pytest.fixture(scope="module")
def view(fall, browser):
    with opened(browser, rd.replay(fall), offline=True) as opened_view:
        yield opened_view


def keyframes(view) -> np.ndarray:
    """Times of the joints' keyframes, as the viewer holds them."""
    clip = "viewer.animator.actions.find(a => a._clip.name == 'run/0 shoulder_pan_joint')._clip"
    return np.array(view.ask(f"[...{clip}.tracks[1].times]"))


def at(run, t: float) -> np.ndarray:
    """The q of a time between samples, on a line."""
    return np.array([np.interp(t, run.t, column) for column in run.q.T])


def test_the_canvas_shows_the_arm(view) -> None:
    """With the robot hidden the picture differs in more than 1 % of its pixels; a blank canvas never does."""
    shown = view.picture()
    view.ask("(viewer.set_property(['run'], 'visible', false), 0)")
    hidden = view.picture()
    view.ask("(viewer.set_property(['run'], 'visible', true), 0)")
    assert (np.abs(shown - hidden).sum(axis=2) > 30).mean() > 0.01


def test_links_stand_where_forward_kinematics_puts_them(view, fall) -> None:
    """Pinocchio's placement of each link; single precision of six quaternions in a chain of 1 m: 1e-6."""
    arm = rd.load("ur5")
    links = arm.description.element.xpath("joint[@type='revolute']/child/@link")
    assert len(links) == 6
    for t in keyframes(view)[[0, 7, -9, -1]]:
        view.ask(f"(replay.seek({t}), 0)")
        view.stands(arm, fall.q[np.abs(fall.t - t).argmin()], *links, within=1e-6)


def test_the_thinning_error_is_as_stated(view, fall) -> None:
    """The page's own number bounds what is seen between keyframes: the last joint's angle at samples."""
    (note,) = (text for text in view.notes() if "keyframes" in text)
    stated = float(note.partition("at most ")[2].split()[0])
    assert stated <= 5.6e-4  # 5e-4, and a tenth of that for lines between the times that are thinned
    arm = rd.load("ur5")
    path, parent = view.path("wrist_3_link"), view.path("wrist_2_link")
    for t, q in zip(fall.t[3::40], fall.q[3::40], strict=True):
        view.ask(f"(replay.seek({t}), 0)")
        seen = np.linalg.inv(view.placement(parent)) @ view.placement(path)
        true = np.linalg.inv(arm.placement(q, "wrist_2_link")) @ arm.placement(q, "wrist_3_link")
        assert np.linalg.norm(pin.log3(seen[:3, :3].T @ true[:3, :3])) <= stated * 1.05 + 1e-6


def test_the_slider_moves_robot_and_plots_together(view, fall) -> None:
    view.page.locator("#time").fill("0.4")
    view.stands(rd.load("ur5"), at(fall, 0.4), "forearm_link", within=2e-3)  # the thinning error
    numbers = "m => [Number(m.dataset.t), parseFloat(m.style.left), m.parentElement.clientWidth]"
    marks = view.ask(f"[...document.querySelectorAll('.mark')].map({numbers})")
    assert len(marks) == 3  # of q, v and the energies; u is 0
    for t, left, width in marks:
        assert t == 0.4
        assert left == pytest.approx(0.4 * width, abs=1.5)  # the axis of a run of 1 s spans the plot
    view.page.locator("#time").fill("0.9")
    view.stands(rd.load("ur5"), at(fall, 0.9), "forearm_link", within=2e-3)
    assert view.ask("document.querySelector('#now').textContent").startswith("0.900")


def test_a_click_on_a_plot_moves_the_robot_there(view) -> None:
    plot = view.page.locator(".u-over").first
    box = plot.bounding_box()
    plot.click(position={"x": 0.25 * box["width"], "y": 20})
    assert view.ask("replay.time") == pytest.approx(0.25, abs=0.01)


def test_play_runs_at_the_chosen_speed_and_stops_at_the_end(view) -> None:
    view.ask("(replay.seek(0.8), 0)")
    view.page.locator("#speed").select_option("5")
    view.page.locator("#play").click()
    until(lambda: not view.ask("replay.playing"), "it plays on", view)
    assert view.ask("replay.time") == 1.0
    view.page.locator("#speed").select_option("0.1")
    view.page.locator("#play").click()  # from the end it starts again
    until(lambda: 0 < view.ask("replay.time") < 0.5, "it does not play", view)
    view.page.locator("#play").click()
    assert not view.ask("replay.playing")


def test_the_mark_keeps_its_time_when_the_window_changes(view) -> None:
    view.ask("(replay.seek(0.5), 0)")
    where = "(m => [parseFloat(m.style.left), m.parentElement.clientWidth])(document.querySelector('.mark'))"
    size = view.page.viewport_size
    for width in (600, 1100):
        view.page.set_viewport_size({"width": width, "height": 700})
        view.page.wait_for_timeout(300)
        left, plot = view.ask(where)
        assert left == pytest.approx(0.5 * plot, abs=1.5)
    view.page.set_viewport_size(size)


def test_the_ball_is_the_centre_of_mass(view, fall) -> None:
    """Of what moves: Pinocchio's, whose model leaves the fixed base out as well; single precision."""
    model, data = rd.load("ur5").model, rd.load("ur5").model.createData()
    view.ask("(replay.seek(0.5), 0)")
    com = pin.centerOfMass(model, data, at(fall, 0.5))
    np.testing.assert_allclose(view.placement("run/centre of mass")[:3, 3], com, atol=1e-3)  # its path is thinned


@pytest.mark.parametrize("t, acts", [(0.1, False), (0.201, True), (0.3, True), (0.699, True), (0.701, False)])
def test_an_arrow_stands_at_the_hand_while_the_wrench_acts(view, fall, t: float, acts: bool) -> None:
    """It points along the force (20, 0, 10) and starts where the force acts."""
    view.ask(f"(replay.seek({t}), 0)")
    assert view.ask("node('run/force on ee_link').visible") is acts
    if acts:
        place = view.placement("run/force on ee_link")
        np.testing.assert_allclose(place[:3, 2] / np.linalg.norm(place[:3, 2]), [2 / 5**0.5, 0, 1 / 5**0.5], atol=1e-5)
        np.testing.assert_allclose(place[:3, 3], rd.load("ur5").placement(at(fall, t), "ee_link")[:3, 3], atol=1e-3)


def test_a_joint_is_red_while_it_bears_on_its_stop(view, fall) -> None:
    assert fall.at_stop.any(axis=0).sum() >= 2  # the scene has something to show
    arm = rd.load("ur5")
    links = {name: joint.child for name, joint in structure_of(arm.description, arm.edits).joints.items()}
    for name, bears in zip(fall.joint_names, fall.at_stop.T, strict=True):
        if not bears.any():
            continue
        for k in (0, int(bears.argmax()), int(bears.argmax()) - 1):
            view.ask(f"(replay.seek({fall.t[k]} + 1e-7), 0)")
            node = f"{view.path(links[name]).rpartition('/')[0]}/at its stop"
            assert view.ask(f"node({node!r}).visible") is bool(bears[k])


def test_a_ghost_is_a_second_arm_that_lets_light_through(browser, fall, tmp_path) -> None:
    """Both stand where their own runs put them; the plots hold both; the meshes stand in the file once."""
    arm = rd.load("ur5")
    other = rd.simulate(
        rd.Plant(arm, [rd.effects.ViscousFriction(5.0)]), q0=UR5_Q, duration_s=0.8, estimate_error=False
    )
    alone = rd.replay(fall).save(tmp_path / "alone.html").stat().st_size
    both = rd.replay(fall, other).save(tmp_path / "both.html")
    assert both.stat().st_size < 1.2 * alone
    with opened(browser, both) as view:
        view.ask("(replay.seek(0.7), 0)")
        for run, root in ((fall, "run"), (other, "ghost 1")):
            view.stands(arm, at(run, 0.7), "forearm_link", within=2e-3, root=root)
        collect = "node({!r}).traverseVisible(o => o.isMesh && all.push(o.material.opacity))"
        clear = "(() => {{ const all = []; " + collect + "; return all; }})()"
        assert max(view.ask(clear.format("ghost 1"))) < 0.5
        assert min(view.ask(clear.format(view.path("forearm_link")))) == 1
        labels = view.ask("[...document.querySelectorAll('.plot')].map(p => p.textContent)")
        name = rd.diff_runs(fall, other).names[1]
        assert all("elbow_joint" in text and f"elbow_joint ({name})" in text for text in labels[:2])


def test_runs_have_the_names_of_the_user_and_the_curves_of_a_joint_follow_each_other() -> None:
    arm = rd.load("planar_2r")
    runs = [
        rd.simulate(arm, [q, 0.1], duration_s=0.05, method="RK4", step_s=0.01, estimate_error=False) for q in (0.2, 0.3)
    ]
    document = document_of((*runs,), (), None, False, names=["before", "after"])
    positions = document["plots"][0]["series"]
    assert [series["label"] for series in positions] == [
        f"{joint} ({name})" for joint in arm.joint_names for name in ("before", "after")
    ]
    assert [series["ghost"] for series in positions] == [False, True] * arm.n
    assert [float(series["values"][0]) for series in positions[:2]] == pytest.approx([0.2, 0.3], rel=1e-6)  # float32
    assert "before / after" in document["title"]
    for wrong in (["before"], ["a", "a"], ["a", " "], "ab", [1, 2]):
        with pytest.raises(QueryError):
            document_of((*runs,), (), None, False, names=wrong)  # pyright: ignore[reportArgumentType]


def test_names_of_a_file_are_text_and_no_code(browser) -> None:
    """Joint and robot names with HTML, slashes and quotes are shown, not run: a script would complain."""
    evil, text = "</script><img src=x onerror=alert(1)>", rd.load("planar_2r").description.text.decode()
    text = text.replace('"joint_1"', json.dumps(evil).replace("<", "&lt;"))
    text = text.replace('robot name="', 'robot name="&lt;/title&gt;&lt;script&gt;alert(2)&lt;/script&gt;')
    arm = rd.Robot.from_text(text)
    run = rd.simulate(arm, q0=np.full(arm.n, 0.3), duration_s=0.2, estimate_error=False)
    with opened(browser, rd.replay(run)) as view:
        view.page.wait_for_timeout(300)
        assert evil in view.ask("document.querySelector('.plot').textContent")
        assert "alert(2)" in view.page.title()


def test_events_are_marked_on_the_plots_and_named_as_they_occur(browser) -> None:
    """A dotted line at each event, where the axis has its time; its name stands in the scene for a while after it."""
    arm = rd.load("planar_2r")
    struck = rd.Plant(arm, rd.effects.joint_stops([-0.2, -1.5], [2.0, 1.5], 2e3, 20.0))
    run = rd.simulate(struck, q0=[0.4, -0.7], duration_s=0.6, estimate_error=False, record_every_s=0.01)
    assert len(run.events) > 1
    first = run.events[0]
    with opened(browser, rd.replay(run)) as view:
        plots = int(view.ask("document.querySelectorAll('.plot').length"))
        assert view.ask("document.querySelectorAll('.event').length") == plots * len(run.events)
        at = float(view.ask("parseFloat(document.querySelector('.event').style.left)"))
        wide = float(view.ask("document.querySelector('.u-over').clientWidth"))
        assert at == pytest.approx(first.t / 0.6 * wide, abs=1.0)
        view.ask(f"(replay.seek({first.t - 1e-3}), 0)")
        assert view.ask("document.getElementById('event').textContent") == ""
        view.ask(f"(replay.seek({first.t + 1e-3}), 0)")
        assert first.name in view.ask("document.getElementById('event').textContent")


def test_the_price_of_a_run_stands_beside_its_plots(browser) -> None:
    """Its numbers are those of the run; that they can be read, axe finds."""
    plant = rd.Plant(rd.load("planar_2r"), [rd.effects.ViscousFriction(0.2)])
    run = rd.simulate(plant, [0.4, -0.7], duration_s=0.3, accuracy=1e-6, engine="interpreted")
    coarse = rd.simulate(plant, [0.4, -0.7], duration_s=0.3, method="RK4", step_s=0.01, estimate_error=False)
    accuracy = run.accuracy
    assert accuracy is not None and run.error is not None
    rows = "[...document.querySelectorAll('.price tr')].map((row) => [...row.cells].map((cell) => cell.textContent))"
    boxes = "[...document.querySelectorAll('#plots > section')].map(x => x.getBoundingClientRect().toJSON())"
    with opened(browser, rd.replay(run, coarse)) as view:
        head, *table = view.ask(rows)
        *others, price = view.ask(boxes)
    told = {line[0]: line[1:] for line in table}
    assert head == ["", "method DOP853, …", "method RK4, …"]
    assert told["method"] == [run.statistics.method, "RK4, step 0.01 s"]
    assert told["steps"] == [str(run.statistics.steps), "30"]
    assert told["evaluations"] == [str(run.statistics.evaluations), "120"]
    assert told["estimated error of q [rad]"] == [str(run.error), "not estimated"]
    assert told["time of the loop"] == [format_duration(each.statistics.wall_s) for each in (run, coarse)]
    assert told["a digit more"][0].startswith(f"about {accuracy.digit_more:.0f} evaluations, ")
    assert told["a digit less"] == [told["a digit less"][0], "–"]
    assert all(
        price["left"] >= other["right"] or other["left"] >= price["right"] or price["top"] >= other["bottom"]
        for other in others
    )


@pytest.fixture(scope="module")
def swing():
    return rd.simulate(rd.load("planar_2r"), q0=[0.4, -0.7], duration_s=0.4, method="RK4", estimate_error=False)


def test_bad_input_is_told_in_one_line(swing, tmp_path) -> None:
    file = swing.save(tmp_path / "run.npz")
    half = tmp_path / "half.npz"
    half.write_bytes(file.read_bytes()[:2000])
    (tmp_path / "x.mp4").write_text("a letter")
    cases = {
        (str(half),): "cannot be read as a run file",
        (str(tmp_path / "none.npz"),): "there is no such file",
        (str(file), "--html", str(tmp_path / "no" / "out.html")): "there is no folder",
        (str(file), "--html", str(tmp_path)): "is a folder",
        (str(file), "--html", str(tmp_path / "a.html"), "--frame", "hnd"): "no link 'hnd'",
        (str(file), "--html", "a.html", "--port", "8000"): "not both",
        (str(file), "--video", "x.gif", "--html", "x.html"): "give only one of --video, --html and --port",
        (str(file), "--video", "x.gif", "--size", "wide"): "--size must be WIDTHxHEIGHT",
        (str(file), "--video", str(tmp_path / "x.mp4"), "--force"): "is not an MP4 video",
    }
    for args, text in cases.items():
        done = command("replay", *args)
        assert done.returncode == 2, args
        assert text in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_runs_that_cannot_be_shown_say_why(swing) -> None:
    arrays = {name: getattr(swing, name)[:0] for name in ("t", "q", "v", "a", "u")}
    for why, changes in (
        ("no samples", arrays),
        ("contains no URDF", {"metadata": {}}),
        ("not those of its URDF", {"joint_names": ("a", "b")}),
        ("edits in the run cannot be read", {"metadata": swing.metadata | {"edits": json.dumps({"gravity": 1})}}),
    ):
        with pytest.raises(rd.RobotDynError, match=why):
            rd.replay(replace(swing, **changes))


def test_a_diverged_run_is_shown_as_far_as_it_is_finite(browser, swing) -> None:
    """The samples beyond are counted on the page."""
    q = swing.q.copy()
    q[300:] = np.nan
    with pytest.warns(rd.ModelWarning, match="the last 101 samples are not shown"):
        page = rd.replay(replace(swing, q=q))
    with opened(browser, page) as view:
        assert "the last 101 samples are not shown" in view.ask("document.querySelector('header').textContent")
        assert view.ask("replay.duration") == pytest.approx(0.299)
