"""Time stepping: what holds does not move at all, the limit is that of the events, the ledger closes step by step."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.integrate import MoreauJean, RightSide
from robot_dyn.integrate.integrator import States
from robot_dyn.integrate.primitives import copy
from robot_dyn.integrate.time_stepping import problem_rows
from robot_dyn.simulation import DoubtKind
from tests.campaigns.estimates.scenes import arms
from tests.foundations.test_convex import minimum, problem
from tests.long import long, third

ENGINES = ["interpreted", "compiled"]
RAIL = arms()["rail"]  # 1 kg on a vertical rail
ARM = rd.load("planar_2r")
G = 9.80665
FIXED = {"method": "MoreauJean", "estimate_error": False}


def panda() -> rd.Robot:
    whole = rd.load("panda")
    return whole.with_(lock=dict.fromkeys(whole.joint_names[7:], 0.0))


@pytest.mark.parametrize("load", [1.0, *long([0.3])])
def test_what_friction_holds_stays_for_any_number_of_steps(load: float) -> None:
    """A block on a rail for an hour, with the load at its limit to the last bit too: 0.0."""
    plant, options = rd.Plant(RAIL, [rd.effects.DryFriction(G / load)]), {"record_every_s": 900.0} | FIXED
    run = rd.simulate(plant, [0.25], duration_s=3600.0, step_s=1e-3, engine="compiled", **options)
    assert run.statistics.steps == 3_600_000
    assert (run.q == 0.25).all()
    assert (run.v == 0).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sliding_block_stops_within_a_step_of_where_it_must(engine: str) -> None:
    """Its velocity falls by (f + g) h in each step, and is 0.0 from the step on in which it would change its sign."""
    f, v0, h = 11.0, 1.7, 1e-3
    run = rd.simulate(
        rd.Plant(RAIL, [rd.effects.DryFriction(f)]), [0.1], [v0], duration_s=0.2, step_s=h, engine=engine, **FIXED
    )
    slows = f + G
    k = np.arange(len(run.t))
    assert np.abs(run.v[:, 0] - np.maximum(v0 - slows * h * k, 0)).max() <= 1e-13
    assert (run.v[k > v0 / slows / h] == 0).all()
    assert run.q[-1, 0] == pytest.approx(0.1 + v0**2 / (2 * slows), abs=slows * h**2)
    assert run.a[5, 0] == pytest.approx(-slows, rel=1e-12)
    assert run.a[-1, 0] == 0
    assert run.power["dry_friction"][5] == pytest.approx(-f * run.v[5, 0], rel=1e-12)


@pytest.mark.parametrize("period_s", [0.0, 0.02], ids=["continuous", "sampled"])
def test_the_actuation_of_every_step_is_seen_by_both_engines(period_s: float) -> None:
    """Its extremes are those of the samples at each tick, or at each step to O(h); machine code is as Python."""
    plant = rd.Plant(ARM, [rd.effects.DryFriction([0.5, 0.2]), rd.effects.ViscousFriction([0.1, 0.1])])
    control = rd.control.PD(rd.control.hold([0.4, -0.2]), kp=[30.0, 20.0], kd=[3.0, 2.0], period_s=period_s)
    runs = [
        rd.simulate(
            plant, [0.9, 0.3], [0.4, -0.7], duration_s=0.4, step_s=1e-3, record_every_s=0.0, controller=control,
            engine=engine, **FIXED,
        )
        for engine in ENGINES
    ]  # fmt: skip
    (least, largest), u = runs[0].extremes[2], runs[0].u[:-1]  # what is held from the end on is in no step
    np.testing.assert_allclose(runs[1].extremes, runs[0].extremes, rtol=1e-9)
    allowed = 0.0 if period_s else 0.2  # [N m], half a step at 300 N m/s
    assert np.abs(least - u.min(axis=0)).max() <= allowed
    assert np.abs(largest - u.max(axis=0)).max() <= allowed


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_an_impact_turns_the_velocity_by_its_restitution(e: float) -> None:
    """A block thrown at a stop without friction: v⁺ = −e v, and the ledger has ½ (1 − e²) v²."""
    level = RAIL.with_(gravity=(0, 0, 0))
    run = rd.simulate(
        rd.Plant(level, [rd.effects.RigidStops(-np.inf, 0.5, e)]), [0.0], [2.0], duration_s=0.5, step_s=1e-3, **FIXED
    )
    assert run.v[-1, 0] == -2.0 * e
    assert run.ledger.work["rigid_stops"][-1] == pytest.approx(-(1 - e**2) * 2.0, rel=1e-14, abs=1e-15)
    assert run.q.max() <= 0.5 + 2.0 * 1e-3


def test_works_close_the_ledger_where_the_mass_is_constant() -> None:
    """½ v² + g q − Σ W changes by rounding alone: impulses work at the mean velocity, two frictions by their shares."""
    dry = rd.effects.DryFriction
    effects = [dry(2.0), rd.effects.RigidStops(0.0, 0.6, 0.4), dry(1.0), rd.effects.ViscousFriction(0.7)]
    run = rd.simulate(rd.Plant(RAIL, effects), [0.3], [2.4], duration_s=2.0, step_s=1e-3, **FIXED)
    ledger = run.ledger
    total = ledger.kinetic + ledger.potential - sum(ledger.work.values())
    assert np.abs(total - total[0]).max() <= 1e-12
    assert ledger.work["rigid_stops"][-1] < -0.1
    assert ledger.work["dry_friction"][-1] == pytest.approx(2 * ledger.work["dry_friction 2"][-1], rel=1e-13)


def test_no_stop_adds_energy_whatever_the_restitutions() -> None:
    """Works r (v + v⁺)/2 ≤ 0 of each joint, where one leaves its stop as another one strikes, but for 10 roundings."""
    rng = np.random.default_rng(9)
    q, v = rng.uniform(-0.3, 0.3, (64, 2)), 5 * rng.normal(size=(64, 2))
    setup = rd.Setup(
        rd.Plant(ARM, [rd.effects.RigidStops(-0.35, 0.35, [0.25, 0.9])]), q[0], duration_s=2.0, step_s=4e-3, **FIXED
    )
    work = rd.rollouts(setup, q, v, record=("work",)).work["rigid_stops"]
    assert np.diff(work).max() <= 10 * np.finfo(float).eps * np.abs(work).max()
    assert (work[:, -1] < -1).all()


def test_of_two_stops_the_nearer_one_works() -> None:
    plant = rd.Plant(RAIL.with_(gravity=(0, 0, 0)), [rd.effects.RigidStops(-1, 0.8), rd.effects.RigidStops(-1, 0.5)])
    run = rd.simulate(plant, [0.0], [1.0], duration_s=0.7, step_s=1e-3, **FIXED)
    assert run.ledger.work["rigid_stops"][-1] == 0
    assert run.ledger.work["rigid_stops 2"][-1] == pytest.approx(-0.5, rel=1e-14)


def test_without_what_holds_it_is_the_method_of_stormer_and_verlet() -> None:
    """Of order 2 for forces of the position, and reversible: a pendulum there and back, to rounding."""
    pendulum = ARM.with_(lock={ARM.joint_names[1]: 0.0})
    errors = []
    exact = rd.simulate(pendulum, [0.4], duration_s=1.0, method=rd.integrate.Adaptive(rtol=1e-12, atol=1e-12)).q[-1]
    for h in (2e-3, 1e-3):
        run = rd.simulate(pendulum, [0.4], duration_s=1.0, step_s=h, **FIXED)
        errors.append(np.abs(run.q[-1] - exact).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)
    back = rd.simulate(pendulum, run.q[-1], -run.v[-1], duration_s=1.0, step_s=1e-3, **FIXED)
    assert np.abs(back.q[-1] - 0.4).max() <= 1e-12


def test_its_limit_is_that_of_the_events() -> None:
    """Panda-7 through 55 switches: the distance falls with h, by a mean slope of 1 ± 0.15 over five halvings."""
    arm, q0 = panda(), np.array([0, -0.5, 0.2, -1.9, 0.1, 1.4, 0.5])
    levels = np.array([3, 6, 2, 4, 1, 0.8, 0.3])
    A, w = np.array([6, 10, 5, 8, 2, 1.5, 0.6]), np.array([4, 5, 6, 4.5, 7, 5.5, 8])
    N0 = arm.N(q0)

    def drive(t, q, v):
        return 0.8 * N0 + A * np.sin(w * t + 0.3)

    plant = rd.Plant(arm, [rd.effects.ViscousFriction(0.1), rd.effects.DryFriction(levels)])
    given = {"duration_s": 2.0, "controller": drive, "estimate_error": False, "engine": "compiled"}
    exact = rd.simulate(plant, q0, method=rd.integrate.Adaptive(rtol=1e-8, atol=1e-8), record_every_s=0.1, **given)
    steps = 4e-3 / 2.0 ** np.arange(6)
    errors = [
        np.abs(rd.simulate(plant, q0, method="MoreauJean", step_s=h, record_every_s=0.1, **given).q - exact.q).max()
        for h in steps
    ]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(1, abs=0.15)


HELD = {
    "levels": [rd.effects.DryFriction([1.5, 0.4], static=[2.0, 0.5])],
    "Stribeck": [rd.effects.DryFriction([1.5, 0.4], static=[2.0, 0.5], stribeck_velocity=0.1)],
    "stops": [rd.effects.RigidStops([-0.6, -0.7], [0.6, 0.5], [0.3, 0.8]), rd.effects.ViscousFriction(0.1)],
    "all": [
        rd.effects.DryFriction([0.8, 0.2]),
        rd.effects.RigidStops(-0.6, 0.5, 0.5),
        rd.effects.DryFriction(0.1),
        rd.effects.RigidStops(-0.5, 0.7),
    ],
    "bristles": [rd.effects.RigidStops(-0.6, 0.6), rd.effects.LuGreFriction(100.0, 0.5, 0.1, 0.3, 0.5, 0.1)],
}


@pytest.mark.parametrize(("name", "sampled"), [*third((name, False) for name in HELD), ("all", True)])
def test_rollouts_are_the_runs_of_simulate(name: str, sampled: bool) -> None:
    """In both engines and in lanes, with equal events: they differ by rounding that the motion has magnified."""
    rng = np.random.default_rng(7)
    q, v = rng.uniform(-0.45, 0.45, (70, 2)), rng.normal(size=(70, 2))
    control = rd.control.PID(rd.control.hold([0.2, -0.1]), kp=40.0, ki=20.0, kd=4.0, period_s=0.004 if sampled else 0.0)
    setup = rd.Setup(rd.Plant(ARM, HELD[name]), q[0], duration_s=0.6, controller=control, step_s=1e-3, **FIXED)
    many = rd.rollouts(setup, q, v, record=("q", "v", "u", "energy", "work"))
    for run in (0, 33, 69):
        for engine in ENGINES:
            one = rd.simulate(setup, q[run], v[run], engine=engine)
            assert one.outcome.ending == "finished"
            assert np.abs(many.q[run] - one.q).max() <= 1e-11
            assert np.abs(many.v[run] - one.v).max() <= 1e-9
            assert np.abs(many.kinetic[run] - one.ledger.kinetic).max() <= 1e-9
            for source, work in one.ledger.work.items():
                assert np.abs(many.work[source][run] - work).max() <= 1e-9, source


def test_a_run_in_a_tile_does_not_depend_on_the_others() -> None:
    """Bit by bit: Newton's steps go on for some runs of a vector and leave the others as they are."""
    rng = np.random.default_rng(8)
    q, v = rng.uniform(-0.45, 0.45, (130, 2)), 3 * rng.normal(size=(130, 2))
    setup = rd.Setup(rd.Plant(ARM, HELD["all"]), q[0], duration_s=0.5, step_s=1e-3, **FIXED)
    whole, few = rd.rollouts(setup, q, v, threads=2), rd.rollouts(setup, q[::13], v[::13], threads=1)
    assert (whole.q[::13] == few.q).all()
    assert (whole.v[::13] == few.v).all()


