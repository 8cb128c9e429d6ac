"""Error against work: orders, the front, the reference and its horizon, resolved and extrapolated errors."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from functools import partial
from importlib import import_module
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import robot_dyn as rd
from robot_dyn.accuracy import ArmMotion, PeerError, desired_motion
from robot_dyn.accuracy.work_precision_diagram.diagram import most_precise
from robot_dyn.accuracy.work_precision_diagram.measurement import Walk, measure
from robot_dyn.accuracy.work_precision_diagram.method_under_test import (
    MethodUnderTest,
    Point,
    ToleranceLadder,
    own,
    recorded,
    whole,
)
from robot_dyn.accuracy.work_precision_diagram.peers import methods_of_peers
from robot_dyn.accuracy.work_precision_diagram.reference_run import HorizonError, Reference, past_horizon, reference
from robot_dyn.accuracy.work_precision_diagram.work_precision import programs
from robot_dyn.foundations import json_text, plain
from robot_dyn.integrate import ButcherTableau, ExplicitRungeKutta
from robot_dyn.queries import format_duration
from robot_dyn.report import Budget
from robot_dyn.scene import parse_scene, starter
from tests.long import long, third


def swing(duration_s: float = 0.3) -> rd.Setup:
    """A double pendulum with friction, interpreted: smooth, of two joints, at a general state."""
    plant = rd.Plant(rd.load("planar_2r"), [rd.effects.ViscousFriction([0.3, 0.2])])
    return rd.Setup(plant, [0.4, 0.9], [0.3, -0.5], duration_s, engine="interpreted")


@pytest.fixture(scope="module")
def smooth() -> tuple[rd.Setup, Reference]:
    return reference(whole(swing()), Budget(1e3))


def ladder(candidate: MethodUnderTest, truth: Reference, first: int, last: int) -> ToleranceLadder:
    """The rungs from `first` to `last`, whatever time they take."""
    walk = Walk(candidate)
    for setting in islice(candidate.settings(), first, last):
        walk.add(setting, truth, math.inf)
    return walk.ladder(truth.error)


@pytest.mark.parametrize(
    ("name", "first", "last"),
    [("RK4", 0, 3), *third([("Euler", 3, 6), ("Midpoint", 1, 4), ("GaussLegendre4", 0, 3), ("Rodas5PFixed", 0, 4)])],
)
def test_measured_orders_are_those_of_the_methods(smooth, name: str, first: int, last: int) -> None:
    """Slope = p + O(h).

    With a motion of some 5 rad/s and h ≤ 20 ms the second term of the error is 0.1 of the first, and half of that at
    half the step, so that a slope is off by log2(1.1 / 1.05) < 0.1; 0.25 leaves room for its factor.
    """
    setup, truth = smooth
    found = ladder(own(setup, rd.integrate.method(name), "interpreted"), truth, first, last)
    assert found.measured_order == pytest.approx(rd.integrate.method(name).order, abs=0.25)


def test_a_wrong_coefficient_shows_in_the_measured_order(smooth) -> None:
    """Weights (1, 2, 3, 0)/6 in place of (1, 2, 2, 1)/6 add up to 1, but Σ b c = 5/12 is not 1/2: order 1."""
    setup, truth = smooth
    half, sixth = Fraction(1, 2), Fraction(1, 6)
    wrong = ButcherTableau(((), (half,), (0, half), (0, 0, 1)), (sixth, 2 * sixth, 3 * sixth, 0), (0, half, half, 1), 4)
    found = ladder(own(setup, ExplicitRungeKutta("RK4", wrong), "interpreted"), truth, 2, 5)
    assert found.measured_order is not None and found.measured_order < 1.5


def test_the_reference_is_the_closed_form_of_a_pendulum() -> None:
    """sin(q/2) = k sn(K(k) − ω t, k), released at rest: the reference is within its own error of it, as is claimed.

    The functions of SciPy err by some roundings, so that 1e-14 is added.
    """
    arm, q0 = rd.load("pendulum"), 1.2
    omega = math.sqrt(arm.N([math.pi / 2])[0] / arm.M([0.0])[0, 0])
    if arm.N([0.1])[0] < 0:
        pytest.fail("q = 0 must hang down")
    setup, truth = reference(recorded(whole(rd.Setup(rd.Plant(arm), [q0], engine="interpreted")), 1.0), Budget(1e3))
    k = math.sin(q0 / 2)
    sn, *_ = ellipj(ellipk(k * k) - omega * truth.t, k * k)
    assert np.abs(truth.q[:, 0] - 2 * np.arcsin(k * sn)).max() <= truth.error + 1e-14
    assert truth.error < 1e-12 and truth.horizon_s == setup.duration_s == 1.0


def test_chaotic_motion_is_cut_where_references_part() -> None:
    """Up to the horizon other runs agree to 1e-6, a thousand times the distance at which it is cut; later they do not.

    They are of order 8 with two steps.
    """
    setup = rd.Setup(rd.Plant(rd.load("planar_2r")), [2.4, 0.9], [0.3, -0.5], 60.0, engine="compiled")
    cut, truth = reference(whole(setup), Budget(1e3))
    assert truth.parted_s is not None and truth.lost_s is not None
    assert truth.horizon_s == cut.duration_s <= truth.parted_s < truth.lost_s < 40.0
    runs = [
        rd.simulate(setup, method="DP8", step_s=step, record_every_s=1.0, estimate_error=False) for step in (1e-3, 5e-4)
    ]
    apart = np.abs(runs[0].q - runs[1].q).max(axis=1)
    assert apart[runs[0].t <= truth.horizon_s].max() < 1e-6 < 1.0 < apart.max()
    assert truth.error < 1e-8


def test_beyond_the_horizon_energy_and_the_way_back_judge() -> None:
    """Two joints there and back: a method of higher order comes back nearer; with friction nothing comes back."""
    rubbed, methods = swing(2.0), {name: rd.integrate.method(name) for name in ("RK4", "DP8")}
    setup = replace(rubbed, plant=rd.Plant(rubbed.plant.dynamics))
    made = [
        ToleranceLadder(
            name, "interpreted", True, order, "step", (Point(step, 1, 1, 1e-3, 0.0, True, times=(1e-6,)),), "", 0.0
        )
        for name, order, step in (("RK4", 4, 0.02), ("DP8", 8, 0.02))
    ]
    other = ToleranceLadder("MuJoCo RK4", "", True, 4, "step", made[0].points, "", 0.0)
    rk4, dp8 = past_horizon(setup, 1.0, [*made, other], methods, Budget(1e3))
    assert (rk4.name, dp8.name) == ("RK4", "DP8")
    assert 1e-10 < dp8.returned < 1e-2 * rk4.returned < 1e-2  # swung through, where both magnify what they err
    assert dp8.energy < 1e-2 * rk4.energy < 1e-4
    assert [each.returned for each in past_horizon(rubbed, 1.0, made, methods, Budget(1e3))] == [None, None]
    assert past_horizon(setup, 1.0, made, methods, Budget(1e-6)) == ()  # no run is short enough


def test_machine_code_that_is_loaded_takes_no_time_of_a_run_beyond_the_horizon(monkeypatch) -> None:
    """By a clock that stands still but for 1000 s of the first run of a method: a run may take 20 s."""
    module, now, loaded = import_module(past_horizon.__module__), [0.0], set[str]()

    def loading(run):
        def first(setup: rd.Setup, **options):
            now[0] += 1000.0 * (setup.method.name not in loaded)
            loaded.add(setup.method.name)
            return run(setup, **options)

        return first

    for name in ("warmed", "simulate"):
        monkeypatch.setattr(module, name, loading(getattr(module, name)))
    monkeypatch.setattr(module, "Budget", partial(Budget, clock=lambda: now[0]))
    budget, point = Budget(1e3, clock=lambda: now[0]), Point(0.02, 1, 1, 1e-3, 0.0, True, times=(1e-6,))
    ladder = ToleranceLadder("RK4", "interpreted", True, 4, "step", (point,), "", 0.0)
    found = past_horizon(swing(), 0.1, [ladder], {"RK4": rd.integrate.method("RK4")}, budget)
    assert [each.name for each in found] == ["RK4"] and budget.spent == 0


def test_an_accuracy_of_the_setup_is_not_used() -> None:
    """It would choose the method, which differs from run to run here."""
    (only,) = rd.accuracy.work_precision(
        replace(swing(0.1), accuracy=1e-6), methods=["RK4"], repeats=1, peers=False
    ).ladders
    assert only.points


def test_a_motion_without_reference_is_refused() -> None:
    with pytest.raises(HorizonError, match=r"no run of 0\.3 s by DOP853 or Rodas5P finishes"):
        rd.accuracy.work_precision(replace(swing(), controller=lambda t, q, v: v * (np.nan if t > 0.1 else 1.0)))


def points(*errors: float, resolved: bool = True, each_s: float = 1e-3) -> tuple[Point, ...]:
    """Runs that take 1, 2, 4, … times as many steps and as long."""
    return tuple(
        Point(0.1 / 2**k, 10 * 2**k, 40 * 2**k, e, e, resolved, times=(each_s * 2**k,)) for k, e in enumerate(errors)
    )


def invented(*ladders: ToleranceLadder, floor: float = 1e-12) -> rd.accuracy.WorkPrecision:
    truth = Reference(np.zeros(2), np.zeros((2, 1)), floor, ("one", "other"), 1.0)
    return rd.accuracy.WorkPrecision("arm", (), "rad", 1.0, truth, ladders, (), {"processor": "P"}, 1.0, 1.0)


def of(
    name: str, runs: tuple[Point, ...], order: int = 4, floor: float = 1e-12, engine: str = "compiled"
) -> ToleranceLadder:
    return ToleranceLadder(name, engine, True, order, "step", runs, "", floor)


def test_a_ladder_ends_where_steps_would_no_longer_end_at_events() -> None:
    """A run of more than 200 000 fixed steps passes its events within steps: its error is of another method."""
    stops = rd.effects.joint_stops(-1.0, 1.0, 1e3, 10.0)
    setup = recorded(rd.Setup(rd.Plant(rd.load("pendulum"), stops), [0.4], [3.0]), 1.0)
    finest = {}
    for events in (True, False):
        method = own(setup, rd.integrate.method("RK4"), "compiled", events)
        finest[events] = list(islice(method.settings(), 25))[-1]
    assert 1e5 < 1.0 / finest[True] <= 2e5 < 1.0 / finest[False]


@pytest.mark.parametrize(
    ("times", "repeatable"),
    [
        ([1.0, 1.04, 9.0, 9.0, 9.0], True),
        ([9.0, 9.0, 1.0, 9.0, 1.04], True),
        ([1.0, 1.06, 1.2, 1.3, 1.4], False),
        ([1.0, 1.0, 1.0, 1.0], False),
        ([1.0], False),
    ],
)
def test_a_time_is_repeatable_if_the_two_least_of_five_turns_agree_to_five_percent(
    times: list[float], repeatable: bool
) -> None:
    point = Point(0.1, 1, 4, 1e-6, 0.0, True, times=tuple(times))
    assert (point.time_s, point.repeats, point.repeatable) == (min(times), len(times), repeatable)


def test_at_most_eight_methods_are_drawn_the_soonest_at_six_digits_and_one_of_each_program() -> None:
    """Of twelve whose times are 1, 2, 3, … times those of the first, in any order."""
    ladders = [of(f"m{k}", points(1e-4, 1e-8, each_s=1e-3 * (k + 1))) for k in (7, 3, 11, 0, 5, 1, 9, 2, 10, 4, 6, 8)]
    names = [each.method for each in most_precise(ladders)]
    assert names == ["m7", "m3", "m0", "m5", "m1", "m2", "m4", "m6"]
    peer = of("MuJoCo RK4", points(1e-2, 1e-8, each_s=1.0), engine="")
    names = [each.method for each in most_precise([*ladders, peer])]
    assert names == ["m3", "m0", "m5", "m1", "m2", "m4", "m6", "MuJoCo RK4"]


def test_no_run_beats_one_of_the_front_and_each_other_is_beaten() -> None:
    rng = np.random.default_rng(5)
    runs = [
        tuple(
            Point(1.0, 9, 9, float(e), 0.0, bool(e > 1e-9), times=(float(t),))
            for e, t in 10.0 ** rng.uniform(-12, 0, (30, 2))
        )
        for _ in range(3)
    ]
    front = [p for _, p in invented(*(of(str(k), each) for k, each in enumerate(runs))).front]
    assert len(front) > 3
    resolved = [p for each in runs for p in each if p.resolved]
    for p in resolved:
        beaten = any(o.error <= p.error and o.time_s <= p.time_s and o is not p for o in resolved)
        assert beaten != (p in front)
    assert all(p.resolved for p in front)


def test_errors_below_that_of_the_reference_are_not_resolved(smooth) -> None:
    """DOP853 at 1e-13 ends nearer to the reference than the two runs of that are to each other: it takes no part."""
    setup, truth = smooth
    coarse = replace(truth, error=1e-6)
    found = ladder(own(setup, rd.integrate.method("DOP853"), "interpreted"), coarse, 0, 12)
    assert [p.resolved for p in found.points] == [p.error > 1e-6 for p in found.points]
    assert not found.points[-1].resolved and found.points[0].resolved
    assert all(p.error > 1e-6 for _, p in invented(found, floor=1e-6).front)
    assert found.price(1e-7) is None


def test_points_near_the_error_of_the_reference_do_not_count_for_the_order() -> None:
    """Errors of order 4 that end at a floor of 1e-9 have a median slope below 4, unless those near it are left out."""
    errors = [1e-2 / 16**k + 1e-9 for k in range(18)]
    assert of("RK4", points(*errors), floor=1e-9).measured_order == pytest.approx(4, abs=0.02)
    assert of("RK4", points(*errors), floor=1e-13).measured_order == pytest.approx(0, abs=0.02)


def test_prices_are_interpolated_between_runs_and_extrapolated_by_the_order() -> None:
    found = of("RK4", points(1e-2, 1e-2 / 16, 1e-2 / 256))
    between, finer = found.price(1e-2 / 64), found.price(1e-2 / 256 / 10**4)
    assert between is not None and finer is not None
    assert (between.value, between.extrapolated) == (pytest.approx(1e-3 * 2**1.5), False)
    assert (finer.value, finer.extrapolated) == (pytest.approx(4e-3 * 10), True)


def test_an_error_that_finer_runs_exceed_again_was_not_reached() -> None:
    price = of("RK4", points(1e-2, 1e-8, 1e-3, 1e-6)).price(1e-5)
    assert price is not None and price.value > 4e-3


def test_the_sentence_marks_what_is_extrapolated() -> None:
    fast, slow = of("DOP853", points(1e-3, 1e-5, 1e-7, 1e-9)), of("Euler", points(1e-2, 5e-3, 2.5e-3), order=1)
    peer = of("Other RK", points(1e-4, 1e-6, 1e-8, each_s=0.5), engine="")
    said = invented(fast, slow, peer).sentence
    assert said == "6 digits of q over 1 s: DOP853 2.8 ms; Other RK 1 s; Euler would take 10 s (extrapolated)"
    quick = of("Other RK", points(1e-4, 1e-6, 1e-8), engine="")
    assert invented(fast, quick).sentence == "6 digits of q over 1 s: Other RK 2 ms; DOP853 2.8 ms"
    assert invented(slow).sentence_of(3) == "no run reached 3 digits of q"
    assert format_duration(0.00031) == "310 µs" and format_duration(7200.0) == "2 h"


def test_events_keep_the_order_at_a_stop() -> None:
    """A stop is a kink of the second derivative: RK4 keeps its order where steps end there.

    Where they do not, it errs a hundred times as much, or more.
    """
    plant = rd.Plant(
        rd.load("pendulum"), [rd.effects.ViscousFriction(0.1), *rd.effects.joint_stops(-1.0, 1.0, 1e3, 10.0)]
    )
    setup, truth = reference(whole(rd.Setup(plant, [0.98], [2.0], 0.06, engine="interpreted")), Budget(1e3))
    with_events, without = (
        ladder(own(setup, rd.integrate.method("RK4"), "interpreted", events), truth, 2, 5) for events in (True, False)
    )
    assert with_events.measured_order == pytest.approx(4, abs=0.3)
    assert without.points[-1].error > 100 * with_events.points[-1].error
    assert without.name == "RK4 (interpreted, without events)"


def free_panda() -> rd.Setup:
    arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
    return rd.Setup(rd.Plant(arm), [0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2], duration_s=0.2)


def scene(name: str, duration_s: float) -> rd.Setup:
    return replace(parse_scene(starter(name), name).setup(Path(), {}), duration_s=duration_s)


@pytest.mark.parametrize(
    ("setup", "first"),
    [
        pytest.param(free_panda(), 0, id="free"),
        *long([pytest.param(scene("ur5_pd", 1.0), 3, id="PD and friction")]),  # where steps are stable
        *long([pytest.param(scene("stops", 0.5), 5, id="stops")]),
        *long([pytest.param(scene("flyball_governor", 0.01), 3, id="springs and dampers of lines")]),
    ],
)
def test_other_programs_solve_the_same_equation(setup: rd.Setup, first: int) -> None:
    """MuJoCo's RK4 with the same step differs by rounding alone: errors of 1e-4 agree to 1e-6 of that.

    SciPy's runs at tight tolerances end within 1e-9 of the reference.
    """
    import_module("mujoco")
    setup, truth = reference(whole(replace(setup, engine="compiled")), Budget(1e3))
    peers, _ = methods_of_peers(setup)
    theirs = {each.method: each for each in peers}
    assert {"SciPy DOP853 + pin.aba", "MuJoCo RK4", "MuJoCo Euler", "MuJoCo implicitfast"} <= theirs.keys()
    assert ("MuJoCo discrete" in theirs) == ("mjINT_DISCRETE" in vars(import_module("mujoco").mjtIntegrator))
    ours = ladder(own(setup, rd.integrate.method("RK4"), "compiled", events=False), truth, first, first + 2)
    same = ladder(theirs["MuJoCo RK4"], truth, first, first + 2)
    for a, b in zip(ours.points, same.points, strict=True):
        assert b.error == pytest.approx(a.error, rel=1e-6) and b.steps == a.steps
    for name in theirs.keys() & {f"SciPy {x} + pin.aba" for x in ("DOP853", "LSODA")}:
        assert ladder(theirs[name], truth, 11, 12).points[0].error < 1e-9


def test_programs_that_cannot_do_a_scene_are_left_out_with_the_reason() -> None:
    arm = rd.load("planar_2r")
    plant = rd.Plant(arm, [rd.effects.DryFriction(0.1)])
    sampled = rd.control.PD(rd.control.hold([0.0, 0.0]), kp=10.0, kd=1.0, period_s=0.01)
    for setup, why in (
        (rd.Setup(plant, [0.4, 0.9], duration_s=0.5), "dry_friction is not supported"),
        (rd.Setup(rd.Plant(arm), [0.4, 0.9], controller=sampled, duration_s=0.5), "only a continuous PD"),
    ):
        peers, left_out = methods_of_peers(recorded(setup, 0.5))
        assert not peers and why in left_out[0]


def test_a_program_with_other_torques_is_refused() -> None:
    motion = ArmMotion(recorded(whole(swing()), 0.5))
    arm, damping = motion.robot, np.array([0.3, 0.2])
    bias = partial(arm.inverse_dynamics, a=np.zeros(2))
    motion.check(arm.M, bias, lambda t, q, v: -damping * v)
    with pytest.raises(PeerError, match="the torque of control and effects differs by"):
        motion.check(arm.M, bias, lambda t, q, v: -1.000001 * damping * v)


def test_the_motion_given_to_other_programs_is_that_of_the_reference() -> None:
    """At knots, between them, before and after."""
    spline = rd.control.via_points([0.1, 0.4, 0.5, 1.2], np.random.default_rng(2).normal(size=(4, 3)))
    desired = desired_motion(spline)
    for t in (0.0, 0.1, 0.25, 0.4, 0.45, 0.5, 1.0, 1.2, 1.3):
        q_d, v_d, _ = spline.at(t)
        np.testing.assert_allclose(desired(t), [q_d, v_d], rtol=1e-12, atol=1e-12)


def test_a_program_that_cannot_be_imported_is_left_out(monkeypatch) -> None:
    def broken(_: object) -> list[MethodUnderTest]:
        raise ImportError("no library")

    monkeypatch.setattr("robot_dyn.accuracy.work_precision_diagram.peers.PEERS", {"scipy": broken})
    setup = recorded(whole(rd.Setup(rd.Plant(rd.load("pendulum")), [0.3])), 0.1)
    assert methods_of_peers(setup) == ([], ["scipy: cannot be imported (no library)"])


def test_json_holds_the_runs() -> None:
    result = rd.accuracy.work_precision(swing(0.1), methods=["RK4", "DOP853"], repeats=1, peers=False)
    read = json.loads(json_text(result))
    kept = [p for each in result.ladders for p in each.points]
    assert [{key: row[key] for key in plain(p)} for row, p in zip(read["rows"], kept, strict=True)] == plain(kept)
    assert {p.repeats for p in kept} == {1}
    assert read["sentence"] == result.sentence and read["reference"]["error"] == result.reference.error
    assert any(row["on_front"] for row in read["rows"])


def test_evaluations_are_counted_exactly() -> None:
    """RK4 takes four a step and steps end at the records: 25 of them, or two, four, … times as many."""
    result = rd.accuracy.work_precision(swing(0.1), methods=["RK4"], repeats=1, peers=False)
    (only,) = result.ladders
    assert [(p.steps, p.evaluations) for p in only.points[:3]] == [(25, 100), (50, 200), (100, 400)]


def test_a_budget_that_ends_says_what_was_left_out(smooth) -> None:
    setup, truth = smooth
    candidate = own(setup, rd.integrate.method("RK4"), "interpreted")
    left_out = ["RK4 (interpreted): the budget of 1e-09 s ended"]
    assert measure([candidate], truth, Budget(1e-9), 1) == ((), left_out)


def test_each_program_is_named_with_its_cheapest_method_or_with_what_ended_it() -> None:
    def ladder(
        name: str, *errors: float, engine: str = "", each_s: float = 1e-3, ended: str = "late"
    ) -> ToleranceLadder:
        return ToleranceLadder(name, engine, True, 4, "step", points(*errors, each_s=each_s), ended, 1e-12)

    own = ladder("DOP853", 1e-6, 1e-8, engine="compiled"), ladder("RK4", 1e-2, 1e-8, engine="compiled", each_s=1.0)
    other = ladder("Other RK4", 1e-4, 1e-8, each_s=0.1), ladder("Other Euler", 1.0, 0.5)
    more = ladder("Third RK", 2.0, 1.0), ladder("Fourth RK", 1e-8)
    assert list(programs(invented(*other, *own, *more), 1e-8)) == [
        "  robot_dyn DOP853: 2 ms", "  Fourth RK: 1 ms, 0.5 times as long", "  Other RK4: 200 ms, 100 times as long",
        "  Third: not reached (late)", "  times: shortest time of prepared runs that take turns",
    ]  # fmt: skip
    lost = list(programs(invented(ladder("DOP853", 2.0, 1.0, engine="compiled"), *other), 1e-8))
    assert lost[:2] == ["  robot_dyn: not reached (late)", "  Other RK4: 200 ms"]
