"""Poisoned queries: valid calls of public functions with one entry, one argument or its shape made wrong or extreme.

What is accepted must answer with finite numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tests.wrong_arguments import NOT_NUMBERS, NOT_OBJECTS, examples

# These open files, browsers and compilers, or take long by themselves; their arguments are tried one by one elsewhere.
SLOW = {
    "compiled", "compare", "euler_lagrange", "list_robots", "load", "read",
    "plot", "read_scene", "replay", "rollouts", "Adaptive.solve", "Rollouts.save", "Trajectory.save",
    "show", "simulate", "linearise",
}  # fmt: skip
ENTRIES = (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e160, 5e-324, -0.0, 1e16, -1.0, 0.0, 1j, None, "0.1", True, 10**400)
Query = tuple[str, Any, dict[str, Any]]


def seeds(folder: Path) -> list[Query]:
    return [(name, *example) for name, example in examples(folder).items() if name not in SLOW and example[1]]


def mutate(rng: np.random.Generator, seed: Query) -> Query:
    """A call with one or two arguments poisoned."""
    name, function, arguments = seed
    arguments = dict(arguments)
    for _ in range(int(rng.integers(1, 3))):
        key = list(arguments)[int(rng.integers(len(arguments)))]
        arguments[key] = _poisoned(rng, arguments[key])
    return name, function, arguments


def attempt(mutant: Query, folder: Path) -> str:
    """Call it; whatever numbers it answers are finite."""
    name, function, arguments = mutant
    answer = function(**arguments)
    for part in answer if isinstance(answer, tuple) else (answer,):
        x = np.asarray(part)
        assert x.dtype.kind not in "fc" or np.isfinite(x).all(), (name, arguments)
    return "accepted"


def _poisoned(rng: np.random.Generator, value: Any) -> Any:
    pool = (*NOT_NUMBERS, *NOT_OBJECTS)
    numbers = isinstance(value, float | np.ndarray | list | tuple) and np.asarray(value, dtype=object).size > 0
    kind = int(rng.integers(5)) if numbers else 0
    if kind == 0:
        return pool[int(rng.integers(len(pool)))]
    flat = np.array(value, dtype=object)
    entry = ENTRIES[int(rng.integers(len(ENTRIES)))]
    if flat.ndim == 0:
        return entry
    if kind < 3:
        flat.flat[int(rng.integers(flat.size))] = entry
        return flat.tolist()
    if kind == 3:
        return [flat[None], flat[:-1], flat[..., None], np.repeat(flat, 2), flat[:0]][int(rng.integers(5))].tolist()
    with np.errstate(all="ignore"):
        try:
            return np.asarray(value, dtype=float) * [1e160, 1e-160, 1e300, -1.0, 1e8][int(rng.integers(5))]
        except (TypeError, ValueError, OverflowError):
            return entry
