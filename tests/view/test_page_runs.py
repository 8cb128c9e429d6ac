"""What a run knows stands in its plots: desired motion, limits, tracking error; of two runs, what differs."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import opened
from tests.long import long

TITLES = "[...document.querySelectorAll('.plot h2')].map((each) => each.textContent)"


def followed(mass: float) -> rd.Trajectory:
    """A planar arm that follows a quintic, with a payload that its controller does not know."""
    arm = rd.load("planar_2r")
    loaded = arm.with_(payload=rd.Payload("tip", mass)) if mass else arm
    plan = rd.control.quintic([0.4, -0.7], [0.6, -0.4], 0.3)
    law = rd.control.ComputedTorque(arm, plan, kp=100.0, kd=20.0)
    return rd.simulate(loaded, q0=[0.4, -0.7], duration_s=0.4, record_every_s=0.01, controller=law)


@pytest.fixture(scope="module")
def runs():
    return followed(0.0), followed(0.5)


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), *long([(390, "dark")])])
def test_two_runs_show_desired_motion_difference_and_settings(browser, runs, width: int, scheme: str) -> None:
    """The difference that is drawn is that of the samples; the table names the payload alone."""
    a, b = runs
    with opened(browser, rd.replay(a, b), size=(width, 900), color_scheme=scheme) as view:
        titles = view.ask(TITLES)
        assert titles[0] == "joint positions q, desired dotted" and "tracking error q_d − q" in titles
        (number,) = [k for k, each in enumerate(titles) if each.startswith("difference of q, payload on tip 0.5 kg − ")]
        assert "they part at t = 0.01 s" in titles[number]
        drawn = np.array(view.ask(f"replay.plots.figures[{number}].data.map((each) => [...each])"), dtype=float)
        np.testing.assert_allclose(drawn[1:].T, b.q - a.q, atol=1e-6)  # single precision
        desired = view.ask("[...replay.plots.figures[0].data[3]]")  # t, q of both runs, q_d
        assert a.desired is not None
        np.testing.assert_allclose(desired, a.desired[:, 0], atol=1e-6)
        rows = "[...document.querySelectorAll('.differs')].map((e) => [...e.rows ?? e.querySelectorAll('tr')]"
        (table, *_) = view.ask(f"{rows}.map((row) => [...row.cells].map((cell) => cell.textContent)))")
        assert table[1:] == [["payload on tip", "—", "0.5 kg"]]
        assert view.ask("document.documentElement.scrollWidth") <= width


def test_a_desired_curve_is_hidden_with_that_of_its_joint(browser, runs) -> None:
    with opened(browser, rd.replay(runs[0])) as view:
        shown = "replay.plots.figures[0].series.map((each) => each.show)"
        view.page.locator(".u-series th[tabindex]").first.click()
        assert view.ask(shown)[1:] == [False, False, True, True]


def test_limits_near_a_curve_are_drawn_and_others_are_named(runs) -> None:
    """By the limits of the arm: none beyond 1.5 times the largest value of its joint is drawn."""
    arm = rd.load("ur5")
    q = np.array([0.1, -1.2, 2.9, -2.2, -1.5, 0.3])
    page = rd.replay(rd.simulate(arm, q0=q, duration_s=0.05, estimate_error=False))
    first = page.document["plots"][0]
    assert [(each["value"], each["label"]) for each in first["limits"]] == [
        (pytest.approx(np.pi, abs=1e-3), "elbow_joint")
    ]
    assert first["beyond"] == "5 joints ±6.283; elbow_joint −3.142"
    titles = [each["title"] for each in page.document["plots"]]
    assert not any("tracking" in each or "desired" in each for each in titles)
