"""Linearisation of a plant about a state: d/dt (δq, δv) = A (δq, δv) + B δu.

A = [[0, 1], [∂a/∂q, ∂a/∂v]],   B = [[0], [M⁻¹]]
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, final

import numpy as np

from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.validate import one_state
from robot_dyn.integrate.differences import of_fourth_order
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import without_rounding

_STEPS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # of Richardson's extrapolated central difference: error O(h⁴) and u/h
_AT_REST = 1e-9  # of the acceleration without actuation
_ONE_SIDED = 0.01  # of a slope: a larger difference between its two sides is not curvature at the shortest step
_NO_DERIVATIVE = "the plant has no derivative at this state, such as at an effort limit or a stop; move the state"
_AGREE = 1e-6  # of the largest slope: two steps that differ by more do not show a derivative


class _Matrices(NamedTuple):
    A: np.ndarray
    B: np.ndarray


@final
class Linearisation(Answer, _Matrices):
    """A and B about one state, a pair that shows its eigenvalues.

    Attributes:
        A: Of (δq, δv), shape (2n, 2n).
        B: Of δu, shape (2n, n).
    """

    __slots__ = ()

    def blocks(self) -> Iterator[Block]:
        n = self.B.shape[1]
        yield f"d/dt (δq, δv) = A (δq, δv) + B δu: A ({2 * n}, {2 * n}), B ({2 * n}, {n})"
        found = [x for x in np.linalg.eigvals(self.A).tolist() if complex(x).imag >= 0]
        rows = sorted((complex(x) for x in found), key=lambda x: (-x.real, x.imag))
        headings = ("growth, real part [1/s]", "± imaginary part [rad/s]")
        yield "eigenvalues of A:"
        shown = without_rounding([(x.real, x.imag) for x in rows])
        yield Table(headings, tuple(map(tuple, shown.tolist())), 4)


def linearise(plant: Plant | Dynamics, q: Array, v: Array = None, u: Array = None, *, t: float = 0.0) -> Linearisation:
    """A and B about one state.

    Args:
        plant: A plant, or a robot without effects.
        q: Position, shape (n,), in [rad] or [m].
        v: Velocity, shape (n,), in [rad/s] or [m/s]; 0 by default.
        u: Actuation, shape (n,), in [N m] or [N]; by default the actuation at which the acceleration is 0, so that a
            state at rest is an equilibrium.
        t: Time, in [s].

    Returns:
        A, shape (2n, 2n), and B, shape (2n, n); shown as the eigenvalues of A.

    Raises:
        QueryError: If an argument is wrong, the acceleration has no derivative at this state, no actuation makes it 0
            and u is not given, or effects have states of their own.
    """
    if not isinstance(plant, Plant):
        plant = Plant(plant)
    plant = plant.at(t)
    if drives := plant.equation_of_motion.drives:
        name = next(iter(drives.values())).name
        raise QueryError(f"linearise: {name} has motors of its own, which are no part of (q, v); leave it out")
    for k in plant.equation_of_motion.states:
        raise QueryError(f"linearise: {plant.effects[k].name} has states, which are no part of (q, v); leave it out")
    names, n = plant.dynamics.joint_names, plant.dynamics.n
    q, v = one_state("q", q, names), one_state("v", np.zeros(n) if v is None else v, names)
    balanced = u is None
    u = plant.inverse_dynamics(t, q, v, np.zeros(n)) if balanced else one_state("u", u, names)
    x = np.concatenate([q, v, u])

    def a(x: np.ndarray) -> np.ndarray:
        return plant.forward_dynamics(t, x[:n], x[n : 2 * n], x[2 * n :])

    if balanced and np.abs(a(x)).max() > _AT_REST * (1 + np.abs(a(np.concatenate([q, v, 0 * u]))).max()):
        raise QueryError("linearise: no actuation within the limits of the plant holds this state; give u")

    slopes, rest = of_fourth_order(a, x, _STEPS[0]), list(_STEPS[1:])
    while rest:  # steep friction needs a short step; the longest one that a shorter one confirms errs least
        shorter = of_fourth_order(a, x, rest.pop(0))
        if np.abs(shorter - slopes).max() <= _AGREE * np.abs(shorter).max():
            break
        slopes = shorter
    else:
        raise QueryError(_NO_DERIVATIVE)
    h, here = _STEPS[-1], a(x)
    for i, step in enumerate(h * np.eye(3 * n)):  # where one-sided slopes differ, though their mean has a value
        if np.abs(a(x + step) + a(x - step) - 2 * here).max() > _ONE_SIDED * h * np.abs(slopes[:, i]).max() + 1e-9:
            raise QueryError(_NO_DERIVATIVE)
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:], A[n:] = np.eye(n), slopes[:, : 2 * n]
    return Linearisation(A, np.vstack([np.zeros((n, n)), slopes[:, 2 * n :]]))
