"""The layout of a page: the arm stays in view, the scene is light or dark with it, all controls have names and keys."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import opened, until
from tests.long import long


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    arm = rd.load("ur5")
    run = rd.simulate(arm, q0=[0.3, -1.1, 0.9, -0.6, 1.2, 0.4], duration_s=0.3, estimate_error=False)
    return rd.save_replay(run, tmp_path_factory.mktemp("page") / "ur5.html")


def box(view, selector: str) -> tuple[float, float, float, float]:
    """Left, top, right and bottom in the window."""
    where = f"(b => [b.left, b.top, b.right, b.bottom])(document.querySelector({selector!r}).getBoundingClientRect())"
    return tuple(view.ask(where))


@pytest.mark.parametrize("width, height", [(1400, 900), (390, 844), *long([(1920, 1000), (1200, 800), (1199, 800)])])
def test_the_arm_stays_in_view_while_the_plots_scroll(browser, file, width: int, height: int) -> None:
    """From 1200 px on it stands left of them, as high as the window; else it and the slider stick above them."""
    with opened(browser, file, size=(width, height)) as view:
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
        assert view.complaints == []


def test_dark_is_dark_in_the_scene_too_and_at_once(browser, file) -> None:
    """Mean brightness (0 to 255) of the picture's uppermost rows, of its lowest, and of the paper."""
    paper = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number)"
    with opened(browser, file, color_scheme="dark") as view:
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
def test_every_control_has_a_name_and_is_reached_by_the_keyboard(browser, file, width: int) -> None:
    """Tab comes to each that is seen, in the order of the page, and shows where it is."""
    with opened(browser, file, size=(width, 844)) as view:
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


def test_the_panel_of_the_viewer_opens_by_its_button_alone(browser, file) -> None:
    with opened(browser, file) as view:
        assert not view.page.locator(".dg.main").is_visible()
        button = view.page.locator("#panel")
        button.click()
        assert view.page.locator(".dg.main").is_visible() and button.get_attribute("aria-expanded") == "true"
        button.click()
        assert not view.page.locator(".dg.main").is_visible() and button.get_attribute("aria-expanded") == "false"
        until(lambda: view.complaints == [], "complaints", view, 1)
