"""The primitives of machine code and those of NumPy are the same, to the last bit: order of sums, signs of 0, nan."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import signature
from typing import Any

import numpy as np
import pytest

from robot_dyn.codegen import INSTEAD, MachineFunction
from robot_dyn.codegen import primitives as loops
from robot_dyn.foundations import MachineCodeError
from robot_dyn.integrate import primitives
from robot_dyn.integrate.primitives import GOING
from tests.codegen.cells import cell

SPECIAL = np.array([0.0, -0.0, np.nan, np.inf, -np.inf, 5e-324, -2e-310, 1e308, -1e-308, 1.0, -1.0])
RUNS = pytest.mark.parametrize("W", [1, 3, 64], ids=["one run", "3 runs", "64 runs"])


def numbers(rng: np.random.Generator, *shape: int, special: float = 0.25) -> np.ndarray:
    """Of many sizes, some of them special."""
    x = rng.normal(size=shape) * 10.0 ** rng.integers(-9, 9, shape)
    return np.where(rng.random(shape) < special, rng.choice(SPECIAL, shape), x)


@cache
def machine_code(primitive: Callable[..., Any]) -> Any:
    """A primitive, called by a function of the subset: a call from outside gives numbers alone."""
    names, result = ", ".join(signature(primitive).parameters), signature(primitive).return_annotation
    caller = f"def f({names}):\n    {'return ' * (result != 'None')}call({names})\n"
    return MachineFunction(cell(caller, call=primitive).f, INSTEAD, lambda: None, "").calls()


def three_ways(function: Callable[..., Any], plain: Callable[..., Any] | None, *given: Any) -> None:
    """By NumPy, by machine code and by the loops as Python runs them: results and arrays."""
    results = []
    ways = [function, machine_code(function), *([plain] if plain else [])]
    for way in ways:
        own = [x.copy() if isinstance(x, np.ndarray) else x for x in given]
        with np.errstate(all="ignore"):
            results.append(([way(*own)], own))
    for made in results[1:]:
        for x, y in zip((*made[0], *made[1]), (*results[0][0], *results[0][1]), strict=True):
            if x is None:
                continue
            x, y = np.asarray(x), np.asarray(y)
            np.testing.assert_array_equal(x, y)
            here = ~np.isnan(x) if x.dtype == float else np.zeros(x.shape, bool)
            np.testing.assert_array_equal(np.signbit(x[here]), np.signbit(y[here]))


def multiplied(x, h, out) -> None:
    np.multiply(x, h, out)


@RUNS
@pytest.mark.parametrize("m", [1, 4, 13, 23])
def test_combinations(m: int, W: int) -> None:
    """Weights of 0 are left out, whatever their term is; without any other, y is copied, sign of 0 and all."""
    rng = np.random.default_rng(m * W)
    y, K, x = numbers(rng, m, W), numbers(rng, 5, m + 2, W), np.zeros((m, W))
    some, none = [0.5, 0.0, -1.0, 0.0, 3.0], [0.0] * 5
    weights = rng.normal(size=5).tolist(), some, none, none, [0, 0, 1.0, 0, 0], [0.0, -0.0, np.nan, 1, 1]
    for h, w in zip((1e-3, -2.0, -1.0, np.inf, 0.25, 1.0), map(np.array, weights), strict=True):
        three_ways(primitives.combination, loops.combination, x, y, h, w, K, 5)
        three_ways(primitives.combination, loops.combination, x, y, h, w, K, 3)
    three_ways(primitives.combination, loops.combination, x, y, 0.5, np.ones(5), K, 0)


@RUNS
def test_entries(W: int) -> None:
    """Copies, differences, products, and sums of sizes in their order."""
    rng = np.random.default_rng(W)
    for m in (1, 7, 12):
        x, y = numbers(rng, m, W), numbers(rng, m, W)
        three_ways(primitives.copy, None, x, y)
        three_ways(primitives.copy, None, x[:, 0].copy(), y[:, 0])
        three_ways(primitives.subtract, None, x, y)
        three_ways(multiplied, None, x, -0.3, y)
        three_ways(primitives.sizes, loops.sizes, numbers(rng, m, W, special=0.02), np.full(W, np.nan))
    for _ in range(9):  # of like sizes, where the order is seen
        three_ways(primitives.sizes, loops.sizes, rng.normal(size=(40, W)), np.zeros(W))
        if W == 1:
            three_ways(primitives.norm, loops.norm, *rng.normal(size=(3, 40, 1)), 1e-6, 1e-9)


@RUNS
def test_bounds(W: int) -> None:
    """Nothing is taken of nan; limits may be infinite, or met exactly. Which zero is the lesser is left open."""
    rng = np.random.default_rng(W)
    for length in (W, 7 * W, 12 * W + 5):
        low, high, x = (np.where(each == 0.0, 1.0, each) for each in numbers(rng, 3, length))
        low, high = np.nan_to_num(low, nan=np.inf), np.nan_to_num(high, nan=-np.inf)
        for limits in ((-np.inf, np.inf), (np.fmin.reduce(x), np.fmax.reduce(x)), (-1e9, 1e9)):
            three_ways(primitives.enclose, None, low, high, x, *limits)
        for at in rng.integers(0, length, 3):  # one entry outside, by one unit in the last place
            inside = rng.uniform(-1.0, 1.0, length)
            for limits in ((np.nextafter(-2.0, -3.0), 1.0), (-1.0, np.nextafter(2.0, 1.0))):
                inside[at] = -2.0 if limits[1] == 1.0 else 2.0
                three_ways(primitives.enclose, None, low, high, inside, *limits)


@RUNS
def test_limits(W: int) -> None:
    """All entries are less; one that is not, or is nan, or is the limit, is found at each place. Of integers, too."""
    for length in (W, 2 * W + 5):
        x, whole = np.random.default_rng(W).uniform(-1.0, 1.0, length), np.zeros(length, np.int64)
        three_ways(primitives.below, None, x, 1.0)
        three_ways(primitives.below, None, whole, 1)
        assert primitives.below(x, 1.0) and primitives.below(whole, 1)
        for at in {0, W // 2, W - 1, length - 1}:
            for value in (1.0, np.nan, np.inf):
                other = np.where(np.arange(length) == at, value, x)
                assert not primitives.below(other, 1.0)
                three_ways(primitives.below, None, other, 1.0)
            three_ways(primitives.below, None, (np.arange(length) == at).astype(np.int64), 1)


def test_norms() -> None:
    """Inf where a number is not finite; nan in the state after a step as well."""
    rng = np.random.default_rng(5)
    for special in (0.0, 0.0, 0.05, 0.3):
        given = [numbers(rng, 9, 1, special=special) for _ in range(3)]
        three_ways(primitives.norm, loops.norm, *given, 1e-6, 1e-9)


@RUNS
def test_polynomials(W: int) -> None:
    rng = np.random.default_rng(W)
    for d in (3, 4, 7):
        y, F = numbers(rng, 6, W), numbers(rng, d, 6, W)
        for theta in (0.0, 0.3, 1.0, -0.0):
            three_ways(primitives.between, loops.between, y, F, theta, np.zeros((6, W)))


@RUNS
def test_iterations(W: int) -> None:
    """Rounds that shrink, stall, overflow and are nan, of runs that go on and runs that have ended."""
    rng = np.random.default_rng(W)
    for special in (0.0, 0.02, 0.2):
        Z, y = numbers(rng, 2, 5, W, special=special), numbers(rng, 5, W, special=special)
        new = Z + rng.normal(size=Z.shape) * 10.0 ** rng.integers(-20, 2, Z.shape)
        least, stale = np.abs(numbers(rng, 5, W, special=0.1)), rng.integers(0, 4, W)
        state = rng.choice([GOING, GOING, 0, 2], W)
        three_ways(primitives.settle, loops.settle, Z, new, y, least, stale, state, 2.0**-52)
        three_ways(primitives.settle, loops.settle, Z, Z.copy(), y, least, stale, state, 2.0**-52)


@RUNS
@pytest.mark.parametrize("m", [1, 2, 5, 14])
def test_elimination(m: int, W: int) -> None:
    """Pivots of equal size, of 0 and nan; each run has its own."""
    rng = np.random.default_rng(m + W)
    for special in (0.0, 0.02, 0.3):
        shape = m + 1, m, W
        J = np.where(rng.random(shape) < 0.3, rng.integers(-2, 3, shape), numbers(rng, *shape, special=special))
        J[0, :, 0] = 0.0
        J[0, 0, 0] = 0.5  # 1 − 2 · 0.5 = 0
        A, rows, lost = np.zeros((m, m, W)), np.zeros((m, W), np.int64), np.zeros(W, np.int64)
        three_ways(primitives.factor, loops.factor, A, J, 2.0, rows, lost)
        with np.errstate(all="ignore"):
            primitives.factor(A, J, 2.0, rows, lost)
        three_ways(primitives.solve, loops.solve, A, rows, numbers(rng, m, W, special=special))


LOST = np.zeros(1, np.int64)
WRONG = [  # arrays of ones by their shapes
    (primitives.combination, ((3, 1), (3, 1), 1.0, (2,), (4, 3, 1), 4), "of a combination"),
    (primitives.combination, ((3, 1), (3, 1), 1.0, (4,), (4, 2, 1), 4), "of a combination"),
    (primitives.subtract, ((3, 1), (2, 1)), "have different sizes"),
    (primitives.enclose, ((4,), (4,), (3,), 0.0, 2.0), "have different sizes"),
    (primitives.enclose, ((3,), (4,), (3,), 0.0, 2.0), "have different sizes"),
    (primitives.norm, ((3, 1), (2, 1), (3, 1), 1.0, 1.0), "arrays of a norm"),
    (primitives.solve, ((3, 3, 1), np.full((3, 1), 7), (3, 1)), "a row to exchange is out of range"),
    (primitives.factor, ((3, 3, 1), (2, 3, 1), 1.0, np.zeros((3, 1), np.int64), LOST), "arrays of an elimination"),
]


@pytest.mark.parametrize(("primitive", "given", "message"), WRONG)
def test_arrays_of_other_sizes_end_the_call(primitive: Any, given: Any, message: str) -> None:
    """Within a primitive nothing is checked: it looks at the sizes first."""
    with pytest.raises(MachineCodeError, match=message):
        machine_code(primitive)(*(np.ones(x) if isinstance(x, tuple) else x for x in given))