def test_a_step_solves_problems_that_newtons_method_does_not() -> None:
    """Of 300 random problems side by side: where places still change after its steps the active set takes over."""
    rng, n, runs = np.random.default_rng(10), 3, 300
    given = [each for k in range(4000) if len((each := problem(rng, k % 2 == 1))[1]) == n][:runs]
    rows, stepper = problem_rows(n), MoreauJean().stepper(None, 2 * n + 1, n, 3 * n + 1, runs)
    m, lost = 2 * n + 1, np.zeros(runs, np.int64)
    y, after = np.zeros((m, runs)), np.zeros((m, runs))

    def gave_up(t, x, p, run_parameters, out):
        out[m + rows.changed] = 1.0
        for b, (M, *vectors) in enumerate(given):
            out[m + rows.M : m + rows.p, b] = M[np.triu_indices(n)]
            out[m + rows.p : m + rows.u, b] = np.concatenate(vectors)

    def told(t, x, p, found, out):
        copy(out[:n], found[:n])

    functions = RightSide(None, 0, gave_up, told)
    x = States(y=y, after=after, p=np.zeros(0), run_parameters=np.zeros((0, runs)), failed=lost)
    stepper.step(functions, rows, stepper.work, 0.0, 1e-3, x)
    assert (lost == 0).all()
    for b, each in enumerate(given):
        M, p, f, *_ = each
        scale = np.abs(M) @ np.abs(after[:n, b]) + np.abs(p) + f
        assert (np.abs(M @ (after[:n, b] - minimum(*each))) <= 1e-9 * scale.max()).all()


