"""What moves, as the convex problems of events take it: mass matrix, and all torques but the reactions.

    bodies = (M, load, u_m):   load = τ + Σ τ_effect − C v − ∂V/∂q,   u_m = u − b θ̇ of each motor in a rigid backlash

[As of `effects.rigid_backlash`]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.simulation.dynamics.state_equation import StateEquation


def bodies(equation: StateEquation, t: Any, y: Array, held: Array | None) -> Array:
    """M by rows, load (n,) and u_m, (n² + n + motors,), in a mode in which no motor rests; in floats or symbols.

    Args:
        equation: The state equation.
        t: Time, in [s].
        y: A state.
        held: The actuation in zero-order hold; None of a controller that acts continuously.
    """
    motion, n, (q, v, z, _) = equation.equation_of_motion, equation.plant.dynamics.n, equation.state(y)
    u, of_effects = equation.actuation(t, q, v, z, held), z[equation.state_size :]
    torques = motion.torques(t, q, v, z=of_effects)
    load = sum(torques, start=motion.on_joints(u)) - equation.plant.dynamics.inverse_dynamics(q, v, 0 * v)
    coupled: dict[int, Any] = {k: drive for k, drive in motion.drives.items() if drive.coupled}
    motors = [u[list(x.driven(n))] - x.drag(n, of_effects[motion.states[k]]) for k, x in coupled.items()]
    return np.concatenate([equation.plant.M(q).ravel(), load, *motors])
