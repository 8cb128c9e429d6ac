"""Distributions of varying parameters: F⁻¹ of the rows of a design, by `scipy.stats`; stored by name and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations import SweepError, Value, numbers, shown
from robot_dyn.tools.sweeps.texts import call_of, called

LEAST, MOST = 2.0**-54, 1 - 2.0**-53
"""Range of the arguments of F⁻¹: F⁻¹(0) may be infinite."""
_SCIPY = "scipy.stats."
_ORDERED = {"uniform": ("low", "high"), "triangular": ("low", "mode", "high")}
_BOUNDS: dict[str, Any] = {"sd": {"least": 0.0}, "sigma_of_log": {"least": 0.0}, "median": {"above": 0.0}}


@final
@dataclass(frozen=True, eq=False)
class Distribution(Value):
    """A distribution of one number, or of n independent ones.

    Attributes:
        name: "uniform", "normal", "lognormal", "triangular", "choice", or "scipy.stats.gamma" for one of SciPy.
        parameters: Parameters by name, numbers or arrays (n,); for "choice" the values, shape (m,) or (m, n).
            Positional parameters of SciPy have the names "0", "1", ….
    """

    name: str
    parameters: Mapping[str, Any]

    def __post_init__(self) -> None:
        shapes = ((), ("n",)) if self.name != "choice" else (("m",), ("m", "n"))
        checked = {}
        for key, x in self.parameters.items():
            label = f"the {key} of choice" if self.name == "choice" else f"{key} of {self.name}"
            array = numbers(label, x, *shapes, error=SweepError, **_BOUNDS.get(key, {}))
            if self.name.startswith(_SCIPY) and np.asarray(x).dtype.kind in "iu":  # SciPy may need integers
                array = np.array(x)
                array.setflags(write=False)
            checked[key] = array
        object.__setattr__(self, "parameters", checked)
        if self.name == "choice":
            return
        _ = self.shape  # raises if lengths differ
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
        """Shape of one value: () or (n,)."""
        if self.name == "choice":
            return self.parameters["values"].shape[1:]
        try:
            return np.broadcast_shapes(*(np.shape(x) for x in self.parameters.values()))
        except ValueError:
            raise SweepError(f"lengths differ in {self}") from None

    @property
    def size(self) -> int:
        """Number of columns of a design that it uses."""
        return 1 if self.name == "choice" or not self.shape else self.shape[0]

    @property
    def width(self) -> int:
        """Number of entries of one value."""
        return self.shape[0] if self.shape else 1

    def values(self, u: np.ndarray) -> np.ndarray:
        """Return F⁻¹(u), shape (k,) or (k, n), for numbers in [0, 1), shape (k, size); 2⁻⁵⁴ replaces 0."""
        if self.name == "choice":
            values = self.parameters["values"]
            return values[np.minimum((u[:, 0] * len(values)).astype(int), len(values) - 1)]
        return self._inverse(np.clip(u, LEAST, MOST).reshape(-1, *self.shape))

    def _inverse(self, u: np.ndarray) -> np.ndarray:
        x = np.asarray(self._ppf(u), float)
        return np.broadcast_to(x, (len(u), *self.shape)).copy()

    @cached_property
    def _ppf(self) -> Any:
        if not self.name.startswith(_SCIPY):
            return partial(_INVERSES[self.name], **self.parameters)
        from scipy import stats  # imported here because it takes a second

        name = self.name.removeprefix(_SCIPY)
        kind = getattr(stats, name, None)
        if not isinstance(kind, stats.rv_continuous | stats.rv_discrete):
            raise SweepError(f"scipy.stats has no distribution {shown(name)} of one variable")
        args = [self.parameters[key] for key in sorted(filter(str.isdigit, self.parameters), key=int)]
        try:
            return kind(*args, **{key: x for key, x in self.parameters.items() if not key.isdigit()}).ppf
        except TypeError as error:
            raise SweepError(f"scipy.stats does not accept {self}: {error}") from None

    def __str__(self) -> str:
        arguments = (f"{'' if key.isdigit() else f'{key}='}{x.tolist()}" for key, x in self.parameters.items())
        return f"{self.name}({', '.join(arguments)})"

    def to_dict(self) -> dict[str, object]:
        """Return name and numbers, for JSON; `from_dict` returns an equal distribution."""
        return {"distribution": self.name, **{key: x.tolist() for key, x in self.parameters.items()}}


def uniform(*, low: ArrayLike, high: ArrayLike) -> Distribution:
    """Return a uniform distribution from low to high; numbers or arrays (n,), in the unit of the parameter."""
    return Distribution("uniform", {"low": low, "high": high})


def normal(*, mean: ArrayLike, sd: ArrayLike) -> Distribution:
    """Return a normal distribution; mean and standard deviation are numbers or arrays (n,), in the parameter's unit."""
    return Distribution("normal", {"mean": mean, "sd": sd})


