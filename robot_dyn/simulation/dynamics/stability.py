"""Stability of linear maps δx⁺ = Φ(h) δx, and the longest step of a method, or period of a loop, at which it holds.

    a sampled loop:          |λ_i(Φ)| ≤ 1,   known to |δλ_i| ≤ |w_i|ᵀ |δΦ| |x_i| / |w_iᴴ x_i|
    a method on δx' = J δx:  ln |R(h λ_i)| / h ≤ 2 max(0, Re λ_i(J)):  what grows in the motion may grow faster

x_i and w_i are the right and left eigenvectors, R is the stability function of a method whose Φ(h) is R(h J). Of
others, as semi-implicit Euler, the k-th largest |λ(Φ)| is compared with the k-th largest Re λ(J). [Golub, Van Loan,
Matrix Computations, 4th ed., 2013, 7.1 and 7.2; Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed.,
1996, IV.2]
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import StrEnum
from math import exp, inf, log
from sys import float_info
from typing import Any, NamedTuple, cast

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.integrator import System

_BAND = 1e-3  # of |λ|: no eigenvalue further from 1 is taken for one at 1, however defective it is
_AMPLIFIES = 1e-6  # per radian of the fastest motion: an oscillation that a method amplifies by less is its error
_ROUNDED = 1e-7  # ln |λ(Φ)|: a double eigenvalue is known to the root of rounding
_GROWS = 2.0  # times as fast as in the motion: a method that amplifies growth by less is inaccurate, not unstable
_LEAST, _FARTHEST = 1e-6, 1e3  # h |λ| between which limits are looked for, of the fastest and of the slowest motion
STILL = 1e-5  # of the fastest |λ|, and per second: differences do not tell less from zero
_SMOOTH = 0.03  # h |λ| of the fastest motion up to which Φ(h) is smooth on a scale of factors
_SCAN = (2, 8, 5)  # lengths in each factor of ten up to there, beyond, and in each radian of an oscillation
_MOST = 500  # lengths that are tried at each part of a radian, before they grow by factors alone
_DECAYED = 5.0  # h |Re λ| from which an oscillation is over before the next tick
_SHARP = 3e-4  # of a limit
LARGEST = 690.0  # ln of a growth that is told


class Stability(StrEnum):
    """What a map is."""

    STABLE = "stable"
    MARGINAL = "marginal"
    UNSTABLE = "unstable"


class Growth(NamedTuple):
    """How deviations grow under a map.

    Attributes:
        factor: Spectral radius.
        least, most: Bounds of max |λ_i| − 1, from the error of each eigenvalue.
        doubt: The error of the eigenvalue that the lower bound is of.
    """

    factor: float
    least: float
    most: float
    doubt: float

    @property
    def verdict(self) -> Stability:
        """Unstable if some deviation grows for certain, stable if all decay for certain."""
        if self.least > 0:
            return Stability.UNSTABLE
        return Stability.STABLE if self.most < 0 else Stability.MARGINAL


def worst(growths: Iterable[Growth]) -> Growth:
    """Of several maps, the bounds that hold for all."""
    return Growth(*map(max, zip(*growths, strict=True)))


NO_BOUND = Growth(inf, inf, inf, 0.0)


def growth(made: Array, error: Array) -> Growth:
    """Growth under a map whose entries are known to an error.

    Args:
        made: The map, (m, m).
        error: Of its entries, (m, m), not negative.
    """
    from scipy.linalg import eig

    if not np.isfinite(made).all():
        return NO_BOUND
    with np.errstate(all="ignore"):  # a defective eigenvalue has left and right vectors at right angles
        values, left, right = cast(tuple[Array, Array, Array], eig(made, left=True, right=True))
        doubt = np.einsum("ik,ij,jk->k", np.abs(left), error, np.abs(right)) / np.abs((left.conj() * right).sum(axis=0))
    size, doubt = np.abs(values), np.minimum(np.nan_to_num(doubt, nan=_BAND), _BAND)
    k = int((size - doubt).argmax())
    least, most = float(size[k] - doubt[k]) - 1, float((size + doubt).max()) - 1
    return Growth(float(size.max()), least, most, float(doubt[k]))


def longest_step(method: Any, J: Array, n: int) -> float:
    """The longest step of a method that is stable on δx' = J δx, in [s]; inf if every step is.

    Steps whose stages are not found, as long ones of Gauss methods by fixed-point iteration, count as unstable.

    Args:
        method: A method of fixed step.
        J: (m, m).
        n: Number of positions, the first entries of x.
    """
    excess = excess_rate(method, J, n)
    return first_unstable(lambda h: excess(h) > 0, lengths(np.linalg.eigvals(J), np.zeros(0)))


def excess_rate(method: Any, J: Array, n: int) -> Callable[[float], float]:
    """The rate, in [1/s], by which steps h let deviations grow faster than is allowed; a function of h.

    Args: As of `longest_step`.
    """
    from scipy.linalg import schur

    T, Z = cast(tuple[Array, Array], schur(J, "complex"))
    rates, made = T.diagonal(), step_map(method, J, n)
    allowed = _GROWS * np.maximum(0.0, np.real(rates)) + _AMPLIFIES * np.abs(rates).max()
    of_each = _acts_on_each(method, J, n)

    def excess(h: float) -> float:
        try:
            with np.errstate(all="ignore"):
                if of_each:  # Φ(h) = R(h J) is triangular in the basis in which J is
                    grown = np.log(np.abs(np.einsum("ji,jk,ki->i", Z.conj(), made(h), Z)))
                    return _largest(grown / h - allowed)
                grown = np.log(np.sort(np.abs(np.linalg.eigvals(made(h)))))
                return _largest(np.where(grown < _ROUNDED, 0.0, grown / h) - np.sort(allowed))
        except (RobotDynError, np.linalg.LinAlgError):
            return inf

    return excess


def _largest(rates: Array) -> float:
    """The largest of some rates, inf where one is none."""
    return inf if np.isnan(rates).any() else float(rates.max())


def _acts_on_each(method: Any, J: Array, n: int) -> bool:
    """Whether Φ(h) is a function of h J: a method that treats positions and velocities alike does not read n."""
    h = _SMOOTH / max(STILL, float(np.abs(np.linalg.eigvals(J)).max()))
    try:
        return np.array_equal(step_map(method, J, n)(h), step_map(method, J, 0)(h))
    except RobotDynError:
        return False


def step_map(method: Any, J: Array, n: int) -> Callable[[float], Array]:
    """Φ(h) of a method of fixed step on δx' = J δx, as of `longest_step`."""
    by_entry = np.concatenate([J.T, np.zeros((1, len(J)))])

    def exact(t: Any, y: Array) -> Array:
        return np.broadcast_to(by_entry.reshape(-1, *(1,) * (y.ndim - 1), len(J)), (len(J) + 1, *y.shape)).copy()

    system = System(lambda t, y: y @ J.T, n, exact=exact)
    return lambda h: np.asarray(method.step(system, 0.0, np.eye(len(J)), h)).T


