"""Rests: when dry friction and rigid stops hold a joint, as closed forms say; in plots and on the page of a replay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import plot
from robot_dyn.view.rests import rests
from tests.browser import opened
from tests.campaigns.estimates.scenes import arms
from tests.view.plotted import cells

G = 9.80665
RAIL = arms()["rail"]  # 1 kg on a vertical rail


@pytest.fixture(scope="module")
def fall() -> rd.Trajectory:
    """Thrown up at 2 m/s from 0 against friction 12 N, held at the top, and pulled down by 4 t to a stop at −0.1."""
    plant = rd.Plant(RAIL, [rd.effects.DryFriction(12.0), rd.effects.RigidStops(-0.1, np.inf)])
    pull = lambda t, q, v: np.array([-4.0 * t])  # noqa: E731
    return rd.simulate(plant, [0.0], [2.0], duration_s=3.0, controller=pull, estimate_error=False,
                       record_every_s=0.0371)  # fmt: skip


def test_a_joint_rests_from_where_it_sticks_to_where_it_breaks_away(fall) -> None:
    """Between samples too: it breaks away at t = (f − g) / 4."""
    ((stuck, at_stop),) = rests(fall)
    slides, rested = (next(each.t for each in fall.events if word in each.name) for word in ("slides", "strikes"))
    assert stuck.start == next(each.t for each in fall.events if "sticks" in each.name)
    assert (stuck.end, stuck.at_stop) == (slides, False)
    assert stuck.end == pytest.approx((12.0 - G) / 4.0, rel=1e-9)
    assert (at_stop.start, at_stop.end, at_stop.at_stop) == (pytest.approx(rested, abs=1e-9), 3.0, True)
    assert fall.at_stop[-1, 0] and not fall.at_stop[0, 0]


def test_nothing_holds_a_joint_in_balance() -> None:
    """A pendulum that hangs still has v = 0 all the time, and no rest; what no run says to act is not guessed."""
    run = rd.simulate(rd.load("pendulum"), [0.0], duration_s=0.2, estimate_error=False)
    assert (run.v == 0).all()
    assert rests(run) == ((),)


def test_rests_are_those_of_the_run_file(fall, tmp_path) -> None:
    assert rests(rd.read(fall.save(tmp_path / "fall"))) == rests(fall)


def test_plots_shade_rests(fall) -> None:
    """Two in each cell, the one at a stop in another colour; none where nothing is said to hold."""
    ((stuck, at_stop),) = rests(fall)
    for symbol in "qv":
        (axes,) = cells(plot(fall, "joints"), symbol)
        one, two = axes.patches
        assert (one.get_x(), two.get_x()) == pytest.approx((stuck.start, at_stop.start))
        assert one.get_width() == pytest.approx(stuck.end - stuck.start)
        assert one.get_facecolor() != two.get_facecolor()
    assert not cells(plot(replace(fall, acting=None), "joints"), "q")[0].patches


def test_a_replay_has_a_line_for_each_joint_that_is_held(browser, fall) -> None:
    """Its rests stand where the time is, and name themselves; its events are on it."""
    ((stuck, at_stop),) = rests(fall)
    with opened(browser, rd.replay(fall)) as view:
        assert view.ask("document.querySelectorAll('.lane').length") == 1
        spans = view.ask("[...document.querySelectorAll('.rest')].map((x) => [x.className, x.style.left, x.title])")
        assert [name for name, *_ in spans] == ["rest", "rest stop"]
        for (_, left, title), rest in zip(spans, (stuck, at_stop), strict=True):
            assert float(left.strip("%")) == pytest.approx(100 * rest.start / 3.0, abs=1e-3)
            assert "lift" in title
        assert view.ask("document.querySelectorAll('.lane .event').length") == len(fall.events)
        view.ask("(replay.seek(1.5), 0)")
        assert view.ask("document.querySelector('.lane .mark').style.left") == "50%"
