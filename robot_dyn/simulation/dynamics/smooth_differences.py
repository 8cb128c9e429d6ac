"""Derivatives of smooth rates: differences at many steps, and the most accurate of them.

The change from one step to the next shows the truncation, and the slopes of both sides show a kink; the rounding of
the rates is an argument. [Press et al., Numerical Recipes, 3rd ed., 2007, sec. 5.7]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

_STEPS = 0.5 ** np.arange(3, 45)
_AGREE = 1e-6  # fraction of the largest slope of a column: with a larger truncation there is no derivative
_HIDDEN = 1e-3  # fraction of the largest slope at any step: a larger rounding hides the derivative
_DOUBT = 1e5  # times the rounding of the rates per unit: a smaller rounding of a slope does not hide it
_ONE_SIDED = 0.01  # fraction of a slope: a larger difference between its two sides is a kink
ROUNDING = 4 * np.finfo(float).eps
"""Rounding of a rate, as a part of the sum of magnitudes of its terms."""


@final
@dataclass(frozen=True)
class Column:
    """Differences of rates by one entry of x, at falling steps.

    Attributes:
        steps: Steps of the differences, each half of the one before, (k,).
        slopes: Differences of fourth order, (k, r).
        bends: Slope on the upper side less the slope on the lower side, (k, r).
        rises: Largest change of a rate over each step, (k,), which bounds the rounding that the step adds.
    """

    steps: np.ndarray
    slopes: np.ndarray
    bends: np.ndarray
    rises: np.ndarray

    @classmethod
    def from_function(
        cls, f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, j: int, here: np.ndarray, most: float
    ) -> Column:
        """Return the differences by entry j, with steps up to `most` that change it by more than rounding."""
        least = 64 * np.spacing(abs(x[j]))
        steps = np.array([h for h in _STEPS if least <= h <= max(most, _STEPS[-5])])
        sides, step = [], np.zeros(len(x))
        for h in steps:
            step[j] = h
            sides.append((f(x + step), f(x - step)))
        up, down = np.array(sides).transpose(1, 0, 2)
        rise, h = up - down, steps[1:, None]
        slopes, bends = (8 * rise[1:] - rise[:-1]) / (12 * h), ((up - here) + (down - here))[1:] / h
        return cls(steps[1:], slopes, bends, np.maximum(np.abs(up - here), np.abs(down - here)).max(axis=1)[1:])

    def best(self, rounding: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the most accurate slopes, with their truncation, half the jump of the slope, and rounding, each (r,).

        The bend of a smooth rate is h f″ + h³ f⁗/12 + …; two extrapolations leave the jump of the slope.

        Args:
            rounding: Rounding of the rates at the state, (r,).
        """
        truncation = np.abs(np.diff(self.slopes, axis=0))[:-1]
        bends = 2 * self.bends[1:] - self.bends[:-1]
        jumps = np.abs(8 * bends[1:] - bends[:-1]) / 14
        rounded = (rounding + ROUNDING * self.rises[:-2, None]) / self.steps[:-2, None]
        k = (truncation + jumps + rounded).argmin(axis=0), np.arange(len(rounding))
        return self.slopes[k], truncation[k], jumps[k], rounded[k]

    def is_smooth(self, rounding: np.ndarray) -> bool:
        """Return True if steps agree on a slope, which is the same on both sides."""
        slopes, truncation, jumps, rounded = self.best(rounding)
        return not (
            (truncation > _AGREE * np.abs(slopes).max() + 4 * rounded).any()
            or (rounded > _HIDDEN * (self.rises / self.steps).max() + _DOUBT * rounding.max()).any()
            or (jumps > _ONE_SIDED * np.abs(slopes) + 16 * rounded).any()
        )
