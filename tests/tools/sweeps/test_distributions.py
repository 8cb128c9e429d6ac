"""Distributions: x = F⁻¹(u), held against SciPy; stored as numbers, equal to the bit when they are read."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import stats

from robot_dyn.foundations import SweepError
from robot_dyn.tools.sweeps import distributions as ds

Q = np.array([0.3, -1.1, 0.7])
MADE: dict[str, tuple[Any, Any]] = {  # each with its distribution in SciPy
    "uniform": (ds.uniform(low=-0.4, high=3.1), stats.uniform(-0.4, 3.5)),
    "uniform of each joint": (ds.uniform(low=Q, high=Q + 0.3), stats.uniform(Q, 0.3)),
    "normal": (ds.normal(mean=0.3, sd=1.7), stats.norm(0.3, 1.7)),
    "normal of each joint": (ds.normal(mean=Q, sd=0.02), stats.norm(Q, 0.02)),
    "lognormal": (ds.lognormal(median=0.5, sigma_of_log=0.2), stats.lognorm(0.2, scale=0.5)),
    "triangular": (ds.triangular(low=-1.0, mode=0.2, high=3.0), stats.triang(0.3, -1.0, 4.0)),
    "triangular, mode low": (ds.triangular(low=1.0, mode=1.0, high=3.0), stats.triang(0.0, 1.0, 2.0)),
    "of SciPy": (ds.distribution(stats.gamma(2.3, scale=0.7)), stats.gamma(2.3, scale=0.7)),
    "of SciPy, each joint": (ds.distribution(stats.t([3.0, 4.0], loc=0.2)), stats.t([3.0, 4.0], loc=0.2)),
    "of SciPy, discrete": (ds.distribution(stats.randint(1, 7)), stats.randint(1, 7)),
}


def unit(size: int, k: int = 400) -> np.ndarray:
    return np.random.default_rng(3).random((k, size))


@pytest.mark.parametrize("name", MADE)
def test_values_are_the_inverse_of_the_distribution_function(name: str) -> None:
    """Rounding of u near 1 is magnified by F⁻¹: 1e-12 of the largest value."""
    made, scipy = MADE[name]
    u = unit(made.size)
    expected = scipy.ppf(u).reshape(-1, *made.shape)
    np.testing.assert_allclose(made.values(u), expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("name", MADE)
def test_a_row_has_the_same_bits_in_any_slice(name: str) -> None:
    """So a run repeated alone has the parameters that it had in a chunk."""
    made, _ = MADE[name]
    u = unit(made.size + 2)[:, 1:-1]  # columns of a wider table
    whole = made.values(u)
    for step in (1, 3, 64):
        parts = [made.values(u[a : a + step]) for a in range(0, len(u), step)]
        np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("name", [*MADE, "choice", "choice of rows"])
def test_a_stored_distribution_has_equal_bits(name: str) -> None:
    more = {"choice": ds.choice([50, 100.1]), "choice of rows": ds.choice([Q, Q / 3])}
    made = more[name] if name in more else MADE[name][0]
    again = ds.from_dict(json.loads(json.dumps(made.to_dict(), allow_nan=False)))
    assert type(again) is type(made) and again.to_dict() == made.to_dict() and again.size == made.size
    np.testing.assert_array_equal(again.values(unit(made.size)), made.values(unit(made.size)))


def test_a_choice_takes_each_value_as_often() -> None:
    values = ds.choice([50, 100, 70]).values(np.arange(300)[:, None] / 300)
    np.testing.assert_array_equal(values, np.repeat([50.0, 100.0, 70.0], 100))
    rows = ds.choice([Q, 2 * Q]).values(np.array([[0.1], [0.9]]))
    np.testing.assert_array_equal(rows, [Q, 2 * Q])


@pytest.mark.parametrize("name", MADE)
def test_the_ends_of_the_unit_interval_give_finite_values(name: str) -> None:
    """Sobol' points may be 0, where an inverse is −∞; they are taken for 2⁻⁵⁴."""
    made, scipy = MADE[name]
    ends = made.values(np.array([[0.0] * made.size, [np.nextafter(1.0, 0.0)] * made.size]))
    assert np.isfinite(ends).all()
    low, high = scipy.support()
    assert (ends >= low).all() and (ends <= high).all()


def test_parameters_are_copies() -> None:
    mean = Q.copy()
    made = ds.normal(mean=mean, sd=0.1)
    mean += 1
    np.testing.assert_array_equal(made.parameters["mean"], Q)
    assert not made.parameters["mean"].flags.writeable


WRONG: dict[str, Callable[[], Any]] = {
    "low of uniform must be at most high, got 2 and 1": lambda: ds.uniform(low=2, high=1),
    "lengths differ in normal": lambda: ds.normal(mean=Q, sd=[1.0, 2.0]),
    "sd of normal must not be negative, got -1": lambda: ds.normal(mean=0, sd=-1.0),
    "mean of normal must be finite": lambda: ds.normal(mean=np.nan, sd=1.0),
    "median of lognormal must be positive": lambda: ds.lognormal(median=0.0, sigma_of_log=1.0),
    "lognormal has no finite values between": lambda: ds.lognormal(median=1.0, sigma_of_log=100.0),
    "mode of triangular must be at most high": lambda: ds.triangular(low=0, mode=2, high=1),
    "the values of choice must be real numbers": lambda: ds.choice(["a", "b"]),
    "the values of choice must have shape": lambda: ds.choice([]),
    "a distribution must be uniform, .*got 3$": lambda: ds.distribution(3),
    "a distribution must be .*got <scipy.stats._mult": lambda: ds.distribution(stats.multivariate_normal([0, 0])),
    "a distribution must be .*gamma_gen": lambda: ds.distribution(stats.gamma),
    "a distribution must be .*rv_histogram": lambda: ds.distribution(stats.rv_histogram(np.histogram([1.0, 2.0]))),
    "scipy.stats.gamma has no finite values .*gamma.-2": lambda: ds.distribution(stats.gamma(-2.0)),
    "lengths differ in scipy.stats.gamma": lambda: ds.distribution(stats.gamma([1.0, 2.0], scale=Q)),
    "no distribution 'unifrm'; nearest: uniform": lambda: ds.from_dict({"distribution": "unifrm"}),
    "missing a required .*argument: .high": lambda: ds.from_dict({"distribution": "uniform", "low": 1}),
    r"^uniform\(lo=1, high=2\): missing a required": lambda: ds.distribution("uniform(lo=1, high=2)"),
    r"write uniform\(low=…, high=…\)$": lambda: ds.distribution("uniform(1)"),
    "has no distribution 'os' of one": lambda: ds.from_dict({"distribution": "scipy.stats.os"}),
    "does not accept scipy.stats.gamma.foo=1": lambda: ds.from_dict({"distribution": "scipy.stats.gamma", "foo": 1}),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_not_a_distribution_is_refused(message: str) -> None:
    with pytest.raises(SweepError, match=message):
        WRONG[message]()
