"""How runs end: finished, diverged, stopped; each keeps its samples and says what to do. And setups without meaning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.control import Stateless
from robot_dyn.effects import Conservative
from robot_dyn.foundations import ControlError, EffectError, QueryError, SingularError
from robot_dyn.simulation import RemarkKind, Run
from tests.long import third
from tests.user_parts import Push

DOUBLE = rd.load("planar_2r")
UR5 = rd.load("ur5")
START = {"q0": [0.4, -0.7], "v0": [0.3, 0.5]}
STRETCHED = rd.RobotDynError("the arm is stretched out")
METHODS = ["RK4", "GaussLegendre4", "Rodas5PFixed", "DOP853"]


@final
@dataclass(frozen=True)
class Interrupted(Stateless):
    """No torque up to `until`; then `ending` is raised, or returned."""

    ending: BaseException | float
    until: float = 0.05
    period_s: float = 0.0
    n: int = 2

    def torque(self, t, q, v, z):
        if t <= self.until:
            return np.zeros(2)
        if isinstance(self.ending, BaseException):
            raise self.ending
        return np.array([0.1, self.ending])


def slack(method, period: float) -> float:
    """How much earlier a run may end: a fixed step, or one that an adaptive method chose."""
    return 0.04 if method == "DOP853" and period == 0 else 2e-3


def check_kept(run: rd.Trajectory, until: float, early: float = 2e-3) -> None:
    """All samples up to where it ended are there, one a step of 1 ms or less; the last may lack what has no value."""
    assert run.t[-1] == pytest.approx(until, abs=early)
    assert len(run.t) >= round(run.t[-1] / 1e-3)
    for array in (run.q, run.v, *(x[:-1] for x in (run.a, run.u, run.ledger.residual, *run.power.values()))):
        assert np.isfinite(array).all()
    assert run.summary.startswith(str(run.outcome.ending))


def test_a_finished_run_says_so() -> None:
    run = rd.simulate(rd.Plant(DOUBLE), **START, duration_s=0.05)
    assert (run.outcome.ending, run.outcome.t, run.outcome.text) == ("finished", 0.05, "")
    check_kept(run, 0.05)


LAWS = {
    "PD": rd.control.PD(rd.control.hold(np.full(6, 0.3)), kp=1e4, kd=1e3),
    "sampled PD": rd.control.PD(rd.control.hold(np.full(6, 0.3)), kp=1e4, kd=1e3, period_s=0.05),
    "computed torque": rd.control.ComputedTorque(UR5, rd.control.hold(np.full(6, 0.3)), kp=1e6, kd=1e3),
}


@pytest.mark.parametrize("estimate", [False, True], ids=["alone", "with companions"])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("method", ["Euler", "RK4"])
def test_stiff_gains_at_too_large_a_step_diverge_and_the_run_says_what_to_do(method: str, law, estimate) -> None:
    """kd/M ≈ 1e5/s at 10 ms is far outside the region of stability, 2/h: the state grows until it overflows."""
    run = rd.simulate(
        rd.Plant(UR5), q0=np.linspace(0.1, 1.0, 6), v0=np.zeros(6), duration_s=10.0, controller=law,
        method=method, step_s=0.01, estimate_error=estimate,
    )  # fmt: skip
    assert run.outcome.ending == "diverged"
    assert 0 <= run.outcome.t < 10.0
    assert any(joint in run.outcome.text for joint in UR5.joint_names)
    loop = law.period_s and run.outcome.t > law.period_s  # which no step makes stable
    kinds = {remark.kind for remark in run.remarks}
    assert RemarkKind.UNSTABLE in kinds if loop else law.period_s or RemarkKind.TOO_LONG in kinds
    assert ("control loop unstable" if loop else "step") in run.outcome.text
    assert run.t[-1] <= run.outcome.t + 0.01
    assert np.isfinite(run.q).all()
    assert np.isfinite(run.v).all()
    assert len(run.t) > 1
    assert "diverged" in run.summary


def test_an_effect_may_be_interrupted_too() -> None:
    def interrupts(t, q, v):
        if t > 0.05:
            raise KeyboardInterrupt
        return 0 * v

    run = rd.simulate(rd.Plant(DOUBLE, [Push(interrupts)]), **START, duration_s=0.2)
    assert run.outcome.ending == "stopped"
    check_kept(run, 0.05)


@pytest.mark.parametrize(
    ("ending", "period"),
    [
        *((KeyboardInterrupt(), 0.0), (KeyboardInterrupt(), 0.01), (STRETCHED, 0.01), (np.nan, 0.0)),
        *third([(STRETCHED, 0.0), (np.nan, 0.01), (np.inf, 0.0), (np.inf, 0.01)]),
    ],
)
@pytest.mark.parametrize("method", METHODS)
def test_a_controller_that_fails_or_is_interrupted_ends_the_run_where_it_does(method, period: float, ending) -> None:
    """At 50 ms, or the tick after it; the outcome names that time, not the start, and no foreign error leaves."""
    law = Interrupted(ending, period_s=period)
    run = rd.simulate(rd.Plant(DOUBLE), **START, duration_s=0.2, controller=law, method=method)
    check_kept(run, 0.05 + period, slack(method, period))
    if isinstance(ending, KeyboardInterrupt):
        assert run.outcome.ending == "stopped" and run.outcome.text and run.error is None
    else:
        assert run.outcome.ending == "diverged"
        assert run.outcome.t == pytest.approx(0.05 + period, abs=slack(method, period))
    if isinstance(ending, rd.RobotDynError):
        assert "stretched out" in run.outcome.text


@pytest.mark.parametrize("method", METHODS)
def test_a_joint_without_inertia_stops_a_run_before_it_starts(method) -> None:
    """With the joint and the remedy, rather than as a run that diverged."""
    with pytest.warns(rd.ModelWarning):
        robot = rd.load("massless_tip")
    for dynamics in (robot, rd.Lagrangian(robot)):
        with pytest.raises(SingularError, match="'pointer_joint' carries no inertia"):
            rd.simulate(rd.Plant(dynamics), q0=[0.1, 0.2], v0=[0.3, 0.4], duration_s=0.1, method=method)


GOOD = {**START, "duration_s": 0.1}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"q0": [0.1, 0.2, 0.3]}, r"q0 must have shape \(2,\).*got \(3,\)"),
        ({"q0": [[0.1, 0.2]]}, r"q0 must be one state of shape \(2,\)"),
        ({"q0": "up"}, "q0 must be an array of 2 real numbers, got 'up'"),
        ({"v0": [0.1, np.nan]}, "v0 must be finite, got nan for joint 'joint_2'"),
        ({"v0": 0.0}, r"v0 must have shape \(2,\)"),
        ({"duration_s": -1.0}, "duration_s must be a positive number of seconds, at least 1e-12; got -1"),
        ({"duration_s": np.nan}, "duration_s must be finite, got nan"),
        ({"duration_s": np.inf}, "duration_s must be finite, got inf"),
        ({"step_s": 0}, "step_s must be a positive number of seconds, at least 1e-12; got 0"),
        ({"step_s": "fine"}, "step_s must be a real number, got 'fine'"),
        ({"record_every_s": -0.1}, "record_every_s must"),
        (
            {"controller": rd.control.PD(rd.control.hold([0.0, 0.0, 0.0]), kp=1.0, kd=1.0)},
            "drives 3 joints, the plant has 2",
        ),
        ({"controller": 3}, "controller"),
        ({"method": "rk44"}, "no integration method 'rk44'; nearest: RK4"),
        ({"method": rd.integrate.Adaptive}, "method: got .*; give a name"),
    ],
    ids=str,
)
def test_a_setup_without_meaning_is_refused(options: dict, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        rd.simulate(rd.Plant(DOUBLE), **{**GOOD, **options})


@final
class Law(Stateless):
    """A controller that returns what it is told to."""

    n = 2

    def __init__(self, given: object = None, period_s: object = 0.0) -> None:
        self.given, self.period_s = given, period_s

    def torque(self, t, q, v, z):
        return self.given


@pytest.mark.parametrize(
    ("given", "found"),
    [
        (np.ones(3), r"shape \(3,\)"),
        (np.ones((1, 2)), r"shape \(1, 2\)"),
        (0.3, r"shape \(\)"),
        ([0.1, np.nan], "nan"),
        ([0.1, -np.inf], "-inf"),
        ([0.1, 1j], r"\[0.1, 1j\]"),
        (None, "None"),
        ("much", "'much'"),
    ],
    ids=str,
)
def test_code_of_ones_own_returns_one_number_for_each_joint(given: object, found: str) -> None:
    """Told with the name of its class; a scalar or (1, n) would else be broadcast without a word."""
    with pytest.raises(EffectError, match=rf"Push\.torque returned {found} for 2 joints"):
        rd.Setup(rd.Plant(DOUBLE, [Push(lambda t, q, v: given)]), [0.3, -0.4])
    with pytest.raises(ControlError, match=rf"Law\.torque returned {found} for 2 joints"):
        rd.Setup(rd.Plant(DOUBLE), [0.3, -0.4], controller=Law(given))


@pytest.mark.parametrize("period", [-0.1, np.nan, np.inf, 1e-15, "often", None, True, [0.1, 0.2]], ids=str)
def test_a_period_of_ones_own_controller_is_a_time(period: object) -> None:
    with pytest.raises(QueryError, match="period_s of the controller must be"):
        rd.Setup(rd.Plant(DOUBLE), [0.3, -0.4], controller=Law(np.ones(2), period))


def test_a_plant_in_ball_arithmetic_is_refused() -> None:
    """Runs are floats: balls in a float array are not numbers at all."""
    with pytest.raises(QueryError, match="plant: runs are computed in floats"):
        rd.Setup(rd.Plant(rd.Lagrangian(DOUBLE, rd.accuracy.Ball(60))), [0.3, -0.4])


def test_a_companion_whose_energy_overflows_is_no_end_of_the_run() -> None:
    """RK4 is stable at ω h = 2.5; at 4 h a step multiplies q by 400, and in 64 steps ½ k q² overflows, q does not."""
    cart = rd.load("cart_pole").with_(lock={"hinge": 0.3})
    k = float(cart.M([0.0])[0, 0]) * 2.5e3**2
    run = rd.simulate(
        rd.Plant(cart, [rd.effects.Spring(k)]), q0=[0.4], duration_s=1.0, engine="interpreted", method="RK4"
    )
    assert run.outcome.ending == "finished"
    assert run.error is not None and "step" in run.error.note


@final
@dataclass(frozen=True, eq=False)
class WithoutEnergy(Conservative):
    """A potential that has no value after 50 ms."""

    def torque(self, dynamics, t, q, v):
        return 0 * v

    def potential(self, dynamics, t, q):
        if np.max(t) > 0.05:
            raise rd.RobotDynError("the potential has no value")
        return 0 * q[..., 0]


@pytest.mark.parametrize("engine", ["interpreted", "auto"])
def test_a_look_at_the_energy_that_fails_ends_the_run(engine: str) -> None:
    run = rd.simulate(rd.Plant(DOUBLE, [WithoutEnergy()]), **START, duration_s=0.2, engine=engine, method="RK4")
    assert run.outcome.ending == "diverged"
    assert 0.05 < run.outcome.t < 0.05 + 64e-3
    assert "the potential has no value" in run.outcome.text


@pytest.mark.parametrize("method", ["RK4", "DOP853"])
def test_an_interrupt_in_a_companion_run_ends_the_estimate_and_keeps_the_run(method, monkeypatch) -> None:
    """All samples are there, no other companion starts, and the outcome says where the interrupt came."""
    ran = []

    def on_second(advance):
        def interrupted(self, *arguments):
            ran.append(self)
            if len(ran) == 2:
                raise KeyboardInterrupt
            return advance(self, *arguments)

        return interrupted

    monkeypatch.setattr(Run, "_to_the_end", on_second(Run._to_the_end))
    run = rd.simulate(rd.Plant(DOUBLE), **START, duration_s=0.2, method=method, engine="interpreted")
    assert len(ran) == 2
    assert (run.outcome.ending, run.outcome.t) == ("stopped", 0.2)
    assert "in its error estimate" in run.outcome.text
    assert run.t[-1] == 0.2
    assert run.error is not None and "interrupted" in str(run.error)


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
@pytest.mark.parametrize("period", [0.0, 0.01])
def test_an_interrupt_before_the_first_step_leaves_the_start(engine: str, period: float, monkeypatch) -> None:
    """One sample, the state at 0 s; what a controller would have held is not known."""
    law = rd.control.PD(rd.control.hold([0.1, 0.2]), kp=3.0, kd=1.0, period_s=period)
    setup = rd.Setup(rd.Plant(DOUBLE), method="RK4", **START, duration_s=0.2, controller=law, engine=engine)
    rd.simulate(setup)  # compiled, and looked at, before

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(Run, "_to_the_end", interrupted)
    run = rd.simulate(setup)
    assert (run.outcome.ending, run.outcome.t) == ("stopped", 0.0)
    np.testing.assert_array_equal(run.t, [0.0])
    np.testing.assert_array_equal(run.q, [START["q0"]])
    assert run.summary.startswith("stopped at t = 0 s, 1 samples")
