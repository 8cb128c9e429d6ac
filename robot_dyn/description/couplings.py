"""Mimic joints as a constant linear map: q_full = S q + s₀, so that M = Sᵀ M_full S and N = Sᵀ N_full."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array, Numeral
from robot_dyn.foundations.errors import OverflowedError
from robot_dyn.foundations.validate import MAX_ROUNDING_ERROR, is_moderate
from robot_dyn.foundations.values import Value

_EXACT = MAX_ROUNDING_ERROR / np.finfo(np.float64).eps  # float64 positions below this are exact to MAX_ROUNDING_ERROR


@final
@dataclass(frozen=True)
class Mimic:
    """A joint coupled to another: q = multiplier · q_source + offset, as literals."""

    source: str
    multiplier: Numeral
    offset: Numeral


def resolve(name: str, mimics: Mapping[str, Mimic], arithmetic: Arithmetic) -> tuple[str, Any, Any]:
    """Return the independent joint that `name` follows, with the composed multiplier and offset of the chain."""
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
    """The map q_full = S q + s₀ from n independent coordinates to all N moving joints.

    Attributes:
        S: Shape (N, n), with one nonzero entry in each row.
        s0: Shape (N,).
    """

    S: Array
    s0: Array

    def __post_init__(self) -> None:
        self.S.setflags(write=False)
        self.s0.setflags(write=False)

    @cached_property
    def trivial(self) -> bool:
        """True if q_full = q."""
        N, n = self.S.shape
        return n == N and bool(np.all(np.eye(n, dtype=int) == self.S)) and bool(np.all(self.s0 == 0))

    @cached_property
    def _source(self) -> Array:
        """Index of the coordinate that each joint follows, (N,)."""
        return np.argmax(self.S != 0, axis=1)

    @cached_property
    def _ratio(self) -> Array | None:
        """Nonzero entry of each row of S, (N,); None if all are 1."""
        ratio = self.S[np.arange(len(self.S)), self._source]
        return None if np.all(ratio == 1) else ratio

    @cached_property
    def _shifted(self) -> bool:
        return not np.all(self.s0 == 0)

    def position(self, q: Array) -> Array:
        """Return q_full = S q + s₀.

        Raises:
            OverflowedError: If q is so large that rounding errors of the coupled positions are not negligible.
        """
        if self.trivial:
            return q
        full = self.velocity(q)
        if self._shifted:
            full = full + self.s0
        if self._rounded.size and full.dtype.kind == "f" and self._hidden(full):
            raise OverflowedError(
                "q is so large that the positions of mimic joints are not exact to"
                f" {MAX_ROUNDING_ERROR:g} rad or m; use a smaller q, or rd.Lagrangian(robot, rd.accuracy.Ball(bits))"
            )
        return full

    @cached_property
    def _rounded(self) -> Array:
        """Indices of the joints whose computed position is rounded, because they do not just copy a coordinate."""
        return np.flatnonzero(np.any((self.S != 0) & (np.abs(self.S) != 1), axis=1) | (self.s0 != 0))

    def _hidden(self, full: Array) -> bool:
        """Return True if rounding of a coupled joint's position exceeds MAX_ROUNDING_ERROR."""
        if full.ndim == 1 and full.dtype == np.float64 and is_moderate(full, _EXACT):
            return False
        position = full[..., self._rounded]
        return bool(np.finfo(position.dtype).eps * np.abs(position).max(initial=0.0) > MAX_ROUNDING_ERROR)

    def velocity(self, v: Array) -> Array:
        """Return v_full = S v; accelerations transform in the same way, because S is constant."""
        if self.trivial:
            return v
        full = v.take(self._source, axis=-1)
        return full if self._ratio is None else self._ratio * full

    def torque(self, tau: Array) -> Array:
        """Return τ = Sᵀ τ_full, by virtual work."""
        return tau if self.trivial else tau.dot(self.S)

    def rows(self, A: Array) -> Array:
        """Return Sᵀ A for torques A (..., N, m) that are linear in m parameters."""
        return A if self.trivial else self.S.T @ A

    def matrix(self, A: Array) -> Array:
        """Return Sᵀ A S for a quadratic form A."""
        if self.trivial:
            return A
        S = self.S  # for one state `dot` takes half the time of `@`
        return S.T.dot(A).dot(S) if A.ndim == 2 else S.T @ A @ S

    def cube(self, A: Array) -> Array:
        """Apply S to each of the last three axes of A, as ∂M/∂q needs."""
        for axis in () if self.trivial else (-3, -2, -1):
            A = np.moveaxis(np.moveaxis(A, axis, -1) @ self.S, -1, axis)
        return A

    def columns(self, J: Array) -> Array:
        """Return J S for a Jacobian J."""
        if self.trivial:
            return J
        return J.dot(self.S) if J.ndim <= 2 else J @ self.S

    def reduced(self, values: Array, axes: tuple[int | str, ...]) -> Array:
        """Reduce a quantity of all joints to independent coordinates; "n" in `axes` marks joint axes of its shape."""
        if self.trivial or "n" not in axes:
            return values
        if axes[-2:] == ("n", "n"):
            return self.matrix(values)
        return self.columns(values) if axes[-1] == "n" else self.rows(values)