def test_it_estimates_no_error_and_finds_no_events() -> None:
    plant = rd.Plant(ARM, HELD["levels"])
    run = rd.simulate(plant, [0.3, 0.2], duration_s=0.1, step_s=1e-3, method="MoreauJean")
    assert run.error.ends_early.kind is DoubtKind.NO_ORDER_OF_IMPACTS
    event = rd.Event(lambda t, q, v: q[0] - 0.25)
    with pytest.raises(QueryError, match="MoreauJean cannot end at them; use method='DOP853'"):
        rd.simulate(plant, [0.3, 0.2], step_s=1e-3, method="MoreauJean", events=[event])
    with pytest.raises(QueryError, match="1e-06 beyond its upper stop"):
        rd.simulate(
            rd.Plant(ARM, [rd.effects.RigidStops(-1, 0.3)]), [0.3 + 1e-6, 0.0], step_s=1e-3, method="MoreauJean"
        )
    with pytest.raises(QueryError, match=r"uncut: .* where steps must end"):
        rd.rollouts(plant, [0.3, 0.2], method="RK4", step_s=1e-3, uncut=True)


def test_it_takes_over_where_events_accumulate(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ball that bounces, with a limit of 12 changes in a hundredth of the run: made by time stepping, and said."""
    from robot_dyn.simulation.run import event_handler

    monkeypatch.setattr(event_handler, "_MOST_CHANGES", 12)
    monkeypatch.setattr(event_handler, "_BRIEF", 1e-2)
    plant = rd.Plant(RAIL, [rd.effects.RigidStops(0.0, 2.0, 0.5)])
    run = rd.simulate(plant, [0.4], duration_s=2.0)
    assert run.outcome.ending == "finished"
    assert run.statistics.method == "MoreauJean"
    (said,) = [each for each in run.remarks if each.kind == "events_accumulate"]
    assert "made by time stepping with steps of 0.001 s" in said.remedy
    assert abs(run.q[-1, 0]) <= 3e-3  # of a step at the velocity of the first impact
    named = rd.simulate(plant, [0.4], duration_s=2.0, method="DOP853")
    assert named.outcome.ending == "diverged"
    assert "use method='MoreauJean'" in named.outcome.text


def test_a_run_far_beyond_its_stable_step_ends_as_diverged() -> None:
    """Positions of 1e16 rad and more, where M by Pinocchio is rounding and no longer positive definite."""
    robot, q = rd.load("panda"), np.full(8, 0.3)
    law = rd.control.PDGravity(robot, rd.control.hold(q), kp=1e3, kd=50.0)
    run = rd.simulate(
        robot, q + 1e-3, controller=law, duration_s=0.5, method="MoreauJean", step_s=0.01, engine="interpreted",
        estimate_error=False,
    )  # fmt: skip
    assert run.outcome.ending == "diverged" and run.outcome.t < 0.5
