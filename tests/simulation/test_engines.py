"""The compiled engine is the interpreted one: same steps, same runs, same ends; and the choice between them is told."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError, TraceError
from robot_dyn.integrate import FIXED_STEP
from robot_dyn.model import with_exact_right_angles
from robot_dyn.simulation import MachineError, Run, StateEquation, choose
from robot_dyn.simulation.compiled.self_check import check
from robot_dyn.simulation.run.watch import Watch
from tests.long import long, stress, third
from tests.own_method import OwnImplicit
from tests.user_parts import Push

ARM = rd.load("planar_2r")
UR5 = with_exact_right_angles(rd.load("ur5"))[0]  # its file states right angles with too few digits
Q, V = np.array([0.4, -0.7]), np.array([0.3, 0.5])
REFERENCE = rd.control.via_points([0.05, 0.1, 0.2], [Q, Q + 0.3, Q - 0.2], kind="cubic")
CONTROLLERS = {
    "none": None,
    "PD": rd.control.PD(rd.control.hold(Q), kp=40.0, kd=[4.0, 3.0]),
    "PD, sampled": rd.control.PD(REFERENCE, kp=40.0, kd=4.0, period_s=0.01),
    "PID": rd.control.PID(REFERENCE, kp=40.0, ki=30.0, kd=4.0, effort_limit=3.0),
    "PID, sampled": rd.control.PID(REFERENCE, kp=40.0, ki=30.0, kd=4.0, effort_limit=[3.0, np.inf], period_s=0.004),
    "PD and gravity": rd.control.PDGravity(ARM, REFERENCE, kp=40.0, kd=4.0),
    "feed forward": rd.control.FeedForward(ARM, REFERENCE, kp=40.0, kd=4.0),
    "computed torque": rd.control.ComputedTorque(ARM.with_(gravity=(0.0, 0.0, -9.0)), REFERENCE, kp=40.0, kd=9.0),
}
LINK = ARM.frame_names[-1]
EFFECTS = {
    "viscous friction": [rd.effects.ViscousFriction([0.3, 0.1])],
    "dry friction": [rd.effects.RegularisedCoulombFriction(0.4, 0.1)],
    "spring": [rd.effects.Spring([3.0, 1.0], 0.2)],
    "stops": rd.effects.joint_stops([-0.5, -0.75], [0.45, 2.0], 1e3, 1e2),
    "effort limit": [rd.effects.EffortLimit([2.0, np.inf])],
    "wrench": [rd.effects.ExternalWrench(LINK, [3, 2, 1, 0.1, 0.2, 0.3], "body", start_s=0.04, end_s=0.13)],
    "two wrenches": [
        rd.effects.ExternalWrench(LINK, [3, 2, 1, 0.1, 0.2, 0.3]),
        rd.effects.ExternalWrench(LINK, [0, 2, 1, 0.1, 0.2, 0.3], "world", start_s=0.1),
    ],
}
SOME = ("RK4", "GaussLegendre4")  # in (q, v) and in (q, p)


def both(**options) -> tuple[rd.Trajectory, rd.Trajectory]:
    """A run in machine code and the same interpreted."""
    plant = rd.Plant(options.pop("robot", ARM), options.pop("effects", ()))
    setup = rd.Setup(plant, **{"q0": Q, "v0": V, "duration_s": 0.25, "method": "RK4", "step_s": 1e-3} | options)
    return rd.simulate(setup, engine="compiled"), rd.simulate(setup, engine="interpreted")


def check_equal(ours: rd.Trajectory, theirs: rd.Trajectory, tolerance: float) -> None:
    """All that a run tells, each array by its own size."""
    assert ours.outcome == theirs.outcome
    assert ours.statistics.steps == theirs.statistics.steps
    np.testing.assert_array_equal(ours.t, theirs.t)
    pairs = [(getattr(ours, name), getattr(theirs, name)) for name in ("q", "v", "a", "u")]
    pairs += [(ours.ledger.kinetic, theirs.ledger.kinetic), (ours.ledger.potential, theirs.ledger.potential)]
    assert list(ours.power) == list(theirs.power) and list(ours.ledger.work) == list(theirs.ledger.work)
    pairs += [(ours.power[name], theirs.power[name]) for name in ours.power]
    pairs += [(ours.ledger.work[name], theirs.ledger.work[name]) for name in ours.power]
    for mine, other in pairs:
        assert mine.shape == other.shape
        np.testing.assert_allclose(mine, other, rtol=0, atol=tolerance * (1 + np.abs(other).max()))
    assert (ours.error is None) == (theirs.error is None)
    if ours.error is not None and theirs.error is not None:
        assert (ours.error.note, ours.error.until_s) == (theirs.error.note, theirs.error.until_s)
        np.testing.assert_array_equal(ours.error.t, theirs.error.t)
        np.testing.assert_allclose(ours.error.error, theirs.error.error, rtol=1e-3, atol=1e-11)


@pytest.mark.parametrize("name", [*SOME, *third(name for name in FIXED_STEP if name not in SOME)])
def test_each_method_makes_the_interpreted_step(name: str) -> None:
    """One step from equal states: the machine's own check, 1e-13 of the state's size, and a run of 60 steps."""
    ours, theirs = both(method=rd.integrate.method(name), duration_s=0.06, controller=CONTROLLERS["PD"])
    check_equal(ours, theirs, 1e-12)  # 60 steps of rounding, amplified by the gains
    assert ours.statistics.engine == "compiled" and ", compiled\n" in ours.summary
    assert theirs.statistics.engine.startswith("interpreted")
    np.testing.assert_allclose(ours.q[1], theirs.q[1], rtol=1e-13)


@pytest.mark.parametrize(
    "name",
    ["PD, sampled", "computed torque", "PID, sampled", *third(["none", "PD", "PID", "PD and gravity", "feed forward"])],
)
def test_each_controller_drives_the_same_run(name: str) -> None:
    """Memory, ticks and the breaks of a reference included; a cubic spline's acceleration jumps where it ends."""
    ours, theirs = both(controller=CONTROLLERS[name])
    check_equal(ours, theirs, 1e-11)


