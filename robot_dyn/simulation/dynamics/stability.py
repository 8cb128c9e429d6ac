"""Stability of linear maps δx⁺ = Φ(h) δx, and the longest stable step of a method or period of a sampled loop.

    a sampled loop:          |λ_i(Φ)| ≤ 1,   with an error |δλ_i| ≤ |w_i|ᵀ |δΦ| |x_i| / |w_iᴴ x_i|
    a method on δx' = J δx:  ln |R(h λ_i)| / h ≤ 2 max(0, Re λ_i(J)):  a growing motion may grow faster

x_i and w_i are the right and left eigenvectors; R is the stability function of a method with Φ(h) = R(h J). For other
methods, for example semi-implicit Euler, the k-th largest |λ(Φ)| is compared with the k-th largest Re λ(J).
[Golub, Van Loan, Matrix Computations, 4th ed., 2013, 7.1 and 7.2; Hairer, Wanner, Solving Ordinary Differential
Equations II, 2nd ed., 1996, IV.2]
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import StrEnum
from math import exp, inf, log
from sys import float_info
from typing import NamedTuple, cast

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.integrator import Integrator, System

_BAND = 1e-3  # largest error of |λ|: an eigenvalue further from 1 is not at 1, even if it is defective
_AMPLIFIES = 1e-6  # per radian of the fastest motion: a method that amplifies by less is inaccurate, not unstable
_ROUNDED = 1e-7  # ln |λ(Φ)|: error of a double eigenvalue, the square root of rounding
_GROWS = 2.0  # times the growth of the motion: a method that grows by less is inaccurate, not unstable
_LEAST, _FARTHEST = 1e-6, 1e3  # range of h |λ| for limits: of the fastest motion, and of the slowest one
STILL = 1e-5  # fraction of the fastest |λ|, and per second: differences cannot distinguish a smaller |λ| from zero
_SMOOTH = 0.03  # h |λ| of the fastest motion up to which Φ(h) is smooth in ln h
_SCAN = (2, 8, 5)  # lengths in each factor of ten up to _SMOOTH, beyond it, and in each radian of an oscillation
_MOST = 500  # lengths that resolve the radians of oscillations; further lengths grow by factors
_DECAYED = 5.0  # h |Re λ| from which an oscillation has decayed before the next tick
_SHARP = 3e-4  # relative accuracy of a limit
LARGEST = 690.0  # ln of the largest growth that is reported


class Stability(StrEnum):
    """Stability of a map."""

    STABLE = "stable"
    MARGINAL = "marginal"
    UNSTABLE = "unstable"


class Growth(NamedTuple):
    """Growth of deviations under a map.

    Attributes:
        factor: Spectral radius.
        least, most: Bounds of max |λ_i| − 1, from the error of each eigenvalue.
        doubt: Error of the eigenvalue that determines the lower bound.
    """

    factor: float
    least: float
    most: float
    doubt: float

    @property
    def verdict(self) -> Stability:
        """Unstable if a deviation certainly grows, stable if all certainly decay, else marginal."""
        if self.least > 0:
            return Stability.UNSTABLE
        return Stability.STABLE if self.most < 0 else Stability.MARGINAL


def worst(growths: Iterable[Growth]) -> Growth:
    """Return the largest factor and bounds of several maps."""
    return Growth(*map(max, zip(*growths, strict=True)))


NO_BOUND = Growth(inf, inf, inf, 0.0)


def growth(matrix: Array, error: Array) -> Growth:
    """Return the growth under a map whose entries have errors; NO_BOUND if an entry is not finite.

    Args:
        matrix: The map, (m, m).
        error: Largest error of each entry, (m, m), not negative.
    """
    from scipy.linalg import eig

    if not np.isfinite(matrix).all():
        return NO_BOUND
    with np.errstate(all="ignore"):  # the left and right eigenvectors of a defective eigenvalue are orthogonal
        values, left, right = cast(tuple[Array, Array, Array], eig(matrix, left=True, right=True))
        doubt = np.einsum("ik,ij,jk->k", np.abs(left), error, np.abs(right)) / np.abs((left.conj() * right).sum(axis=0))
    size, doubt = np.abs(values), np.minimum(np.nan_to_num(doubt, nan=_BAND), _BAND)
    k = int((size - doubt).argmax())
    least, most = float(size[k] - doubt[k]) - 1, float((size + doubt).max()) - 1
    return Growth(float(size.max()), least, most, float(doubt[k]))


def longest_step(method: Integrator, J: Array, n: int) -> float:
    """Return the longest step of a method that is stable on δx' = J δx, in [s]; inf if every step is.

    A step is unstable if its stages do not converge, such as a long step of a Gauss method by fixed-point iteration.

    Args:
        method: A method of fixed step.
        J: Jacobian, (m, m), in [1/s].
        n: Number of positions, the first entries of x.
    """
    excess = excess_rate(method, J, n)
    return first_unstable(lambda h: excess(h) > 0, lengths(np.linalg.eigvals(J), np.zeros(0)))


def excess_rate(method: Integrator, J: Array, n: int) -> Callable[[float], float]:
    """Return a function of the step h: the rate, in [1/s], by which the growth of deviations exceeds the allowed one.

    Args:
        method: A method of fixed step.
        J: Jacobian, (m, m), in [1/s].
        n: Number of positions, the first entries of x.
    """
    from scipy.linalg import schur

    T, Z = cast(tuple[Array, Array], schur(J, "complex"))
    rates, phi = T.diagonal(), step_map(method, J, n)
    allowed = _GROWS * np.maximum(0.0, np.real(rates)) + _AMPLIFIES * np.abs(rates).max()
    is_function = _is_function_of_hJ(method, J, n)

    def excess(h: float) -> float:
        try:
            with np.errstate(all="ignore"):
                if is_function:  # then Φ(h) = R(h J) is triangular in the Schur basis of J
                    grown = np.log(np.abs(np.einsum("ji,jk,ki->i", Z.conj(), phi(h), Z)))
                    return _largest(grown / h - allowed)
                grown = np.log(np.sort(np.abs(np.linalg.eigvals(phi(h)))))
                return _largest(np.where(grown < _ROUNDED, 0.0, grown / h) - np.sort(allowed))
        except (RobotDynError, np.linalg.LinAlgError):
            return inf

    return excess


def _largest(rates: Array) -> float:
    """Return the largest rate; inf if one is not a number."""
    return inf if np.isnan(rates).any() else float(rates.max())


def _is_function_of_hJ(method: Integrator, J: Array, n: int) -> bool:
    """Return True if Φ(h) is a function of h J: the method treats positions and velocities alike and ignores n."""
    h = _SMOOTH / max(STILL, float(np.abs(np.linalg.eigvals(J)).max()))
    try:
        return np.array_equal(step_map(method, J, n)(h), step_map(method, J, 0)(h))
    except RobotDynError:
        return False


def step_map(method: Integrator, J: Array, n: int) -> Callable[[float], Array]:
    """Return Φ(h) of a method of fixed step on δx' = J δx; see `longest_step` for the arguments."""
    by_entry = np.concatenate([J.T, np.zeros((1, len(J)))])

    def exact(t: object, y: Array) -> Array:
        return np.broadcast_to(by_entry.reshape(-1, *(1,) * (y.ndim - 1), len(J)), (len(J) + 1, *y.shape)).copy()

    system = System(lambda t, y: y @ J.T, n, exact=exact)
    return lambda h: np.asarray(method.step(system, 0.0, np.eye(len(J)), h)).T


