"""Regularity of M: singular at every configuration, so nearly singular that digits are lost, or regular.

    κ = λ_max / λ_min  of  D⁻¹ M D⁻¹,  D = diag(√M_ii)

Solutions of M a = τ have a relative error of about u κ, at most 8 n u κ.

[Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, thm. 10.3]
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.errors import SingularError, UndecidedError
from robot_dyn.queries.dynamics import acceleration

MIN_DIGITS = 8  # M counts as nearly singular if forward dynamics has fewer digits


class NearlySingular(NamedTuple):
    """Facts about an M with which forward dynamics has fewer digits than MIN_DIGITS.

    Attributes:
        condition: Condition number κ.
        digits: Digits of forward dynamics, −log₁₀(u κ).
        joint: The joint that moves most along the smallest eigenvector.
    """

    condition: float
    digits: float
    joint: str


class Regularity(NamedTuple):
    """Result of the check that M can be inverted.

    Attributes:
        singular: If M is singular at every q, or if float64 cannot decide it: function that returns the error to raise;
            otherwise None.
        near: Loss of digits if M is nearly singular, otherwise None.
    """

    singular: Callable[[], SingularError] | None
    near: NearlySingular | None

    @property
    def joint(self) -> str | None:
        """Joint at which M is singular, or None."""
        return None if self.singular is None else self.singular().joint


def regularity(M: np.ndarray, joint_names: tuple[str, ...]) -> Regularity:
    """Check M (n, n), the mass matrix at a configuration without symmetries."""
    try:
        acceleration(M, np.ones(len(M)), joint_names)
    except UndecidedError as error:
        singular = partial(UndecidedError, error.joint, "at any q", "float64")
        return Regularity(singular, _nearly_singular(M, joint_names))
    except SingularError as error:
        return Regularity(partial(SingularError, error.joint, "at any q; give its link a mass, or lock it"), None)
    return Regularity(None, _nearly_singular(M, joint_names))


def _nearly_singular(M: np.ndarray, joint_names: tuple[str, ...]) -> NearlySingular | None:
    """Return the loss of digits in forward dynamics for M with M_ii > 0, or None if enough remain."""
    d = np.sqrt(np.diagonal(M))
    eigenvalues, vectors = np.linalg.eigh(M / np.outer(d, d))
    u = np.finfo(float).eps / 2
    condition = float(eigenvalues[-1] / max(eigenvalues[0], u * eigenvalues[-1]))
    digits = float(-np.log10(u * condition))
    if digits >= MIN_DIGITS:
        return None
    return NearlySingular(condition, max(digits, 0.0), joint_names[int(np.argmax(np.abs(vectors[:, 0])))])
