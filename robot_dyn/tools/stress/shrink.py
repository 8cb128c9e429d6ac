"""Shrinking: of a state with a property, one with fewer entries that are not zero, and fewer digits, that has it too.

[Zeller and Hildebrandt, Simplifying and isolating failure-inducing input, IEEE TSE 28, 2002]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

_MOST_DIGITS = 17


def shrunk(state: np.ndarray, fails: Callable[[np.ndarray], bool], most: int = 400) -> np.ndarray:
    """A state that fails too, with as few entries and digits as a greedy search finds.

    Args:
        state: One that fails, (k,); it is given back as it is if it does not.
        fails: Whether a state (k,) has the property.
        most: How many states are tried at most.
    """
    best, left = np.array(state, dtype=float), most

    def holds(young: np.ndarray) -> bool:
        nonlocal left
        left -= 1
        return left >= 0 and bool(fails(young))

    if not holds(best):
        return best
    for young in (_zeroed, _rounded, _rounded_one_by_one, _zeroed):
        best = young(best, holds)
    return best


def _zeroed(best: np.ndarray, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Parts of the entries set to zero: all of them, halves, and so on to single ones, until no more can be."""
    before = None
    while before is None or np.count_nonzero(best) < before:
        before = np.count_nonzero(best)
        for part in _parts(np.flatnonzero(best)):
            young = best.copy()
            young[part] = 0.0
            if np.any(best[part]) and holds(young):
                best = young
    return best


def _parts(entries: np.ndarray) -> Iterator[np.ndarray]:
    pieces = 1
    while len(entries) and pieces < 2 * len(entries):
        yield from np.array_split(entries, min(pieces, len(entries)))
        pieces *= 2


def _rounded(best: np.ndarray, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """All entries in the fewest digits."""
    for digits in range(1, _MOST_DIGITS):
        young = np.array([_in_digits(x, digits) for x in best])
        if np.array_equal(young, best) or holds(young):
            return young
    return best


def _rounded_one_by_one(best: np.ndarray, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Each entry in the fewest digits with the others as they are."""
    for k in np.flatnonzero(best):
        for digits in range(1, _MOST_DIGITS):
            young = best.copy()
            young[k] = _in_digits(best[k], digits)
            if young[k] == best[k]:
                break
            if holds(young):
                best = young
                break
    return best


def _in_digits(x: float, digits: int) -> float:
    return float(f"{x:.{digits - 1}e}")
