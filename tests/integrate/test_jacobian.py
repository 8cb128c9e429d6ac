"""The Jacobian of the state equation: machine code against longdouble and closed forms, and when it is made."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.integrate import System
from robot_dyn.simulation import MachineError, StateEquation, machine_code, segment_table
from robot_dyn.simulation.compiled.self_check import check, jacobian_error

HAS_LONGDOUBLE = np.finfo(np.longdouble).nmant > 52
ARM = rd.load("planar_2r")
START: dict[str, Any] = {"q0": [0.4, -0.7], "v0": [0.3, 0.5]}
EFFECTS = (
    rd.effects.ViscousFriction([0.4, 0.2]),
    rd.effects.RegularisedCoulombFriction([1.3, 0.7], 0.2),
    rd.effects.Spring([3.0, 5.0], [0.1, 0.2]),
    *rd.effects.joint_stops([-1.0, -0.6], [0.3, 1.0], 1e5, 1e4),  # both joints lie beyond one
)
LAW = rd.control.PID(
    rd.control.quintic([0.0, 0.1], [0.5, 0.9], 1.0, v0=0.3, v1=[0.2, 0.4]), kp=[20.0, 9.0], ki=[4.0, 2.0], kd=[3.0, 1.0]
)
STATE = np.array([0.4, -0.7, 0.13, -0.25, 0.02, -0.03, 0.5, -0.1, -0.2, -0.3])


def setup(**options: Any) -> rd.Setup:
    return rd.Setup(rd.Plant(ARM, EFFECTS), **START, **{"controller": LAW, "duration_s": 1.0} | options)


def equation_of(made: rd.Setup) -> StateEquation:
    return StateEquation(made.plant, made.controller)


def exact_jacobian(made: rd.Setup, t: float, y: np.ndarray) -> np.ndarray:
    """∂f/∂y_j for each j, then ∂f/∂t, of machine code."""
    machine = machine_code(equation_of(made), rd.integrate.method("Rodas5PFixed"))
    out, m = np.empty((len(y) + 1, len(y), 1)), len(y)
    p, run_parameters = segment_table(made).parameters[0], machine.run_parameters({})
    machine.in_python.jacobian(t, np.ascontiguousarray(y)[:, None], p, run_parameters, out)
    assert out.shape == (m + 1, m, 1)
    return out[:, :, 0]


@pytest.mark.skipif(not HAS_LONGDOUBLE, reason="np.longdouble is float64 here")
def test_it_is_that_of_the_equations_in_longdouble() -> None:
    """Of gains, friction, springs, stops and states of the controller; differences of order 4 are right to 1e-11."""
    made = setup()
    plant = rd.Plant(rd.Lagrangian(ARM, np.longdouble), EFFECTS)
    equation = StateEquation(plant, LAW)
    span, J = np.longdouble(1e-4), exact_jacobian(made, 0.37, STATE)
    for j in range(len(STATE)):
        shift = np.eye(len(STATE), dtype=np.longdouble)[j] * span
        f2, f1, b1, b2 = (equation.rate(0.37, STATE + k * shift, None)[0] for k in (2, 1, -1, -2))
        expected = ((8 * (f1 - b1) - (f2 - b2)) / (12 * span)).astype(float)
        np.testing.assert_allclose(J[j], expected, rtol=0, atol=1e-10 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("t", [0.37, 0.0, 1.0])
def test_it_knows_how_the_reference_moves(t: float) -> None:
    """∂a/∂t = M⁻¹ (kp q̇_d + kd q̈_d); at the ends of the run, too, where time is kept within it."""
    made = setup()
    _, v, a = LAW.reference.at(min(max(t, 1e-15), 1 - 1e-15))
    rate = exact_jacobian(made, t, STATE)[-1]
    expected = np.linalg.solve(ARM.M(STATE[:2]), LAW.kp * v + LAW.kd * a)
    assert np.abs(expected).max() > 1
    np.testing.assert_allclose(rate[2:4], expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(rate[:2], 0.0)


def test_it_is_held_to_differences_of_the_interpreted_equation() -> None:
    """What is off in one entry by 1e-3 of the column is seen; rounding is not."""
    made = setup()
    equation, p = equation_of(made), segment_table(made).parameters[0]
    J = exact_jacobian(made, 0.37, STATE)
    assert jacobian_error(equation, 0.37, STATE, None, p, J) < 1
    for column in (1, 3, 5, len(STATE)):
        wrong = J.copy()
        wrong[column, 2] += 1e-3 * max(1.0, np.abs(J[column]).max())
        assert jacobian_error(equation, 0.37, STATE, None, p, wrong) > 1


def test_wrong_machine_code_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    made = machine_code(equation_of(setup()), rd.integrate.method("Rodas5PFixed"))
    wrong = replace(made, code=replace(made.code, checked={}))
    functions = made.in_python

    def jacobian(t: float, y: Any, p: Any, run_parameters: Any, out: np.ndarray) -> None:
        functions.jacobian(t, y, p, run_parameters, out)
        out[2 * 10 + 3] *= 1.01

    monkeypatch.setitem(wrong.__dict__, "in_python", functions._replace(jacobian=jacobian))
    with pytest.raises(MachineError, match="Jacobian of planar_2r differs"):
        check(wrong, setup())


def test_it_is_made_only_for_methods_that_need_it() -> None:
    equation = equation_of(setup())
    assert "jacobian" not in machine_code(equation, rd.integrate.method("RK4")).code.programs
    assert machine_code(equation).in_python.jacobian == 0
    assert "jacobian" in machine_code(equation, rd.integrate.method("Rodas5PFixed")).code.programs


def test_runs_in_lock_step_have_each_their_own() -> None:
    """With parameters that differ from run to run, and to the last bits of one run alone."""
    law = rd.control.PD(LAW.reference, kp=LAW.kp, kd=LAW.kd)
    made, lanes = setup(controller=law), 16
    rng = np.random.default_rng(3)
    damping = rng.uniform(0.1, 9.0, (lanes, 2))
    machine = machine_code(
        equation_of(made),
        rd.integrate.method("Rodas5PFixed"),
        lanes=lanes,
        extras=(),
        swept=("viscous_friction.viscous",),
    )
    m = machine.equation.size
    y, out = rng.normal(size=(m, lanes)), np.empty((m + 1, m, lanes))
    run_parameters = machine.run_parameters({"viscous_friction.viscous": damping})
    machine.in_python.jacobian(0.37, y, segment_table(made).parameters[0], run_parameters, out)
    for b in (0, 7, 15):
        effects = rd.effects.ViscousFriction(damping[b]), *EFFECTS[1:]
        alone = exact_jacobian(replace(made, plant=rd.Plant(ARM, effects)), 0.37, y[:, b])
        np.testing.assert_allclose(out[:, :, b], alone, rtol=0, atol=1e-13 * np.abs(alone).max())


def test_differences_are_named_in_the_summary() -> None:
    options = START | {"duration_s": 0.02, "step_s": 0.01, "method": "Rodas5PFixed", "estimate_error": False}
    labels = [rd.simulate(ARM, **options, engine=engine).statistics.engine for engine in ("interpreted", "compiled")]
    assert labels[0] == "interpreted (Jacobian by differences)"
    assert "differences" not in labels[1]
    assert "differences" not in rd.simulate(ARM, **options | {"method": "RK4"}).statistics.engine


@pytest.mark.parametrize("end", [0.3 + 0.1, 0.3 - 0.1, 0.3 + 1e-7])
def test_differences_by_time_stay_within_the_step(end: float) -> None:
    """A difference across its ends would be no derivative where an effect starts or stops there."""
    times: list[float] = []

    def rate(t: Any, y: np.ndarray) -> np.ndarray:
        times.append(float(t))
        return y * np.sin(3 * t)

    made = System(rate, 0).derivatives(0.3, np.array([2.0, -1.5]), end)
    assert min(times) >= min(0.3, end) and max(times) <= max(0.3, end)
    np.testing.assert_allclose(made[-1], np.array([2.0, -1.5]) * 3 * np.cos(0.9), rtol=1e-7)
