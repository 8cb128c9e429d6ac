"""How near M is to a singular matrix.

    κ = λ_max / λ_min  of  D⁻¹ M D⁻¹,  D = diag(√M_ii);    a solution of M a = τ errs by some u κ, by 8 n u κ at most

[Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, thm. 10.3]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LEAST_DIGITS = 8  # of forward dynamics; with fewer, M is called nearly singular


class NearlySingular(NamedTuple):
    """A matrix M that leaves forward dynamics fewer than LEAST_DIGITS.

    Attributes:
        condition: κ.
        digits: What u κ leaves.
        joint: The joint that moves most along the smallest eigenvector.
    """

    condition: float
    digits: float
    joint: str


def nearly_singular(M: np.ndarray, joint_names: tuple[str, ...]) -> NearlySingular | None:
    """What M, (n, n) with M_ii > 0, leaves of the digits of forward dynamics, or None if that is enough."""
    d = np.sqrt(np.diagonal(M))
    eigenvalues, vectors = np.linalg.eigh(M / np.outer(d, d))
    u = np.finfo(float).eps / 2
    condition = float(eigenvalues[-1] / max(eigenvalues[0], u * eigenvalues[-1]))
    digits = float(-np.log10(u * condition))
    if digits >= LEAST_DIGITS:
        return None
    return NearlySingular(condition, max(digits, 0.0), joint_names[int(np.argmax(np.abs(vectors[:, 0])))])
