"""The convex problem of dry friction and rigid stops: its optimality conditions, degenerate cases, another solver."""

from __future__ import annotations

import numpy as np
import pytest
import quadprog

from robot_dyn.foundations import NotPositiveDefiniteError
from robot_dyn.foundations.convex import PASSES, active_set, newton, not_found, residual

SEEDS = [1, 20261127]


def minimum(M: np.ndarray, p: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The x of least value, (n,); a coordinate at 0 or at a bound is so exactly.

    Args:
        M: Symmetric and positive definite, (n, n).
        p: M x₀, (n,).
        f: Not negative, (n,).
        lower: Lower bounds, −inf for none, (n,).
        upper: Upper bounds, not below the lower ones, inf for none, (n,).

    Raises:
        RobotDynError: If no minimum is found, as with numbers that are not finite or M that is not positive definite.
    """
    lower, upper = (np.asarray(each, float) for each in (lower, upper))
    place = np.where((f == 0) & (lower < 0) & (upper > 0), 1.0, 0.0)
    try:
        for _ in range(PASSES):
            x, after = newton(M, p, f, lower, upper, place)
            if (after == place).all():
                return x
            place = after
        n, x = len(p), np.zeros(len(p))
        if active_set(M, p, f, lower, upper, x, place, np.empty((n + 1, n))):
            return x
    except NotPositiveDefiniteError:
        pass
    raise not_found(M, p)


def problem(rng: np.random.Generator, degenerate: bool) -> tuple[np.ndarray, ...]:
    """M, p, f, lower, upper: condition numbers up to 1e6; degenerate ones are loaded exactly at their limits."""
    n = int(rng.choice([1, 2, 3, 7, 12]))
    U, _ = np.linalg.qr(rng.normal(size=(n, n)))
    M = U @ np.diag(np.geomspace(1, 10 ** -rng.uniform(0, 6), n)) @ U.T
    M = (M + M.T) / 2
    f = rng.uniform(0, 2, n) * (rng.random(n) < 0.7)
    ends = [rng.uniform(0, 2, n) * (rng.random(n) < 0.6) for _ in range(2)]
    lower, upper = (np.where(rng.random(n) < 0.4, end, np.inf) for end in ends)
    p = rng.normal(size=n) * 10 ** rng.uniform(-2, 1)
    if degenerate:
        x = np.clip(np.where(rng.random(n) < 0.5, 0.0, rng.normal(size=n)), -lower, upper)
        p = M @ x + np.where(x != 0, f * np.sign(x), f * rng.choice([-1, 0, 0.5, 1], n))
    return M, p, f, -lower, upper


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("degenerate", [False, True])
def test_the_minimum_obeys_its_optimality_conditions(seed: int, degenerate: bool) -> None:
    """P − M x ∈ f ∂|x| + N(x), to 1e-13 of the terms added: rounding of one Cholesky solution leaves 3e-15."""
    rng = np.random.default_rng([seed, degenerate])
    for _ in range(250):
        given = problem(rng, degenerate)
        x = minimum(*given)
        assert residual(*given, x) <= 1e-13
        assert ((given[3] <= x) & (x <= given[4])).all()


@pytest.mark.parametrize("degenerate", [False, True])
def test_changing_one_place_at_a_time_leads_to_the_same_minimum(degenerate: bool) -> None:
    """The active set alone, which is taken where Newton's method cycles: M (x − y) = 0 to the same rounding."""
    rng = np.random.default_rng([9, degenerate])
    for _ in range(150):
        M, p, f, lower, upper = given = problem(rng, degenerate)
        x, place = np.full(len(p), np.nan), np.full(len(p), np.nan)
        assert active_set(*given, x, place, np.empty((len(p) + 1, len(p))))
        assert residual(*given, x) <= 1e-13
        assert ((lower <= x) & (x <= upper)).all()
        scale = np.abs(M) @ np.abs(x) + np.abs(p) + f
        assert (np.abs(M @ (x - minimum(*given))) <= 1e-9 * scale.max()).all()


def test_no_other_point_has_less() -> None:
    """½ xᵀM x − pᵀx + Σ f|x| grows in all directions that the bounds leave, but for the rounding of its sums."""
    rng = np.random.default_rng(3)
    for _ in range(60):
        M, p, f, lower, upper = given = problem(rng, False)
        x = minimum(*given)

        def cost(y: np.ndarray, M=M, p=p, f=f) -> float:
            return float(y @ M @ y / 2 - p @ y + f @ np.abs(y))

        others = np.clip(x + rng.normal(size=(40, len(x))) * 10 ** rng.uniform(-3, 1, (40, 1)), lower, upper)
        added = max(np.abs(y) @ np.abs(M) @ np.abs(y) + np.abs(p) @ np.abs(y) + f @ np.abs(y) for y in others)
        assert min(map(cost, others)) >= cost(x) - 2 * len(x) * np.finfo(float).eps * added


def test_the_residual_sees_a_point_that_is_off() -> None:
    rng = np.random.default_rng(4)
    for _ in range(40):
        given = problem(rng, False)
        x = minimum(*given)
        i = int(rng.integers(len(x)))
        x[i] += 1e-3 if x[i] < given[4][i] - 1e-3 else -1e-3
        assert residual(*given, x) > 1e-10


def test_a_load_at_its_limit_leaves_exact_zeros() -> None:
    """X = 0 for every p with |p| ≤ f, to the last float; beyond it is not."""
    rng = np.random.default_rng(5)
    for _ in range(100):
        M, _, f, *_ = problem(rng, False)
        n, free = len(f), np.full(len(f), np.inf)
        p = f * rng.choice([-1.0, 1.0], n)
        assert (minimum(M, p, f, -free, free) == 0).all()
        if (f > 0).any():
            p[np.argmax(f)] *= 1 + 1e-12
            assert (minimum(M, p, f, -free, free) != 0).any()


def by_quadprog(
    M: np.ndarray, p: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, eps: float = 1e-5
) -> np.ndarray:
    """The same minimum by quadprog: t ≥ |x| for |x|, and ε |t − t_k|² / 2, since it asks for a definite matrix.

    The minimum of one pass is the next t_k: the proximal point method, whose limit does not depend on ε.
    """
    n, one, none = len(p), np.eye(len(p)), np.zeros((len(p), len(p)))
    same, low, high = lower == upper, np.isfinite(lower) & (lower < upper), np.isfinite(upper) & (lower < upper)
    x, t_and_x, t_less_x = (np.hstack(pair) for pair in ((one, none), (one, one), (-one, one)))
    rows = np.vstack([x[same], t_and_x, t_less_x, x[low], -x[high]])
    least = np.concatenate([lower[same], np.zeros(2 * n), lower[low], -upper[high]])
    G, t = np.block([[M, none], [none, eps * one]]), np.zeros(n)
    for _ in range(10):
        y = quadprog.solve_qp(G, np.concatenate([p, eps * t - f]), rows.T, least, int(same.sum()))[0]
        t = y[n:]
    return y[:n]


@pytest.mark.parametrize("degenerate", [False, True])
def test_quadprog_has_the_same_minimum(degenerate: bool) -> None:
    """M x to 1e-10 of the largest term: its own rounding, that of the matrix it factorises, 1e-16 M / ε."""
    rng, compared = np.random.default_rng([11, degenerate]), 0
    for _ in range(300):
        M, p, f, *_ = given = problem(rng, degenerate)
        x = minimum(*given)
        largest = (np.abs(p) + np.abs(M) @ np.abs(x) + f).max()
        if np.linalg.cond(M) <= 1e4:
            compared += 1
            assert np.abs(M @ (x - by_quadprog(*given))).max() <= 1e-10 * largest
    assert compared > 150
