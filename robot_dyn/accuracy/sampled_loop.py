"""The longest stable period of a sampled control loop, linearised at a state.

    δx⁺ = e^{AT} δx + (∫₀ᵀ e^{As} ds) B δu,   δu = K δx + K_z δz,   δz⁺ = L δx + L_z δz

A and B are of the plant, K and L of the controller, z its states. [Åström, Wittenmark, Computer-Controlled Systems,
3rd ed., 1997, ch. 2]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from robot_dyn.accuracy.stability import longest
from robot_dyn.arithmetic import Array
from robot_dyn.coefficients import with_values
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.foreign import call
from robot_dyn.integrate.differences import by_state
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.stiffness import jacobian


def longest_period(plant: Plant, controller: Controller, t: float, y: Array, duration_s: float) -> float:
    """The longest stable period, in [s]; inf if every period of a run is.

    Args:
        plant: What is controlled.
        controller: What controls it.
        t: Time, in [s].
        y: State (q, v, z), z of the controller and then of the effects.
        duration_s: Of the run.
    """
    from scipy.linalg import expm

    n, size, free = plant.dynamics.n, controller.state_size, StateEquation(plant, None).in_a_mode
    law = y[: 2 * n + size]
    x = np.concatenate([y[: 2 * n], y[2 * n + size :], np.zeros(len(free.sources))])
    u = _law(controller, controller.torque, t, n)(t, law)
    A = jacobian(free, t, x, u)
    m = len(A)
    B = by_state(_rows(lambda each: free.rate(t, x, each)[0][:m]), t, u).T
    K = _wide(by_state(_law(controller, controller.torque, t, n), t, law).T, n, m)
    driven = np.block([[A, B], [np.zeros((n, m + n))]])

    def loop(period: float) -> Array:
        held = expm(driven * period)
        made = np.zeros((m + size, m + size))
        made[:m] = held[:m, m:] @ K
        made[:m, :m] += held[:m, :m]
        if size:
            of_period: Any = with_values(controller, {"period_s": period})
            made[m:] = _wide(by_state(_law(of_period, of_period.next_state, t, n), t, law).T, n, m)
        return made

    return longest(loop, A + B @ K[:, :m], duration_s)


def _wide(columns: Array, n: int, m: int) -> Array:
    """Derivatives by (q, v, z) as ones by (q, v, states of effects, z)."""
    made = np.zeros((len(columns), m + columns.shape[1] - 2 * n))
    made[:, : 2 * n], made[:, m:] = columns[:, : 2 * n], columns[:, 2 * n :]
    return made


def _law(controller: Controller, function: Callable[..., Any], t: float, n: int) -> Callable[[Any, Array], Array]:
    """A function of a controller, of rows (q, v, z)."""
    return _rows(lambda row: call(function, t, row[:n], row[n : 2 * n], row[2 * n :]))


def _rows(function: Callable[[Array], Any]) -> Callable[[Any, Array], Array]:
    """A function of one state for states (…, m)."""

    def f(at: Any, states: Array) -> Array:
        made = [np.asarray(function(row), dtype=float) for row in states.reshape(-1, states.shape[-1])]
        return np.array(made).reshape(*states.shape[:-1], -1)

    return f
