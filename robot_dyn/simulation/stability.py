"""The longest stable step of a method about states of a motion.

    δx⁺ = Φ(h) δx on δx' = J δx,   stable while ρ(Φ(h)) grows no more than max(1, ρ(e^{hJ})) does

[Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.2]
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, log
from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.integrator import System

_GROWTH = 1e3  # over the run, beyond that of the motion itself: a run that grows by more has blown up
_RANGE = (1e-4, 1e3)  # h |λ| where limits are looked for, of the fastest and of the slowest motion
_STILL = 1e-9  # of the fastest |λ|: differences do not tell less from zero
_LEAST_STEPS = 20  # of a run: longer steps are not judged
_SCAN = 5  # lengths in each factor of ten
_SHARP = 1e-3  # of a limit


def longest_step(method: Any, J: Array, n: int, duration_s: float) -> float:
    """The longest step of a method that is stable on δx' = J δx, in [s]; inf if every step of a run is.

    Steps whose stages are not found, as long ones of Gauss methods by fixed-point iteration, count as unstable.

    Args:
        method: A method of fixed step.
        J: (m, m).
        n: Number of positions, the first entries of x.
        duration_s: Of the run.
    """
    return longest(step_map(method, J, n), J, duration_s)


def step_map(method: Any, J: Array, n: int) -> Callable[[float], Array]:
    """Φ(h) of a method of fixed step on δx' = J δx, as of `longest_step`."""
    by_entry = np.concatenate([J.T, np.zeros((1, len(J)))])

    def exact(t: Any, y: Array) -> Array:
        return np.broadcast_to(by_entry.reshape(-1, *(1,) * (y.ndim - 1), len(J)), (len(J) + 1, *y.shape)).copy()

    system = System(lambda t, y: y @ J.T, n, exact=exact)
    return lambda h: np.asarray(method.step(system, 0.0, np.eye(len(J)), h)).T


def blows_up(made: Array, J: Array, h: float, duration_s: float, steps: int = 1) -> bool:
    """Whether the powers of a matrix, of so many steps h, grow by 1e3 more than the motion with J does over a run."""
    with np.errstate(all="ignore"):
        rate = np.log(np.abs(np.linalg.eigvals(made)).max()) / (steps * h)
    growth = max(0.0, float(np.linalg.eigvals(J).real.max()))
    return not rate - growth <= log(_GROWTH) / duration_s


def below(limit: float) -> str:
    """A length safely below a limit, in one digit."""
    return f"{float(f'{limit / 2:.0e}'):g}"


def longest(matrix: Callable[[float], Array], J: Array, duration_s: float, steps: int = 1) -> float:
    """The longest h for which the powers of a matrix, of so many steps h, grow no more than the motion with J does.

    It is inf if each is, and 0 if none is. It is looked for from short to long, so that what is stable again beyond
    does not count.
    """
    rates = np.abs(np.linalg.eigvals(J))
    size = float(rates.max())

    def stable(h: float) -> bool:
        try:
            return not blows_up(matrix(h), J, h, duration_s, steps)
        except (RobotDynError, np.linalg.LinAlgError):
            return False

    if not size > 0:
        return inf
    slowest = float(rates[rates > _STILL * size].min())  # it may be what a long period makes unstable
    low, high = _RANGE[0] / size, min(_RANGE[1] / slowest, duration_s / _LEAST_STEPS)
    if low >= high:
        return inf
    before, after = 0.0, inf
    with np.errstate(all="ignore"):
        for h in np.geomspace(low, high, 2 + int(_SCAN * np.log10(high / low))).tolist():
            if not stable(h):
                after = h
                break
            before = h
        while low * _SHARP < after < inf and after - before > _SHARP * after:
            middle = (before + after) / 2
            before, after = (middle, after) if stable(middle) else (before, middle)
    return before if after < inf else inf
