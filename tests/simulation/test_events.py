"""Events: found where closed forms have them, cut to rounding, none missed and none invented; effects change there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robot_dyn as rd
from robot_dyn.foundations import QueryError, TraceError
from tests.campaigns.estimates.scenes import arms
from tests.long import long
from tests.slides import slides

G = 9.80665
BALL = arms()["rail"]  # 1 kg on a vertical rail
ARM = rd.load("planar_2r")
ENGINES = ["interpreted", "compiled"]
TIGHT = rd.integrate.Adaptive(rtol=1e-12, atol=1e-12)


def tossed(rise: float, excess: float, k: float, after: float, **options) -> tuple[rd.Trajectory, float]:
    """1 kg thrown up for `rise` s to `excess` m above a stop of k N/m, and the closed form of its place at the end."""
    v0 = G * rise
    stop = v0**2 / (2 * G) - excess
    plant = rd.Plant(BALL, rd.effects.joint_stops([-50.0], [stop], k, 0.0))
    options = {"method": TIGHT, "estimate_error": False} | options
    run = rd.simulate(plant, [0.0], [v0], duration_s=rise + after, **options)
    left = v0**2 - 2 * G * stop
    if left <= 0:
        T = rise + after
        return run, v0 * T - G * T**2 / 2
    speed, omega = np.sqrt(left), np.sqrt(k)
    touched = (v0 - speed) / G
    rest = rise + after - touched - 2 * np.arctan(speed * omega / G) / omega
    return run, stop - speed * rest - G * rest**2 / 2


@pytest.mark.parametrize("seed", [1, *long([20261122])])
def test_grazed_and_struck_stops_are_met_as_in_closed_form(seed: int) -> None:
    """1e-2 … 1e-6 m past stops of 1e4 … 1e9 N/m: touched and left once; at a tolerance of 1e-12 right to 1e-11 m."""
    rng = np.random.default_rng(seed)
    for _ in range(30):
        excess, k = 10 ** rng.uniform(-6, -2), 10 ** rng.uniform(4, 9)
        run, exact = tossed(rng.uniform(0.2, 0.6), excess, k, rng.uniform(0.1, 0.3), record_every_s=1.0)
        assert [each.direction for each in run.events] == [1, -1], (excess, k)
        assert abs(run.q[-1, 0] - exact) < 1e-11, (excess, k)


def test_a_run_that_ends_far_from_its_start_has_an_estimate() -> None:
    """Of fixed steps that are cut: how far a joint turns in a step is told from its path, which begins at the start."""
    plant = rd.Plant(ARM.with_(gravity=(0, 0, 0)), rd.effects.joint_stops([-9.0, -9.0], [9.0, 9.0]))
    run = rd.simulate(plant, [0.1, 0.2], [3.0, 0.5], duration_s=2.5, method="RK4", step_s=0.01)
    assert np.abs(run.q[-1] - run.q[0]).max() > np.pi
    assert run.error is not None
    assert not run.error.note


def test_near_misses_are_no_events() -> None:
    """1e-12 … 1e-4 m below a stop of 1e8 N/m."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        run, exact = tossed(rng.uniform(0.2, 0.6), -(10 ** rng.uniform(-12, -4)), 1e8, 0.2, record_every_s=1.0)
        assert run.events == ()
        assert abs(run.q[-1, 0] - exact) < 1e-12


@pytest.mark.parametrize("engine", ENGINES)
def test_an_event_lies_on_its_level_to_the_last_digits(engine: str) -> None:
    run, _ = tossed(0.5, 1e-3, 1e6, 0.3, engine=engine)
    stop = (G * 0.5) ** 2 / (2 * G) - 1e-3
    touched, left = run.events
    assert (touched.name, left.name) == ("upper stop of lift touched", "upper stop of lift left")
    assert "events: upper stop of lift touched at 0.4857 s" in run.summary
    assert touched.q == left.q == (stop,)
    assert touched.t == pytest.approx(0.5 - np.sqrt(2e-3 / G), abs=4 * np.spacing(0.5) + 1e-13)
    assert left.v[0] == pytest.approx(-touched.v[0], rel=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", [TIGHT, "DOP853"])
def test_a_function_of_the_users_own_is_an_event_where_it_vanishes(engine: str, method) -> None:
    """The apex, and a height of 1 m on the way up and down: closed forms to rounding of a parabola."""
    apex = rd.Event(lambda t, q, v: v[0], name="apex")
    falls = rd.Event(lambda t, q, v: q[0] - 1.0, direction=-1, name="falls")
    options = {"engine": engine, "method": method, "estimate_error": False, "events": [apex, falls]}
    run = rd.simulate(BALL, [0.0], [5.0], duration_s=0.9, **options)
    assert [(each.name, each.direction) for each in run.events] == [("apex", -1), ("falls", -1)]
    assert run.events[0].t == pytest.approx(5 / G, abs=1e-14)
    assert run.events[1].t == pytest.approx((5 + np.sqrt(25 - 2 * G)) / G, abs=1e-14)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_terminal_event_ends_the_run_there(engine: str) -> None:
    """Run until the arm hangs at rest to 1 mrad/s: the run is finished, its last sample is the event."""
    slow = rd.Event(lambda t, q, v: v[0] ** 2 + v[1] ** 2 - 1e-6, direction=-1, terminal=True, name="at rest")
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(8.0)])
    run = rd.simulate(plant, [0.3, 0.4], duration_s=60.0, engine=engine, events=[slow], record_every_s=0.1)
    assert run.outcome.ending == "finished"
    assert run.outcome.t == run.t[-1] == run.events[-1].t < 60
    assert "at rest" in run.outcome.text
    assert np.hypot(*run.v[-1]) == pytest.approx(1e-3, rel=1e-9)
    assert np.isfinite(run.a[-1]).all()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("level", [1e-2, 1e-6, 1e-10])
