"""The self check: a fresh kernel is compared with an independent engine at random states, or refused.

    |x_kernel − x_independent| ≤ tolerance · (Σ of the absolute values of the terms added into x)

Accelerations are held in the units d_i = √M_ii of the joints, to the terms of the torque they are solved from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.lagrange.magnitude import Magnitudes, floored, magnitudes, scaled
from robot_dyn.lagrange.manipulator import Lagrangian

STATES = 16
_LEAST = {"float64": 1e-12, "float32": 2e-5}  # the library's tolerance; its rounding times that of float32 over float64


class SelfCheckError(RobotDynError):
    """A compiled kernel that does not agree with its self check; nothing of it is used."""


@final
@dataclass(frozen=True)
class SelfCheck:
    """An engine that kernels must agree with.

    Attributes:
        dynamics: Rigid bodies in gravity: Pinocchio's Robot.
        name: What it is called in a report.
    """

    dynamics: Any
    name: str

    def states(self) -> dict[str, np.ndarray]:
        """Random states without zeros, (STATES, n) each, and times t (STATES,).

        Torques are those of random accelerations: random ones would move a light link more than a kernel answers.
        """
        rng, n = np.random.default_rng(20), self.dynamics.n
        q = rng.uniform(-np.pi, np.pi, (STATES, n))
        v, a, other = rng.normal(size=(3, STATES, n))
        tau = self.dynamics.inverse_dynamics(q, v, other)
        return {"t": rng.uniform(0, 1, STATES), "q": q, "v": v, "a": a, "tau": tau, "u": tau}

    def judge(
        self,
        quantity: str,
        ours: np.ndarray,
        theirs: np.ndarray,
        dtype: str,
        effects: np.ndarray | float = 0.0,
        answered: np.ndarray | None = None,
    ) -> None:
        """Hold results at `states()` to the independent ones.

        Args:
            quantity: Its name.
            ours: Results of the kernel, (STATES, …).
            theirs: The independent ones.
            dtype: That of the kernel.
            effects: Torques of effects, terms of the sum.
            answered: At which states the kernel gives a result rather than reports a doubt, (STATES,).

        Raises:
            SelfCheckError: If they differ by more than rounding, or there is no result at all.
        """
        if answered is not None and not answered.any():
            raise SelfCheckError(f"compiled {quantity} gives no result at any of {STATES} random states")
        scale = self._scale(quantity, theirs, effects)
        error = scaled(np.asarray(ours, dtype=float) - theirs, np.broadcast_to(scale, theirs.shape))
        error = np.where(np.isnan(error), np.inf, error)
        if answered is not None:
            error[~answered] = 0.0
        worst, tolerance = np.unravel_index(np.argmax(error), error.shape), self._tolerance(quantity, dtype)
        if not error[worst] <= tolerance:
            state = {name: x[worst[0]].tolist() for name, x in self.states().items()}
            raise SelfCheckError(
                f"compiled {quantity} {np.asarray(ours)[worst]:.17g} is not {self.name}'s {theirs[worst]:.17g} at entry"
                f" {tuple(map(int, worst[1:]))}: {error[worst]:.1e} of its terms, {tolerance:.1e} allowed;"
                f" state {state}"
            )

    @cached_property
    def _sizes(self) -> list[Magnitudes]:
        linkage = Lagrangian(self.dynamics).linkage
        return [magnitudes(linkage, q) for q in self.states()["q"]]

    @cached_property
    def _units(self) -> np.ndarray:
        """D = √M_ii, (STATES, n)."""
        M = self.dynamics.M(self.states()["q"])
        return np.sqrt(np.maximum(np.diagonal(M, axis1=-2, axis2=-1), 1e-300))

    def _scale(self, quantity: str, theirs: np.ndarray, effects: np.ndarray | float) -> np.ndarray:
        """Of each entry: the largest over all states, for at some its terms may happen to vanish."""
        state, sizes, d = self.states(), self._sizes, self._units
        v, a, tau = np.abs(state["v"]), np.abs(state["a"]), np.abs(state["tau"])
        rows = range(STATES)
        if quantity in ("forward_dynamics", "forward_dynamics_derivatives"):
            zero = np.zeros_like(v[0])
            terms = np.array([sizes[i].inverse_dynamics(v[i], zero) for i in rows]) + tau + np.abs(effects)
            whole = np.linalg.norm(terms / d, axis=-1)
            if quantity == "forward_dynamics":
                return np.max([whole, np.linalg.norm(theirs * d, axis=-1)]) / d
            sides = np.stack([np.broadcast_to(whole[:, None], d.shape)] * 2 + [1 / d], axis=1)  # by q, by v, by τ
            return np.maximum(sides[:, :, None, :], _columns(theirs * d[:, None, :, None])) / d[:, None, :, None]
        terms = {
            "M": lambda i: sizes[i].M,
            "C": lambda i: sizes[i].C(v[i]),
            "N": lambda i: sizes[i].N,
            "coriolis_torque": lambda i: sizes[i].C(v[i]) @ v[i],
            "coriolis_transpose": lambda i: sizes[i].C(v[i]).T @ v[i],
            "inverse_dynamics": lambda i: sizes[i].inverse_dynamics(v[i], a[i]),
            "momentum": lambda i: sizes[i].M @ v[i],
            "kinetic_energy": lambda i: v[i] @ sizes[i].M @ v[i] / 2,
            "potential_energy": lambda i: np.asarray(sizes[i].V),
            "torque": lambda i: np.zeros_like(v[i]),
        }[quantity]
        own = np.max([floored(terms(i)) for i in rows], axis=0)
        return own + d * np.max(np.abs(effects) / d) if np.ndim(effects) else own

    def _tolerance(self, quantity: str, dtype: str) -> float:
        if quantity not in ("forward_dynamics", "forward_dynamics_derivatives"):
            return _LEAST[dtype]
        d, M = self._units, self.dynamics.M(self.states()["q"])
        condition = float(np.max(np.linalg.cond(M / (d[:, :, None] * d[:, None, :]))))
        return max(_LEAST[dtype], 8 * self.dynamics.n * float(np.finfo(dtype).eps) / 2 * condition)


def _columns(x: np.ndarray) -> np.ndarray:
    """The largest absolute value of each column, as a row."""
    return np.abs(x).max(axis=-2, keepdims=True)
