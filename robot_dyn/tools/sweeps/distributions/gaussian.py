"""The normal distribution, and the one whose logarithm is normal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from robot_dyn.foundations import SweepError
from robot_dyn.tools.sweeps.distributions.base import MOST, Distribution


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class Normal(Distribution):
    """Normal, of mean and standard deviation."""

    name: ClassVar[str] = "normal"
    mean: np.ndarray
    sd: np.ndarray

    def __post_init__(self) -> None:
        self._check("mean")
        self._check("sd", least=0.0)
        self._check_shapes()

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        return self.mean + self.sd * _standard_normal(u)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class LogNormal(Distribution):
    """Log-normal: the logarithm is normal, of mean log(median) and standard deviation sigma_of_log."""

    name: ClassVar[str] = "lognormal"
    median: np.ndarray
    sigma_of_log: np.ndarray

    def __post_init__(self) -> None:
        self._check("median", above=0.0)
        self._check("sigma_of_log", least=0.0)
        self._check_shapes()
        with np.errstate(over="ignore"):
            largest = self._inverse(np.full((1, *self.shape), MOST))
        if not np.isfinite(largest).all():
            raise SweepError("median and sigma_of_log of lognormal are so large that its values overflow")

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        return self.median * np.exp(self.sigma_of_log * _standard_normal(u))


def _standard_normal(u: np.ndarray) -> np.ndarray:
    from scipy.special import ndtri  # late: only runs need it

    return ndtri(u)
