"""What of an effect differs from run to run in rollouts: each run is that of the effect with its value."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from tests.effects.test_effect_states import ARM, FRICTION, LEVEL, SLIDER, STIFFNESS, Q, beats
from tests.effects.test_line_spring_damper import BETWEEN, TO_WORLD, TREE, state
from tests.long import third

PLAN = rd.control.quintic(Q, [0.6, -0.3], 0.3)
PID = rd.control.PID(PLAN, kp=90.0, ki=60.0, kd=20.0)
STATES = [rd.effects.ActuatorLag([0.05, 0.02]), FRICTION, rd.effects.EffortLimit(15.0)]
DRIVE = [
    rd.effects.EffortLimit(30.0), rd.effects.ActuatorLag(0.02),
    rd.effects.SeriesElastic([200.0, 0.0], 0.02, 6.0, 0.5, 0.2, 1e-3),
]  # fmt: skip
STRUT = {
    "line_spring_damper.stiffness": [100.0, 400.0], "line_spring_damper.damping": [2.0, 9.0],
    "line_spring_damper.length": [0.2, 0.9], "line_spring_damper.point": [[0.1, 0.2, 0.3], [-0.3, 0.1, 0.2]],
    "line_spring_damper.other_point": [[0.8, 0.2, 0.3], [0.6, 0.1, 1.0]],
}  # fmt: skip


ON_ARM, ON_TREE = (ARM, Q, None, 0.3, PID), (TREE, *state(), 0.05, None)


def driven(period_s: float) -> tuple[Any, ...]:
    return ARM, Q, [0.2, 0.1], 0.3, rd.control.PD(PLAN, kp=90.0, kd=15.0, period_s=period_s)


STIFFNESSES = {"series_elastic.stiffness": [[200.0, 0.0], [90.0, 0.0]]}
POINTS = [[0.8, 0.2, 0.3], [0.6, 0.1, 1.0]]
CASES = [
    ([rd.effects.DahlFriction(STIFFNESS, LEVEL, 1.5)], (SLIDER, [0.0], None, 0.5, beats),
     {"dahl_friction.exponent": [1.2, 2.0]}),
    (STATES, ON_ARM, {"actuator_lag.time_constant_s": [[0.05, 0.02], [0.01, 0.08]]}),
    (STATES, ON_ARM, {"lugre_friction.bristle_stiffness": [120.0, 60.0]}),
    (DRIVE, driven(0.005), STIFFNESSES),
    ([BETWEEN], ON_TREE, STRUT),
    ([BETWEEN, TO_WORLD], ON_TREE,
     {"line_spring_damper 2.other_point": POINTS, "line_spring_damper 1.stiffness": [50.0, 90.0]}),
    *third([
        (STATES, ON_ARM, {"lugre_friction.coulomb": [[1.0, 0.5], [0.3, 1.2]]}),
        (DRIVE, driven(0.0), STIFFNESSES),
        *(([BETWEEN], ON_TREE, {name: values}) for name, values in STRUT.items()),
        ([TO_WORLD], ON_TREE, {"line_spring_damper.other_point": POINTS}),
    ]),
]  # fmt: skip


def setup(effects: Any, scene: tuple[Any, ...]) -> rd.Setup:
    arm, *start, duration_s, controller = scene
    steps = "RK4", 5e-4, duration_s / 10
    return rd.Setup(rd.Plant(arm, effects), *start, duration_s, controller, *steps, estimate_error=False)


def changed(effects: Any, values: dict[str, Any], k: int) -> list[Any]:
    """Return the effects with the values of run k; of several of one name, the one of the number has its value."""
    effects = list(effects)
    for name, runs in values.items():
        part, _, key = name.rpartition(".")
        part, _, number = part.partition(" ")
        i = [i for i, effect in enumerate(effects) if effect.name == part][int(number or 1) - 1]
        effects[i] = replace(effects[i], **{key: runs[k]})
    return effects


@pytest.mark.parametrize(("effects", "scene", "params"), CASES)
def test_each_run_is_that_of_the_effect_with_its_value(effects: Any, scene: Any, params: dict[str, Any]) -> None:
    """In both engines: 1e-12 of positions, 1e-10 of what stiff effects make of them. Rollouts keep no states."""
    works = 1e-11 if effects is DRIVE else 1e-10
    given = {name: np.array(x) for name, x in params.items()}
    runs = rd.rollouts(setup(effects, scene), vary=given, record=("q", "v", "u", "work"))
    for k in range(2):
        own = setup(changed(effects, given, k), scene)
        alone = rd.simulate(own, engine="interpreted")
        np.testing.assert_allclose(runs.q[k], alone.q, atol=1e-12)
        np.testing.assert_allclose(rd.simulate(own, engine="compiled").q, alone.q, atol=1e-12)
        np.testing.assert_allclose(runs.u[k], alone.u, atol=1e-10)
        one = runs[k]
        np.testing.assert_array_equal(one.u, runs.u[k])
        for name, work in alone.ledger.work.items():
            np.testing.assert_allclose(runs.work[name][k], work, atol=works)
            np.testing.assert_allclose(one.ledger.work[name], work, atol=works)
        assert np.isnan(one.a).all() == bool(alone.effect_states)
    assert np.abs(runs.q[1] - runs.q[0]).max() > (1e-3 if effects is DRIVE else 1e-5 if effects is STATES else 1e-6)
