"""Discrete-time models of ẋ = A x + B u(t − δ), u held for a period T: exact, by the matrix exponential.

    x_{k+1} = Φ x_k + Γ₀ u_{k−d} + Γ₁ u_{k−d−1},   δ = d T + δ',  0 ≤ δ' < T
    Φ = e^{AT},   Γ₀ = ∫₀^{T−δ'} e^{As} ds B,   Γ₁ = e^{A(T−δ')} ∫₀^{δ'} e^{As} ds B

[Van Loan, Computing integrals involving the matrix exponential, 1978] [Åström, Wittenmark, Computer-Controlled Systems,
3rd ed., 1997, ch. 2]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from robot_dyn.foundations import QueryError, Value, duration, number, numbers, read_only

_MOST_DELAYED = 1000  # periods
_ROUNDING = 1e-12  # of a period


@final
@dataclass(frozen=True, eq=False)
class SampledModel(Value):
    """A model x⁺ = A x + B u with a period; unpacks as a pair: `A, B = discretise(…)`.

    With a delay, x also holds the preceding inputs, the latest first: (x, u_{k−1}, u_{k−2}, …).

    Attributes:
        A: Matrix of the state, (m, m).
        B: Matrix of the input, (m, r).
        period_s: Period, in [s].
        delay_s: Delay of the input, in [s].
    """

    A: np.ndarray
    B: np.ndarray
    period_s: float
    delay_s: float

    def __post_init__(self) -> None:
        read_only(self)

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter((self.A, self.B))


def discretise(A: ArrayLike, B: ArrayLike, period_s: float, delay_s: float = 0.0) -> SampledModel:
    """Return the exact zero-order-hold model of ẋ = A x + B u, with a delay of the input.

    Args:
        A: Matrix of the state, (m, m), for example of `rd.linearise`.
        B: Matrix of the input, (m, r).
        period_s: Period for which u is held, in [s].
        delay_s: Time from the sample to the change of u, in [s]: computation, bus and drive; up to 1000 periods.

    Returns:
        The model; its state has r more entries for each begun period of the delay.

    Raises:
        QueryError: If a matrix has another shape or is not finite, or a time is out of range.
    """
    A, B = numbers("A", A, ("m", "m")), numbers("B", B, ("m", "r"))
    if A.shape != (len(A), len(A)) or len(B) != len(A):
        raise QueryError(f"A must have shape (m, m) and B (m, r), got {A.shape} and {B.shape}")
    T, delay = duration("period_s", period_s), number("delay_s", delay_s)
    if not 0 <= delay <= _MOST_DELAYED * T:
        raise QueryError(f"delay_s must be from 0 to {_MOST_DELAYED} periods of {T:g} s, got {delay:g}")
    begun = int(np.ceil(delay / T - _ROUNDING))  # periods of the delay
    rest = max(T * begun - delay, 0.0) if begun else T  # part of a period with the input u_{k−begun+1}
    (m, r), size = B.shape, len(A) + begun * B.shape[1]
    with np.errstate(all="ignore"):
        after, newer = _held(A, B, rest)
        before, older = _held(A, B, T - rest)
        moved, old = after @ before, after @ older
    if not all(np.isfinite(x).all() for x in (moved, newer, old)):
        raise QueryError(f"the model overflows within a period of {T:g} s; give a shorter one, or check the units of A")
    inputs = np.zeros((m, (begun + 1) * r))  # of u_k, u_{k−1}, …
    latest = max(begun - 1, 0)
    inputs[:, latest * r : (latest + 1) * r] = newer
    F, G = np.zeros((size, size)), np.zeros((size, r))
    if begun:
        inputs[:, begun * r :] = old
        F[m + r :, m : size - r], G[m : m + r] = np.eye(size - m - r), np.eye(r)
    F[:m, :m], F[:m, m:], G[:m] = moved, inputs[:, r:], inputs[:, :r]
    return SampledModel(F, G, T, delay)


def _held(A: np.ndarray, B: np.ndarray, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Return e^{AT} and ∫₀^T e^{As} ds B, two blocks of one exponential."""
    (m, r) = B.shape
    both = expm(np.block([[A, B], [np.zeros((r, m + r))]]) * T)
    return both[:m, :m], both[:m, m:]
