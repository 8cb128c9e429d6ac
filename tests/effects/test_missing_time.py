"""Queries without t: allowed if no effect depends on the time, else refused with the name of the effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import MissingTimeError
from tests.user_parts import Push

ARM = rd.load("planar_2r")
Q, V, U = np.array([0.3, -0.8]), np.array([0.5, 0.4]), np.array([1.0, -2.0])
PLAN = rd.control.quintic(Q, Q + 1, 1.0)
FRICTION = rd.effects.ViscousFriction(0.3)
QUERIES: Mapping[str, Callable[..., Any]] = {
    "M": lambda plant, **at: plant.M(Q, **at),
    "C": lambda plant, **at: plant.C(Q, V, **at),
    "N": lambda plant, **at: plant.N(Q, V, **at),
    "torque": lambda plant, **at: plant.torque(Q, V, **at),
    "inverse_dynamics": lambda plant, **at: plant.inverse_dynamics(Q, V, U, **at),
    "forward_dynamics": lambda plant, **at: plant.forward_dynamics(Q, V, U, **at),
}
OF_PLANTS: Mapping[str, Callable[..., Any]] = {
    "held": lambda plant, **at: plant.held_joints(Q, V, U, **at),
    "linearise": lambda plant, **at: rd.linearise(plant, Q, V, U, **at).A,
    "why": lambda plant, **at: rd.why(plant, Q, V, U, "joint_1", **at).tau,
}
TIMED: Mapping[str, Callable[..., Any]] = {
    "product": lambda t, q, v: t * v,
    "sine": lambda t, q, v: np.sin(t) * v,
    "sine of math": lambda t, q, v: math.sin(t) * v,
    "condition": lambda t, q, v: v if t > 1 else q,
    "where": lambda t, q, v: np.where(t > 1, q, v),
    "table": lambda t, q, v: np.interp(t, [0.0, 1.0], [0.0, 1.0]) * v,
    "reference": lambda t, q, v: PLAN.at(t)[0] - q,
    "array": lambda t, q, v: np.asarray([t, 1.0]) + v,
    "float": lambda t, q, v: float(t) + v,
}
WINDOW = rd.effects.ExternalWrench("tip", [1.0, 0, 2, 0, -0.5, 0], start_s=0.2, end_s=0.6)
PAYLOAD = rd.effects.CarriedPayload(rd.Payload("tip", 1.0), 0.1, 0.2)


@pytest.mark.parametrize("query", QUERIES | OF_PLANTS)
def test_without_time_dependence_t_is_optional(query: str) -> None:
    plant = rd.Plant(ARM, [FRICTION, Push(lambda t, q, v: -v)])
    ask = (QUERIES | OF_PLANTS)[query]
    for each in (plant, rd.compiled(plant)) if query in QUERIES else (plant,):
        np.testing.assert_array_equal(ask(each), ask(each, t=0.4))


@pytest.mark.parametrize("does", TIMED)
def test_an_effect_that_uses_the_time_is_named(does: str) -> None:
    plant = rd.Plant(ARM, [FRICTION, Push(TIMED[does])])
    for ask in [QUERIES[name] for name in ("N", "torque", "inverse_dynamics", "forward_dynamics")] + [
        *OF_PLANTS.values()
    ]:
        with pytest.raises(MissingTimeError, match="push depends on the time: pass t="):
            ask(plant)
        ask(plant, t=0.4)


@pytest.mark.parametrize("does", ["product", "sine", "condition", "where"])
def test_machine_code_names_it_too(does: str) -> None:
    plant = rd.compiled(rd.Plant(ARM, [FRICTION, Push(TIMED[does])]))
    for states in (V, np.tile(V, (20, 1))):
        with pytest.raises(MissingTimeError, match="push depends on the time: pass t="):
            plant.forward_dynamics(states, states, states)


@pytest.mark.parametrize("query", QUERIES | OF_PLANTS)
def test_payloads_and_wrenches_of_a_time_need_it(query: str) -> None:
    """M and C depend on payloads only; the torque of the effects does not."""
    for effect in {"M": [PAYLOAD], "C": [PAYLOAD], "torque": [WINDOW]}.get(query, [PAYLOAD, WINDOW]):
        with pytest.raises(MissingTimeError, match=f"{effect.name} depends on the time: pass t="):
            (QUERIES | OF_PLANTS)[query](rd.Plant(ARM, [FRICTION, effect]))


def test_a_batch_of_a_compiled_plant_needs_no_time() -> None:
    plant, many = rd.compiled(rd.Plant(ARM, [FRICTION])), [np.tile(x, (20, 1)) for x in (Q, V, U)]
    np.testing.assert_array_equal(plant.forward_dynamics(*many), plant.forward_dynamics(*many, t=np.zeros(20)))
