"""Finite Fourier series that start and end at rest.

    q(t) = c + Σ_k a_k sin(ω k t)/(ω k) + b_k cos(ω k t)/(ω k),   ω = 2π/T,   Σ a_k = 0,   Σ k b_k = 0

so velocity and acceleration are 0 at t = 0 and t = T. [Swevers, Ganseman, Tükel, De Schutter, Van Brussel 1997]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.linalg import null_space


@final
@dataclass(frozen=True)
class FourierSeries:
    """The series of one period.

    Attributes:
        duration_s: Period T, in [s].
        harmonics: Number of harmonics, at least 2.
    """

    duration_s: float
    harmonics: int

    @property
    def size(self) -> int:
        """Number of coefficients of one joint: the mean position, then the free combinations of a_k and b_k."""
        return 2 * self.harmonics - 1

    def basis(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return Φ, Φ' and Φ'' at times t, each (m, size), with q = Φ x for coefficients x."""
        k = np.arange(1, self.harmonics + 1)
        w = 2 * np.pi / self.duration_s * k
        sine, cosine = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
        A, B = null_space(np.ones((1, len(k)))), null_space(k[None].astype(float))
        one, zero = np.ones((len(t), 1)), np.zeros((len(t), 1))
        return (
            np.hstack([one, sine / w @ A, cosine / w @ B]),
            np.hstack([zero, cosine @ A, -sine @ B]),
            np.hstack([zero, -sine * w @ A, -cosine * w @ B]),
        )
