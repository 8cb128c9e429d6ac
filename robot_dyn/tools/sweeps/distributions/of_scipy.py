"""Frozen distributions of scipy.stats, of one variable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np

from robot_dyn.foundations import SweepError, numbers, shown
from robot_dyn.tools.sweeps.distributions.base import LEAST, MOST, Distribution, said


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class OfSciPy(Distribution):
    """A frozen distribution of scipy.stats, stored by its name and its numbers.

    Attributes:
        of: Its name in scipy.stats.
        args: Parameters by position.
        kwds: Parameters by name.
    """

    name: ClassVar[str] = "scipy.stats"
    of: str
    args: tuple[Any, ...] = ()
    kwds: Mapping[str, Any]

    def __post_init__(self) -> None:
        args = tuple(self._parameter(f"parameter {k}", x) for k, x in enumerate(self.args))
        kwds = {name: self._parameter(str(name), x) for name, x in dict(self.kwds).items()}
        object.__setattr__(self, "args", args)
        object.__setattr__(self, "kwds", kwds)
        if len(self.shape) > 1:
            raise SweepError(f"parameters of scipy.stats.{self.of} must be numbers or of shape (n,)")
        ends = self._inverse(np.array([[LEAST], [0.5], [MOST]]) + np.zeros(self.size))
        if not np.isfinite(ends).all():
            raise SweepError(
                f"scipy.stats.{self.of} has no finite values between its quantiles of 2⁻⁵⁴ and 1 − 2⁻⁵³ with"
                f" {self._said}"
            )

    def _parameter(self, name: str, x: Any) -> Any:
        what = f"{name} of scipy.stats.{self.of}"
        array = numbers(what, x, (), ("n",), error=SweepError)
        if np.asarray(x).dtype.kind in "iu":  # a discrete distribution may need whole numbers
            array = np.array(x)
            array.setflags(write=False)
        return array

    @property
    def _said(self) -> str:
        return said(
            {f"parameter {k}": x.tolist() for k, x in enumerate(self.args)}
            | {k: x.tolist() for k, x in self.kwds.items()}
        )

    @property
    def shape(self) -> tuple[int, ...]:
        try:
            return np.broadcast_shapes(*(x.shape for x in (*self.args, *self.kwds.values())))
        except ValueError:
            raise SweepError(f"lengths differ in scipy.stats.{self.of}: {self._said}") from None

    def frozen(self) -> Any:
        """The distribution of scipy.stats."""
        from scipy import stats  # late: it takes a second

        kind = getattr(stats, self.of, None)
        if not isinstance(kind, stats.rv_continuous | stats.rv_discrete):
            raise SweepError(f"scipy.stats has no distribution {shown(self.of)} of one variable")
        try:
            return kind(*self.args, **self.kwds)
        except TypeError as found:
            raise SweepError(f"scipy.stats.{self.of} does not take {self._said}: {found}") from None

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        return np.asarray(self.frozen().ppf(u), float).reshape(-1, *self.shape)
