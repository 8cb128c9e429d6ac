"""The time of a page: keys step through the samples, and the address holds it."""

from __future__ import annotations

from html import escape

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import opened, until
from tests.long import long


@pytest.fixture(scope="module")
def swing():
    arm = rd.load("planar_2r")
    return rd.simulate(arm, q0=[0.4, -0.7], duration_s=1.0, record_period_s=0.05, estimate_error=False)


@pytest.fixture(scope="module")
def file(swing, tmp_path_factory):
    return rd.save_replay(swing, tmp_path_factory.mktemp("page") / "swing.html")


@pytest.mark.parametrize("focus", ["body", "#time", *long(["#show", ".u-series th[tabindex]"])])
def test_arrows_step_a_sample_whatever_has_the_focus(browser, file, swing, focus: str) -> None:
    with opened(browser, file) as view:
        view.page.locator(focus).first.focus()
        for key, index in [("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1), ("End", -1), ("ArrowRight", -1),
                           ("ArrowLeft", -2), ("Home", 0), ("ArrowLeft", 0)]:  # fmt: skip
            view.page.keyboard.press(key)
            assert view.ask("replay.time") == swing.t[index], key


def test_the_space_bar_presses_the_button_with_the_focus(browser, file) -> None:
    """And plays where nothing needs it; the choice of a frame keeps its arrows."""
    with opened(browser, file) as view:
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


def test_the_address_sets_the_time_and_is_kept_current(browser, file) -> None:
    with opened(browser, file.absolute().as_uri() + "#t=0.75", offline=True) as view:
        assert view.ask("replay.time") == 0.75
        assert view.page.locator("#now").text_content().startswith("0.750")
        view.ask("(replay.jump(0.3), 0)")
        until(lambda: view.ask("location.hash") == "#t=0.3", "the address is not written", view)
        view.ask("(location.hash = '#t=0.6', 0)")
        until(lambda: view.ask("replay.time") == 0.6, "the address is not read", view)
        view.ask("(location.hash = '#t=soon', 0)")
        view.ask("(location.hash = '#t=99', 0)")
        until(lambda: view.ask("replay.time") == 1.0, "the end is not kept", view)
        assert view.complaints == []


def test_a_frame_without_an_address_shows_the_page(browser, file, tmp_path) -> None:
    """As in a notebook: `srcdoc`, scripts alone, no access to what is around."""
    outer = tmp_path / "outer.html"
    text = escape(file.read_text(encoding="utf-8"))
    outer.write_text(f'<iframe sandbox="allow-scripts" width="800" height="600" srcdoc="{text}"></iframe>', "utf-8")
    context = browser.new_context(offline=True)
    page, complaints = context.new_page(), []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.goto(outer.as_uri())
    frame = page.frames[1]
    frame.wait_for_function("() => window.replay && viewer.animator.actions.length")
    frame.evaluate("() => replay.jump(0.4)")
    page.wait_for_timeout(700)  # longer than until the address is written
    assert frame.evaluate("() => replay.time") == pytest.approx(0.4, abs=np.finfo(float).eps)
    assert complaints == []
    context.close()


FRAMES = "viewer.renderer.info.render.frame"
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))"


def test_no_frame_is_computed_twice(browser, file) -> None:
    """Pictures that are drawn are at most the times that are shown, and a page at rest draws none."""
    with opened(browser, file) as view:
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
