"""Delays of a sampled loop: whole periods by a queue of signals, the rest of a period by a further instant.

    measured at t_k − τ_m: x_{k−d} of the instants t_k − (τ_m mod T);   acts from t_k + τ_u on: at t_{k+d} + (τ_u mod T)

[Åström, Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, sec. 2.3]
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import ControlError
from robot_dyn.foundations.validate import number

_LEAST = 1e-6  # of a period, between two instants
_MOST = 1000  # periods of a delay: each is a state of every joint
_ROUNDED = 1e-9  # of a period


class Instant(NamedTuple):
    """A part of each period at which the loop measures, computes, or lets a torque act."""

    part: float
    measures: bool
    computes: bool
    acts: bool


def instants(measurement_delay: float, actuation_delay: float) -> tuple[Instant, ...]:
    """Return the instants of each period, the computation first, for delays in periods.

    Raises:
        ControlError: If two instants lie too close together.
    """
    measured, acted = -measurement_delay % 1.0, actuation_delay % 1.0
    parts = sorted({0.0, measured, acted})
    if (np.diff([*parts, 1.0]) < _LEAST).any():
        raise ControlError(
            f"measurement_delay = {measurement_delay!r} and actuation_delay = {actuation_delay!r} make instants that"
            f" lie closer together than {_LEAST:g} of a period; make them one, or move them apart"
        )
    return tuple(Instant(part, part == measured, part == 0.0, part == acted) for part in parts)


def delay(name: str, given: Any) -> float:
    """Return a delay in periods, rounded to a whole number if it is that but for rounding."""
    periods = number(name, given, error=ControlError)
    if not 0 <= periods <= _MOST:
        raise ControlError(f"{name} must be from 0 to {_MOST} periods, got {periods:g}; take another period")
    return float(round(periods)) if abs(periods - round(periods)) < _ROUNDED else periods


def shifted(x: Array, past: Array) -> tuple[Array, Array]:
    """Return what leaves a delay of whole periods when x enters it, and its content then, the newest first."""
    if not len(past):
        return x, past
    return past[-len(x) :], np.concatenate([x, past[: -len(x)]])
