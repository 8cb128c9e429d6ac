"""Distributions by name, and as dictionaries that JSON can hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from robot_dyn.foundations import SweepError, nearest, shown
from robot_dyn.tools.sweeps.distributions.base import Distribution
from robot_dyn.tools.sweeps.distributions.bounded import Triangular, Uniform
from robot_dyn.tools.sweeps.distributions.choices import Choice
from robot_dyn.tools.sweeps.distributions.gaussian import LogNormal, Normal
from robot_dyn.tools.sweeps.distributions.of_scipy import OfSciPy

KINDS: Mapping[str, type[Distribution]] = {
    kind.name: kind for kind in (Uniform, Normal, LogNormal, Triangular, Choice, OfSciPy)
}


def uniform(*, low: Any, high: Any) -> Uniform:
    """Uniform from low to high; numbers or arrays of shape (n,), in the unit of the parameter."""
    return Uniform(low=low, high=high)


def normal(*, mean: Any, sd: Any) -> Normal:
    """Normal, of mean and standard deviation; numbers or arrays of shape (n,), in the unit of the parameter."""
    return Normal(mean=mean, sd=sd)


def lognormal(*, median: Any, sigma_of_log: Any) -> LogNormal:
    """Log-normal, of median and of the standard deviation of the logarithm; numbers or arrays of shape (n,)."""
    return LogNormal(median=median, sigma_of_log=sigma_of_log)


def triangular(*, low: Any, mode: Any, high: Any) -> Triangular:
    """Triangular from low to high with its peak at mode; numbers or arrays of shape (n,)."""
    return Triangular(low=low, mode=mode, high=high)


def choice(values: Any) -> Choice:
    """One of the values, each as likely: numbers, shape (m,), or rows of n numbers, shape (m, n)."""
    return Choice(of=values)


def distribution(value: Any) -> Distribution:
    """A distribution of this module as it is, and a frozen one of scipy.stats by its name and numbers.

    Raises:
        SweepError: If the value is neither.
    """
    if isinstance(value, Distribution):
        return value
    kind = getattr(value, "dist", None)
    of, stored = getattr(kind, "name", ""), None
    if isinstance(of, str) and kind is not None and type(value).__module__.startswith("scipy.stats"):
        from scipy import stats

        stored = getattr(stats, of, None)
    if stored is None or type(stored) is not type(kind):
        raise SweepError(
            "a distribution must be uniform, normal, lognormal, triangular or choice, or a frozen one of scipy.stats"
            f" such as stats.gamma(2.0), got {shown(value)}"
        )
    return OfSciPy(of=of, args=value.args, kwds=value.kwds)


def from_dict(stored: Mapping[str, Any]) -> Distribution:
    """The distribution of a dictionary that `to_dict` made.

    Raises:
        SweepError: If it has another form.
    """
    if not isinstance(stored, Mapping) or not isinstance(stored.get("distribution"), str):
        raise SweepError(f'a stored distribution is a table with the key "distribution", got {shown(stored)}')
    given = {key: x for key, x in stored.items() if key != "distribution"}
    kind = KINDS.get(stored["distribution"])
    if kind is None:
        raise SweepError(f"no distribution {shown(stored['distribution'])}; {nearest(stored['distribution'], KINDS)}")
    expected = [each.name for each in fields(kind)]
    if set(given) != set(expected):
        raise SweepError(f"{kind.name} takes {', '.join(expected)}, got {', '.join(map(str, given)) or 'nothing'}")
    return kind(**given)
