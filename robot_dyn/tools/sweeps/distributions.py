"""Distributions of what varies: F⁻¹ of the rows of a design, by `scipy.stats`; stored by name and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, Value, numbers, shown
from robot_dyn.tools.sweeps.texts import call_of, called

LEAST, MOST = 2.0**-54, 1 - 2.0**-53
"""Between which numbers are taken: F⁻¹(0) may be infinite."""
_SCIPY = "scipy.stats."
_ORDERED = {"uniform": ("low", "high"), "triangular": ("low", "mode", "high")}
_BOUNDS: dict[str, Any] = {"sd": {"least": 0.0}, "sigma_of_log": {"least": 0.0}, "median": {"above": 0.0}}


@final
@dataclass(frozen=True, eq=False)
class Distribution(Value):
    """A distribution of one number, or of n independent ones.

    Attributes:
        name: "uniform", "normal", "lognormal", "triangular", "choice", or "scipy.stats.gamma" for one of SciPy.
        parameters: By name, each a number or of shape (n,); of "choice" the values, shape (m,) or (m, n). Those that
            SciPy takes by position are named "0", "1", ….
    """

    name: str
    parameters: Mapping[str, Any]

    def __post_init__(self) -> None:
        shapes = ((), ("n",)) if self.name != "choice" else (("m",), ("m", "n"))
        checked = {}
        for key, x in self.parameters.items():
            what = f"the {key} of choice" if self.name == "choice" else f"{key} of {self.name}"
            array = numbers(what, x, *shapes, error=SweepError, **_BOUNDS.get(key, {}))
            if self.name.startswith(_SCIPY) and np.asarray(x).dtype.kind in "iu":  # SciPy may need whole numbers
                array = np.array(x)
                array.setflags(write=False)
            checked[key] = array
        object.__setattr__(self, "parameters", checked)
        if self.name == "choice":
            return
        _ = self.shape  # refused if lengths differ
        for low, high in pairwise(_ORDERED.get(self.name, ())):
            a, b = np.broadcast_arrays(checked[low], checked[high])
            if (wrong := a > b).any():
                raise SweepError(
                    f"{low} of {self.name} must be at most {high}, got {a[wrong][0]:g} and {b[wrong][0]:g}"
                )
        with np.errstate(all="ignore"):
            ends = self._inverse(np.full((3, self.size), [[LEAST], [0.5], [MOST]]).reshape(3, *self.shape))
        if not np.isfinite(ends).all():
            raise SweepError(f"{self.name} has no finite values between its quantiles of 2⁻⁵⁴ and 1 − 2⁻⁵³: {self}")

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Of one value: () or (n,)."""
        if self.name == "choice":
            return self.parameters["values"].shape[1:]
        try:
            return np.broadcast_shapes(*(np.shape(x) for x in self.parameters.values()))
        except ValueError:
            raise SweepError(f"lengths differ in {self}") from None

    @property
    def size(self) -> int:
        """The columns of a design that it takes."""
        return 1 if self.name == "choice" or not self.shape else self.shape[0]

    @property
    def width(self) -> int:
        """The numbers of one value."""
        return self.shape[0] if self.shape else 1

    def values(self, u: np.ndarray) -> np.ndarray:
        """F⁻¹(u), shape (k,) or (k, n), of numbers in [0, 1), shape (k, size); 0 is taken for 2⁻⁵⁴."""
        if self.name == "choice":
            of = self.parameters["values"]
            return of[np.minimum((u[:, 0] * len(of)).astype(int), len(of) - 1)]
        return self._inverse(np.clip(u, LEAST, MOST).reshape(-1, *self.shape))

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        x = np.asarray(self._ppf(u), float)
        return np.broadcast_to(x, (len(u), *self.shape)).copy()

    @cached_property
    def _ppf(self) -> Any:
        if not self.name.startswith(_SCIPY):
            return partial(_INVERSES[self.name], **self.parameters)
        from scipy import stats  # late: it takes a second

        name = self.name.removeprefix(_SCIPY)
        kind = getattr(stats, name, None)
        if not isinstance(kind, stats.rv_continuous | stats.rv_discrete):
            raise SweepError(f"scipy.stats has no distribution {shown(name)} of one variable")
        args = [self.parameters[key] for key in sorted(filter(str.isdigit, self.parameters), key=int)]
        try:
            return kind(*args, **{key: x for key, x in self.parameters.items() if not key.isdigit()}).ppf
        except TypeError as found:
            raise SweepError(f"scipy.stats does not take {self}: {found}") from None

    def __str__(self) -> str:
        said = (f"{'' if key.isdigit() else f'{key}='}{x.tolist()}" for key, x in self.parameters.items())
        return f"{self.name}({', '.join(said)})"

    def to_dict(self) -> dict[str, Any]:
        """Its name and numbers, for JSON; `from_dict` returns an equal distribution."""
        return {"distribution": self.name} | {key: x.tolist() for key, x in self.parameters.items()}


