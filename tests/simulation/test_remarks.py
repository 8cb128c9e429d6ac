"""Remarks: what happens between samples is said, with joint, time and value, by every loop and method."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.cli import report
from robot_dyn.foundations import json_text
from robot_dyn.simulation import RemarkKind, observation_of, remark_lines
from robot_dyn.simulation.observation import observer as observers
from robot_dyn.simulation.observation.guard_levels import NO_LEVELS
from robot_dyn.simulation.observation.observer import CHUNK, Observer
from robot_dyn.view import document_of
from tests.long import long
from tests.view.plotted import headings

INERTIA = 1 / 3  # of the pendulum about its pivot, in [kg m²]
PERIOD = 1e-3
LIMIT = 2.0  # [N m]


@pytest.fixture(scope="module")
def joint():
    """One joint of constant inertia, with no gravity and no limits: M v̇ = u."""
    return rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))


def damped(joint, ratio: float, **options) -> rd.Setup:
    """Sampled damping with kd T/M = ratio, disturbed by a little stiffness; a sample every 10 ticks."""
    control = rd.control.PD(rd.control.hold([0.3]), kp=0.05, kd=ratio * INERTIA / PERIOD, period_s=PERIOD)
    given = {"duration_s": 0.5, "record_every_s": 10 * PERIOD, "engine": "interpreted"}
    if options.get("method") != "DOP853":
        given |= {"method": "RK4", "step_s": PERIOD / 4}
    plant = rd.Plant(joint, [rd.effects.EffortLimit(LIMIT)])
    return rd.Setup(plant, [0.2], [0.02], controller=control, estimate_error=False, **given | options)


def kinds(run) -> list[RemarkKind]:
    return [remark.kind for remark in run.remarks]


@pytest.mark.parametrize(("ratio", "chatters"), [(0.9, False), (2.2, True)])
@pytest.mark.parametrize("integrator", ["RK4", "DOP853"])
def test_sampled_damping_chatters_above_two(joint, ratio: float, integrator, chatters: bool) -> None:
    """v⁺ = (1 − kd T/M) v at a tick: above 2 it grows, up to where the effort limit holds u at ± LIMIT."""
    run = rd.simulate(damped(joint, ratio, method=integrator))
    assert kinds(run).count(RemarkKind.CHATTER) == chatters
    if chatters:
        (said,) = (remark for remark in run.remarks if remark.kind is RemarkKind.CHATTER)
        # from ~1 % of the limit to it, amplitudes grow by 1.2 a tick: some 25 ticks
        assert said.start_s < 0.05
        assert said.start_s + said.duration_s == pytest.approx(0.5 - PERIOD, abs=2 * PERIOD)
        assert said.value == pytest.approx(LIMIT, rel=1e-12)
        assert "kd period_s / M is 2.2" in said.remedy
        np.testing.assert_array_equal(run.extremes[2, :, 0], [-LIMIT, LIMIT])
        assert RemarkKind.EFFORT_REACHED in kinds(run)


def test_ringing_that_dies_out_is_no_chatter(joint) -> None:
    """1 − 1.7 = −0.7: below a fiftieth of its start after ln 50 / ln (1/0.7) = 11 ticks, 10 of them are told."""
    slow, quick = (rd.simulate(damped(joint, ratio)) for ratio in (1.85, 1.4))
    assert RemarkKind.CHATTER in kinds(slow)
    assert RemarkKind.CHATTER not in kinds(quick)


def test_chatter_is_said_by_a_run_that_diverges(joint) -> None:
    """Without a limit it grows until the run ends; the remedy stands beside the outcome."""
    run = rd.simulate(damped(joint, 3.5, duration_s=2.0), plant=rd.Plant(joint))
    assert run.outcome.ending == "diverged"
    assert RemarkKind.CHATTER in kinds(run)


@pytest.mark.parametrize("method", ["RK4", "GaussLegendre4", "SemiImplicitEuler", "Rodas5PFixed"])
def test_extremes_are_those_of_all_steps(method: str) -> None:
    """A run that keeps every step shows them: least and largest of q and v over its samples, to the bit."""
    arm = rd.load("ur5")
    q0, v0 = np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4]), np.array([0.5, 0.4, -0.3, 0.2, 0.6, -0.5])
    plant, law = rd.Plant(arm, [rd.effects.ViscousFriction(2.0)]), rd.control.PD(rd.control.hold(q0), kp=50.0, kd=5.0)
    setup = rd.Setup(plant, q0, v0, 0.05, law, method, estimate_error=False)
    every, few = rd.simulate(setup), rd.simulate(setup, record_every_s=0.05)
    np.testing.assert_array_equal(every.extremes, few.extremes)
    # a step in (q, p) has its velocity at its stages only
    slack = 0.02 if method.startswith("GaussLegendre") else 0.0
    for seen, sampled in zip(every.extremes[:2], (every.q, every.v), strict=True):
        np.testing.assert_allclose(seen, [sampled.min(axis=0), sampled.max(axis=0)], rtol=0, atol=slack)
    size = np.abs(every.u).max()  # u of the last stage of a step, not at its end
    np.testing.assert_allclose(every.extremes[2], [every.u.min(axis=0), every.u.max(axis=0)], atol=0.05 * size)


def test_machine_code_shows_what_the_interpreted_loop_shows(joint, monkeypatch) -> None:
    """Also where other steps are looked at together; both loops differ by rounding, which 6000 stable steps keep."""
    setup = damped(joint, 0.5, duration_s=1.5)
    swing = replace(setup, controller=replace(setup.controller, kp=40.0))
    interpreted = rd.simulate(swing)
    monkeypatch.setattr(observers, "CHUNK", 700)
    compiled = rd.simulate(swing, engine="compiled")
    np.testing.assert_allclose(compiled.extremes, interpreted.extremes, rtol=1e-9)
    assert [each.text for each in compiled.remarks] == [each.text for each in interpreted.remarks]
    few = rd.simulate(damped(joint, 2.2, duration_s=1.5), engine="compiled")
    monkeypatch.undo()
    many = rd.simulate(damped(joint, 2.2, duration_s=1.5), engine="interpreted")
    assert kinds(few) == kinds(many)
    assert few.remarks[0].duration_s == pytest.approx(many.remarks[0].duration_s)
    assert few.remarks[0].start_s == many.remarks[0].start_s


def test_time_at_the_effort_limit_is_that_of_the_closed_form(joint) -> None:
    """The limit L acts while kp (e − L t²/2M) − kd L t/M > L: the positive root of a quadratic, to a step of 1 ms."""
    kp, kd, e = 20.0, 10.0, 1.0
    a = LIMIT / INERTIA
    control = rd.control.PD(rd.control.hold([e]), kp=kp, kd=kd)
    setup = rd.Setup(
        rd.Plant(joint, [rd.effects.EffortLimit(LIMIT)]), [0.0], duration_s=1.0, controller=control, method="RK4"
    )
    run = rd.simulate(setup, record_every_s=0.5, estimate_error=False)
    root = np.roots([kp * a / 2, kd * a, LIMIT - kp * e]).max()
    (said,) = (remark for remark in run.remarks if remark.kind is RemarkKind.EFFORT_REACHED)
    assert (said.start_s, said.value) == (0.0, LIMIT)
    assert said.duration_s == pytest.approx(root, abs=1.5e-3)


@pytest.fixture(scope="module")
def cart():
    """A cart pushed beyond 2 m, 5 m/s and 100 N, the limits of its file, with a sample at both ends only."""
    plan = rd.control.quintic(np.zeros(2), np.array([2.5, 0.0]), 0.8)
    plant, law = rd.Plant(rd.load("cart_pole")), rd.control.PD(plan, kp=4e3, kd=400.0)
    return rd.Setup(plant, np.zeros(2), None, 1.0, law, "RK4", record_every_s=1.0, estimate_error=False)


def test_what_passes_the_limits_of_the_file_is_said(cart) -> None:
    """Farthest values, times and durations are those of a run that keeps every step."""
    run, every = rd.simulate(cart), rd.simulate(cart, record_every_s=0.0)
    said = {remark.quantity: remark for remark in run.remarks if remark.kind is RemarkKind.BEYOND}
    assert set(said) == {"q", "v", "u"}
    for (quantity, x), limit in zip((("q", every.q), ("v", every.v), ("u", every.u)), (2.0, 5.0, 100.0), strict=True):
        remark, size = said[quantity], np.abs(x[:, 0])
        slack = 0.01 * size.max() if quantity == "u" else 0.0  # its value is that of the last stage
        assert abs(remark.value) == pytest.approx(size.max(), abs=slack)
        assert remark.at_s == pytest.approx(every.t[size.argmax()], abs=2e-3)
        assert remark.start_s == pytest.approx(every.t[np.flatnonzero(size > limit)[0]], abs=2e-3)
        assert remark.duration_s == pytest.approx(np.sum(size > limit) * 1e-3, abs=5e-3)
        assert (remark.joint, abs(remark.limit)) == ("slide", limit)


def test_a_limit_that_the_plant_enforces_is_reached_not_passed(cart) -> None:
    """A stop at the limit holds the cart up to its softness, an effort limit holds the actuation."""
    arm = cart.plant.dynamics
    effects = [*rd.effects.joint_stops(arm.lower, arm.upper, 1e6), rd.effects.EffortLimit("urdf")]
    said = {(remark.kind, remark.quantity) for remark in rd.simulate(cart, plant=rd.Plant(arm, effects)).remarks}
    assert (RemarkKind.EFFORT_REACHED, "u") in said
    assert (RemarkKind.STOP_REACHED, "q") in said
    assert not {(RemarkKind.BEYOND, "u"), (RemarkKind.BEYOND, "q")} & said


def test_a_start_beyond_a_limit_is_said(cart) -> None:
    """From 0 s, though the first step leaves it at once."""
    run = rd.simulate(cart, q0=[2.0 + 1e-6, 0.0], v0=[-1.0, 0.0], controller=None, duration_s=0.1)
    (said,) = run.remarks
    assert (said.kind, said.start_s, said.value, said.limit) == (RemarkKind.BEYOND, 0.0, 2.0 + 1e-6, 2.0)


def test_an_adaptive_run_is_watched_at_its_steps() -> None:
    """A pole falls: q and v against a fixed step of 1 ms; between two of its own steps little is missed."""
    setup = rd.Setup(
        rd.Plant(rd.load("cart_pole")), np.array([0.0, 0.4]), duration_s=2.0, estimate_error=False, method="RK4"
    )
    fine = rd.simulate(setup, method=rd.integrate.method("DP8"), step_s=1e-3)
    run = rd.simulate(setup, method=rd.integrate.Adaptive(), record_every_s=1.0)
    span = np.ptp(fine.extremes[:2], axis=1)
    assert np.abs(run.extremes[:2] - fine.extremes[:2]).max() < 0.05 * span.max()


@pytest.mark.parametrize(("per_turn", "said"), [(1, True), (20, False)])
def test_a_record_that_hides_an_oscillation_is_said(joint, per_turn: int, said: bool) -> None:
    """Sampled once a period T = 2π √(M/k) an oscillation of ±0.4 rad looks like rest at 0.4 rad."""
    stiffness = 30.0
    turn = 2 * np.pi * np.sqrt(INERTIA / stiffness)
    plant = rd.Plant(joint, [rd.effects.Spring(stiffness)])
    setup = rd.Setup(plant, [0.4], None, 4 * turn, None, "RK4", turn / 200, turn / per_turn, estimate_error=False)
    run = rd.simulate(setup)
    assert (kinds(run) == [RemarkKind.COARSE]) == said
    if said:
        assert np.ptp(run.q) < 1e-3
        assert run.remarks[0].quantity in ("q", "v")
        assert run.extremes[0, 0, 0] == pytest.approx(-0.4, abs=1e-3)


@dataclass(frozen=True, eq=False)
class Push(rd.effects.Dissipative):
    """A torque along the velocity, declared against it."""

    damping: float

    def torque(self, dynamics, t, q, v):
        return -self.damping * v


@pytest.mark.parametrize("damping", [0.2, -0.2, *long([0.0])])
def test_an_effect_declared_dissipative_that_does_work_is_said(joint, damping: float) -> None:
    """P = τᵀ v = −b v² is positive for b < 0; v = v₀ exp(−b t / I), so the largest is at the end."""
    run = rd.simulate(rd.Plant(joint, [Push(damping)]), q0=[0.2], v0=[1.5], duration_s=0.5)
    said = [remark for remark in run.remarks if remark.kind is RemarkKind.GAINS]
    assert bool(said) == (damping < 0)
    if said:
        assert said[0].value == pytest.approx(-damping * (1.5 * np.exp(-damping * 0.5 / INERTIA)) ** 2, rel=1e-6)
        assert "a dissipative effect does positive work: push" in run.summary


def test_memory_does_not_grow_with_the_run() -> None:
    """300 000 steps: extremes to the bit, windows in order, their number bounded."""
    rng = np.random.default_rng(3)
    observer, x = (
        Observer(observation_of(np.zeros((6, 1)), NO_LEVELS)),
        np.cumsum(rng.normal(size=(6, 300_000)), axis=1),
    )
    for first in range(0, x.shape[1], CHUNK):
        part = x[:, first : first + CHUNK]
        observer.filled = part.shape[1]
        observer.columns[0, : observer.filled] = 1e-3 * (1 + first + np.arange(part.shape[1]))
        observer.columns[1:, : observer.filled] = part
        observer.process(end=True)
    edges, low, high = observer.windows
    assert len(low) == len(high) == len(edges) - 1 <= 256
    assert edges[0] == 0.0 and edges[-1] == pytest.approx(300.0) and (np.diff(edges) > 0).all()
    for k in (0, len(low) // 2, len(low) - 1):
        a, b = (round(edge / 1e-3) for edge in edges[k : k + 2])
        np.testing.assert_array_equal([low[k], high[k]], [x[:, a:b].min(axis=1), x[:, a:b].max(axis=1)])
    np.testing.assert_array_equal([low.min(axis=0), high.max(axis=0)], [x.min(axis=1), x.max(axis=1)])


def test_remarks_are_said_wherever_a_run_is_shown(joint, tmp_path) -> None:
    """Summary, plot, replay page, --json; and they come back from a run file."""
    run = rd.simulate(damped(joint, 2.2))
    said = remark_lines(run.remarks)
    assert len(said) >= 2
    assert [str(remark) for remark in run.remarks] == [remark_lines([remark])[0] for remark in run.remarks]
    assert all(line in run.summary for line in said)
    title = headings(rd.plot(run, "torques"))
    assert all(line in title for line in said)
    assert document_of((run,), (), None, False)["remarks"] == said
    told = json.loads(json_text(report.run(run)))
    assert [each["text"] for each in told["remarks"]] == [remark.text for remark in run.remarks]
    assert told["extremes"]["u"] == {"least": [-LIMIT], "largest": [LIMIT]}
    back = rd.read(run.save(tmp_path / "run"))
    assert back.remarks == run.remarks
    np.testing.assert_array_equal(back.extremes, run.extremes)


def test_a_run_that_was_not_watched_says_so(joint, tmp_path) -> None:
    run = replace(rd.simulate(damped(joint, 0.5)), extremes=None, remarks=())
    assert "not observed" in rd.read(run.save(tmp_path / "run")).summary


def test_regularised_friction_that_creeps_is_named_with_its_speed(joint) -> None:
    """Under a load τ < f at v_s artanh(τ / f), once v has settled; dry friction, and a load above f, give no remark."""
    f, scale, tau = 2.0, 0.01, 1.2
    load = {"controller": lambda t, q, v: np.array([tau]), "duration_s": 0.5, "estimate_error": False}
    run = rd.simulate(rd.Plant(joint, [rd.effects.RegularisedCoulombFriction(f, scale)]), [0.1], **load)
    (remark,) = run.remarks
    assert remark.kind is RemarkKind.CREEPS
    assert remark.value == pytest.approx(scale * np.arctanh(tau / f), rel=1e-3)
    assert "under 1.2 of 2 N m; dry_friction would hold" in run.summary
    assert rd.simulate(rd.Plant(joint, [rd.effects.DryFriction(f)]), [0.1], **load).remarks == ()
    load["controller"] = lambda t, q, v: np.array([3.0])
    assert rd.simulate(rd.Plant(joint, [rd.effects.RegularisedCoulombFriction(f, scale)]), [0.1], **load).remarks == ()


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
@pytest.mark.parametrize(("part", "grows"), [(0.97, False), (1.03, True)])
def test_a_sampled_loop_that_grows_says_so_though_nothing_chatters(
    joint, engine: str, part: float, grows: bool
) -> None:
    """M v̇ = −kp q a period late: z² (z − 1) … has |z| = 1 at the period of its Jury criterion, found by bisection."""
    kp, kd = 40.0, 4.0

    def radius(T: float) -> float:  # of (q, v, the torque on its way)
        b = np.array([T**2 / 2, T, 0.0]) / INERTIA
        made = np.array([[1, T, 0], [0, 1, 0], [-kp, -kd, 0]]) + np.outer(b, [0, 0, 1.0])
        return float(np.abs(np.linalg.eigvals(made)).max())

    low, high = 1e-3, 1e-1
    while high / low > 1 + 1e-6:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if radius(middle) < 1 else (low, middle)
    period = part * low
    loop = rd.control.Loop(
        rd.control.PD(rd.control.hold([0.0]), kp=kp, kd=kd, period_s=period), actuation_delay_periods=1.0
    )
    run = rd.simulate(
        joint, [1e-6], duration_s=1000 * period, controller=loop, method="RK4", step_s=period, engine=engine,
        estimate_error=False,
    )  # fmt: skip
    assert RemarkKind.CHATTER not in kinds(run)
    assert (RemarkKind.UNSTABLE in kinds(run)) == grows
    if grows:
        (said,) = (each for each in run.remarks if each.kind is RemarkKind.UNSTABLE)
        assert said.value == pytest.approx(radius(period), rel=1e-6)
        assert "control loop unstable, deviations grow: pivot by a factor of 1." in run.summary
        assert float(said.remedy.split("use period_s=")[1].split(",")[0]) < low


@pytest.mark.parametrize("steps", [*long([{"method": "DOP853"}]), {"method": "RK4", "step_s": 2e-3}])
def test_a_task_that_is_damped_says_so_between_samples_too(steps) -> None:
    """A planar arm held stretched but for 1e-3: the smallest eigenvalue of J M⁻¹ Jᵀ by inv(M). Bent, it is silent."""
    arm, frame = rd.load("planar_2r").with_(gravity=(0, 0, 0)), "tip"
    for bend, says in ((1e-3, True), (1.0, False)):
        q = np.array([0.4, bend])
        at = arm.placement(q, frame)[:3, 3]
        law = rd.control.OperationalSpace(arm, frame, rd.control.line(at, at, 1.0), kp=50.0, kd=10.0, rows=(0, 2))
        run = rd.simulate(arm, q, duration_s=0.3, controller=law, estimate_error=False, **steps)
        assert (RemarkKind.DAMPED in kinds(run)) == says
        if says:
            (said,) = (each for each in run.remarks if each.kind is RemarkKind.DAMPED)
            J = arm.jacobian(q, frame)[[0, 2]]
            assert said.value == pytest.approx(np.linalg.eigvalsh(J @ np.linalg.inv(arm.M(q)) @ J.T)[0], rel=1e-6)
            assert said.duration_s == pytest.approx(0.3)
            assert "task damped near a singularity: tip for 0.3 s from 0 s" in run.summary


def test_chatter_by_the_quantum_of_an_encoder_is_told_from_chatter_by_gains() -> None:
    """Of computed torque M⁻¹ kd is kd, times the period 0.04: differences of a rounded position reverse the torque."""
    arm, goal = rd.load("planar_2r"), rd.control.quintic([0.3, 0.2], [0.8, 0.6], 0.2)
    law = rd.control.ComputedTorque(arm, goal, kp=400.0, kd=40.0, period_s=1e-3)
    rounded = [rd.control.Quantisation(2 * np.pi / 2**12)]
    for filters, chatters in (([], True), ([rd.control.LowPass(50.0)], False)):
        loop = rd.control.Loop(law, rounded, [rd.control.Differences(), *filters])
        run = rd.simulate(rd.Plant(arm), [0.3, 0.2], controller=loop, duration_s=0.2, estimate_error=False)
        facts = [remark.facts for remark in run.remarks if remark.kind == "chatter"]
        assert bool(facts) is chatters
        assert all(of["blocks"] == "quantisation" and of["ratio"] == pytest.approx(0.04, rel=0.1) for of in facts)
