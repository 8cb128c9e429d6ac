"""Weighted instrumental variables: torques of a log as a linear function of parameters.

    τ = Y_k(q, v, a) π + v b + sign(v) c + τ₀ − δ dτ/dt + e
    θ = (Zᵀ W Y)⁻¹ Zᵀ W τ,   cov θ = (Zᵀ W Y)⁻¹ Zᵀ W S W Z (Zᵀ W Y)⁻ᵀ

Z is the same regressor on a motion that nearly lacks the noise of the log: least squares are biased, because noise of q
enters Y and, through the controller, τ. S is the autocovariance of the residuals between all joints.
Sums of it are corrected for the part of the errors that the fit takes.
[Young 2011; Janot, Vandanjon, Gautier 2014; Newey, West 1987]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn.foundations import Value

LAGS = 3  # rows, in the autocovariance
LEVEL = 0.95
_LEAST = 1e-12  # [N m]: least standard deviation of residuals


@final
@dataclass(frozen=True, eq=False)
class Rows(Value):
    """Rows of a log: m times, n joints, p parameters.

    Attributes:
        names: Names of the parameters, (p,).
        Y: Regressor, (m, n, p).
        Z: Instruments, (m, n, p).
        tau: Torques, (m, n), in [N m] or [N].
        used: True for rows in the fit, (m, n).
    """

    names: tuple[str, ...]
    Y: np.ndarray
    Z: np.ndarray
    tau: np.ndarray
    used: np.ndarray

    def where(self, used: np.ndarray) -> Rows:
        """Return the rows with fewer of them in the fit."""
        return replace(self, used=self.used & used)

    def only(self, columns: np.ndarray, tau: np.ndarray | None = None) -> Rows:
        """Return the rows with some of the columns, and other torques."""
        names = tuple(np.array(self.names)[columns])
        return replace(self, names=names, Y=self.Y[..., columns], Z=self.Z[..., columns],
                       tau=self.tau if tau is None else tau)  # fmt: skip


@final
@dataclass(frozen=True, eq=False)
class Fit(Value):
    """An estimate of the parameters of rows.

    Attributes:
        names: Names of the parameters, (p,).
        values: Estimates, (p,).
        covariance: Covariance by the autocovariance of the residuals, (p, p).
        residuals: τ − Y θ, (m, n).
        used: Rows in the fit, (m, n).
        dof: Degrees of freedom.
    """

    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    residuals: np.ndarray
    used: np.ndarray
    dof: float

    @cached_property
    def standard_errors(self) -> np.ndarray:
        """Standard errors, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def quantile(self) -> float:
        """Half width of a 95 % interval in standard errors, by Student's distribution."""
        from scipy.stats import t

        return float(t.ppf((1 + LEVEL) / 2, self.dof))

    @property
    def half_widths(self) -> np.ndarray:
        """Half widths of the 95 % intervals, (p,)."""
        return self.quantile * self.standard_errors

    @property
    def rms(self) -> np.ndarray:
        """Root mean square of the residuals in the fit, (n,)."""
        return rms(self.residuals, self.used)


def rms(x: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return the root mean square of rows of each joint, (n,); nan without rows."""
    count = used.sum(axis=0)
    return np.sqrt(np.divide((x**2 * used).sum(axis=0), count, out=np.full(len(count), np.nan), where=count > 0))


def fit(rows: Rows, passes: int = 3) -> Fit:
    """Return the estimate; joints are weighted by the variance of their residuals.

    The first pass weights them by the variance of their torques.
    """
    _, n, p = rows.Y.shape
    used = rows.used.astype(float)[..., None]
    Y, Z, tau = rows.Y * used, rows.Z * used, rows.tau * rows.used
    scale = np.sqrt((Y**2).sum(axis=(0, 1)))
    scale = np.where(scale > 0, scale, 1.0)
    residuals = rows.tau - rows.tau.mean(axis=0)
    values, sigma, A = np.zeros(p), np.ones(n), np.eye(p)
    for _ in range(passes):
        sigma = np.maximum(rms(residuals, rows.used), _LEAST)
        scores = (Z / scale / sigma[:, None] ** 2).reshape(-1, p)
        A = scores.T @ (Y / scale).reshape(-1, p)
        values = np.linalg.solve(A, scores.T @ tau.ravel()) / scale
        residuals = rows.tau - rows.Y @ values
    inverse = np.linalg.inv(A)
    Y, Z, e = Y / scale / sigma[:, None], Z / scale / sigma[:, None], residuals * rows.used / sigma
    taken = Y @ inverse  # e = (1 − H) ε with H = taken · Zᵀ
    covariance = inverse @ _weighted_autocovariance(Z, e, taken, rows.used) @ inverse.T / np.outer(scale, scale)
    return Fit(rows.names, values, covariance, residuals, rows.used, float(rows.used.sum() - p))


def _weighted_autocovariance(Z: np.ndarray, e: np.ndarray, taken: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return Σ Zᵢᵀ S_ij Z_j with the autocovariance of the errors, tapered over the lags (Bartlett).

    The fit takes part of the errors: of white ones, residuals have the covariance 1 − H. Sums of H over the rows are
    added to those of the residuals, joint by joint and lag by lag.
    """
    m, _, p = Z.shape
    S = np.zeros((p, p))
    for k in range(LAGS + 1):
        a, b = slice(k, m), slice(0, m - k)
        count = used[a].astype(float).T @ used[b].astype(float)
        c = e[a].T @ e[b] + np.tensordot(taken[a], Z[b], ((0, 2), (0, 2)))
        part = np.einsum("tip,ij,tjr->pr", Z[a], (1 - k / (LAGS + 1)) * c / np.maximum(count, 1), Z[b], optimize=True)
        S += part if k == 0 else part + part.T
    return S
