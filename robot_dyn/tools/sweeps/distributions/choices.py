"""One of several values, each as likely."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from robot_dyn.foundations import SweepError, numbers
from robot_dyn.tools.sweeps.distributions.base import Distribution


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class Choice(Distribution):
    """One of m values with equal probabilities: numbers, or rows of n numbers."""

    name: ClassVar[str] = "choice"
    of: np.ndarray

    def __post_init__(self) -> None:
        of = numbers("the values of choice", self.of, ("m",), ("m", "n"), error=SweepError)
        object.__setattr__(self, "of", of)

    @property
    def shape(self) -> tuple[int, ...]:
        return self.of.shape[1:]

    @property
    def size(self) -> int:
        return 1

    @property
    def _taken(self) -> tuple[int, ...]:
        return ()

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        return self.of[np.minimum((u * len(self.of)).astype(int), len(self.of) - 1)]
