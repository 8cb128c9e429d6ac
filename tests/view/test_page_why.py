"""The panel of torque by cause shows what the run has, at the time of the page, in bars, as text and by keyboard."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.view import Page
from tests.browser import View, opened, without_shapes
from tests.long import long

STEPS = 2 * 32767  # the numbers of the page are whole steps, two of them half of one off
TIMES = (0.0, 0.1234, 0.37, 0.4)
E = rd.effects


@pytest.fixture(scope="module")
def run() -> rd.Trajectory:
    """An UR5 with a payload, friction that sticks, springs, and effort limits of its file."""
    arm = without_shapes(rd.load("ur5")).with_(payload=rd.Payload("tool0", 2.0, (0.05, 0.0, 0.1)))
    effects = [E.ViscousFriction(1.5), E.DryFriction(2.0), E.Spring(3.0, 0.2), E.EffortLimit("urdf")]
    start = np.array([0.1, -1.2, 1.4, -0.6, 1.2, 0.3])
    reference = rd.control.quintic(start, start + np.array([1.2, 0.5, -0.8, 0.7, -0.5, 0.9]), 0.35)
    hold = rd.control.ComputedTorque(arm, reference, kp=100.0, kd=20.0)
    return rd.simulate(rd.Plant(arm, effects), start, duration_s=0.4, controller=hold, estimate_error=False)


@pytest.fixture(scope="module")
def page(run: rd.Trajectory) -> Page:
    return rd.replay(run)


def at(run: rd.Trajectory, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Torques (causes + 1, n) of the latest sample at t, the sum last, and half a step of each joint, (n,)."""
    split = run.causes()
    parts = np.stack([*split.torques.values(), split.tau])
    sample = max(int(np.searchsorted(run.t, t, side="right")) - 1, 0)
    return parts[:, sample], np.abs(parts).max(axis=(0, 1)) / STEPS


def values(view: View, count: int, n: int) -> np.ndarray:
    return np.array(view.ask(f"[...Array({count})].map((_, i) => [...Array({n})].map((_, j) => why.value(j, i)))"))


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), *long([(390, "dark")])])
def test_numbers_and_bars_are_those_of_the_run(
    browser: Any, run: rd.Trajectory, page: Page, width: int, scheme: Any
) -> None:
    """To half a step of 1/32767 of the largest of each joint, at several times; bars stack at their side of 0."""
    names = list(run.causes().torques)
    with opened(browser, page, size=(width, 900), color_scheme=scheme, offline=True) as view:
        for t in TIMES:
            view.ask(f"replay.jump({t})")
            expected, half = at(run, t)
            found = values(view, len(names) + 1, 6)
            assert (np.abs(found - expected) <= half * (1 + 1e-9)).all()
            bars = view.ask(_BARS)
            for j, lane in enumerate(bars):
                _check_lane(lane, found[:-1, j], found[-1, j])
        assert view.ask("document.documentElement.scrollWidth") <= width


_BARS = """[...document.querySelectorAll('.why .lane')].map((lane) => {
  const box = (name) => lane.querySelector(name).getBoundingClientRect(), zero = box('.zero').left;
  const place = ({ left, right }) => [left - zero, right - zero];
  const bars = [...lane.querySelectorAll('.bar')].map((each) => place(each.getBoundingClientRect()));
  return { width: box('.track').width, bars, sum: place(box('.sum')) };
})"""


def _check_lane(lane: dict[str, Any], parts: np.ndarray, total: float) -> None:
    """Lengths are in proportion to torques; each side is filled without gaps; the mark is at positive less negative."""
    lengths = np.array([right - left for left, right in lane["bars"]])
    scale = lengths.sum() / np.abs(parts).sum()
    pixel = 1.0
    np.testing.assert_allclose(lengths, scale * np.abs(parts), atol=pixel)
    for way in (1, -1):
        side = way * parts > 0
        ends = [x for x, of in zip(lane["bars"], side, strict=True) if of]
        reach = max((way * x for pair in ends for x in pair), default=0.0)
        assert reach == pytest.approx(scale * np.abs(parts[side]).sum(), abs=pixel)
        assert reach <= lane["width"] / 2 + pixel
    assert np.mean(lane["sum"]) == pytest.approx(scale * total, abs=2 * pixel)


