"""Stability is a property of a sampled loop and not of a run: that of the map of a period, however short the run."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import RemarkKind
from robot_dyn.simulation.dynamics.stability import Stability
from tests.campaigns.estimates.scenes import RAIL
from tests.long import long
from tests.short_loops import Arm, ShortLoop, judge

BLOCK = rd.Robot.from_text(RAIL)  # 1 kg


@pytest.mark.parametrize(("seed", "index"), [(28, 9), *long([(28, 4), (2026, 97)])])
def test_a_loop_is_stable_up_to_where_the_radius_of_a_period_passes_1(seed: int, index: int) -> None:
    """Slides, an arm and a filter, in runs of a few periods; `python -m tests.short_loops` judges a hundred."""
    judged = judge(seed, index)
    assert judged.holds, judged


@pytest.mark.parametrize(("period", "duration"), [(0.11, 0.5), (0.15, 2.0), (0.3, 2.0), (0.3, 0.2)])
def test_a_short_run_makes_no_loop_stable(period: float, duration: float) -> None:
    """A mass under PD is stable for T < 2 m/kd, here 0.05 s, and the run grows by ρ in each whole period of it."""
    law = rd.control.PD(rd.control.hold([0.0]), kp=100.0, kd=40.0, period_s=period)
    advice = rd.advise(BLOCK, [0.1], duration_s=duration, controller=law, engine="interpreted")
    u = np.array([-100.0, -40.0])
    made = np.array([[1, period], [0, 1]]) + np.outer([period**2 / 2, period], u)
    radius = np.abs(np.linalg.eigvals(made)).max()
    assert advice.longest_period_s == pytest.approx(0.05, rel=1e-3)
    assert not advice.stable
    assert advice.period_growth == pytest.approx(radius, rel=1e-6)
    assert advice.growth == pytest.approx(radius ** (duration // period), rel=1e-6)
    assert "unstable; the loop is stable up to 0.05 s: use period_s=0.02, or lower gains" in advice.text
    assert (
        f"deviations grow by a factor of {advice.growth:.4g} over this run, by {radius:.4g} in each period"
        in advice.text
    )
    assert (advice.run is None) == (advice.growth > 1e3)  # what the run bears is run


@dataclass(frozen=True, eq=False)
class Braking(rd.control.Stateless):
    """Stop a mass of 1 kg within a period if c is 1: τ = −k q − c v / T."""

    c: float
    period_s: float = 0.02
    n = property(lambda self: 1)

    def torque(self, t: float, q: Any, v: Any, z: Any) -> Any:
        return -100.0 * q - self.c / self.period_s * v

    def thresholds(self) -> tuple[()]:
        return ()


@pytest.mark.parametrize("c", [1.0, 3.0])
def test_a_law_that_divides_by_its_period_is_judged_at_it(c: float) -> None:
    """Such a law has no continuous form. The radius of the map of a period: u = (−100, −c/T) is held for T."""
    law = Braking(c)
    T = law.period_s
    radius = np.abs(np.linalg.eigvals(np.array([[1, T], [0, 1]]) + np.outer([T**2 / 2, T], [-100.0, -c / T]))).max()
    advice = rd.advise(BLOCK, [0.1], duration_s=0.2, controller=law, engine="interpreted")
    assert advice.period_growth == pytest.approx(radius, rel=1e-6)
    run = rd.simulate(BLOCK, [0.1], duration_s=0.2, controller=law, engine="interpreted")
    unstable = any(remark.kind is RemarkKind.UNSTABLE for remark in run.remarks)
    assert unstable == (radius > 1) == (not advice.stable)


def test_a_period_is_judged_itself_where_a_shorter_one_is_unstable() -> None:
    """A spring and a damper under P control: unstable from some period on, and stable again before ω T = 2 π."""
    k, d, kp = 100.0, 1.0, 60.0
    A, one = np.array([[0.0, 1.0], [-k, -d]]), np.ones(1)
    arm = Arm(
        "spring",
        rd.Plant(BLOCK, [rd.effects.Spring([k]), rd.effects.ViscousFriction([d])]),
        A,
        np.array([[0.0], [1.0]]),
        one,
        0.1 * one,
        0 * one,
        0 * one,
    )
    loop = ShortLoop(arm, kp * one, None, 0 * one, (0.0, 0.0), False, 0, 1.0, 10)
    first = loop.longest()
    again = next(T for T in np.arange(first, 1.0, 1e-3) if loop.radius(T) > 1 and loop.radius(T + 2e-3) < 0.999) + 2e-3
    for period, stable in ((0.9 * first, True), (1.1 * first, False), (again, True)):
        advice = rd.advise(replace(loop, period=float(period)).setup())
        assert advice.longest_period_s == pytest.approx(first, rel=1e-3)
        assert advice.stable == stable, period
    assert f"stable; some shorter periods are unstable: the loop is stable up to {first:.3g} s" in advice.text


def test_what_neither_grows_nor_decays_is_marginal_and_hides_no_limit() -> None:
    """A planar arm that lies flat, with its first joint not driven: the exact limit is that of the map without it."""
    arm = rd.load("planar_2r").with_(gravity=(0.0, 0.0, 0.0))
    q, (kp, kd) = np.array([0.4, -0.7]), ((0.0, 50.0), (0.0, 5.0))
    M = np.linalg.inv(arm.M(q))[1, 1]  # of the second joint while no torque acts on the first

    def radius(T: float) -> float:
        made = np.array([[1, T], [0, 1]]) + np.outer([M * T**2 / 2, M * T], [-kp[1], -kd[1]])
        return float(np.abs(np.linalg.eigvals(made)).max())

    advice = rd.advise(
        arm,
        q,
        duration_s=0.05,
        controller=rd.control.PD(rd.control.hold(q), kp=np.array(kp), kd=np.array(kd), period_s=1e-3),
    )
    assert advice.stable
    assert advice.at_period is Stability.MARGINAL
    assert f"no deviation grows for periods up to {advice.longest_period_s:.3g} s" in advice.text
    assert radius(advice.longest_period_s) <= 1 < radius(1.001 * advice.longest_period_s)


@pytest.mark.parametrize(
    ("law", "remedy"),
    [
        (rd.control.PD(rd.control.hold([0.0]), kp=100.0, kd=0.0, period_s=1e-3), "lower gains, or less delay"),
        (rd.control.PID(rd.control.hold([0.0]), kp=100.0, ki=1500.0, kd=10.0, period_s=1e-3), "other gains"),
    ],
)
def test_a_loop_that_is_unstable_at_every_period_says_why(law: rd.control.Controller, remedy: str) -> None:
    """P control of a mass has ρ² = 1 + kp T²/2m; a PID with ki > kp kd/m is unstable at all times, by Routh."""
    advice = rd.advise(BLOCK, [0.1], duration_s=0.02, controller=law)
    assert advice.longest_period_s == 0.0
    assert not advice.stable
    assert f"unstable; no period is stable: use {remedy}" in advice.text
    assert (advice.continuous_growth_rate > 0) == (remedy == "other gains")


def test_a_step_has_its_limit_however_short_the_run() -> None:
    """1 kg with a damper of 100 N s/m: RK4 is stable up to 2.785/100 s, also where a run is two steps long."""
    plant = rd.Plant(BLOCK, [rd.effects.ViscousFriction(100.0)])
    for duration in (0.1, 10.0):
        advice = rd.advise(plant, [0.0], [1.0], duration_s=duration, method="RK4", step_s=0.05)
        assert advice.limits["RK4"] == pytest.approx(0.02785293563405282, rel=1e-3)
        assert not advice.stable


@pytest.mark.parametrize("options", [{"method": "RK4", "step_s": 1e-3}, {"method": "DOP853"}])
def test_a_run_that_its_loop_ends_says_so_and_not_to_take_a_smaller_step(options) -> None:
    """A pendulum with a spring of 1e8 N m/rad on ticks of 10 ms, whatever the step."""
    joint, law = rd.load("pendulum"), rd.control.PD(rd.control.hold([0.0]), kp=1e8, kd=0.0, period_s=0.01)
    run = rd.simulate(joint, [0.1], duration_s=5.0, controller=law, estimate_error=False, **options)
    runs = rd.rollouts(joint, [[0.1], [0.2]], duration_s=5.0, controller=law, **options)
    for outcome in (run.outcome, runs.outcome(0), runs.outcome(1)):
        assert outcome.ending == "diverged"
        assert outcome.text.startswith("control loop unstable, deviations grow: pivot by ")
        assert "step" not in outcome.text
    assert run.summary.count("control loop unstable") == 1


def test_a_run_that_its_step_ends_under_a_stable_loop_says_so() -> None:
    """A damper of 1e5 per second, which RK4 follows with steps of 28 µs; the loop is stable up to 2 b/kp."""
    plant, law = (
        rd.Plant(BLOCK, [rd.effects.ViscousFriction(1e5)]),
        rd.control.PD(rd.control.hold([0.0]), kp=100.0, kd=0.0, period_s=0.01),
    )
    run = rd.simulate(
        plant, [0.1], [1.0], duration_s=0.5, controller=law, method="RK4", step_s=1e-3, estimate_error=False
    )
    assert run.outcome.ending == "diverged"
    (remark,) = (each for each in run.remarks if each.kind is RemarkKind.TOO_LONG)
    assert remark.limit == pytest.approx(2.785293563405282e-5, rel=1e-3)
    assert run.outcome.text.startswith("step too long to be stable")
    assert RemarkKind.UNSTABLE not in {each.kind for each in run.remarks}


def test_sampling_is_told_apart_from_an_arm_that_falls_anyway() -> None:
    """Upright with kp = 0 it falls at each period, slowly; from kd T/M = 2 on its damper overshoots, as 1 − kd T/M.

    The period that the remedy names ends that: no remark is left.
    """
    arm, kd = rd.load("pendulum"), 20.0
    limit = 2 * float(arm.M([np.pi])[0, 0]) / kd
    plant, upright = rd.Plant(arm), rd.control.hold([np.pi])

    def remarks(period: float) -> list:
        law = rd.control.PD(upright, kp=0.0, kd=kd, period_s=period)
        run = rd.simulate(
            plant, [np.pi - 0.01], duration_s=0.3, controller=law, method="RK4", step_s=1e-3, estimate_error=False
        )
        return [each.remedy for each in run.remarks if each.kind is RemarkKind.UNSTABLE]

    (remedy,) = remarks(1.5 * limit)
    told = re.search(r"by ([\d.]+) per second; periods beyond ([\d.]+) s add to that: use period_s=([\d.]+)", remedy)
    assert told is not None
    rate, beyond, period = map(float, told.groups())
    falls = float(arm.N([np.pi - 1e-6])[0] - arm.N([np.pi])[0]) / 1e-6  # −∂N/∂q upright
    M = limit * kd / 2
    assert rate == pytest.approx((np.sqrt(kd**2 + 4 * M * falls) - kd) / (2 * M), rel=5e-3)  # M λ² + kd λ = falls
    assert beyond == pytest.approx(limit, rel=0.03)  # gravity moves it by (g/l) T²/4
    assert not remarks(period)