def after(factor: float, times: float) -> float:
    """factor^times, at most e^690 = 4.6e299."""
    return exp(min(times * log(factor), LARGEST)) if factor > 0 and times else float(not times)


def periods(duration_s: float, period_s: float) -> int:
    """Number of whole periods in a duration, each of which may be rounded."""
    return int(duration_s / period_s * (1 + 4 * float_info.epsilon))


def shown(factor: float) -> str:
    """A factor in four digits, or as 1 and two digits; as a bound if it is the largest that is told."""
    if factor >= exp(LARGEST):
        return "more than 1e+299"
    return f"1 + {factor - 1:.2g}" if 0 < factor - 1 < _BAND else f"{factor:.4g}"


def below(limit: float) -> str:
    """A length safely below a limit, in one digit."""
    return f"{float(f'{limit / 2:.0e}'):g}"


def lengths(rates: Array, rings: Array, least: float = _LEAST) -> list[float]:
    """Lengths h to try, the shortest first, for motions of these rates λ; none if nothing moves.

    Args:
        rates: Eigenvalues, in [1/s].
        rings: Those of oscillations by which stability may come and go as h grows.
        least: The first h |λ|, of the fastest motion.
    """
    sizes = np.abs(rates)
    fastest = float(sizes.max(initial=0.0))
    told = sizes[sizes > STILL * max(1.0, fastest)]
    if not len(told):
        return []
    h, last, made = least / fastest, _FARTHEST / float(told.min()), []
    while h < last:
        made.append(h)
        goes_on = np.abs(np.imag(rings))[-np.real(rings) * h < _DECAYED] if len(made) < _MOST else np.zeros(0)
        step = 1 / (_SCAN[2] * goes_on.max()) if goes_on.any() else inf
        h = min(h * 10 ** (1 / _SCAN[int(h * fastest > _SMOOTH)]), h + step)
    return made


def first_unstable(unstable: Callable[[float], bool], tried: list[float]) -> float:
    """The length up to which nothing is unstable; inf if nothing tried is, 0 if the shortest is.

    Args:
        unstable: Whether Φ(h) is.
        tried: Lengths, the shortest first.
    """
    before = 0.0
    for beyond in tried:
        if unstable(beyond):
            break
        before = beyond
    else:
        return inf
    while before and beyond - before > _SHARP * beyond:
        middle = (before + beyond) / 2
        before, beyond = (before, middle) if unstable(middle) else (middle, beyond)
    return before
