"""Signals of a log: even times, zero-phase low-pass filters, derivatives.

The same filters act on the regressor and on the torque, so that Y θ = τ also holds for the filtered rows.
[Gautier 1997; Janot, Vandanjon, Gautier 2014]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn.foundations import Value

_ORDER = 4  # of each pass
_OUTER, _ROWS = 2.0, 8.0  # first cutoff, and rate of the regressor, in units of the cutoff
_EDGE = 1.0  # rows left out at both ends, in periods of the cutoff
_NYQUIST = 0.45  # highest cutoff, in units of the rate


@final
@dataclass(frozen=True, eq=False)
class Signals(Value):
    """Two zero-phase filters: the first of q and τ at all times, the second of regressor and torque, at fewer times.

    Attributes:
        start_s: Time of the first sample, in [s].
        step_s: Time between samples, in [s].
        count: Number of samples.
        cutoff_hz: Cutoff of the second filter; the first has twice as much, where the rate allows it.
    """

    start_s: float
    step_s: float
    count: int
    cutoff_hz: float

    @property
    def times(self) -> np.ndarray:
        """Even times of the samples, (m,), in [s]."""
        return self.start_s + self.step_s * np.arange(self.count)

    @cached_property
    def every(self) -> int:
        """Samples in the time between two evaluations of the regressor."""
        return max(1, int(1 / (self.step_s * _ROWS * self.cutoff_hz)))

    @property
    def row_step_s(self) -> float:
        """Time between two evaluations of the regressor, in [s]."""
        return self.step_s * self.every

    @property
    def row_times(self) -> np.ndarray:
        """Times of the evaluations of the regressor, (k,), in [s]."""
        return self.times[:: self.every]

    @cached_property
    def stride(self) -> int:
        """Evaluations in the time between two rows: after the filter, rows this far apart are nearly independent."""
        return max(1, int(1 / (2 * self.cutoff_hz * self.row_step_s)))

    def first(self, x: np.ndarray) -> np.ndarray:
        """Return samples, (m, ...), after the first filter."""
        return low_pass(x, _OUTER * self.cutoff_hz * self.step_s)

    def second(self, x: np.ndarray) -> np.ndarray:
        """Return rows, (k, ...), after the second filter: fewer rows, without the ends."""
        return self.second_of(low_pass(x, self.cutoff_hz * self.row_step_s))

    def second_of(self, x: np.ndarray) -> np.ndarray:
        """Return the rows of `second`, (k, ...), without a filter."""
        edge = int(_EDGE / (self.cutoff_hz * self.row_step_s)) + 1
        return x[edge : len(x) - edge : self.stride]

    def rates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, v and a at the row times from filtered samples q, (m, n), by central differences."""
        v = np.gradient(q, self.step_s, axis=0)
        a = np.gradient(v, self.step_s, axis=0)
        return q[:: self.every], v[:: self.every], a[:: self.every]


def low_pass(x: np.ndarray, cutoff: float) -> np.ndarray:
    """Return samples after a Butterworth filter run forwards and backwards; `cutoff` in units of the rate."""
    from scipy.signal import butter, sosfiltfilt

    if cutoff >= _NYQUIST:
        return x
    return sosfiltfilt(butter(_ORDER, 2 * cutoff, output="sos"), x, axis=0)


def evenly(t: np.ndarray, x: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return samples x, (m, n), at other times, by a cubic spline."""
    from scipy.interpolate import CubicSpline

    return CubicSpline(t, x)(times)
