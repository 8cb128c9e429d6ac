"""Scene and layout of a page: the whole arm stays in view, light or dark; layers, names and keys do what they say."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import opened, until
from tests.long import long, third

Q = np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4])


@pytest.fixture(scope="module")
def run():
    return rd.simulate(rd.load("ur5"), q0=Q, duration_s=0.8, record_every_s=0.005, estimate_error=False)


@pytest.fixture(scope="module")
def page(run):
    return rd.replay(run)


@pytest.fixture(scope="module")
def view(browser, page):
    with opened(browser, page, size=(1400, 900)) as opened_view:
        yield opened_view


SEEN = """(() => {
  const low = [9, 9], high = [-9, -9], p = new MeshCat.THREE.Vector3();
  for (let k = 0; k <= 8; k++) {
    replay.seek(k / 8 * replay.duration);
    viewer.scene.updateMatrixWorld(true);
    node('run').traverseVisible((part) => {
      if (!part.isMesh) return;
      const points = part.geometry.attributes.position;
      for (let i = 0; i < points.count; i += 7) {
        p.fromBufferAttribute(points, i).applyMatrix4(part.matrixWorld).project(viewer.camera);
        [p.x, p.y].forEach((x, j) => { low[j] = Math.min(low[j], x); high[j] = Math.max(high[j], x); });
      }
    });
  }
  return [low, high];
})()"""
TOWARDS = {"front": [0, -1, 0], "side": [1, 0, 0], "top": [0, 0, 1]}


@pytest.mark.parametrize("size", [(1400, 900), (390, 844)])
def test_the_whole_run_is_in_view_and_fills_it(browser, page, size) -> None:
    """In parts of the pane, from −1 to 1, at nine times: all of the arm is seen, over more than half of one side."""
    with opened(browser, page, size=size) as view:
        view.page.wait_for_timeout(300)
        for name in ("iso", *TOWARDS):
            view.page.locator(f"[data-view={name}]").click()
            low, high = np.array(view.ask(SEEN))
            assert low.min() > -1 and high.max() < 1, name
            assert (high - low).max() > 1.0, name
            assert view.page.locator("[aria-pressed=true][data-view]").text_content() == name


@pytest.mark.parametrize("name", TOWARDS)
def test_a_button_looks_along_its_axis(view, name: str) -> None:
    """The viewer's y is up: (x, y, z) there are (x, z, −y)."""
    view.page.locator(f"[data-view={name}]").click()
    x, y, z = view.ask("viewer.camera.position.clone().sub(viewer.controls.target).normalize().toArray()")
    np.testing.assert_allclose([x, -z, y], TOWARDS[name], atol=2e-4)


def test_keys_turn_and_move_the_camera(view) -> None:
    """Five degrees a key; the distance of the target stays while it turns."""
    where = "new MeshCat.THREE.Spherical().setFromVector3(viewer.camera.position.clone().sub(viewer.controls.target))"
    state = f"(s => [s.radius, s.phi, s.theta])({where})"
    view.page.locator("[data-view=iso]").click()
    first = np.array(view.ask(state))
    view.page.keyboard.press("Shift+ArrowRight")
    view.page.keyboard.press("Shift+ArrowUp")
    np.testing.assert_allclose(np.array(view.ask(state)) - first, [0, -np.pi / 36, np.pi / 36], atol=1e-9)
    view.page.keyboard.press("n")
    assert view.ask(state)[0] == pytest.approx(0.9 * first[0])
    view.page.keyboard.press("f")
    assert view.ask(state)[0] == pytest.approx(first[0])
    assert view.page.locator("[aria-pressed=true][data-view]").count() == 0


def toggle(view, text: str) -> None:
    if not view.page.locator("#layers").is_visible():
        view.page.locator("#show").click()
    view.page.get_by_label(text).click()


