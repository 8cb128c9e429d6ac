"""Whether a sampled control loop is stable, and its longest stable period, linearised at a state.

    from one tick to the next:  δx⁺ = e^{Aδ} δx + (∫₀^δ e^{As} ds) B δu,   δz⁺ = δz,   δu⁺ = δu
    at a tick:                  δu = K δx + K_z δz,   δz⁺ = L δx + L_z δz

A and B are of the plant, K and L of the controller; z holds its states, and what is on its way in a loop with delays.
The two integrals are one exponential. [Åström, Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, ch. 2; Van Loan
1978]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.foreign import call
from robot_dyn.integrate.differences import by_state
from robot_dyn.simulation.stability import longest
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.stiffness import jacobian


def longest_period(plant: Plant, controller: Controller, t: float, y: Array, duration_s: float) -> float:
    """The longest stable period, in [s]; inf if every period of a run is. Delays are as many periods at each.

    Args:
        plant: What is controlled.
        controller: What controls it.
        t: Time, in [s].
        y: State (q, v, z), z of the continuous controller and then of the effects.
        duration_s: Of the run.
    """
    cycle, loop = linearised(plant, controller, t, y)
    return longest(cycle, loop, duration_s, controller.cycle)


def linearised(plant: Plant, controller: Controller, t: float, y: Array) -> tuple[Callable[[float], Array], Array]:
    """The map of (x, u, z) over a cycle of ticks, of their period in [s]; and J of the loop at all times, of x.

    Args:
        plant: As of `longest_period`, like the others.
        controller: What controls it.
        t: Time, in [s].
        y: State.
    """
    from scipy.linalg import expm

    controller = controller.small_signal()
    continuous = controller.at_period(0.0)
    n, size, free = plant.dynamics.n, continuous.state_size, StateEquation(plant, None).in_a_mode
    law = y[: 2 * n + size]
    x = np.concatenate([y[: 2 * n], y[2 * n + size :], np.zeros(len(free.sources))])
    u = _law(continuous, continuous.torque, t, n)(t, law)
    A = jacobian(free, t, x, u)
    m = len(A)
    B = by_state(_rows(lambda each: free.rate(t, x, each)[0][:m]), t, u).T
    K = by_state(_law(continuous, continuous.torque, t, n), t, law).T[:, : 2 * n]
    driven = np.block([[A, B], [np.zeros((n, m + n))]])

    def cycle(period: float) -> Array:
        of_period = controller.at_period(period)
        z = of_period.settled(t, law[:n], law[n : 2 * n], law[2 * n :])
        made = np.eye(m + n + len(z))
        parts = of_period.instants
        flows = [expm(driven * (period * length)) for length in np.diff([*parts, 1.0])]
        for _ in range(of_period.cycle):
            for flow in flows:
                made = _between(flow, len(z)) @ _tick(of_period, t, law[: 2 * n], z, m) @ made
                z = np.asarray(call(of_period.next_state, t, law[:n], law[n : 2 * n], z), dtype=float)
        return made

    loop = A.copy()
    loop[:, : 2 * n] += B @ K
    return cycle, loop


def _between(flow: Array, size: int) -> Array:
    """From one tick to the next: of (x, u, z), z constant."""
    made = np.eye(len(flow) + size)
    made[: len(flow), : len(flow)] = flow
    return made


def _tick(controller: Controller, t: float, joints: Array, z: Array, m: int) -> Array:
    """A tick: of (x, u, z), x constant, with joints the first entries (q, v) of x, of which there are m."""
    n = len(joints) // 2
    law = np.concatenate([joints, z])
    of_u = by_state(_law(controller, controller.torque, t, n), t, law).T
    made = np.eye(m + n + len(z))
    made[m : m + n] = 0
    made[m : m + n, : 2 * n], made[m : m + n, m + n :] = of_u[:, : 2 * n], of_u[:, 2 * n :]
    if len(z):
        of_z = by_state(_law(controller, controller.next_state, t, n), t, law).T
        made[m + n :] = 0
        made[m + n :, : 2 * n], made[m + n :, m + n :] = of_z[:, : 2 * n], of_z[:, 2 * n :]
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
