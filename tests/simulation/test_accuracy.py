"""A run to an accuracy that is asked for: its error is at most that, or it is refused with the reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.foundations import QueryError, SceneError
from robot_dyn.simulation import AccuracyError
from tests.campaigns.estimates.asked import FAMILIES, answer, asked_scene
from tests.campaigns.estimates.held import meet
from tests.campaigns.estimates.truth import truth
from tests.campaigns.hard.nonsmooth_tutorials import twisting
from tests.long import long

ARM = rd.load("planar_2r")
START = np.array([0.4, -0.7])


@pytest.mark.parametrize("index", [0, *long([21, 2]), 3, *long([4])], ids=FAMILIES)
def test_the_error_is_at_most_what_is_asked(index: int) -> None:
    """Against SciPy on equations written out in tests/campaigns/estimates, near rounding."""
    scene, asked = asked_scene(1, index)
    setup = replace(scene.setup, record_every_s=scene.setup.duration_s / 10)
    run = rd.simulate(setup, accuracy=asked)
    assert run.accuracy is not None
    assert run.accuracy.requested == asked
    assert run.accuracy.estimated <= asked
    assert np.abs(run.q - truth(setup, run.t)).max() <= asked


@pytest.mark.parametrize("index", [6, *long([0, 1, 9])])
def test_the_error_is_at_most_what_is_asked_where_joints_stick_and_strike(index: int) -> None:
    """Of random dry friction and rigid stops; more of them by `python -m tests.campaigns.estimates --held`."""
    found = meet(1, index)
    assert found.met, str(found)
    assert found.estimated <= found.asked


@pytest.mark.parametrize("index", [*long([0, 1]), 2, *long([3])], ids=["pendulum", "planar_2r", "ur5", "panda"])
def test_a_request_is_met_and_not_refused_at_an_estimate_below_it(index: int) -> None:
    """The short form of `python -m tests.campaigns.estimates --requests 400`, against SciPy over `pin.aba`."""
    found = answer(20261123, index)
    assert found.met, str(found)
    assert found.told
    assert not found.refused_below


def test_the_last_run_goes_to_a_tenth_of_the_tolerance() -> None:
    """In 13 to 21 steps an error falls more slowly than the tolerance: four runs ended at 0.73 of what is asked."""
    q = [0.71357415, -0.67734523, -0.40458398, 0.29839077, -0.51547014, 0.67809834]
    v = [0.77390165, -0.52790667, -0.78913078, -0.18638423, -0.08987585, -0.23066578]
    arm, asked = rd.load("ur5"), 1.059e-4
    run = rd.simulate(arm, q, v, duration_s=0.99, accuracy=asked, record_every_s=0.09)
    exact = truth(rd.Setup(rd.Plant(arm), q, v, 0.99), run.t)
    assert np.abs(run.q - exact).max() <= asked
    assert run.accuracy.margin >= 2


def test_what_is_estimated_below_what_is_asked_is_delivered_with_its_margin() -> None:
    """At 4.3 rad rounding may leave 4500 u (1 + 4.3) = 5.3e-12 rad whatever the tolerance: more than half of 1e-11."""
    far = START + np.array([4.0, 0.0])
    run = rd.simulate(ARM, far, duration_s=0.3, accuracy=1e-11, record_every_s=0.03)
    assert 1 < run.accuracy.margin < 2
    assert f"a margin of {run.accuracy.margin:.1f}" in run.summary
    assert np.abs(run.q - truth(rd.Setup(rd.Plant(ARM), far, duration_s=0.3), run.t)).max() <= 1e-11


@pytest.mark.long
def test_accuracy_is_refused_where_events_accumulate() -> None:
    """Time stepping takes over where switches accumulate, and has neither a tolerance nor an estimate."""
    with pytest.raises(AccuracyError) as refusal:
        rd.simulate(twisting().motion.setup, accuracy=1e-6)
    assert refusal.value.best == np.inf


def test_a_tolerance_is_not_the_error() -> None:
    """What is chosen lies far from what is asked; ten times the accuracy costs what the order of the method says."""
    runs = {asked: rd.simulate(ARM, START, duration_s=3.0, accuracy=asked) for asked in (1e-7, 1e-10)}
    of = {asked: run.accuracy for asked, run in runs.items()}
    assert of[1e-7].rtol < 0.2e-7
    assert all(each.estimated <= asked for asked, each in of.items())
    digits = np.log10(of[1e-7].estimated / of[1e-10].estimated)
    expected = of[1e-7].run * (of[1e-7].digit_more / of[1e-7].run) ** digits
    assert of[1e-10].run == pytest.approx(expected, rel=0.2)  # whole steps, and a first one that is chosen apart
    assert f"accuracy: requested 1.0e-10, estimated {of[1e-10].estimated:.1e} at rtol" in runs[1e-10].summary


@pytest.mark.parametrize("index", [1, *long([36])])
def test_a_trial_step_that_goes_too_far_does_not_end_a_run(index: int) -> None:
    """Interpreted, into stiff stops at a loose tolerance: stages that overflow are those of steps that are refused."""
    scene, asked = asked_scene(20261126, index)
    run = rd.simulate(replace(scene.setup, engine="interpreted"), accuracy=asked)
    assert run.outcome.ending == "finished"
    assert run.accuracy is not None


def test_stiff_and_sampled_runs_are_made_by_their_methods() -> None:
    stiff = rd.simulate(rd.Plant(ARM, [rd.effects.ViscousFriction(1e5)]), START, duration_s=1.0, accuracy=1e-6)
    assert stiff.statistics.method == "Rodas5P"
    assert stiff.statistics.steps < 200
    law = rd.control.PD(rd.control.hold([0.0, 0.0]), kp=30.0, kd=8.0, period_s=0.005)
    sampled = rd.simulate(ARM, START, duration_s=0.5, controller=law, accuracy=1e-6)
    assert sampled.statistics.method == "RK4"
    assert sampled.statistics.steps == 100  # one in each period
    fine = rd.simulate(ARM, START, duration_s=0.5, controller=law, accuracy=1e-11, record_every_s=0.1)
    exact = truth(rd.Setup(rd.Plant(ARM), START, duration_s=0.5, controller=law), fine.t)
    assert np.abs(fine.q - exact).max() <= 1e-11


def test_what_chaos_denies_is_refused() -> None:
    message = "is not attainable: runs with other steps differ by more than 0.1 rad or m; .* a shorter run"
    with pytest.raises(AccuracyError, match=message):
        rd.simulate(ARM, [2.5, -0.7], duration_s=60.0, accuracy=1e-6, record_every_s=0.1)


def test_the_best_that_is_named_can_be_had() -> None:
    below = r"is not attainable: the estimated error is .* at DOP853's smallest tolerance, 2.2e-14; use accuracy \d"
    with pytest.raises(AccuracyError, match=below) as caught:
        rd.simulate(ARM, START, duration_s=1.0, accuracy=1e-16)
    best = float(str(caught.value).rpartition("use accuracy ")[2])
    assert rd.simulate(ARM, START, duration_s=1.0, accuracy=best).accuracy.estimated <= best


def test_a_run_that_diverges_says_so() -> None:
    """No accuracy is claimed of it."""
    law = rd.control.PD(rd.control.hold([0.0, 0.0]), kp=1e6, kd=1.0, period_s=0.05)
    run = rd.simulate(ARM, START, duration_s=5.0, controller=law, accuracy=1e-3)
    assert run.outcome.ending == "diverged"
    assert run.accuracy is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"accuracy": 0.0}, "accuracy must be positive"),
        ({"accuracy": "fine"}, "accuracy must be a"),
        ({"accuracy": {"deg": 1.0}}, "no unit 'deg'; give 'rad', 'm' or both"),
        ({"accuracy": {"m": 1e-3}}, "no value for joints in rad"),
        ({"accuracy": 1e-6, "method": "RK4"}, "chooses method and tolerances; leave out method"),
        ({"accuracy": 1e-6, "method": rd.integrate.Adaptive(rtol=1e-6)}, "leave out method"),
        ({"accuracy": 1e-6, "estimate_error": False}, "leave out estimate_error=False"),
    ],
)
def test_what_means_nothing_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(QueryError, match=message):
        rd.simulate(ARM, START, **options)
    with pytest.raises(RobotDynError, match="accuracy has no effect, simulate one of the runs"):
        rd.rollouts(ARM, START[None], accuracy=1e-6)


def test_of_two_units_the_least_that_a_joint_has_holds() -> None:
    cart = rd.load("cart_pole")
    for given, expected in (({"rad": 1e-5, "m": 1e-7}, 1e-7), ({"rad": 1e-6, "m": 1e-3}, 1e-6)):
        assert rd.simulate(cart, [0.1, 0.4], duration_s=0.2, accuracy=given).accuracy.requested == expected
    assert rd.simulate(ARM, START, duration_s=0.2, accuracy={"rad": 1e-5, "m": 1e-9}).accuracy.requested == 1e-5


def test_it_is_kept_with_the_run_and_asked_for_in_scenes(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text('robot = "planar_2r"\nduration_s = 0.3\naccuracy = 1e-7\n[[effect]]\nkind = "gravity"\n')
    run = rd.simulate(rd.read_scene(scene))
    assert run.accuracy.requested == 1e-7
    kept = rd.read(run.save(tmp_path / "run.npz"))
    assert kept.accuracy == run.accuracy
    scene.write_text(scene.read_text().replace("accuracy", 'method = "RK4"\naccuracy'))
    with pytest.raises(SceneError, match="method: has no effect because accuracy chooses"):
        rd.read_scene(scene)
