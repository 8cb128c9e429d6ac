"""CasADi Functions against the library: values, shapes, derivatives, open parameters."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import ExportError, QueryError
from robot_dyn.tools import export

QUANTITIES = "M", "C", "N", "inverse_dynamics", "forward_dynamics"
ARM = rd.load("cart_pole")
PLANT = rd.Plant(ARM, [rd.effects.ViscousFriction([0.3, 0.2]), rd.effects.RegularisedCoulombFriction(0.4)])
Q, V, U = np.array([[0.3, -0.4], [0.7, 1.1], [1.3, 0.9]])


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("of", [ARM, PLANT], ids=["arm", "plant"])
def test_values_are_those_of_the_library(quantity: str, of: rd.Robot | rd.Plant) -> None:
    """To 1e-13: sums of some ten terms of size 10."""
    function = export.casadi(of, quantity)
    arguments = [{"q": Q, "v": V}.get(name, U) for name in function.name_in()]
    expected = getattr(of, quantity)(*arguments)
    result = np.array(function(*arguments))
    assert result.shape == (expected.shape if quantity in ("M", "C") else (2, 1))
    assert np.allclose(result.reshape(expected.shape), expected, rtol=0, atol=1e-13)


def test_derivatives_are_those_of_the_compiled_arm() -> None:
    function = export.casadi(ARM, "forward_dynamics")
    ours = [np.array(J) for J in function.jacobian()(Q, V, U, 0)]
    theirs = rd.compiled(ARM).forward_dynamics_derivatives(Q, V, U)
    assert all(np.allclose(x, y, rtol=1e-12, atol=1e-12) for x, y in zip(ours, theirs, strict=True))


def test_open_parameters_are_an_input() -> None:
    function = export.casadi(PLANT, "N", open_parameters=True)
    values = export.parameter_values(PLANT)
    assert function.name_in() == ["q", "v", "p"]
    assert np.allclose(np.array(function(Q, V, np.concatenate([*values.values()])))[:, 0], PLANT.N(Q, V), atol=1e-13)
    values["viscous_friction.viscous"] = np.array([1.0, 2.0])
    other = rd.Plant(ARM, [rd.effects.ViscousFriction([1.0, 2.0]), *PLANT.effects[1:]])
    assert np.allclose(np.array(function(Q, V, np.concatenate([*values.values()])))[:, 0], other.N(Q, V), atol=1e-13)
    assert export.casadi(PLANT, "M", open_parameters=True).name_in() == ["q", "p"]
    assert export.parameter_values(rd.Plant(ARM)).keys() == {"gravity"}


def test_a_function_is_of_symbols_that_an_optimiser_can_differentiate_twice() -> None:
    function = export.casadi(PLANT, "forward_dynamics")
    assert function.is_a("SXFunction")
    q = ca.SX.sym("q", 2)
    hessian, _ = ca.hessian(function(q, V, U)[0], q)
    assert hessian.shape == (2, 2)


def test_wrong_effects_and_names_are_refused() -> None:
    with pytest.raises(ExportError, match="dry_friction"):
        export.casadi(rd.Plant(ARM, [rd.effects.DryFriction(0.1)]), "M")
    with pytest.raises(QueryError, match="inverse_dynamics"):
        export.casadi(ARM, "ID")
