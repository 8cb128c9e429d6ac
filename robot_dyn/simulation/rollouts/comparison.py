"""Runs whose steps pass thresholds, compared with runs whose steps end there, on a random sample of a batch.

If n runs are drawn at random and the largest difference among them is d, then with confidence γ at most the fraction

    1 − (1 − γ)^(1/n)

of all runs differs by more than d: the one-sided tolerance limit of Wilks (1941), 4.6 % for n = 64 and γ = 95 %.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.foundations.values import Value

SAMPLE = 64  # runs that are compared; of a smaller batch, all
CONFIDENCE = 0.95


@final
@dataclass(frozen=True)
class Difference(Value):
    """Difference of a quantity between uncut and cut runs.

    Attributes:
        name: Name of the quantity.
        unit: Unit of the quantity.
        median, largest: Median and largest difference over the compared runs; infinite for a run that has a value in
            one way only.
    """

    name: str
    unit: str
    median: float
    largest: float

    @property
    def heading(self) -> str:
        """Name with its unit, such as "q [rad]"."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@final
@dataclass(frozen=True)
class Comparison(Value):
    """Uncut runs against the same runs with steps cut at thresholds.

    Attributes:
        compared: Number of compared runs, drawn at random.
        runs: Number of all runs.
        other_outcome: Number of compared runs with another outcome.
        differences: Differences by quantity.
    """

    compared: int
    runs: int
    other_outcome: int
    differences: tuple[Difference, ...]

    @property
    def beyond(self) -> float:
        """Largest fraction of all runs that differs by more than `largest`, with 95 % confidence."""
        return 0.0 if self.compared == self.runs else 1.0 - (1.0 - CONFIDENCE) ** (1.0 / self.compared)

    def __str__(self) -> str:
        which = "all runs" if self.compared == self.runs else f"{self.compared} of {self.runs} runs, drawn at random,"
        parts = [f"{which} were repeated with steps that end at thresholds; {self.other_outcome} have another outcome"]
        parts += [
            f"{x.heading} differs by {x.median:.2g} in the median, {x.largest:.2g} at most" for x in self.differences
        ]
        if self.compared < self.runs:
            parts.append(
                f"with {100 * CONFIDENCE:g} % confidence at most {100 * self.beyond:.2g} % of all runs differ by more"
            )
        return "; ".join(parts)


def drawn(runs: int, seed: int = 0) -> np.ndarray:
    """Return the places of the runs to compare, drawn at random without repetition, in order."""
    places = np.random.default_rng([seed, runs]).choice(runs, min(runs, SAMPLE), replace=False)
    return np.sort(places)


def differences(
    uncut: Mapping[str, np.ndarray], cut: Mapping[str, np.ndarray], units: Mapping[str, str]
) -> Iterable[Difference]:
    """Yield the difference of each quantity, from its values (k,) or (k, …) in k uncut and k cut runs."""
    for name, x in uncut.items():
        y = cut[name]
        finite, same = np.isfinite(x) & np.isfinite(y), (x == y) | (np.isnan(x) & np.isnan(y))
        gaps = np.full(x.shape, np.inf)
        np.subtract(x, y, out=gaps, where=finite)
        of_run = np.where(same, 0.0, np.abs(gaps)).reshape(len(x), -1).max(axis=1)
        yield Difference(name, units.get(name, ""), float(np.median(of_run)), float(of_run.max()))
