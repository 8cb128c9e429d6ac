"""Angles of 1e16 rad, velocities whose squares nearly overflow, denormals, NaN and infinity beside numbers.

A float of 1e16 rad is one angle, whose sine is known; terms grow as v². What has a finite answer gets it, to 32 n u of
the terms added, as under Conditioning; what overflows is refused by name. In a batch by nan_rows the rows
beside one without an answer have the bits of the batch with a finite row in its place; else the row is named, and
`out` is as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.foundations import NotFiniteError, midpoint
from robot_dyn.lagrange import diagonal_scale, floored, magnitudes, scaled
from robot_dyn.model import with_exact_right_angles
from robot_dyn.queries import INVERSE_DYNAMICS, M, N, Quantity
from tests.campaigns.hard.case import Case, Row
from tests.campaigns.hard.conditioning import SUMS, U

TITLE = "Range"
BITS = 1400  # 1e160² beside 1e-160
BATCH, SPOILT = 19, 7


class Implementations(NamedTuple):
    """A robot with its right angles written out in full, its engines and its balls."""

    robot: rd.Robot
    engines: dict[str, Any]
    truth: rd.Lagrangian


def loaded(name: str) -> rd.Robot:
    """A robot of the catalog, its right angles written out in full."""
    return with_exact_right_angles(rd.load(name))[0]


def implementations(robot: rd.Robot) -> Implementations:
    """Of a robot whose right angles are written out in full."""
    engines = {"Pinocchio": robot, "Lagrangian": rd.Lagrangian(robot), "machine code": rd.compiled(robot)}
    return Implementations(robot, engines, rd.Lagrangian(robot, rd.accuracy.Ball(BITS)))


def error(of: Implementations, implementation: str, quantity: Quantity, state: dict[str, np.ndarray]) -> float:
    """In units of n u of the terms added."""
    size = magnitudes(rd.Lagrangian(of.robot).linkage, state["q"])
    x = midpoint(quantity.evaluate(of.truth, state))
    absolute = {key: np.abs(value) for key, value in state.items()}
    with np.errstate(over="ignore"):  # of the terms where v² overflows, and every implementation refuses
        scale = diagonal_scale(x) if quantity.definite else quantity.terms(size, absolute)
    difference = quantity.evaluate(of.engines[implementation], state) - x
    return float(scaled(difference, floored(np.asarray(scale))).max() / (of.robot.n * U))


def general(n: int, seed: int) -> np.ndarray:
    """q, v and a, from 0.5 to 1 in size, (3, n)."""
    rng = np.random.default_rng((23, seed))
    return rng.uniform(0.5, 1.0, (3, n)) * rng.choice([-1, 1], (3, n))


def far_angles(name: str, far: float, seed: int) -> Iterator[Row]:
    """M and N at angles of any size, which are reduced exactly."""
    of = implementations(loaded(name))
    q = far * general(of.robot.n, seed)[0]
    for implementation in of.engines:
        found = max(error(of, implementation, quantity, {"q": q}) for quantity in (M, N))
        yield Row(f"{name}: q of {far:g} rad", f"{implementation}: M, N, in n u", found, SUMS)


def fast(name: str, speed: float, seed: int) -> Iterator[Row]:
    """Inverse dynamics at velocities of any size whose squares are finite."""
    of = implementations(loaded(name))
    q, v, a = general(of.robot.n, seed)
    for implementation in of.engines:
        found, said = float("nan"), ""
        try:
            found = error(of, implementation, INVERSE_DYNAMICS, {"q": q, "v": speed * v, "a": a})
        except RobotDynError as refusal:
            said = str(refusal)
        finite = speed * speed < 1e307
        if finite or said:
            yield Row(
                f"{name}: v of {speed:g} rad/s", f"{implementation}: ID, in n u", found, SUMS, "" if finite else said
            )
        else:
            yield Row(
                f"{name}: v of {speed:g} rad/s", f"{implementation}: answers where v² overflows", float("nan"), SUMS
            )


def spoilt(name: str, bad: float, seed: int) -> Iterator[Row]:
    """A row without an answer leaves the others as they are."""
    yield from beside(name, implementations(loaded(name)), bad, seed)


def beside(name: str, of: Implementations, bad: float, seed: int) -> Iterator[Row]:
    rng = np.random.default_rng((29, seed))
    n = of.robot.n
    q, (v, tau) = rng.uniform(-1, 1, (BATCH, n)), rng.normal(size=(2, BATCH, n))
    marred = q.copy()
    marred[SPOILT, n // 2] = bad
    others = np.arange(BATCH) != SPOILT
    asked = [("M", ()), ("inverse_dynamics", (v, tau)), ("forward_dynamics", (v, 10 * tau))]
    if of.robot.joint_without_inertia is not None:
        asked.pop()
    for implementation, engine in of.engines.items():
        changed, named = 0, 0
        for query, rest in asked:
            ask = getattr(engine, query)
            whole, made = ask(q, *rest), getattr(engine.nan_rows, query)(marred, *rest)
            changed += int(np.sum(made[others] != whole[others])) + int(np.sum(~np.isnan(made[SPOILT])))
            named += _is_named(partial(ask, marred, *rest))
        case = f"{name}: a row with {bad}"
        yield Row(case, f"{implementation}: entries of other rows with other bits", changed, 0)
        yield Row(case, f"{implementation}: queries that do not name the row", len(asked) - named, 0)
    yield Row(case, "machine code: entries of out that were touched", _touched(of.engines["machine code"], marred), 0)


def _is_named(ask: Callable[[], Any]) -> bool:
    try:
        ask()
    except NotFiniteError as refusal:
        return f"in row {SPOILT} of the batch" in str(refusal)
    return False


def _touched(compiled: Any, q: np.ndarray) -> int:
    out = np.full((*q.shape, q.shape[1]), 7.0)
    try:
        compiled.M(q, out=out)
    except NotFiniteError:
        return int(np.sum(out != 7.0))
    return out.size


CASES = [
    *(Case(f"q of {far:g} rad", partial(far_angles, "ur5", far)) for far in (1e3, 1e5, 1e9, 1e16)),
    *(Case(f"v of {v:g} rad/s", partial(fast, "ur5", v)) for v in (5e-324, 1e-200, 1e-10, 1e75, 1e150, 1e160)),
    *(Case(f"{bad} in a row", partial(spoilt, "ur5", bad)) for bad in (np.nan, np.inf, -np.inf)),
]
