"""What all distributions of parameters have in common: the inverse of F, its numbers as JSON."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from robot_dyn.foundations import SweepError, Value, numbers

LEAST, MOST = 2.0**-54, 1 - 2.0**-53
"""Between which numbers are taken: F⁻¹(0) may be infinite."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Distribution(Value, ABC):
    """A distribution of one number, or of n independent ones."""

    name: ClassVar[str]

    @property
    def shape(self) -> tuple[int, ...]:
        """Of one value: () or (n,), the common shape of its parameters."""
        return np.broadcast_shapes(*(np.shape(getattr(self, each.name)) for each in fields(self)))

    @property
    def size(self) -> int:
        """The columns of a design that it takes."""
        return self.shape[0] if self.shape else 1

    def values(self, u: Any) -> np.ndarray:
        """F⁻¹(u), shape (k,) or (k, n).

        Args:
            u: Numbers in [0, 1), shape (k, size); 0 is taken for 2⁻⁵⁴.

        Raises:
            SweepError: If u is anything else.
        """
        u = numbers(f"u of {self.name}", u, ("k", self.size), error=SweepError, least=0.0)
        if (u >= 1).any():
            raise SweepError(f"u of {self.name} must be below 1, got {u[u >= 1][0]:g}")
        return self._inverse(np.clip(u, LEAST, MOST).reshape(-1, *self._taken))

    @property
    def _taken(self) -> tuple[int, ...]:
        """The shape of the numbers that one value takes."""
        return self.shape

    @abstractmethod
    def _inverse(self, u: np.ndarray) -> np.ndarray:
        """F⁻¹(u) of u in (0, 1), shape (k, …)."""

    def to_dict(self) -> dict[str, Any]:
        """Its name and numbers, for JSON; `from_dict` returns an equal distribution."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        return {"distribution": self.name} | {name: _listed(x) for name, x in given.items()}

    def _check(self, name: str, above: float | None = None, least: float | None = None) -> None:
        """Convert a parameter to an array of shape () or (n,)."""
        what = f"{name} of {self.name}"
        x = numbers(what, getattr(self, name), (), ("n",), error=SweepError, above=above, least=least)
        object.__setattr__(self, name, x)

    def _check_shapes(self) -> None:
        """Raise SweepError unless the parameters have one common shape."""
        shapes = {each.name: np.shape(getattr(self, each.name)) for each in fields(self)}
        if len(set(shapes.values()) - {()}) > 1:
            raise SweepError(f"lengths differ in {self.name}: {said(shapes)}")

    def _check_order(self, low: str, high: str) -> None:
        """Raise SweepError unless one parameter is at most another."""
        a, b = np.broadcast_arrays(getattr(self, low), getattr(self, high))
        if (wrong := a > b).any():
            raise SweepError(f"{low} of {self.name} must be at most {high}, got {a[wrong][0]:g} and {b[wrong][0]:g}")


def _listed(x: Any) -> Any:
    """What JSON can hold of a parameter, equal to the bit."""
    if isinstance(x, np.ndarray):
        return x.tolist()
    if isinstance(x, tuple):
        return [_listed(each) for each in x]
    return {name: _listed(each) for name, each in x.items()} if isinstance(x, Mapping) else x


def said(given: Mapping[str, Any]) -> str:
    """Parameters in a message."""
    return ", ".join(f"{name} {x}" for name, x in given.items()) or "no parameters"
