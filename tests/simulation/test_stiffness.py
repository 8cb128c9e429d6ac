"""Which motion is the fastest, of which joint, and by which effect."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.integrate import System
from robot_dyn.simulation import RemarkKind, StateEquation
from robot_dyn.simulation.dynamics.fastest_motion import BODIES, fastest
from tests.long import long

ARM = rd.load("planar_2r")
STATE = np.array([0.4, -0.7, 0.13, -0.25])


def found(effects: list[rd.Effect], controller: rd.control.Controller | None = None, held: np.ndarray | None = None):
    equation = StateEquation(rd.Plant(ARM, effects), controller)
    return fastest(equation, 0.2, np.concatenate([STATE, np.zeros(equation.size - 4)]), held)


@pytest.mark.parametrize(("b", "joint"), [([1e5, 1.0], "joint_1"), ([1.0, 1e5], "joint_2")])
def test_a_damper_is_named_with_its_joint(b: list[float], joint: str) -> None:
    """λ is that of −M⁻¹ b but for other motions, 1e-4 of it."""
    made = found([rd.effects.Spring(3.0), rd.effects.ViscousFriction(b)])
    expected = np.linalg.eigvals(-np.linalg.solve(ARM.M(STATE[:2]), np.diag(b)))
    assert made.eigenvalue == pytest.approx(expected.real.min(), rel=1e-4)
    assert (made.joint, made.source) == (joint, "viscous_friction")
    assert str(made).startswith("the fastest motion, at joint ") and "decays at" in str(made)


def test_springs_control_and_narrow_friction_are_told_apart() -> None:
    damper = rd.effects.ViscousFriction(0.3)
    made = found([damper, rd.effects.Spring([1.0, 1e8])])
    assert (made.joint, made.source) == ("joint_2", "spring")
    assert abs(made.eigenvalue) == pytest.approx(abs(made.eigenvalue.imag), rel=1e-3)
    assert "changes at" in str(made)
    law = rd.control.PD(rd.control.hold([0.1, 0.2]), kp=[10.0, 10.0], kd=[1e6, 1.0])
    made = found([damper], law)
    assert (made.joint, made.source) == ("joint_1", "control")
    slow = found([damper], law, held=np.zeros(2))  # in zero-order hold it has no slope
    assert slow.source in ("viscous_friction", BODIES)
    assert abs(slow.eigenvalue) < 100
    friction = rd.effects.RegularisedCoulombFriction([1.0, 2.0], [0.5, 1e-6])
    near = StateEquation(rd.Plant(ARM, [damper, friction]), None)
    made = fastest(near, 0.0, np.array([0.4, -0.7, 0.1, 3e-7, 0.0, 0.0, 0.0]), None)
    assert (made.joint, made.source) == ("joint_2", "regularised_coulomb_friction")


def test_without_effects_it_is_the_bodies() -> None:
    assert found([]).source == BODIES


def test_a_run_says_that_stability_bounds_its_steps() -> None:
    """With the joint and the effect, where a damper is stiff and motion has decayed; not where the tolerance does."""
    options: dict[str, Any] = {"q0": STATE[:2], "duration_s": 0.1, "engine": "compiled", "estimate_error": False}
    options |= {"method": "DOP853"}
    stiff = rd.simulate(rd.Plant(ARM, [rd.effects.ViscousFriction([1.0, 1e4])]), **options)
    (remark,) = (each for each in stiff.remarks if each.kind is RemarkKind.STIFF)
    assert stiff.statistics.steps > 1000
    assert remark.joint == "joint_2"
    assert "steps bounded by stability: the fastest motion, at joint " in stiff.summary
    assert "due to 'viscous_friction'; use method='Rodas5P'" in stiff.summary
    short = rd.simulate(ARM, **options | {"duration_s": 20.0, "method": rd.integrate.Adaptive(rtol=1e-13, atol=1e-13)})
    assert short.statistics.steps > 1000
    assert not [each for each in short.remarks if each.kind is RemarkKind.STIFF]


@pytest.mark.parametrize("engine", ["compiled", *long(["interpreted"])])
def test_a_run_that_stability_would_keep_for_hours_ends_with_the_reason(engine: str) -> None:
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction([1.0, 1e6])])
    run = rd.simulate(plant, STATE[:2], duration_s=100.0, engine=engine, estimate_error=False, method="DOP853")
    assert run.outcome.ending == "diverged"
    assert run.outcome.t < 1.0
    assert re.search(
        "at joint 'joint_2', decays at .* due to 'viscous_friction': use Rodas5P, softer", run.outcome.text
    )


def test_a_stiff_run_is_made_by_the_stiff_method_unless_another_is_named() -> None:
    """Both are right to their estimates; the first takes a few of the steps, and says why."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction([1.0, 1e4])])
    chosen, named = (rd.simulate(plant, STATE[:2], duration_s=0.5, method=name) for name in ("auto", "DOP853"))
    assert chosen.statistics.method == "Rodas5P"
    assert 20 * chosen.statistics.steps < named.statistics.steps
    assert np.abs(chosen.q - named.q).max() < 3 * (
        chosen.error.largest + named.error.largest
    )  # estimates may be 0.3 of it
    (remark,) = (each for each in chosen.remarks if each.kind is RemarkKind.STIFF)
    assert remark.joint == "joint_2"
    assert "due to 'viscous_friction'; made by Rodas5P instead of DOP853" in chosen.summary


@pytest.mark.parametrize(
    ("effects", "tolerance"),
    [([], 1e-13), ([rd.effects.Spring(1e6)], 1e-10)],
    ids=["bounded by its tolerance", "stiff springs, which an L-stable method would damp"],
)
def test_other_runs_are_those_of_the_explicit_method(effects: list[rd.Effect], tolerance: float) -> None:
    """To the last bit, looks included: both take more steps than the first look waits for."""
    options: dict[str, Any] = {"q0": STATE[:2], "duration_s": 5.0 if effects else 20.0, "estimate_error": False}
    chosen, named = (
        rd.simulate(rd.Plant(ARM, effects), **options, method=rd.integrate.Adaptive(name, tolerance, tolerance))
        for name in ("auto", "DOP853")
    )
    assert chosen.statistics.steps > 600
    assert chosen.statistics.method == "DOP853"
    np.testing.assert_array_equal(chosen.q, named.q)


def test_rollouts_are_made_by_the_explicit_method_and_equations_name_one() -> None:
    """Where a method is to be chosen: no run of many is another's, and a plain equation has nothing to look at."""
    chosen, named = (rd.rollouts(ARM, [STATE[:2]], duration_s=0.2, method=name) for name in ("auto", "DOP853"))
    np.testing.assert_array_equal(chosen.q, named.q)
    with pytest.raises(QueryError, match="use 'DOP853' or 'Rodas5P'"):
        rd.integrate.Adaptive("auto").solve(System(lambda t, y: -y, 1), 0.0, np.ones(2), 1.0)