@pytest.mark.parametrize("name", EFFECTS)
def test_each_effect_acts_alike(name: str) -> None:
    ours, theirs = both(effects=EFFECTS[name], controller=CONTROLLERS["PD"])
    check_equal(ours, theirs, 1e-11)
    for link, wrench in theirs.wrenches.items():
        np.testing.assert_allclose(ours.wrenches[link], wrench, atol=1e-11)


@pytest.mark.parametrize("method", [*long(["RK4"]), *stress(["GaussLegendre4"])])
def test_six_joints_under_all_at_once(method: str) -> None:
    q = np.array([0.3, -0.6, 0.4, -1.2, 0.5, 1.1])
    effects = [
        rd.effects.ViscousFriction(0.5),
        rd.effects.EffortLimit("urdf"),
        rd.effects.ExternalWrench("tool0", [5, 3, 1, 0.1, 0.2, 0.3]),
    ]
    controller = rd.control.ComputedTorque(UR5, rd.control.quintic(q, q + 0.4, 0.1), kp=100.0, kd=20.0)
    options = {"q0": q, "v0": 0 * q, "robot": UR5, "effects": effects, "controller": controller, "duration_s": 0.12}
    check_equal(*both(method=rd.integrate.method(method), **options), 1e-11)


@pytest.mark.parametrize("period", [0.0, 0.0025, 0.01, 0.07])
def test_samples_lie_at_the_recording_times(period: float) -> None:
    check_equal(*both(record_every_s=period), 1e-12)


def test_a_method_in_python_takes_the_rate_in_machine_code() -> None:
    """Its Jacobian is exact there, and by differences where the run is interpreted."""
    ours, theirs = both(method=OwnImplicit(), controller=CONTROLLERS["PID"], duration_s=0.1)
    assert ours.statistics.engine.startswith("compiled (the equation of motion")
    np.testing.assert_allclose(ours.q, theirs.q, atol=1e-9)
    np.testing.assert_allclose(ours.u, theirs.u, atol=1e-6)
    assert ours.outcome == theirs.outcome


