"""Which motion is the fastest, of which joint, and by which effect."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.stiffness import BODIES, fastest

ARM = rd.load("planar_2r")
STATE = np.array([0.4, -0.7, 0.13, -0.25])


def found(effects: list[rd.Effect], controller: rd.Controller | None = None, held: np.ndarray | None = None):
    equation = StateEquation(rd.Plant(ARM, effects), controller)
    return fastest(equation, 0.2, np.concatenate([STATE, np.zeros(equation.size - 4)]), held)


@pytest.mark.parametrize(("b", "joint"), [([1e5, 1.0], "joint_1"), ([1.0, 1e5], "joint_2")])
def test_a_damper_is_named_with_its_joint(b: list[float], joint: str) -> None:
    """λ is that of −M⁻¹ b but for other motions, 1e-4 of it."""
    made = found([rd.Spring(3.0), rd.ViscousFriction(b)])
    expected = np.linalg.eigvals(-np.linalg.solve(ARM.M(STATE[:2]), np.diag(b)))
    assert made.eigenvalue == pytest.approx(expected.real.min(), rel=1e-4)
    assert (made.joint, made.source) == (joint, "viscous_friction")
    assert str(made).startswith("the fastest motion decays with")


def test_springs_control_and_narrow_friction_are_told_apart() -> None:
    damper = rd.ViscousFriction(0.3)
    made = found([damper, rd.Spring([1.0, 1e8])])
    assert (made.joint, made.source) == ("joint_2", "spring")
    assert abs(made.eigenvalue) == pytest.approx(abs(made.eigenvalue.imag), rel=1e-3)
    assert "changes with" in str(made)
    law = rd.PD(rd.hold([0.1, 0.2]), [10.0, 10.0], [1e6, 1.0])
    made = found([damper], law)
    assert (made.joint, made.source) == ("joint_1", "control")
    slow = found([damper], law, held=np.zeros(2))  # in zero-order hold it has no slope
    assert slow.source in ("viscous_friction", BODIES)
    assert abs(slow.eigenvalue) < 100
    friction = rd.RegularisedCoulombFriction([1.0, 2.0], [0.5, 1e-6])
    near = StateEquation(rd.Plant(ARM, [damper, friction]), None)
    made = fastest(near, 0.0, np.array([0.4, -0.7, 0.1, 3e-7, 0.0, 0.0, 0.0]), None)
    assert (made.joint, made.source) == ("joint_2", "regularised_coulomb_friction")


def test_without_effects_it_is_the_bodies() -> None:
    assert found([]).source == BODIES
