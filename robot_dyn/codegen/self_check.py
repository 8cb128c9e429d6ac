"""The self-check: a new kernel must agree with an independent implementation at random states.

    |x_kernel − x_independent| ≤ tolerance · (Σ of the absolute values of the terms added into x)

Accelerations are compared in the joint units d_i = √M_ii, with the terms of the torque that causes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.magnitude import Magnitudes, magnitudes
from robot_dyn.lagrange.scale import (
    acceleration_entries,
    derivative_entries,
    floored,
    joint_units,
    scaled,
    solved_tolerance,
)
from robot_dyn.model.robot import Robot
from robot_dyn.queries.quantity import Quantity

STATES = 16
_TOLERANCE = {
    "float64": 1e-12,
    "float32": 2e-5,
}  # tolerance by dtype: for float64 that of `compare`, for float32 about 335 rounding units


class SelfCheckError(RobotDynError):
    """A compiled kernel fails its self-check and is not used."""


@final
@dataclass(frozen=True)
class SelfCheck:
    """An independent implementation with which kernels must agree.

    Attributes:
        dynamics: Robot, computed by Pinocchio.
        name: Name in messages.
    """

    dynamics: Robot
    name: str

    def states(self) -> dict[str, np.ndarray]:
        """Return random states without zeros, (STATES, n) each, and times t (STATES,).

        Torques are computed from random accelerations: random torques could accelerate a light link out of range.
        """
        rng, n = np.random.default_rng(20), self.dynamics.n
        q = rng.uniform(-np.pi, np.pi, (STATES, n))
        v, a, accelerations = rng.normal(size=(3, STATES, n))
        tau = self.dynamics.inverse_dynamics(q, v, accelerations)
        return {"t": rng.uniform(0, 1, STATES), "q": q, "v": v, "a": a, "tau": tau, "u": tau}

    def check(
        self,
        quantity: Quantity,
        ours: np.ndarray,
        theirs: np.ndarray,
        dtype: str,
        effects: np.ndarray | float = 0.0,
        has_result: np.ndarray | None = None,
    ) -> None:
        """Compare results at `states()` with independent results.

        Args:
            quantity: The quantity.
            ours: Results of the kernel, (STATES, …).
            theirs: Independent results.
            dtype: The dtype of the kernel.
            effects: Torques of the effects, which count as terms of τ.
            has_result: True at states where the kernel returns a result instead of reporting doubt, (STATES,).

        Raises:
            SelfCheckError: If they differ by more than the tolerance, or the kernel returns no result at any state.
        """
        if has_result is not None and not has_result.any():
            raise SelfCheckError(f"compiled {quantity.name} has no result at any of {STATES} random states")
        scale = self._scale(quantity, theirs, effects)
        error = scaled(np.asarray(ours, dtype=float) - theirs, np.broadcast_to(scale, theirs.shape))
        error = np.where(np.isnan(error), np.inf, error)
        if has_result is not None:
            error[~has_result] = 0.0
        worst, tolerance = np.unravel_index(np.argmax(error), error.shape), self._tolerance(quantity, dtype)
        if not error[worst] <= tolerance:
            state = {name: x[worst[0]].tolist() for name, x in self.states().items()}
            raise SelfCheckError(
                f"compiled {quantity.name} {np.asarray(ours)[worst]:.17g} is not {self.name}'s {theirs[worst]:.17g} at"
                f" entry {tuple(map(int, worst[1:]))}: {error[worst]:.1e} of its terms, {tolerance:.1e} allowed;"
                f" state {state}"
            )

    @cached_property
    def _sizes(self) -> list[Magnitudes]:
        linkage = Lagrangian(self.dynamics).linkage
        return [magnitudes(linkage, q) for q in self.states()["q"]]

    def _scale(self, quantity: Quantity, theirs: np.ndarray, effects: np.ndarray | float) -> np.ndarray:
        """Return the scale of each entry, the largest over all states, because its terms may vanish at some states."""
        state, d = self.states(), joint_units(self._M)
        rows = [{name: np.abs(x[i]) for name, x in state.items()} for i in range(STATES)]
        terms = [np.asarray(quantity.terms(size, row)) for size, row in zip(self._sizes, rows, strict=True)]
        if quantity.solves:
            torque_terms = np.array(terms) + np.abs(effects)
            entries = acceleration_entries if len(quantity.axes) == 1 else derivative_entries
            return entries(d, torque_terms, theirs)
        own = np.max([floored(term) for term in terms], axis=0)
        return own + d * np.max(np.abs(effects) / d) if np.ndim(effects) else own

    def _tolerance(self, quantity: Quantity, dtype: str) -> float:
        return solved_tolerance(_TOLERANCE[dtype], self._M, dtype) if quantity.solves else _TOLERANCE[dtype]

    @cached_property
    def _M(self) -> np.ndarray:
        """M at all states, (STATES, n, n)."""
        return self.dynamics.M(self.states()["q"])
