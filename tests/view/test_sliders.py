"""The page of `show` moves an arm as its equations do: placements and gravity torques agree with `Robot`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.view import Page
from robot_dyn.view.stage import Stage
from tests.browser import opened

ARMS = {
    "ur5": {},
    "panda": {},
    "flyball_governor": {},
    "kinova": {},
    "cart_pole": {"gravity": (1.0, -2.0, 7.0), "payload": rd.Payload("pole", 1.5, (0.1, 0.2, 0.3))},
}
STATES = 1000


def shown(name: str) -> tuple[rd.Robot, Page]:
    arm = rd.load(name).with_(**ARMS[name])
    return arm, rd.show(arm)


@pytest.mark.parametrize("name", ARMS)
def test_the_gravity_torque_of_the_page_is_that_of_the_robot(browser: Any, name: str) -> None:
    """To 1e-12 of the largest torque, at 1000 configurations, coupled joints and payloads included."""
    arm, page = shown(name)
    q = np.random.default_rng(5).uniform(-3, 3, (STATES, arm.n))
    with opened(browser, page) as view:
        torque = view.page.evaluate("(q) => q.map((each) => gravityTorque(sliders.arm, each))", q.tolist())
    expected = arm.N(q)
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["ur5", "flyball_governor"])
def test_sliders_place_every_body_where_the_robot_has_it(browser: Any, name: str) -> None:
    arm, page = shown(name)
    stage, q = Stage("run", arm), np.random.default_rng(6).uniform(-1, 1, arm.n)
    at = stage.linkage.at(q).in_base
    with opened(browser, page) as view:
        view.page.evaluate("(q) => sliders.set(q)", q.tolist())
        for index, path in enumerate(stage.paths):
            R, p = at[index]
            placed = view.placement(path)
            np.testing.assert_allclose(placed[:3, :3], R, atol=1e-6)  # three.js keeps quaternions of matrices
            np.testing.assert_allclose(placed[:3, 3], p, atol=1e-6)


def test_arrow_keys_move_a_joint_by_a_hundredth_within_its_ends_and_q_is_copied_as_python(browser: Any) -> None:
    """0.01 rad or m, 0.1 with Shift; what is read aloud is the number with its unit, and 0 has no sign."""
    arm, page = shown("cart_pole")
    with opened(browser, page) as view:
        first, second = (view.page.get_by_label(name, exact=True) for name in arm.joint_names)
        first.focus()
        for key in ("ArrowRight", "Shift+ArrowUp", "ArrowLeft"):
            view.page.keyboard.press(key)
        assert view.ask("sliders.q") == pytest.approx([0.1, 0.0])
        assert first.get_attribute("aria-valuetext") == "0.100 m"
        view.page.evaluate("(q) => sliders.set(q)", [-1e-9, 0.0])
        assert first.get_attribute("aria-valuetext") == "0.000 m"
        view.page.keyboard.press("End")
        view.page.keyboard.press("ArrowRight")
        second.focus()
        view.page.keyboard.press("End")
        moved: dict[str, Any] = {}
        exec(view.page.get_by_label("q as Python").input_value(), moved)
        ends = [float(slider.get_attribute("max") or "nan") for slider in (first, second)]
        assert view.ask("sliders.q") == pytest.approx(ends, rel=1e-11) == moved["q"]
        view.page.get_by_role("button", name="Reset").click()
        assert view.ask("sliders.q") == [0, 0]


def test_a_torque_beyond_the_effort_limit_is_marked(browser: Any) -> None:
    """A UR5 with 30 kg at its tool cannot hold itself stretched out."""
    arm = rd.load("ur5").with_(payload=rd.Payload("tool0", 30.0))
    share = np.abs(arm.N(np.zeros(6))) / arm.effort_limit
    with opened(browser, rd.show(arm)) as view:
        over = view.ask("[...document.querySelectorAll('.slider meter')].map((bar) => bar.classList.contains('over'))")
    assert over == list(share > 1)
    assert any(over) and not all(over)
