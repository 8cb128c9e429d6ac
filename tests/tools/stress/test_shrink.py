"""Shrinking: the property stays, and fewer entries and digits are left."""

from __future__ import annotations

import numpy as np
import pytest

from robot_dyn.tools.stress.worst import shrunk

STATE = np.array([0.73125, -1.9371, 0.00123456, 2.718281828, -0.4])


def test_entries_that_do_not_matter_become_zero_and_the_others_get_few_digits() -> None:
    """x₃ > 2.5 holds at 3 alone, the one-digit number nearest to it."""
    np.testing.assert_array_equal(shrunk(STATE, lambda x: x[3] > 2.5), [0, 0, 0, 3, 0])


def test_digits_that_matter_are_kept() -> None:
    """|x₁ + 1.9371| < 1e-4 takes five digits; x₀ ≥ 0.7 one."""
    small = shrunk(STATE, lambda x: abs(x[1] + 1.9371) < 1e-5 and x[0] >= 0.7)
    np.testing.assert_array_equal(small, [0.7, -1.9371, 0, 0, 0])


@pytest.mark.parametrize("seed", range(20))
def test_what_is_given_back_has_the_property_and_no_entry_that_could_be_zero(seed: int) -> None:
    """Of a property of sums, in which entries stand in for each other."""
    rng = np.random.default_rng(seed)
    x, weights = rng.normal(size=8), rng.normal(size=8)
    level = float(x @ weights - 0.1 * abs(x @ weights))

    def fails(y: np.ndarray) -> bool:
        return bool(y @ weights >= level)

    small = shrunk(x, fails)
    assert fails(small)
    assert np.count_nonzero(small) <= np.count_nonzero(x)
    for k in np.flatnonzero(small):
        young = small.copy()
        young[k] = 0.0
        assert not fails(young)


def test_a_state_without_the_property_comes_back_as_it_is_and_tries_are_counted() -> None:
    np.testing.assert_array_equal(shrunk(STATE, lambda x: False), STATE)
    calls = []
    shrunk(STATE, lambda x: bool(calls.append(1)) or (x[0] > 0.7 and x[3] > 2.7), most=7)
    assert len(calls) == 7