def test_names_stand_where_the_links_are(view, run) -> None:
    """Each at the projection of its frame, or below it where another name stands."""
    toggle(view, "names of links")
    view.ask("(replay.seek(0.8), viewer.render(), 0)")
    names = "[...document.querySelectorAll('#names span')]"
    until(lambda: view.ask(f"{names}.length && {names}.every((each) => each.style.transform)"), "no names", view)
    view.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")
    for link in ("forearm_link", "tool0", "base_link"):
        x, y, z = rd.load("ur5").placement(run.q[-1], link)[:3, 3]
        seen = f"new MeshCat.THREE.Vector3({x}, {z}, {-y}).project(viewer.camera)"
        left, top = view.ask(f"(p => [(p.x + 1) / 2 * stage.clientWidth, (1 - p.y) / 2 * stage.clientHeight])({seen})")
        text = f"{names}.find(e => e.textContent === {link!r})"
        at = view.ask(f"{text}.style.transform.match(/[-\\d.]+/g).map(Number)")
        assert at[0] == pytest.approx(left, abs=1.0)
        assert top - 1 <= at[1] <= top + 15 * 10  # ten links, lines of 15 pixels
    places = view.ask(f"{names}.map(e => e.style.transform)")
    assert len(places) == len(set(places))
    toggle(view, "names of links")
    assert view.page.locator("#names span").count() == 0
    toggle(view, "names of joints")
    assert view.ask(f"{names}.map(e => e.textContent)") == list(run.joint_names)
    toggle(view, "names of joints")


def count(view, condition: str) -> int:
    return view.ask(f"(() => {{ let n = 0; node('run').traverseVisible(o => {{ n += {condition}; }}); return n; }})()")


def test_frames_boxes_and_the_centre_of_mass_are_shown_and_hidden(view) -> None:
    """Every link has a frame; each of the six bodies that move a box."""
    links = len(rd.load("ur5").description.element.findall("link"))
    cases = [
        ("frames of links", "o.type === 'AxesHelper'", 0, links),
        ("boxes of equal", "/^inertia /.test(o.name)", 0, 6),
        ("centre of mass", "o.name === 'centre of mass'", 1, 0),
    ]
    for text, condition, before, after in cases:
        for expected in (before, after, before):
            assert count(view, condition) == expected, text
            toggle(view, text)
        toggle(view, text)


@pytest.mark.parametrize("frame", ["tool0", *long(["forearm_link", ""])])
def test_the_path_is_that_of_the_chosen_frame(view, run, frame: str) -> None:
    """Pinocchio's positions, at every sample, lie on the one line that is shown, as near as the page says."""
    if not view.page.locator("#layers").is_visible():
        view.page.locator("#show").click()
    view.page.get_by_label("path of").select_option(frame)
    paths = "Object.entries(viewer.scene_tree.find(['run', 'paths']).children)"
    shown = view.ask(f"{paths}.filter(([, each]) => each.object.visible).map(([name]) => name)")
    assert shown == ([frame] if frame else [])
    (note,) = (text for text in view.notes() if "path of a frame" in text)
    stated = float(note.partition("accurate to ")[2].split()[0]) * 1e-3
    assert 0 < stated < 2e-3
    line = view.ask(f"[...node('run/paths/{frame or 'tool0'}/<object>').geometry.attributes.position.array]")
    points = np.array(line).reshape(-1, 3)
    a, d = points[:-1], np.diff(points, axis=0)
    for p in rd.load("ur5").placement(run.q, frame or "tool0")[:, :3, 3]:
        part = np.clip(((p - a) * d).sum(axis=1) / (d * d).sum(axis=1), 0, 1)
        assert np.linalg.norm(a + part[:, None] * d - p, axis=1).min() <= 1.1 * stated + 1e-6


def test_the_frame_under_control_is_shown_at_first(browser, run) -> None:
    with opened(browser, rd.replay(run, frame="wrist_1_link")) as view:
        assert view.page.locator("#path").input_value() == "wrist_1_link"
        assert view.ask("node('run/paths/wrist_1_link').visible") and not view.ask("node('run/paths/tool0').visible")


def box(view, selector: str) -> tuple[float, float, float, float]:
    """Left, top, right and bottom in the window."""
    where = f"(b => [b.left, b.top, b.right, b.bottom])(document.querySelector({selector!r}).getBoundingClientRect())"
    return tuple(view.ask(where))


