"""An upper bound of the gravity torque at every position: |N_i| ≤ Σ m g r over the bodies that joint i carries.

r is the distance of a centre of mass from the axis with the chain between them stretched: the distance of the next
joint, or of the centre of the joint's own body, from the axis, plus the lengths of all further links and strokes. For a
prismatic joint r is 1. For a joint on the base, only the component of g normal to its axis counts, or along it if it is
prismatic. For coupled joints, the bounds are multiplied by the ratios and added.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray
from numpy.linalg import norm

from robot_dyn.description.couplings import Couplings
from robot_dyn.model.regrouped import joint_axes, slides


def gravity_bound(model: pin.Model, couplings: Couplings) -> ndarray:
    """Return Σ m g r of each coordinate, (n,), in [N m] or [N]; inf after a prismatic joint without limits."""
    twists, stroke, g = joint_axes(model), dict(slides(model)), model.gravity.linear
    axes, moments = twists[:, 3:], np.zeros(model.nv)
    for b in range(1, model.njoints):
        chain = [j for j in model.supports[b] if j]
        places = [*(model.jointPlacements[j].translation for j in chain[1:]), model.inertias[b].lever]
        lengths = [float(norm(place)) for place in places]
        reach = 0.0
        for k in reversed(range(len(chain))):
            j = chain[k] - 1
            first = float(norm(np.cross(axes[j], places[k])))
            beyond = stroke.get(chain[k + 1] - 1, 0.0) if k + 1 < len(chain) else 0.0
            turns = axes[j].any()
            pull = norm(g) if k else _on_base(twists[j], model.jointPlacements[j + 1].rotation.T @ g)
            moments[j] += pull * model.inertias[b].mass * (first + beyond + reach if turns else 1.0)
            reach += lengths[k] + beyond
    return np.abs(couplings.S).T @ moments


def _on_base(twist: ndarray, g: ndarray) -> float:
    """Return the component of g, in the axes of a joint on the base, that acts on the joint."""
    linear, angular = twist[:3], twist[3:]
    return float(norm(np.cross(angular, g)) if angular.any() else abs(linear @ g))
