"""Mimic joints as a constant linear map: q_full = S q + s₀, so that M = Sᵀ M_full S and N = Sᵀ N_full."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array
from robot_dyn.foundations.errors import OverflowedError
from robot_dyn.foundations.validate import LEAST_EXACT, is_moderate
from robot_dyn.foundations.values import Value

_EXACT = LEAST_EXACT / np.finfo(np.float64).eps  # positions below this are known to LEAST_EXACT


@final
@dataclass(frozen=True)
class Mimic:
    """The coupling of a joint to another: q = multiplier · q_source + offset, in literals."""

    source: str
    multiplier: Any
    offset: Any


def resolve(name: str, mimics: Mapping[str, Mimic], arithmetic: Arithmetic) -> tuple[str, Any, Any]:
    """The independent joint that `name` follows through a chain of mimics, with the composed multiplier and offset."""
    ratio, offset = arithmetic.number("1"), arithmetic.number("0")
    while name in mimics:
        coupling = mimics[name]
        offset = offset + ratio * arithmetic.number(coupling.offset)
        ratio = ratio * arithmetic.number(coupling.multiplier)
        name = coupling.source
    return name, ratio, offset


@final
@dataclass(frozen=True, eq=False)
class Couplings(Value):
    """The map q_full = S q + s₀ from n independent coordinates to all N joints that move.

    Attributes:
        S: Shape (N, n); one entry a row.
        s0: Shape (N,).
    """

    S: Array
    s0: Array

    def __post_init__(self) -> None:
        self.S.setflags(write=False)
        self.s0.setflags(write=False)

    @cached_property
    def trivial(self) -> bool:
        """Whether q_full = q."""
        N, n = self.S.shape
        return n == N and bool(np.all(np.eye(n, dtype=int) == self.S)) and bool(np.all(self.s0 == 0))

    @cached_property
    def _source(self) -> Array:
        """The coordinate that each joint follows, (N,)."""
        return np.argmax(self.S != 0, axis=1)

    @cached_property
    def _ratio(self) -> Array | None:
        """The entry of each row of S, (N,); None if all are 1."""
        ratio = self.S[np.arange(len(self.S)), self._source]
        return None if np.all(ratio == 1) else ratio

    @cached_property
    def _shifted(self) -> bool:
        return not np.all(self.s0 == 0)

    def position(self, q: Array) -> Array:
        """q_full = S q + s₀.

        Raises:
            OverflowedError: If q is so large that rounding hides where the joints that follow are.
        """
        if self.trivial:
            return q
        full = self.velocity(q)
        if self._shifted:
            full = full + self.s0
        if self._rounded.size and full.dtype.kind == "f" and self._hidden(full):
            raise OverflowedError(
                "q is so large that rounding hides where the joints that follow others are, to"
                f" {LEAST_EXACT:g} rad or m; take a smaller q, or rd.Lagrangian(robot, rd.accuracy.Ball(bits))"
            )
        return full

    @cached_property
    def _rounded(self) -> Array:
        """The joints that have a position which rounding changes: those that do not just repeat another one's."""
        return np.flatnonzero(np.any((self.S != 0) & (np.abs(self.S) != 1), axis=1) | (self.s0 != 0))

    def _hidden(self, full: Array) -> bool:
        if full.ndim == 1 and full.dtype == np.float64 and is_moderate(full, _EXACT):
            return False
        position = full[..., self._rounded]
        return bool(np.finfo(position.dtype).eps * np.abs(position).max(initial=0.0) > LEAST_EXACT)

    def velocity(self, v: Array) -> Array:
        """v_full = S v, and accelerations alike: S is constant."""
        if self.trivial:
            return v
        full = v.take(self._source, axis=-1)
        return full if self._ratio is None else self._ratio * full

    def torque(self, tau: Array) -> Array:
        """τ = Sᵀ τ_full, by virtual work."""
        return tau if self.trivial else tau.dot(self.S)

    def rows(self, A: Array) -> Array:
        """Sᵀ A, torques that are linear in the columns of A (..., N, m)."""
        return A if self.trivial else self.S.T @ A

    def matrix(self, A: Array) -> Array:
        """Sᵀ A S, for quadratic forms."""
        if self.trivial:
            return A
        S = self.S  # of one state `dot` takes half the time of `@`
        return S.T.dot(A).dot(S) if A.ndim == 2 else S.T @ A @ S

    def cube(self, A: Array) -> Array:
        """A with S applied to each of its last three axes, for ∂M/∂q."""
        for axis in () if self.trivial else (-3, -2, -1):
            A = np.moveaxis(np.moveaxis(A, axis, -1) @ self.S, -1, axis)
        return A

    def columns(self, J: Array) -> Array:
        """J S, for Jacobians."""
        if self.trivial:
            return J
        return J.dot(self.S) if J.ndim <= 2 else J @ self.S

    def reduced(self, values: Any, axes: tuple[int | str, ...]) -> Any:
        """A quantity of all joints as one of the coordinates; "n" marks the axes of joints in its shape."""
        if self.trivial or "n" not in axes:
            return values
        if axes == ("n", "n"):
            return self.matrix(values)
        return self.columns(values) if axes[-1] == "n" else self.rows(values)