@pytest.mark.parametrize("width, height", [(1400, 900), (390, 844), *third([(1920, 1000), (1200, 800), (1199, 800)])])
def test_the_arm_stays_in_view_while_the_plots_scroll(browser, page, width: int, height: int) -> None:
    """From 1200 px on it stands left of them, as high as the window; else it and the slider stick above them."""
    with opened(browser, page, size=(width, height)) as view:
        view.page.wait_for_timeout(300)
        assert view.ask("document.documentElement.scrollWidth") == width
        view.ask("(scrollTo(0, document.documentElement.scrollHeight), 0)")
        view.page.wait_for_timeout(300)
        assert view.ask("scrollY") > 50
        left, top, right, bottom = box(view, "#scene")
        stage, slider, plots = box(view, "#stage"), box(view, "#time"), box(view, "#plots")
        assert left == 0 and top == pytest.approx(0, abs=0.5) and bottom <= height
        assert -0.5 < stage[1] < stage[3] <= slider[1] < slider[3] <= height
        assert box(view, "#view canvas") == pytest.approx(stage, abs=1)
        if width >= 1200:
            assert bottom == pytest.approx(height, abs=0.5) and right <= plots[0]
        else:
            assert right == width and plots[1] < 0 and bottom < 0.6 * height


def test_dark_is_dark_in_the_scene_too_and_at_once(browser, page) -> None:
    """Mean brightness (0 to 255) of the picture's uppermost rows, of its lowest, and of the paper."""
    paper = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number)"
    with opened(browser, page, color_scheme="dark") as view:
        for scheme in ("dark", "light", "dark"):
            view.page.emulate_media(color_scheme=scheme)
            painted = "viewer.scene_tree.children.Background.object.top_color[0] < 128"
            until(lambda: view.ask(painted) == (scheme == "dark"), f"not {scheme}", view)  # noqa: B023
            picture = view.picture()
            for part in (picture[:5], picture[-40:], np.array(view.ask(paper))):
                assert part.mean() < 110 if scheme == "dark" else part.mean() > 170
            floor = view.ask("node('ground/<object>').material.color.toArray()")
            behind = picture[picture.shape[0] * 3 // 4 :].mean() / 255
            assert (np.mean(floor) > behind) == (scheme == "dark")


CONTROLS = (
    "[...document.querySelectorAll('button, input, select, summary, th[tabindex]')].filter(e => e.checkVisibility())"
)
NAME = "(e) => (e.getAttribute('aria-label') || e.labels?.[0]?.textContent || e.textContent).trim()"


@pytest.mark.parametrize("width", [1400, 390])
def test_every_control_has_a_name_and_is_reached_by_the_keyboard(browser, page, width: int) -> None:
    """Tab comes to each that is seen, in the order of the page, and shows where it is."""
    with opened(browser, page, size=(width, 844)) as view:
        view.page.locator("#show").click()
        names = view.ask(f"{CONTROLS}.map({NAME})")
        assert all(names) and "Play" in names and "front" in names and "centre of mass" in names
        view.ask("(document.activeElement.blur(), scrollTo(0, 0), getSelection().removeAllRanges(), 0)")
        view.ask("(document.body.tabIndex = -1, document.body.focus(), document.body.removeAttribute('tabindex'), 0)")
        reached = []
        for _ in names:
            view.page.keyboard.press("Tab")
            reached.append(view.ask(f"({NAME})(document.activeElement)"))
            style = view.ask("(s => [s.outlineStyle, s.outlineWidth])(getComputedStyle(document.activeElement))")
            assert style == ["solid", "2px"], reached[-1]
        assert reached == names


def test_the_panel_of_the_viewer_opens_by_its_button_alone(browser, page) -> None:
    with opened(browser, page) as view:
        button, panel = view.page.locator("#panel"), view.page.locator(".dg.main")
        assert not panel.is_visible()
        for is_open in (True, False):
            button.click()
            assert panel.is_visible() is is_open and button.get_attribute("aria-expanded") == str(is_open).lower()