DIVERGING = {
    "a number overflows": {"controller": rd.control.PD(rd.control.hold(Q), kp=1e9, kd=1e7)},
    "energy grows": {
        "controller": rd.control.PD(rd.control.hold(Q), kp=3e4, kd=0.0),
        "method": "RK4",
        "step_s": 0.05,
        "duration_s": 20.0,
    },
    "stages are not found": {
        "controller": rd.control.PD(rd.control.hold(Q), kp=1e7, kd=0.0),
        "method": rd.integrate.method("GaussLegendre2"),
    },
    "a tick asks for no finite torque": {
        "controller": rd.control.PD(rd.control.hold(Q), kp=1e9, kd=1e7, period_s=0.01)
    },
}


@pytest.mark.parametrize("name", DIVERGING)
def test_a_run_that_diverges_ends_alike(name: str) -> None:
    """Up to rounding, which an explosion multiplies: the same ending, within a few steps, and the same advice."""
    ours, theirs = both(estimate_error=False, **DIVERGING[name])
    assert ours.outcome.ending == theirs.outcome.ending == "diverged"
    assert ours.outcome.t == pytest.approx(theirs.outcome.t, abs=0.011)
    assert ours.outcome.text.split(";")[-1].split("at t")[0] == theirs.outcome.text.split(";")[-1].split("at t")[0]
    assert np.isfinite(ours.q).all() and abs(len(ours.t) - len(theirs.t)) <= 11


def test_progress_is_told_and_an_interrupt_keeps_the_samples() -> None:
    seen: list[float] = []

    def progress(t: float) -> None:
        seen.append(t)
        if len(seen) == 2:
            raise KeyboardInterrupt

    setup = rd.Setup(rd.Plant(ARM), Q, duration_s=400.0, record_every_s=0.1, engine="compiled", method="RK4")
    run = rd.simulate(setup, on_progress=progress)
    assert run.outcome.ending == "stopped" and run.error is None
    assert 0 < run.t[-1] <= run.outcome.t == seen[-1] < 400.0
    assert len(run.t) == len(np.arange(0, run.t[-1] + 0.05, 0.1))
    assert np.isfinite(run.q).all()


def test_a_reference_that_jumps_between_rests() -> None:
    """Steps end at the jump, so that both engines see the same constant on either side."""
    jump = rd.control.PiecewisePolynomial([0, 0.1, 0.2], [[Q], [Q + 1]])
    law = rd.control.PD(jump, kp=10.0, kd=1.0)
    setup = rd.Setup(rd.Plant(ARM), Q, None, 0.2, law, "RK4", estimate_error=False)
    run = rd.simulate(setup, engine="interpreted")
    assert np.abs(run.q[-1] - Q).max() > 0.01
    check_equal(rd.simulate(setup, engine="compiled"), run, 1e-12)


def test_what_cannot_be_compiled_is_named() -> None:
    looked_up = Push(lambda t, q, v: np.array([0.1, 0.2])[int(10 * t) % 2] * v)
    with pytest.raises(TraceError, match=r"effect push cannot be compiled .*engine='interpreted'"):
        rd.simulate(rd.Plant(ARM, [looked_up]), q0=Q, engine="compiled")
    with pytest.raises(QueryError, match="no engine 'fast'; nearest: auto"):
        rd.Setup(rd.Plant(ARM), Q, engine="fast")