def test_the_table_of_a_joint_is_reached_by_keyboard(browser: Any, run: rd.Trajectory, page: Page) -> None:
    """Tab and Enter choose a joint, arrows step the time with the focus there, and the table follows, with units."""
    names = list(run.causes().torques)
    with opened(browser, page, size=(1400, 900)) as view:
        view.ask("replay.jump(0.2)")
        view.page.locator(".why .joint").first.focus()
        view.page.keyboard.press("Tab")
        view.page.keyboard.press("Tab")
        view.page.keyboard.press("Enter")
        view.page.keyboard.press("ArrowRight")
        t = view.ask("replay.time")
        assert t > 0.2
        assert view.ask("[...document.querySelectorAll('.why .joint')].map((each) => each.ariaPressed)")[2] == "true"
        caption = view.page.locator(".why caption").inner_text()
        assert re.fullmatch(r"elbow_joint at t = (\S+) s", caption)
        rows = [re.split(r"\t", row) for row in view.page.locator(".why table tr").all_inner_texts()]
        expected, _ = at(run, t)
        assert [row[0].strip() for row in rows] == [*names, "sum: actuation τ", "effort limit"]
        digits = 10.0 ** -len(rows[0][1].partition(".")[2])
        shown = [float(row[1]) for row in rows[:-1]]
        np.testing.assert_allclose(shown, expected[:, 2], atol=0.5 * digits + np.abs(run.u[:, 2]).max() / STEPS * 4)
        assert rows[-1][1:] == ["150", "N m"] and {row[2] for row in rows} == {"N m"}


def test_an_actuation_beyond_the_effort_limit_of_the_file_is_marked(browser: Any) -> None:
    """A UR5 that holds 30 kg stretched out, without the limits as an effect."""
    arm = without_shapes(rd.load("ur5")).with_(payload=rd.Payload("tool0", 30.0))
    hold = rd.control.PDGravity(arm, rd.control.hold([0.0] * 6), kp=0.0, kd=0.0)
    run = rd.simulate(arm, [0.0] * 6, duration_s=0.05, controller=hold, estimate_error=False)
    over = np.abs(run.u[-1]) > arm.effort_limit
    with opened(browser, rd.replay(run)) as view:
        view.ask("replay.jump(1)")
        marked = view.ask(
            "[...document.querySelectorAll('.track .sum')].map((each) => each.classList.contains('over'))"
        )
    assert marked == list(over) and any(over) and not all(over)


def test_a_run_that_cannot_be_split_has_no_panel(browser: Any, run: rd.Trajectory) -> None:
    """As one of an earlier file; and the page of two runs says whose causes it shows."""
    with opened(browser, rd.replay(replace(run, effect_torques=None))) as view:
        assert view.page.locator(".why").count() == 0
    with opened(browser, rd.replay(run, run)) as view:
        assert view.page.locator(".why h2").inner_text() == "torque by cause: run 1"


def test_the_panel_of_a_long_run_takes_little_room(run: rd.Trajectory) -> None:
    """At most 2000 samples of 6 joints, 7 rows of two bytes, and the times; 4/3 as text, not packed at all."""
    k = 10_001
    every = np.arange(k) % len(run.t)
    t = np.linspace(0.0, 5.0, k)
    torques = {name: torque[every] for name, torque in run.effect_torques.items()}  # pyright: ignore[reportOptionalMemberAccess]
    ledger = replace(run.ledger, kinetic=run.ledger.kinetic[every], potential=run.ledger.potential[every],
                     work={name: work[every] for name, work in run.ledger.work.items()})  # fmt: skip
    power = {name: each[every] for name, each in run.power.items()}
    arrays = {
        name: getattr(run, name)[every]
        for name in ("q", "v", "a", "u", "desired", "desired_velocity", "tracking_error")
    }
    long = replace(run, t=t, effect_torques=torques, ledger=ledger, power=power, events=(), **arrays)
    document = rd.replay(long).document
    entry = document["causes"]
    assert len(entry["t"]) == 2000 and entry["t"][0] == 0.0 and entry["t"][-1] == t[-1]
    sizes = [len(Page({**document, "causes": x}).text) for x in (entry, None)]
    assert 0 < sizes[0] - sizes[1] < 4 / 3 * 2000 * (6 * 7 * 2 + 8)
