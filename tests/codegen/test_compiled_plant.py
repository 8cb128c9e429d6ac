"""Compiled plants against the interpreted ones: the effects are traced from the same lines."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Compiled
from robot_dyn.codegen import CompiledPlant, Trace
from robot_dyn.codegen.llvm import machine_code
from tests.codegen.arms import states
from tests.user_parts import Push

ROBOT = rd.load("planar_2r")
WINDOW = rd.effects.ExternalWrench(ROBOT.frame_names[-1], [1, 2, 3, 0.1, 0.2, 0.3], start_s=0.2, end_s=0.7)


def kick(t: float, q: Any, v: Any) -> Any:
    """A force with an if, which is in the kernel and not decided while tracing, and a comparison of arrays."""
    return np.where(v > 0, 1.0, -2.0) * q if t > 0.5 and q[..., 0] < 1 else 0 * q


EFFECTS: dict[str, list[Any]] = {
    "viscous": [rd.effects.ViscousFriction([0.3, 0.1])],
    "coulomb": [rd.effects.RegularisedCoulombFriction(0.5, 0.1)],
    "spring": [rd.effects.Spring(2.0, 0.1)],
    "stops": [*rd.effects.joint_stops(-1.0, 1.0)],
    "wrench": [WINDOW],
    "bound": [rd.effects.EffortLimit(5.0)],
    "none": [],
    "branches": [Push(kick)],
}
EFFECTS["all"] = [effect for effects in EFFECTS.values() for effect in effects]


def plant(effects: list[Any]) -> CompiledPlant:
    compiled = Compiled(rd.Plant(ROBOT, effects), cache=False)
    assert isinstance(compiled, CompiledPlant)
    return compiled


@pytest.mark.parametrize("name", EFFECTS)
def test_a_compiled_plant_is_the_interpreted_one(name: str) -> None:
    """At times before, within and after a window, inside the stops and beyond: 1e-12 of the largest, κ(M) small."""
    compiled = plant(EFFECTS[name])
    q, v, u = states(2, 12)
    for t in (0.0, 0.3, 0.9):
        for method in ("N", "forward_dynamics"):
            rest = (9 * u,) if method == "forward_dynamics" else ()
            ours, theirs = (
                np.array([getattr(each, method)(t, *row) for row in zip(q, v, *rest, strict=True)])
                for each in (compiled, compiled.interpreted)
            )
            assert np.max(np.abs(ours - theirs)) <= 1e-12 * np.max(np.abs(theirs))


def test_a_batch_of_a_plant_is_its_states_one_by_one() -> None:
    """With tanh, branches and stops in the tile; each state may have its own time."""
    compiled = plant(EFFECTS["all"])
    q, v, u = states(2, 100)
    t = np.linspace(0, 1, 100)
    batch = compiled.forward_dynamics(t, q, v, u)
    single = np.array([compiled.forward_dynamics(*row) for row in zip(t, q, v, u, strict=True)])
    assert np.max(np.abs(batch - single)) <= 1e-12 * np.max(np.abs(single))
    back = compiled.inverse_dynamics(t, q, v, batch)
    assert np.max(np.abs(back - np.clip(u, -5, 5))) <= 1e-9


def test_plants_that_differ_in_numbers_share_their_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other coefficients, an infinite limit, gravity and a payload: nothing is compiled, and each answer is its own."""
    q, v, u = states(2, 40)
    t = np.linspace(0, 1, 40)

    def answers(damping: Any, limit: Any, gravity: float, mass: float) -> None:
        robot = ROBOT.with_(gravity=(0, 0, gravity), payload=rd.Payload(ROBOT.frame_names[-1], mass, (0.1, 0, 0)))
        effects = [
            rd.effects.ViscousFriction(damping),
            rd.effects.EffortLimit(limit),
            rd.effects.RegularisedCoulombFriction(mass, 0.1),
        ]
        compiled = Compiled(rd.Plant(robot, effects), cache=False)
        expected = np.array([compiled.interpreted.forward_dynamics(*row) for row in zip(t, q, v, u, strict=True)])
        batch = compiled.forward_dynamics(t, q, v, u)
        single = [compiled.forward_dynamics(*row) for row in zip(t, q, v, u, strict=True)]
        for ours in (batch, single):
            assert np.max(np.abs(ours - expected)) <= 1e-12 * np.max(np.abs(expected))

    answers([0.3, 0.1], [0.2, np.inf], -9.81, 0.5)
    monkeypatch.setattr(machine_code, "object_file", None)  # from here on nothing can be compiled
    answers(0.7, [np.inf, 3.0], -1.62, 1.5)
    answers([0.0, 2.0], 0.6, -9.81, 0.1)


def test_what_is_off_costs_no_instruction() -> None:
    """A plant without effects has the instructions of the robot."""
    bare, full = plant([]), plant(EFFECTS["all"])
    for compiled in (bare, full):
        compiled.forward_dynamics(0.0, *np.ones((3, 2)))
    (without,), (with_all,) = (each.instructions["forward_dynamics"].values() for each in (bare, full))
    assert without == min(Trace(bare.dynamics.robot).quantity("forward_dynamics").counts.values())
    assert with_all > without
    assert set(full.instructions_by_effect) == {effect.name for effect in full.plant.forces}


def test_machine_code_does_not_keep_the_plant_that_it_was_made_for() -> None:
    """What stays loaded is known by its instructions alone."""
    made = plant([rd.effects.ViscousFriction([0.31, 0.12])])
    q, v, u = states(2, 12)
    made.forward_dynamics(0.0, q[0], v[0], u[0])
    made.forward_dynamics(0.0, q, v, u)
    left = weakref.ref(made.plant), weakref.ref(made.plant.effects[0]), weakref.ref(made.engine)
    del made
    gc.collect()
    assert [each() for each in left] == [None, None, None]


def test_numpy_clip_is_the_minimum_of_a_maximum() -> None:
    """Of six joints with two bounds each: as branches these would be 3⁶."""
    most = np.array([6.0] * 3 + [1.2] * 3)
    law = rd.control.ControlLaw(lambda t, q, v: np.clip(-40.0 * (q - 0.3) - 10.0 * v, -2.0, most), 6)
    setup = rd.Setup(rd.Plant(rd.load("ur5")), [0.1] * 6, duration_s=0.05, integrator="rk4", controller=law)
    interpreted, compiled = (rd.simulate(setup, engine=each) for each in ("interpreted", "compiled"))
    assert compiled.statistics.engine == "compiled"
    np.testing.assert_allclose(compiled.q, interpreted.q, rtol=0, atol=1e-12)
    assert (interpreted.u.max(axis=0) == most).any(), "a bound acts"
