"""The referee: a fresh kernel is held to an engine that shares no line with it, at random states, or is refused.

    |x_kernel − x_referee| ≤ tolerance · scale,   joint i in the unit d_i = √M_ii: M_ij / d_i d_j, τ_i / d_i, a_i d_i

The scale is the largest size, over all states, of the terms added into x: M a, C v, N, τ and the effects.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.errors import RobotDynError

STATES = 16
_LEAST = {"float64": 1e-12, "float32": 2e-5}  # the library's tolerance; its rounding times that of float32 over float64


class RefereeError(RobotDynError):
    """A compiled kernel that does not agree with its referee; nothing of it is used."""


@final
@dataclass(frozen=True)
class Referee:
    """An engine that kernels must agree with.

    Attributes:
        dynamics: Rigid bodies in gravity: Pinocchio's Robot.
        name: What it is called in a report.
    """

    dynamics: Any
    name: str

    def states(self) -> dict[str, np.ndarray]:
        """Random states without zeros, (STATES, n) each, and times t (STATES,)."""
        rng, n = np.random.default_rng(20), self.dynamics.n
        q = rng.uniform(-np.pi, np.pi, (STATES, n))
        v, a = rng.normal(size=(2, STATES, n))
        tau = rng.normal(size=(STATES, n)) * (1 + np.abs(self.dynamics.N(q)))
        return {"t": rng.uniform(0, 1, STATES), "q": q, "v": v, "a": a, "tau": tau, "u": tau}

    def judge(
        self, quantity: str, ours: np.ndarray, theirs: np.ndarray, dtype: str, effects: np.ndarray | float = 0.0
    ) -> None:
        """Hold results at `states()` to the referee's.

        Args:
            quantity: Its name.
            ours: Results of the kernel, (STATES, …).
            theirs: Those of the referee.
            dtype: That of the kernel.
            effects: Torques of effects, terms of the sum.

        Raises:
            RefereeError: If they differ by more than rounding.
        """
        M = self.dynamics.M(self.states()["q"])
        d = np.sqrt(np.maximum(np.diagonal(M, axis1=-2, axis2=-1), 1e-300))
        error = np.abs(_scaled(quantity, np.asarray(ours, dtype=float) - theirs, d))
        error = np.where(np.isnan(error), np.inf, error)
        scale = self._scale(quantity, theirs, d, M, effects)
        worst = np.unravel_index(np.argmax(error), error.shape)
        ratio, tolerance = float(error[worst]) / scale if error[worst] else 0.0, self._tolerance(quantity, d, M, dtype)
        if not ratio <= tolerance:
            state = {name: x[worst[0]].tolist() for name, x in self.states().items()}
            raise RefereeError(
                f"compiled {quantity} {np.asarray(ours)[worst]:.17g} is not {self.name}'s {theirs[worst]:.17g} at entry"
                f" {tuple(map(int, worst[1:]))}: {ratio:.1e} of its terms, {tolerance:.1e} allowed; state {state}"
            )

    def _scale(
        self, quantity: str, theirs: np.ndarray, d: np.ndarray, M: np.ndarray, effects: np.ndarray | float
    ) -> float:
        state = self.states()
        largest = float(np.max(np.abs(_scaled(quantity, theirs, d))))
        if quantity == "forward_dynamics_derivatives" or quantity == "potential_energy":
            return largest
        rate = np.abs(state["v"]).sum(axis=-1)
        inertial = (d * np.abs(state["v"])).sum(axis=-1) * np.maximum(rate, 1.0)  # √M v, and times v: C v where C = 0
        terms = [np.max(inertial)]
        if quantity in ("inverse_dynamics", "forward_dynamics", "N"):
            for term in (self.dynamics.N(state["q"]), state["tau"], np.broadcast_to(effects, state["q"].shape)):
                terms.append(float(np.max(np.abs(term / d))) if quantity != "N" or term is not state["tau"] else 0.0)
        if quantity in ("M", "C"):
            terms = [1.0 if quantity == "M" else float(np.max(rate))]
        return max(largest, sum(terms))

    def _tolerance(self, quantity: str, d: np.ndarray, M: np.ndarray, dtype: str) -> float:
        if quantity not in ("forward_dynamics", "forward_dynamics_derivatives"):
            return _LEAST[dtype]
        condition = float(np.max(np.linalg.cond(M / (d[:, :, None] * d[:, None, :]))))
        return max(_LEAST[dtype], 8 * self.dynamics.n * float(np.finfo(dtype).eps) / 2 * condition)


def _scaled(quantity: str, x: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Values in the units of the joints, d (STATES, n)."""
    if quantity in ("M", "C"):
        return x / (d[:, :, None] * d[:, None, :])
    if quantity == "forward_dynamics":
        return x * d
    if quantity in ("kinetic_energy", "potential_energy", "forward_dynamics_derivatives"):
        return x
    return x / d