def test_a_function_that_dips_below_0_between_two_looks_is_seen(engine: str, level: float) -> None:
    """V² − ε falls below 0 at each turning point, for 2 µs at 1e-10: all are found, by SciPy's times of v = 0."""

    def rate(t: float, x: np.ndarray) -> list[float]:  # of a rod of 1 kg and 1 m
        return [x[1], 3 * (-0.05 * x[1] - G / 2 * np.sin(x[0]))]

    truth = solve_ivp(rate, (0, 6), [0.9, 2.0], "DOP853", events=lambda t, x: x[1], rtol=1e-12, atol=1e-13)
    slow = rd.Event(lambda t, q, v: (v**2).sum() - level, name="slow")
    plant = rd.Plant(rd.load("pendulum"), [rd.effects.ViscousFriction(0.05)])
    options = {"engine": engine, "estimate_error": False, "events": [slow]}
    run = rd.simulate(plant, [0.9], [2.0], duration_s=6.0, **options)
    assert [each.direction for each in run.events] == [-1, 1] * len(truth.t_events[0])
    times = np.array([each.t for each in run.events]).reshape(-1, 2)
    # the speed is linear about a turning point, but for a part of the order of the time within the dip
    assert times.mean(axis=1) == pytest.approx(truth.t_events[0], abs=level + 1e-8)
    run = rd.simulate(plant, [0.9], [2.0], duration_s=6.0, **options | {"events": [replace(slow, function=above)]})
    assert run.events == ()


