"""Plots and time of a page: curves are where their numbers are; plots share cursor and zoom; keys and address step."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import opened, until
from tests.long import long

SPANS = "replay.plots.figures.map((each) => [each.scales.x.min, each.scales.x.max])"


@pytest.fixture(scope="module")
def run():
    arm = rd.load("planar_2r")
    return rd.simulate(arm, q0=[0.4, -0.7], duration_s=1.0, record_every_s=0.002, estimate_error=False)


@pytest.fixture(scope="module")
def page(run):
    return rd.replay(run)


CENTRES = """(() => {
  const u = replay.plots.figures[0];
  u.series.forEach((each, i) => { if (i > 1) u.setSeries(i, { show: false }); });
  u.axes.forEach((axis) => { axis.grid.show = false; axis.show = false; });
  u.redraw(false, true);
  return new Promise((done) => setTimeout(() => {
    const { left, top, width, height } = u.bbox, g = u.ctx.getImageData(left, top, width, height);
    const found = [];
    for (let x = 8; x < width - 8; x++) {
      let mass = 0, moment = 0;
      for (let y = 0; y < height; y++) {
        const ink = g.data[4 * (y * g.width + x) + 3];
        mass += ink;
        moment += ink * (y + 0.5);
      }
      const t = u.scales.x.min + (x + 0.5) / width * (u.scales.x.max - u.scales.x.min);
      found.push([t, moment / mass, u.scales.y.max - u.scales.y.min, u.scales.y.max, height]);
    }
    done(found);
  }, 300));
})()"""


@pytest.mark.parametrize("scale", [1, *long([2])])
def test_a_curve_is_as_fine_as_the_pixels(browser, page, run, scale: int) -> None:
    """The centre of the ink of each column of pixels is the curve's, within 1/4 of a pixel (root mean square 0.1).

    Rounded to whole pixels it would be off by up to a half (root mean square 0.29).
    """
    with opened(browser, page, device_scale_factor=scale) as view:
        t, seen, span, top, height = np.array(view.ask(CENTRES)).T
        true = (top - np.interp(t, run.t, run.q[:, 0])) / span * height
        assert height[0] > 100 * scale
        assert np.ptp(true) > 20 * scale
        assert np.sqrt(np.mean((seen - true) ** 2)) < 0.1
        assert np.abs(seen - true).max() < 0.25


def test_a_zoom_is_of_all_plots_and_ends_by_a_double_click_or_a_key(browser, page) -> None:
    with opened(browser, page, size=(1400, 900)) as view:
        assert view.ask(SPANS) == [[0, 1]] * 3 and not view.page.locator("#whole").is_visible()
        box = view.page.locator(".u-over").first.bounding_box()
        across = [box["x"] + part * box["width"] for part in (0.25, 0.5)]
        for end in ("double click", "key", "button"):
            view.page.mouse.move(across[0], box["y"] + 50)
            view.page.mouse.down()
            view.page.mouse.move(across[1], box["y"] + 60, steps=4)
            view.page.mouse.up()
            until(lambda: view.ask(f"new Set({SPANS}.flat()).size") == 2 and view.ask(SPANS)[0][0] > 0, end, view)
            np.testing.assert_allclose(view.ask(SPANS)[2], [0.25, 0.5], atol=3 / box["width"])
            assert view.page.locator("#whole").is_visible()
            assert view.ask("replay.time") == 0  # a zoom is no click
            match end:
                case "double click":
                    view.page.mouse.dblclick(*(across[0], box["y"] + 50))
                    view.page.keyboard.press("Home")
                case "key":
                    view.page.keyboard.press("0")
                case _:
                    view.page.locator("#whole").click()
            until(lambda: view.ask(SPANS) == [[0, 1]] * 3, end, view)
        view.ask("(replay.jump(0.5), 0)")
        view.page.keyboard.press("+")
        until(lambda: view.ask(SPANS) == [[0.25, 0.75]] * 3, "+", view)
        view.page.keyboard.press("-")
        until(lambda: view.ask(SPANS) == [[0, 1]] * 3, "-", view)


def test_the_cursor_of_a_plot_is_in_all(browser, page, run) -> None:
    """All legends tell the numbers at its time."""
    with opened(browser, page, size=(1400, 900)) as view:
        box = view.page.locator(".u-over").first.bounding_box()
        view.page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 40)
        until(lambda: view.ask("replay.plots.figures.every((each) => each.cursor.idx > 0)"), "no cursor", view)
        told = view.ask(
            "[...document.querySelectorAll('.u-legend')].map((e) => e.querySelector('.u-value').textContent)"
        )
        assert len(set(told)) == 1 and float(told[0].split()[0]) == pytest.approx(0.7, abs=0.004)


def test_a_curve_is_hidden_by_its_name_in_the_legend(browser, page) -> None:
    with opened(browser, page) as view:
        view.page.locator(".u-series th[tabindex]").first.focus()
        for shown in (False, True):
            view.page.keyboard.press("Space")
            assert view.ask("replay.plots.figures[0].series[1].show") is shown
            assert not view.ask("replay.playing")


def test_a_plot_without_a_curve_is_not_drawn_and_says_why(browser, page) -> None:
    """Nothing actuates the arm of this run: u is 0."""
    with opened(browser, page) as view:
        titles = view.ask("[...document.querySelectorAll('.plot h2')].map((each) => each.textContent)")
        assert titles == ["joint positions q", "joint velocities v", "energy ledger"]
        assert view.page.locator(".silent").text_content() == "Not drawn: actuation u (0 throughout)."


@pytest.mark.parametrize("focus", ["body", "#time", *long(["#show", ".u-series th[tabindex]"])])
def test_arrows_step_a_sample_whatever_has_the_focus(browser, page, run, focus: str) -> None:
    with opened(browser, page) as view:
        view.page.locator(focus).first.focus()
        for key, index in [("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1), ("End", -1), ("ArrowRight", -1),
                           ("ArrowLeft", -2), ("Home", 0), ("ArrowLeft", 0)]:  # fmt: skip
            view.page.keyboard.press(key)
            assert view.ask("replay.time") == run.t[index], key


def test_the_space_bar_presses_the_button_with_the_focus(browser, page) -> None:
    """And plays where nothing needs it; the choice of a frame keeps its arrows."""
    with opened(browser, page) as view:
        view.page.locator("#show").focus()
        view.page.keyboard.press("Space")
        assert view.page.locator("#layers").is_visible() and not view.ask("replay.playing")
        view.page.locator("#path").focus()
        before = view.page.locator("#path").input_value()
        view.page.keyboard.press("ArrowUp")
        assert view.page.locator("#path").input_value() != before and view.ask("replay.time") == 0
        view.page.locator("#title").click()
        view.ask("(document.activeElement.blur(), 0)")
        view.page.keyboard.press("Space")
        assert view.ask("replay.playing")


def test_the_address_sets_the_time_and_is_kept_current(browser, page) -> None:
    with opened(browser, page, anchor="#t=0.75", offline=True) as view:
        assert view.ask("replay.time") == 0.75
        assert view.page.locator("#now").text_content().startswith("0.750")
        view.ask("(replay.jump(0.3), 0)")
        until(lambda: view.ask("location.hash") == "#t=0.3", "the address is not written", view)
        view.ask("(location.hash = '#t=0.6', 0)")
        until(lambda: view.ask("replay.time") == 0.6, "the address is not read", view)
        view.ask("(location.hash = '#t=soon', 0)")
        view.ask("(location.hash = '#t=99', 0)")
        until(lambda: view.ask("replay.time") == 1.0, "the end is not kept", view)


FRAMES = "viewer.renderer.info.render.frame"
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))"


def test_no_frame_is_computed_twice(browser, page) -> None:
    """Pictures that are drawn are at most the times that are shown, and a page at rest draws none."""
    with opened(browser, page) as view:
        view.ask(DRAWN)
        view.ask("(window.asked = [], 0)")
        seek = "((at) => (t) => { asked.push(t); return at(t); })(viewer.animator.seek.bind(viewer.animator))"
        view.ask(f"(viewer.animator.seek = {seek}, 0)")
        before = view.ask(FRAMES)
        view.page.locator("#speed").select_option("0.1")
        view.page.locator("#title").click()
        view.page.keyboard.press("Space")
        until(lambda: view.ask("asked.length > 5 || !replay.playing"), "it does not play", view)
        view.ask("(replay.jump(replay.duration), 0)")
        view.ask(DRAWN)
        shown, drawn = view.ask("asked"), view.ask(FRAMES) - before
        assert len(shown) > 2 and len(set(shown)) == len(shown)
        assert 0 < drawn <= len(shown)
        view.ask("(asked.length = 0, replay.seek(replay.time), replay.jump(replay.duration), 0)")
        view.page.keyboard.press("End")
        view.ask(DRAWN)
        assert view.ask("asked") == [] and view.ask(FRAMES) - before == drawn
