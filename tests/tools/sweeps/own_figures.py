"""Figures that tests of sweeps share: functions of what varies alone, so that their statistics are known."""

from __future__ import annotations

from math import inf, log10, nan, pi, sin, sqrt

import numpy as np

from robot_dyn.tools import sweeps as sw


def _kp(run: sw.Run) -> float:
    return float(np.ravel(run.varied["kp"])[0])


def parity(run: sw.Run) -> float:
    """Whether kp is odd: decided by kp, and by no trend of it."""
    return _kp(run) % 2


def waves(run: sw.Run) -> float:
    """Eight periods of a sine over kp in 0 … 1, which explain 6/7 of the variance, and kd in 0 … 1 the rest."""
    return sin(16 * pi * _kp(run)) + (float(np.ravel(run.varied["kd"])[0]) - 0.5)


def below(run: sw.Run) -> float:
    """1 where kp is below 0.48, else 0."""
    return float(_kp(run) < 0.48)


def logarithm(run: sw.Run) -> float:
    """log10 of kp − 0.5, −∞ where that is not positive: an error that vanishes."""
    return log10(_kp(run) - 0.5) if _kp(run) > 0.5 else -inf


def partly(run: sw.Run) -> float:
    """The root of kp − 0.25: a figure that some finished runs do not have."""
    return sqrt(_kp(run) - 0.25) if _kp(run) > 0.25 else nan


def fails(run: sw.Run) -> float:
    """Raise where kp is odd, so that the run counts as failed."""
    if _kp(run) % 2:
        raise ValueError("odd")
    return 0.0


for _figure in (parity, waves, below, logarithm, partly, fails):
    _figure.record = ("q",)  # pyright: ignore[reportFunctionMemberAccess]
