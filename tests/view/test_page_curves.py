"""The plots of a page: curves stand where their numbers are, and all plots share one cursor and one zoom."""

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
    return rd.simulate(arm, q0=[0.4, -0.7], duration_s=1.0, record_period_s=0.002, estimate_error=False)


@pytest.fixture(scope="module")
def file(run, tmp_path_factory):
    return rd.save_replay(run, tmp_path_factory.mktemp("page") / "run.html")


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
def test_a_curve_is_as_fine_as_the_pixels(browser, file, run, scale: int) -> None:
    """The centre of the ink of each column of pixels is the curve's, within 1/4 of a pixel (root mean square 0.1).

    Rounded to whole pixels it would be off by up to a half (root mean square 0.29).
    """
    with opened(browser, file, device_scale_factor=scale) as view:
        t, seen, span, top, height = np.array(view.ask(CENTRES)).T
        true = (top - np.interp(t, run.t, run.q[:, 0])) / span * height
        assert height[0] > 100 * scale
        assert np.ptp(true) > 20 * scale
        assert np.sqrt(np.mean((seen - true) ** 2)) < 0.1
        assert np.abs(seen - true).max() < 0.25


def test_a_zoom_is_of_all_plots_and_ends_by_a_double_click_or_a_key(browser, file) -> None:
    with opened(browser, file, size=(1400, 900)) as view:
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
        assert view.complaints == []


def test_the_cursor_of_a_plot_is_in_all(browser, file, run) -> None:
    """All legends tell the numbers at its time."""
    with opened(browser, file, size=(1400, 900)) as view:
        box = view.page.locator(".u-over").first.bounding_box()
        view.page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 40)
        until(lambda: view.ask("replay.plots.figures.every((each) => each.cursor.idx > 0)"), "no cursor", view)
        told = view.ask(
            "[...document.querySelectorAll('.u-legend')].map((e) => e.querySelector('.u-value').textContent)"
        )
        assert len(set(told)) == 1 and float(told[0].split()[0]) == pytest.approx(0.7, abs=0.004)


def test_a_curve_is_hidden_by_its_name_in_the_legend(browser, file) -> None:
    with opened(browser, file) as view:
        view.page.locator(".u-series th[tabindex]").first.focus()
        for shown in (False, True):
            view.page.keyboard.press("Space")
            assert view.ask("replay.plots.figures[0].series[1].show") is shown
            assert not view.ask("replay.playing")


def test_a_plot_without_a_curve_is_not_drawn_and_says_why(browser, file) -> None:
    """Nothing actuates the arm of this run: u is 0."""
    with opened(browser, file) as view:
        titles = view.ask("[...document.querySelectorAll('.plot h2')].map((each) => each.textContent)")
        assert titles == ["joint positions q", "joint velocities v", "energy ledger"]
        assert view.page.locator(".silent").text_content() == "Not drawn: actuation u (0 throughout)."
