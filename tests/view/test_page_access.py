"""Pages can be read and used by all: axe-core finds nothing serious, in either scheme, on wide and narrow screens."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import axe_playwright_python
import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.view import Page
from tests.browser import opened, until
from tests.long import long

AXE = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")


def sticking(payload: float = 0.0) -> rd.Trajectory:
    """A planar arm that follows a plan, sticks, meets a stop and has a controller that does not know its payload."""
    arm = rd.load("planar_2r")
    loaded = arm.with_(payload=rd.Payload("tip", payload)) if payload else arm
    law = rd.control.ComputedTorque(arm, rd.control.quintic([0.4, -0.7], [0.9, -0.2], 0.3), kp=60.0, kd=5.0)
    effects = [
        rd.effects.DryFriction([3.0, 2.0], [4.0, 3.0], 0.05),
        rd.effects.RigidStops([-2.0, -2.0], [0.6, 2.0], 0.4),
    ]
    return rd.simulate(
        rd.Plant(loaded, effects), q0=[0.4, -0.7], duration_s=0.8, record_every_s=0.01, controller=law,
        estimate_error=False,
    )  # fmt: skip


@pytest.fixture(scope="module", params=["one", *long(["two", "still"])])
def page(request: pytest.FixtureRequest) -> Page:
    if request.param == "still":
        return rd.show(rd.load("cart_pole"), np.array([0.1, 0.2]))
    run = sticking()
    assert run.events
    return rd.replay(run, *([sticking(0.5)] if request.param == "two" else ()))


def screens() -> Iterator[tuple[int, str]]:
    for width in (1400, 390):
        for scheme in ("light", "dark"):
            yield width, scheme


def test_axe_finds_nothing_serious(browser: Any, page: Page) -> None:
    """With the list of layers open; meshcat's own panel, which a button opens, is not ours."""
    with opened(browser, page, offline=True) as view:
        view.page.locator("#show").click()
        view.page.evaluate(f"{AXE}; 0")
        for width, scheme in screens():
            view.page.set_viewport_size({"width": width, "height": 850})
            view.page.emulate_media(color_scheme=scheme)
            view.page.wait_for_timeout(200)
            violations, passes = view.page.evaluate("axe.run(document).then((x) => [x.violations, x.passes.length])")
            assert not [each for each in violations if each["impact"] in ("serious", "critical")], (width, scheme)
            assert passes > 20  # it has looked


def test_a_page_is_used_by_the_keyboard_alone(browser: Any, page: Page) -> None:
    """Play, steps, camera, layers and the control of each panel, without a complaint, offline."""
    with opened(browser, page, offline=True) as view:
        press, focus = view.page.keyboard.press, lambda name: view.page.locator(name).first.focus()
        focus("#show")
        press("Enter")
        if view.ask("replay.duration") > 0:  # so slowly that a press on a busy machine does not come after the end
            view.page.locator("#speed").select_option("0.1")
        for width, scheme in screens():
            view.page.set_viewport_size({"width": width, "height": 850})
            view.page.emulate_media(color_scheme=scheme)
            if (end := view.ask("replay.duration")) > 0:
                press("Home")
                press("ArrowRight")
                assert 0 < view.ask("replay.time") < end
                press("End")
                assert view.ask("replay.time") == end
                focus("[data-view=top]")  # Space presses a button that has the focus, and plays elsewhere
                press("ArrowLeft")
                assert view.ask("replay.time") < end
                press("Home")  # from where playing does not come to its end before it is seen, on a busy machine
                focus("#time")
                for playing in (True, False):
                    press(" ")  # which the page may take later, on a busy machine
                    until(lambda on=playing: view.ask("replay.playing") == on, f"playing is not {playing}", view)
            before = view.ask("viewer.camera.position.toArray()")
            press("Shift+ArrowLeft")
            assert view.ask("viewer.camera.position.toArray()") != before
            focus("[data-view=front]")
            press("Enter")
            assert view.ask("document.querySelector('[data-view=front]').ariaPressed") == "true"
            view.page.get_by_label("names of joints").focus()
            for names in (2, 0):
                press(" ")
                assert view.page.locator("#names span").count() == names
            for control in (".why .joint", ".u-series th[tabindex]", ".sliders button"):
                if view.page.locator(control).count():
                    focus(control)
                    press("Enter")