def after(factor: float, times: float) -> float:
    """Return factor^times, limited to e^690 = 4.6e299."""
    return exp(min(times * log(factor), LARGEST)) if factor > 0 and times else float(not times)


def periods(duration_s: float, period_s: float) -> int:
    """Return the number of whole periods in a duration; both may be rounded."""
    return int(duration_s / period_s * (1 + 4 * float_info.epsilon))


def shown(factor: float) -> str:
    """Return the text of a factor: four digits, 1 + two digits close to 1, or a bound if it is the largest reported."""
    if factor >= exp(LARGEST):
        return "more than 1e+299"
    return f"1 + {factor - 1:.2g}" if 0 < factor - 1 < _BAND else f"{factor:.4g}"


def below(limit: float) -> str:
    """Return the text of half a limit, in one digit."""
    return f"{float(f'{limit / 2:.0e}'):g}"


def lengths(rates: Array, oscillations: Array, least: float = _LEAST) -> list[float]:
    """Return the lengths h to try in ascending order, for motions with eigenvalues λ; none if all λ are 0.

    Args:
        rates: Eigenvalues λ, in [1/s].
        oscillations: Eigenvalues of oscillations, which may make the loop unstable and stable again as h grows.
        least: First h |λ| of the fastest motion.
    """
    sizes = np.abs(rates)
    fastest = float(sizes.max(initial=0.0))
    moving = sizes[sizes > STILL * max(1.0, fastest)]
    if not len(moving):
        return []
    h, last, result = least / fastest, _FARTHEST / float(moving.min()), []
    while h < last:
        result.append(h)
        lasting = -np.real(oscillations) * h < _DECAYED
        frequencies = np.abs(np.imag(oscillations))[lasting] if len(result) < _MOST else np.zeros(0)
        step = 1 / (_SCAN[2] * frequencies.max()) if frequencies.any() else inf
        h = min(h * 10 ** (1 / _SCAN[int(h * fastest > _SMOOTH)]), h + step)
    return result


def first_unstable(is_unstable: Callable[[float], bool], candidates: list[float]) -> float:
    """Return the length below the first unstable one; inf if all are stable, 0 if the shortest is unstable.

    Args:
        is_unstable: Function of h that is True if Φ(h) is unstable.
        candidates: Lengths in ascending order.
    """
    before = 0.0
    for beyond in candidates:
        if is_unstable(beyond):
            break
        before = beyond
    else:
        return inf
    while before and beyond - before > _SHARP * beyond:
        middle = (before + beyond) / 2
        before, beyond = (before, middle) if is_unstable(middle) else (middle, beyond)
    return before
