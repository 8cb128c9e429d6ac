"""Dahl friction: hysteresis against its closed form, run by run; ledger, passivity, machine code, rollouts."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import robot_dyn as rd
from tests.effects.test_effect_states import SLIDER
from tests.long import long

STIFFNESS, LEVEL = 40.0, 1.3  # [N/m], [N]
BOTH = pytest.mark.parametrize("engine", ["interpreted", "compiled"])


def beats(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A force of two frequencies, so that reversals fall on many parts of the curve."""
    return np.stack([2.0 * np.sin(3.1 * t + 0.4) + 1.1 * np.sin(7.3 * t)])


def run(exponent: float | None, engine: str, **options) -> rd.Trajectory:
    plant = rd.Plant(SLIDER, [rd.effects.DahlFriction(STIFFNESS, LEVEL, exponent)])
    options = {"duration_s": 6.0, "record_period_s": 0.01, "estimate_error": False} | options
    return rd.simulate(plant, q0=[0.0], controller=beats, engine=engine, **options)


def curve(start: float, path: np.ndarray, side: float, exponent: float) -> np.ndarray:
    """F after a path of one direction: w = 1 − side F/f, w = w₀ e^(−σ|Δq|/f), or w^(1−α) = w₀^(1−α) + (α−1) σ|Δq|/f."""
    w, way = 1 - side * start / LEVEL, STIFFNESS * np.abs(path) / LEVEL
    after = w * np.exp(-way) if exponent == 1 else (w ** (1 - exponent) + (exponent - 1) * way) ** (1 / (1 - exponent))
    return side * LEVEL * (1 - after)


@pytest.mark.parametrize("exponent", [None, 1.5, *long([1.0, 3.0])])
@BOTH
def test_the_hysteresis_is_that_of_the_closed_form(exponent: float | None, engine: str) -> None:
    """From reversal to reversal F is a function of the path alone; a tolerance of 1e-12 leaves 1e-9."""
    swing = run(exponent, engine, integrator=rd.integrate.Adaptive("DOP853", 1e-12, 1e-14))
    turns = [(each.t, each.q[0]) for each in swing.events]
    assert len(turns) > 4
    at, place = np.array([0.0, *(t for t, _ in turns), np.inf]), np.array([0.0, *(q for _, q in turns)])
    force, expected = 0.0, np.empty(len(swing.t))
    for k, (start, end) in enumerate(pairwise(at)):
        inside = (swing.t >= start) & (swing.t < end)
        way = swing.q[inside, 0] - place[k]
        side = float(np.sign(way.sum()))
        expected[inside] = curve(force, way, side, exponent or 1.0)
        if k + 1 < len(place):
            force = float(curve(force, np.array([place[k + 1] - place[k]]), side, exponent or 1.0)[0])
    found = STIFFNESS * swing.effect_states["dahl_friction"][:, 0]
    assert np.ptp(found) > 1.5 * LEVEL
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(swing.ledger.residual).max() < 1e-10


@pytest.mark.parametrize("exponent", [2.5, *long([None])])
def test_bristles_only_take_energy(exponent: float | None) -> None:
    """Work done on them less what they store never falls; without storage it would."""
    swing = run(exponent, "interpreted")
    work, stored = swing.ledger.work["dahl_friction"], swing.ledger.stored["dahl_friction"]
    assert np.diff(work + stored).max() < 1e-9
    assert np.diff(work).max() > 1e-3


def test_an_exponent_of_one_that_is_stated_is_the_default() -> None:
    np.testing.assert_allclose(run(1.0, "interpreted").q, run(None, "interpreted").q, atol=1e-10)
