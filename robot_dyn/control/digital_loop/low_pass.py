"""Butterworth low-pass filters of order 1 and 2, by the bilinear transform with prewarping at the cutoff.

    K = tan(ω T/2),   order 1: y_k = (K (x_k + x_{k−1}) + (1 − K) y_{k−1}) / (1 + K)
    order 2: H(z) = K² (1 + z⁻¹)² / (1 + √2 K + K² + 2 (K² − 1) z⁻¹ + (1 − √2 K + K²) z⁻²)

[Oppenheim, Schafer, Discrete-Time Signal Processing, 3rd ed., 2010, sec. 7.2; sec. 6.3 for the transposed form]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.control.digital_loop.block import Block
from robot_dyn.foundations.arithmetic import Array, cos, sin, sqrt
from robot_dyn.foundations.coefficients import CoefficientField, coefficient
from robot_dyn.foundations.errors import ControlError, shown


@final
@dataclass(frozen=True, eq=False)
class LowPass(Block):
    """Butterworth low-pass filter of order 1 or 2, with gain 1 at frequency 0 and 1/√2 at the cutoff.

    It starts in the steady state of the first sample.

    Attributes:
        cutoff_rad_s: ω, a scalar or (n,), in [rad/s], positive and less than π/period.
        order: 1 or 2.
    """

    term = "y = x after a Butterworth filter"
    rounds = False

    cutoff_rad_s: CoefficientField = field(metadata=coefficient("rad/s", symbol="ω", exclusive_minimum=0))
    order: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.order, bool) or not isinstance(self.order, int) or self.order not in (1, 2):
            raise ControlError(f"order of a low-pass filter must be 1 or 2, got {shown(self.order)}")

    def check(self, period_s: float) -> None:
        if (np.asarray(self.cutoff_rad_s) >= np.pi / period_s).any():
            raise ControlError(
                f"cutoff_rad_s must be less than π/period = {np.pi / period_s:.4g} rad/s at a period of {period_s:g} s,"
                f" got {self.cutoff_rad_s}; lower the cutoff, or shorten the period"
            )

    def state_size(self, n: int) -> int:
        return self.order * n

    def start(self, x: Array, period_s: float) -> Array:
        b, a = self._coefficients(period_s)
        if self.order == 1:
            return (b[1] - a[0]) * x
        last = (b[2] - a[1]) * x
        return np.concatenate([(b[1] - a[0]) * x + last, last])

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        return self._coefficients(period_s)[0][0] * x + s[: len(x)]

    def next_state(self, x: Array, s: Array, period_s: float) -> Array:
        b, a = self._coefficients(period_s)
        y = b[0] * x + s[: len(x)]
        if self.order == 1:
            return b[1] * x - a[0] * y
        return np.concatenate([b[1] * x - a[0] * y + s[len(x) :], b[2] * x - a[1] * y])

    def _coefficients(self, period_s: float) -> tuple[list[Array], list[Array]]:
        """Return numerator b₀, b₁, … and denominator a₁, … of H in z⁻¹, with a₀ = 1."""
        half = np.asarray(self.cutoff_rad_s) * (period_s / 2)
        K = sin(half) / cos(half)
        if self.order == 1:
            b = K / (1 + K)
            return [b, b], [(K - 1) / (1 + K)]
        below = 1 + sqrt(2.0) * K + K * K
        b = K * K / below
        return [b, 2 * b, b], [2 * (K * K - 1) / below, (1 - sqrt(2.0) * K + K * K) / below]