def uniform(*, low: Any, high: Any) -> Distribution:
    """Uniform from low to high; numbers or arrays of shape (n,), in the unit of the parameter."""
    return Distribution("uniform", {"low": low, "high": high})


def normal(*, mean: Any, sd: Any) -> Distribution:
    """Normal, of mean and standard deviation; numbers or arrays of shape (n,), in the unit of the parameter."""
    return Distribution("normal", {"mean": mean, "sd": sd})


def lognormal(*, median: Any, sigma_of_log: Any) -> Distribution:
    """Log-normal, of median and of the standard deviation of the logarithm; numbers or arrays of shape (n,)."""
    return Distribution("lognormal", {"median": median, "sigma_of_log": sigma_of_log})


def triangular(*, low: Any, mode: Any, high: Any) -> Distribution:
    """Triangular from low to high with its peak at mode; numbers or arrays of shape (n,)."""
    return Distribution("triangular", {"low": low, "mode": mode, "high": high})


def choice(values: Any) -> Distribution:
    """One of the values, each as likely: numbers, shape (m,), or rows of n numbers, shape (m, n)."""
    return Distribution("choice", {"values": values})


CONSTRUCTORS = {each.__name__: each for each in (uniform, normal, lognormal, triangular, choice)}


def distribution(value: Any) -> Distribution:
    """A distribution of this module as it is or as a text; a frozen one of scipy.stats by its name and numbers.

    Raises:
        SweepError: If the value is none of them.
    """
    if isinstance(value, Distribution):
        return value
    if isinstance(value, str):
        return called("distribution", value, CONSTRUCTORS)
    kind = getattr(value, "dist", None)
    name, stored = getattr(kind, "name", ""), None
    if isinstance(name, str) and kind is not None and type(value).__module__.startswith("scipy.stats"):
        from scipy import stats

        stored = getattr(stats, name, None)
    if stored is None or type(stored) is not type(kind):
        raise SweepError(
            f"a distribution must be {', '.join(CONSTRUCTORS)}, or a frozen one of scipy.stats such as"
            f" stats.gamma(2.0), got {shown(value)}"
        )
    return Distribution(_SCIPY + name, {str(k): x for k, x in enumerate(value.args)} | value.kwds)


def from_dict(stored: Mapping[str, Any]) -> Distribution:
    """The distribution of a dictionary that `to_dict` made.

    Raises:
        SweepError: If it names no distribution, or lacks a parameter or has another one.
        KeyError, TypeError or ValueError: If it is no dictionary, or has no name.
    """
    given = dict(stored)
    name = given.pop("distribution")
    if str(name).startswith(_SCIPY):
        return Distribution(name, given)
    return call_of("distribution", name, CONSTRUCTORS, (), given)


def _uniform(u: np.ndarray, low: Any, high: Any) -> np.ndarray:
    return np.clip(low * (1 - u) + high * u, low, high)


def _normal(u: np.ndarray, mean: Any, sd: Any) -> np.ndarray:
    from scipy.special import ndtri  # late: only runs need it

    return mean + sd * ndtri(u)


def _lognormal(u: np.ndarray, median: Any, sigma_of_log: Any) -> np.ndarray:
    return median * np.exp(_normal(u, 0.0, sigma_of_log))


def _triangular(u: np.ndarray, low: Any, mode: Any, high: Any) -> np.ndarray:
    rise, fall = mode - low, high - mode
    width = rise + fall
    left, right = low + np.sqrt(u * width * rise), high - np.sqrt((1 - u) * width * fall)
    return np.clip(np.where(u * width < rise, left, right), low, high)


# unlike SciPy's, they take a width of 0: one joint of several may be known exactly
_INVERSES = {"uniform": _uniform, "normal": _normal, "lognormal": _lognormal, "triangular": _triangular}