def above(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Least at each turning point, and never 0."""
    return (v**2).sum() + 1e-10


def test_events_that_never_occur_do_not_change_the_steps() -> None:
    """Stops out of reach: the same steps, the same bits, and no evaluation more."""
    options = {"q0": [0.3, 0.4], "v0": [0.2, 0.1], "duration_s": 1.0, "estimate_error": False, "record_every_s": 1.0}
    bare = rd.simulate(ARM, **options, engine="interpreted")
    far = rd.simulate(rd.Plant(ARM, rd.effects.joint_stops([-9.0, -9.0], [9.0, 9.0])), **options, engine="interpreted")
    assert far.statistics.evaluations == bare.statistics.evaluations
    assert np.array_equal(far.q[-1], bare.q[-1])


def test_a_start_on_a_stop_and_one_within_it() -> None:
    """Resting on a lower stop exactly, weight sinks in by m g / k; a start within is in contact from the first step."""
    stops = rd.effects.joint_stops([0.0], [5.0], 1e4, 0.0)
    on = rd.simulate(rd.Plant(BALL, stops), [0.0], duration_s=0.1, method=TIGHT)
    omega = 100.0
    exact = -G / omega**2 * (1 - np.cos(omega * on.t))
    assert np.abs(on.q[:, 0] - exact).max() < 1e-11
    sunk = rd.simulate(rd.Plant(BALL, stops), [-G / omega**2], duration_s=0.1, method=TIGHT)
    assert np.abs(sunk.q[:, 0] + G / omega**2).max() < 1e-13
    assert sunk.events == ()


def test_two_joints_that_meet_their_stops_at_once() -> None:
    """Two equal blocks on two rails: both events, at one time, and equal motion afterwards."""
    pair = slides(("j1", "base", "b1", 1.0), ("j2", "base", "b2", 1.0), axes=("0 0 1",) * 2)
    plant = rd.Plant(pair, rd.effects.joint_stops([-0.5, -0.5], [9.0, 9.0], 1e6, 0.0))
    run = rd.simulate(plant, [0.0, 0.0], duration_s=1.0, method=TIGHT)
    times = [each.t for each in run.events]
    assert len(times) >= 4
    assert times[0] == pytest.approx(np.sqrt(1.0 / G), abs=1e-13)
    assert times[0] == pytest.approx(times[1], abs=1e-13)
    np.testing.assert_allclose(run.q[:, 0], run.q[:, 1], atol=1e-12)


def test_machine_code_paused_at_every_third_step_gives_the_same_bits(monkeypatch) -> None:
    from robot_dyn.simulation import Run

    options = {"q0": [0.3, 0.4], "v0": [0.2, 0.1], "duration_s": 2.0, "engine": "compiled", "estimate_error": False}
    plant = rd.Plant(ARM, rd.effects.joint_stops([-1.0, -1.0], [1.0, 1.0], 1e5))
    whole = rd.simulate(plant, **options)
    go = Run._advance
    monkeypatch.setattr(Run, "_advance", lambda self, budget: go(self, 3))
    paused = rd.simulate(plant, **options)
    assert whole.events == paused.events != ()
    for name in ("t", "q", "v", "a", "u"):
        assert np.array_equal(getattr(whole, name), getattr(paused, name))


def test_an_event_that_cannot_be_compiled_is_named_and_runs_interpreted() -> None:
    """`math.sin` takes no symbol: engine="compiled" says so, with the line; "auto" runs in Python."""
    options = {"q0": [0.3, 0.4], "duration_s": 0.3, "estimate_error": False}
    events = [rd.Event(lambda t, q, v: math.sin(q[0]), name="level")]
    with pytest.raises(TraceError, match=r"event level cannot be compiled .*line .* of test_events\.py"):
        rd.simulate(ARM, engine="compiled", events=events, **options)
    assert [each.name for each in rd.simulate(ARM, events=events, **options).events] == ["level"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rd.Event(3), "give a function of"),
        (lambda: rd.Event(lambda t: t), "give a function of"),
        (lambda: rd.Event(lambda t, q, v: t, direction=2), "direction must be"),
        (lambda: rd.simulate(ARM, [0.0, 0.0], events=3), "give a list of rd.Event"),
        (lambda: rd.simulate(ARM, [0.0, 0.0], events=[rd.Event(lambda t, q, v: q)]), "must return a finite number"),
        (lambda: rd.simulate(ARM, [0.0, 0.0], events=[rd.Event(lambda t, q, v: "a")]), "must return a finite number"),
        (lambda: rd.simulate(ARM, [0.0, 0.0], events=[rd.Event(lambda t, q, v: np.nan)]), "must return a finite"),
    ],
)
def test_meaningless_events_are_refused(make, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        make()


def test_a_run_that_takes_more_steps_than_was_guessed_goes_on_in_machine_code() -> None:
    """Its length is guessed by its duration; a stiff damper takes many more steps. The count decides, not a clock."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(3e4)])
    run = rd.simulate(plant, [0.3, 0.4], duration_s=0.05, estimate_error=False, method="DOP853")
    assert run.statistics.evaluations > 20_000
    assert run.statistics.engine == "compiled"
    other = rd.Plant(
        ARM, [rd.effects.ViscousFriction(3e4), rd.effects.ViscousFriction(1.0)]
    )  # no machine code is there yet
    assert rd.simulate(other, [0.3, 0.4], duration_s=1e-4, estimate_error=False).statistics.engine != "compiled"


def test_a_long_run_that_cannot_be_compiled_is_made_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begun again once, and then to its end: nothing else is left to try."""
    tried: list[float] = []

    def refuse(*_: object, **__: object) -> None:
        tried.append(1.0)
        raise rd.RobotDynError("not here")

    monkeypatch.setattr("robot_dyn.simulation.compiled.choice.existing", lambda *_: None)
    monkeypatch.setattr("robot_dyn.simulation.compiled.choice.machine_code", refuse)
    monkeypatch.setattr("robot_dyn.simulation.compiled.choice._COMPILED", 500)
    count = [0.0]  # evaluations of runs before, which other tests may have made
    monkeypatch.setattr("robot_dyn.simulation.compiled.choice.interpreted_before", lambda *_: count)
    tight = rd.integrate.Adaptive(rtol=3e-14, atol=1e-15)
    run = rd.simulate(ARM, [0.3, 0.4], duration_s=0.4, estimate_error=False, method=tight)
    assert run.statistics.evaluations > 500
    assert run.statistics.engine == "interpreted (not here)"
    assert len(tried) == 1