def lognormal(*, median: ArrayLike, sigma_of_log: ArrayLike) -> Distribution:
    """Return a log-normal distribution with median and standard deviation of the logarithm; numbers or arrays (n,)."""
    return Distribution("lognormal", {"median": median, "sigma_of_log": sigma_of_log})


def triangular(*, low: ArrayLike, mode: ArrayLike, high: ArrayLike) -> Distribution:
    """Return a triangular distribution from low to high with the peak at mode; numbers or arrays (n,)."""
    return Distribution("triangular", {"low": low, "mode": mode, "high": high})


def choice(values: ArrayLike) -> Distribution:
    """Return a distribution of equally likely values: numbers, shape (m,), or rows of n numbers, shape (m, n)."""
    return Distribution("choice", {"values": values})


CONSTRUCTORS = {constructor.__name__: constructor for constructor in (uniform, normal, lognormal, triangular, choice)}


def distribution(value: object) -> Distribution:
    """Return a distribution from one of this module, its text, or a frozen one of scipy.stats.

    Raises:
        SweepError: If the value is none of these.
    """
    if isinstance(value, Distribution):
        return value
    if isinstance(value, str):
        return called("distribution", value, CONSTRUCTORS)
    frozen: Any = value
    kind = getattr(frozen, "dist", None)
    name, stored = getattr(kind, "name", ""), None
    if isinstance(name, str) and kind is not None and type(value).__module__.startswith("scipy.stats"):
        from scipy import stats

        stored = getattr(stats, name, None)
    if stored is None or type(stored) is not type(kind):
        raise SweepError(
            f"a distribution must be {', '.join(CONSTRUCTORS)}, or a frozen one of scipy.stats such as"
            f" stats.gamma(2.0), got {shown(value)}"
        )
    return Distribution(_SCIPY + name, {str(k): x for k, x in enumerate(frozen.args)} | frozen.kwds)


def from_dict(stored: Mapping[str, object]) -> Distribution:
    """Return the distribution of a dictionary from `to_dict`.

    Raises:
        SweepError: If the name is not a distribution, or a parameter is missing or unknown.
        KeyError, TypeError or ValueError: If the value is not a dictionary, or has no name.
    """
    parameters = dict(stored)
    name = str(parameters.pop("distribution"))
    if name.startswith(_SCIPY):
        return Distribution(name, parameters)
    return call_of("distribution", name, CONSTRUCTORS, (), parameters)


def _uniform(u: np.ndarray, low: Any, high: Any) -> np.ndarray:
    return np.clip(low * (1 - u) + high * u, low, high)


def _normal(u: np.ndarray, mean: Any, sd: Any) -> np.ndarray:
    from scipy.special import ndtri  # imported here because only runs need it

    return mean + sd * ndtri(u)


def _lognormal(u: np.ndarray, median: Any, sigma_of_log: Any) -> np.ndarray:
    return median * np.exp(_normal(u, 0.0, sigma_of_log))


def _triangular(u: np.ndarray, low: Any, mode: Any, high: Any) -> np.ndarray:
    rise, fall = mode - low, high - mode
    width = rise + fall
    left, right = low + np.sqrt(u * width * rise), high - np.sqrt((1 - u) * width * fall)
    return np.clip(np.where(u * width < rise, left, right), low, high)


# unlike SciPy's, these accept a width of 0: one joint of several may be known exactly
_INVERSES = {"uniform": _uniform, "normal": _normal, "lognormal": _lognormal, "triangular": _triangular}
