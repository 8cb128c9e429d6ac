"""Tracking: how far a motion is from the reference of its controller.

√(mean over samples and joints of (q − q_d)²)
"""

from __future__ import annotations

import numpy as np

from robot_dyn.control.cartesian import CartesianReference
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.simulation.setup.setup import Setup


def deviation_of(setup: Setup, t: np.ndarray, q: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Desired positions (m, n), and how far the joints (…, m, n), or the frame (…, m, 3), are from the reference.

    Args:
        setup: Of the controller.
        t: Times, (m,), in [s].
        q: Positions there, (…, m, n).
    """
    controller = setup.controller
    if controller is None:
        return None, None
    reference = controller.desired
    if isinstance(reference, PiecewisePolynomial):
        desired = reference.at(t)[0]
        return desired, q - desired
    if isinstance(reference, CartesianReference) and controller.task_frame is not None:
        return None, setup.plant.dynamics.placement(q, controller.task_frame)[..., :3, 3] - reference.at(t)[0]
    return None, None


def root_mean_square(deviation: np.ndarray) -> float:
    """Of all entries."""
    scale = np.ldexp(1.0, np.frexp(np.abs(deviation).max(initial=0.0))[1] - 1)  # that squares do not overflow
    return float(scale * np.sqrt(np.mean((deviation / scale) ** 2)))
