"""The arithmetic layer: numbers of literals, and the factorisation in every kind of number."""

from __future__ import annotations

import numpy as np
import pytest
from flint import arb

from robot_dyn.foundations import (
    FLOAT64,
    Ball,
    Float,
    NotPositiveDefiniteError,
    QueryError,
    arithmetic_of,
    cholesky_solve,
    midpoint,
)

RNG = np.random.default_rng(3)


def positive_definite(n: int) -> np.ndarray:
    A = RNG.normal(size=(n, n))
    return A @ A.T + n * np.eye(n)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.longdouble])
def test_factorisation_solves_what_lapack_solves(dtype) -> None:
    """M is well conditioned (κ < 10), so both err by some n u; 100 u allows it. Batches row by row."""
    M, b = np.stack([positive_definite(5) for _ in range(4)]), RNG.normal(size=(4, 5))
    x = cholesky_solve(M.astype(dtype), b.astype(dtype))
    assert x.dtype == dtype
    u = max(np.finfo(dtype).eps, np.finfo(np.float64).eps)
    np.testing.assert_allclose(x.astype(float), np.linalg.solve(M, b[..., None])[..., 0], atol=float(100 * u))


def test_factorisation_of_balls_encloses_the_solution() -> None:
    M, b = positive_definite(4), RNG.normal(size=4)
    ball = Ball(200)
    with ball.scope():
        x = cholesky_solve(ball.array(M), ball.array(b))
        residual = ball.array(M) @ x - ball.array(b)
        assert all(r.contains(arb(0)) for r in residual)
    np.testing.assert_allclose(midpoint(x), np.linalg.solve(M, b), rtol=1e-13)


def test_factorisation_names_the_row_that_is_not_positive() -> None:
    M = np.diag([2.0, 1.0, 0.0, 3.0])
    with pytest.raises(NotPositiveDefiniteError) as caught:
        cholesky_solve(M, np.ones(4))
    assert caught.value.row == 2


def test_inputs_of_the_factorisation_are_left_alone() -> None:
    M, b = positive_definite(3), np.ones(3)
    M0, b0 = M.copy(), b.copy()
    cholesky_solve(M, b)
    assert np.array_equal(M, M0)
    assert np.array_equal(b, b0)


def test_literals_become_the_nearest_number_of_each_kind() -> None:
    """0.1 read in longdouble is nearer to 1/10 than its float64; a ball holds it."""
    third = "0.1"
    assert FLOAT64.number(third) == 0.1
    assert Float(np.dtype(np.float32)).number(third) == np.float32(0.1)
    if np.finfo(np.longdouble).nmant > 52:
        assert Float(np.dtype(np.longdouble)).number(third) != np.longdouble(0.1)
    with Ball(200).scope():
        assert (10 * Ball(200).number(third)).contains(arb(1))


def test_a_longdouble_is_taken_exactly_by_a_ball() -> None:
    x = np.longdouble(1) / 3
    with Ball(200).scope():
        ball = Ball(200).number(x)
        assert ball.is_exact()
        assert ball == arb(float(x)) + arb(float(x - np.longdouble(float(x))))


@pytest.mark.parametrize("dtype", ["float16", "int64", "nonsense", object, np.complex128])
def test_an_unknown_arithmetic_is_refused(dtype) -> None:
    with pytest.raises(QueryError, match="use float32, float64"):
        arithmetic_of(dtype)
