"""Distributions on an interval: uniform and triangular."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from robot_dyn.tools.sweeps.distributions.base import Distribution


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class Uniform(Distribution):
    """Uniform from low to high."""

    name: ClassVar[str] = "uniform"
    low: np.ndarray
    high: np.ndarray

    def __post_init__(self) -> None:
        self._check("low")
        self._check("high")
        self._check_shapes()
        self._check_order("low", "high")

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        return np.clip(self.low * (1 - u) + self.high * u, self.low, self.high)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class Triangular(Distribution):
    """Triangular from low to high with its peak at mode."""

    name: ClassVar[str] = "triangular"
    low: np.ndarray
    mode: np.ndarray
    high: np.ndarray

    def __post_init__(self) -> None:
        for each in ("low", "mode", "high"):
            self._check(each)
        self._check_shapes()
        self._check_order("low", "mode")
        self._check_order("mode", "high")

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        rise, fall = self.mode - self.low, self.high - self.mode
        width = rise + fall
        left = self.low + np.sqrt(u * width * rise)
        right = self.high - np.sqrt((1 - u) * width * fall)
        return np.clip(np.where(u * width < rise, left, right), self.low, self.high)
