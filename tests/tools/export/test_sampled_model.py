"""Discrete models against closed forms, python-control, and the solution of the delayed differential equation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.tools.export import SampledModel, discretise

A, B = (np.array(x) for x in rd.linearise(rd.load("planar_2r"), [np.pi / 2, 0.0]))
T = 0.02


def test_a_double_integrator_has_its_closed_form() -> None:
    """Åström, Wittenmark, example 2.6: with the delay δ' < T, Γ₀ = ((T − δ')²/2, T − δ'), Γ₁ = (δ' (T − δ'/2), δ')."""
    delay = 0.3 * T
    Phi, Gamma = discretise([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], T, delay)
    rest = T - delay
    assert np.allclose(Phi, [[1, T, delay * (T - delay / 2)], [0, 1, delay], [0, 0, 0]], rtol=1e-14, atol=1e-18)
    assert np.allclose(Gamma, [[rest**2 / 2], [rest], [1.0]], rtol=1e-14, atol=1e-18)


def test_without_delay_it_is_that_of_scipy_and_python_control() -> None:
    control = pytest.importorskip("control")
    Phi, Gamma = discretise(A, B, T)
    theirs = cont2discrete((A, B, np.eye(4), np.zeros((4, 2))), T)
    sampled = control.c2d(control.ss(A, B, np.eye(4), 0), T)
    for F, G in (theirs[:2], (sampled.A, sampled.B)):
        assert np.allclose(Phi, F, rtol=1e-13, atol=1e-15) and np.allclose(Gamma, G, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("delay", [0.0, 0.25 * T, T, 1.6 * T, 3 * T, 0.1 * 3 * T])
def test_steps_are_samples_of_the_delayed_equation(delay: float) -> None:
    """ẋ = A x + B u(t − δ) for random held inputs, by DOP853 to 1e-10 from switch to switch."""
    u = np.random.default_rng(3).normal(size=(8, 2))
    model = discretise(A, B, T, delay)
    size = len(model.A) - 4
    x, state = np.array([0.1, -0.2, 0.3, 0.4]), np.zeros(len(model.A))
    state[:4] = x
    assert size == 2 * int(np.ceil(round(delay / T, 9)))

    def held(t: float) -> np.ndarray:
        k = int(np.floor((t - delay) / T))
        return u[k] if k >= 0 else np.zeros(2)

    for k in range(len(u)):
        cuts = sorted({k * T, (k + 1) * T, *(x for x in delay + T * np.arange(9) if k * T < x < (k + 1) * T - 1e-12)})
        for a, b in pairwise(cuts):
            if b - a > 1e-12:
                mean = held((a + b) / 2)
                x = solve_ivp(lambda t, x: A @ x + B @ mean, (a, b), x, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]  # noqa: B023
        state = model.A @ state + model.B @ u[k]
        assert np.allclose(state[:4], x, rtol=1e-10, atol=1e-10)


def test_it_unpacks_and_keeps_its_times() -> None:
    model = discretise(A, B, T, 0.5 * T)
    assert isinstance(model, SampledModel) and (model.period_s, model.delay_s) == (T, 0.5 * T)
    first, second = model
    assert first is model.A and second is model.B
    assert not model.A.flags.writeable


@pytest.mark.parametrize("wrong", [(A[:3], B, T), (A, B[:3], T), (A, B, 0.0), (A, B, T, -1e-3), (A, B, T, 30.0)])
def test_wrong_arguments_are_refused(wrong: tuple) -> None:
    with pytest.raises(QueryError):
        discretise(*wrong)