def test_auto_compiles_where_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Evaluations times their cost: a second of motion is short, an hour is not."""
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    setup = rd.Setup(rd.Plant(ARM.with_(mass_scale=1.01)), Q, duration_s=1.0, method="RK4")
    assert choose(setup).label == "interpreted (the run is too short to compile)"
    long = replace(setup, duration_s=3600.0)
    assert choose(long).label == "compiled"


def test_auto_compiles_what_is_asked_for_again_as_often_as_compiling_takes(monkeypatch) -> None:
    """Each run has 8000 evaluations; three of them as many as compiling takes, loop included."""
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    setup = rd.Setup(rd.Plant(ARM.with_(mass_scale=1.02)), Q, duration_s=1.0, method="RK4")
    said = [choose(setup).label for _ in range(3)]
    assert said[0] == "interpreted (the run is too short to compile)"
    assert said[2] == "compiled"


SHORT = """
import robot_dyn as rd, sys
arm = rd.load("planar_2r")
run = rd.simulate(arm, [0.4, -0.7], [0.3, 0.9], duration_s=0.2, method="RK4", engine=sys.argv[1])
print(run.statistics.engine, *run.q[-1].tolist(), run.error.largest, sep=";")
"""


def test_a_second_process_takes_the_machine_code_of_the_store_for_a_short_run(tmp_path) -> None:
    """Which is within the estimates of what is interpreted before anything is there."""

    def run(engine: str) -> tuple[str, np.ndarray, float]:
        place, code = os.environ | {"ROBOT_DYN_CACHE": str(tmp_path / "store")}, [sys.executable, "-c", SHORT, engine]
        said, *q, error = subprocess.run(code, check=True, env=place, capture_output=True, text=True).stdout.split(";")
        return said, np.array(q, float), float(error)

    before, made, after = run("auto"), run("compiled"), run("auto")
    assert before[0] == "interpreted (the run is too short to compile)"
    assert [made[0], after[0]] == ["compiled", "compiled"]
    assert np.array_equal(made[1], after[1])
    assert np.abs(before[1] - after[1]).max() <= before[2] + after[2]


def test_a_machine_that_disagrees_is_refused(monkeypatch) -> None:
    """The interpreted equation has another gravity than the compiled one: the self check refuses it."""
    from robot_dyn.simulation import machine_code

    setup = rd.Setup(rd.Plant(ARM), Q)
    made = machine_code(StateEquation(setup.plant, None), rd.integrate.method("RK4"))
    check(made, setup)
    code = replace(made.code, checked={})
    other = replace(
        made, compiled_form=StateEquation(rd.Plant(ARM.with_(gravity=(0.0, 0.0, -9.80664))), None), code=code
    )
    with pytest.raises(
        MachineError, match=r"differs from the interpreted one by .* allowed: take engine='interpreted'"
    ):
        check(other, setup)


class Borrowed:
    """An engine of no class of the library: it returns what another one returns."""

    def __init__(self, engine: Any) -> None:
        self.engine = engine

    def __getattr__(self, name: str) -> Any:
        return getattr(self.engine, name)


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
def test_a_run_takes_any_engine(engine: str) -> None:
    """A run reads the protocol alone, also where it restarts its functions at events."""
    plant = rd.Plant(ARM, [rd.effects.DryFriction([0.2, 0.1])])
    setup = rd.Setup(plant, Q, duration_s=0.3, engine=engine, estimate_error=False)
    runs = [Run(setup, each).record() for each in (choose(setup), Borrowed(choose(setup)))]
    assert len(runs[0].events) > 0
    np.testing.assert_array_equal(runs[0].y, runs[1].y)


def test_both_engines_have_the_same_functions() -> None:
    """y', u, K, V, masses and loads of one state; to 1e-12 of their size, some hundred roundings."""
    plant = rd.Plant(ARM, [rd.effects.DryFriction([0.2, 0.1]), rd.effects.ViscousFriction(0.4)])
    setup = rd.Setup(plant, Q, [0.3, -0.8], engine="compiled")
    equation, n = setup.equation, ARM.n
    sizes = {"rate": equation.size + n, "energy": 2, "bodies": n * n + n}
    y, p = equation.start(setup.q0, setup.v0)[:, None], np.array([0.0, 1.0])
    results = []
    for engine in (choose(setup), choose(replace(setup, engine="interpreted"))):
        _, functions, numbers = engine.evaluated(equation, Watch(setup, equation))
        out = {name: np.empty((size, 1)) for name, size in sizes.items()}
        for name, x in out.items():
            getattr(functions, name)(0.2, y, p, numbers[:, None], x)
        results.append(np.concatenate([*out.values()]))
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12, atol=1e-12)
