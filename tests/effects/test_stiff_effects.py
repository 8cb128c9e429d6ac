"""Effects that bend within a small change of q or v: implicit methods get through them, others say why they do not."""

from __future__ import annotations

import re

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.integrate import System
from robot_dyn.simulation import StateEquation
from robot_dyn.simulation.engine.interpreted import interpreted, system
from robot_dyn.simulation.run.watch import Watch
from tests.long import long

ARM = rd.load("planar_2r")
START = {"q0": [0.4, -0.7], "v0": [0.3, 0.5], "engine": "interpreted", "estimate_error": False}
STIFF = rd.integrate.Adaptive("Rodas5P", 1e-6, 1e-9)


@pytest.mark.parametrize("width", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_jacobian_is_taken_inside_the_width_of_the_rate(width: float) -> None:
    """d/dy tanh(y / w) = (1 − tanh²) / w; across 6e-6 it would be 1.6e5 at most. It errs by (1/100)² / 3 or less."""
    y = np.array([0.3 * width, 1.0])
    system = System(
        lambda t, y: np.stack([np.tanh(y[..., 0] / width), y[..., 1] ** 2], -1), 0, np.array([width, np.inf])
    )
    expected = np.diag([(1 - np.tanh(0.3) ** 2) / width, 2.0])
    np.testing.assert_allclose(system.jacobian(0.0, y), expected, rtol=1e-4)


@pytest.mark.parametrize("width", [1e-5, 1e-7, 1e-9])
def test_the_jacobian_of_a_motion_knows_its_friction(width: float) -> None:
    """∂a/∂v of −f tanh(v / v_s) at v = 0 is −M⁻¹ f / v_s beside terms of order one; it errs by (1/100)² / 3."""
    equation = StateEquation(rd.Plant(ARM, [rd.effects.RegularisedCoulombFriction([3.0, 2.0], width)]), None)
    q = np.array([0.4, -0.7])
    setup = rd.Setup(equation.plant, q)
    functions, bounds = interpreted(equation, Watch(setup, equation)), np.array([0.0, 1.0])
    J = system(functions, equation, bounds, np.zeros((0, 1))).jacobian(0.5, equation.start(q, np.zeros(2)))
    expected = -np.linalg.inv(ARM.M(q)) * [3.0, 2.0] / width
    np.testing.assert_allclose(J[2:4, 2:4], expected, rtol=1e-4)


def test_radau_slides_to_rest_whatever_the_width_of_dry_friction() -> None:
    """What differs is the creep inside the width, at most v_s T. The others are near a common limit: 1e-4 of 1e-3."""
    runs = [
        rd.simulate(
            rd.Plant(ARM, [rd.effects.RegularisedCoulombFriction([9.0, 6.0], width)]),
            **START, duration_s=0.2, method=STIFF,
        )
        for width in (1e-4, 1e-7, 1e-9)
    ]  # fmt: skip
    assert [run.outcome.ending for run in runs] == ["finished"] * 3
    assert max(run.statistics.steps for run in runs) < 500
    for run in runs[:2]:
        np.testing.assert_allclose(run.q[-1], runs[2].q[-1], atol=1e-4)


@pytest.mark.parametrize("stiffness", [1e8, 1e11, 1e13])
def test_rosenbrock_bounces_off_a_stop_whatever_its_stiffness(stiffness: float) -> None:
    """At 1 m/s into an elastic stop and back: q = 2 q_stop − v T + v π √(m / k); the tolerance is 1e-6 a step."""
    cart = rd.load("cart_pole").with_(lock={"hinge": 0.3})
    run = rd.simulate(
        rd.Plant(cart, [rd.effects.JointStopSpring(-1.0, 0.1, stiffness)]), q0=[0.0], v0=[1.0], duration_s=0.15,
        engine="interpreted", estimate_error=False, method=STIFF,
    )  # fmt: skip
    assert run.outcome.ending == "finished"
    assert run.statistics.steps < 500
    contact = np.pi * np.sqrt(float(cart.M([0.0])[0, 0]) / stiffness)
    np.testing.assert_allclose(run.q[-1], 0.2 - 0.15 + contact, atol=1e-5)


@pytest.mark.parametrize(
    ("method", "verdict"),
    [
        *long([(rd.integrate.Adaptive(), "is stiff: use Rodas5P, softer effects")]),
        (rd.integrate.method("GaussLegendre2"), "do not converge.*use a smaller step, or a method for stiff systems"),
    ],
    ids=["DOP853", "GaussLegendre2"],
)
def test_a_run_that_does_not_get_on_ends_with_a_verdict(method, verdict: str) -> None:
    """Dry friction of a width that no step resolves: the outcome names the effect, the joint and the remedy."""
    plant = rd.Plant(
        ARM, [rd.effects.ViscousFriction(0.1), rd.effects.RegularisedCoulombFriction([30.0, 20.0], [1.0, 1e-13])]
    )
    run = rd.simulate(plant, **START, duration_s=5.0, method=method)
    assert run.outcome.ending == "diverged"
    assert run.outcome.t < 5.0
    assert re.search(verdict, run.outcome.text)
    assert "regularised_coulomb_friction of joint 'joint_2' bends within 1.0e-13" in run.outcome.text
