"""Arguments and results of a query on its general way: times, and the array `out` that takes the result."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.arithmetic import FLOAT64
from robot_dyn.errors import QueryError


def time_of(t: Any) -> np.ndarray:
    """Times (...,) as a column (..., 1); raises QueryError for anything else."""
    try:
        return FLOAT64.asarray(t)[..., None]
    except (TypeError, ValueError, OverflowError):
        raise QueryError(f"t must be a time in seconds, got {t!r}") from None


def into(out: np.ndarray | None, result: np.ndarray) -> Any:
    """The result, in `out` if that is given; QueryError if it does not fit."""
    if out is None:
        return result if result.ndim else result[()]
    if not isinstance(out, np.ndarray) or out.dtype != result.dtype or out.shape != result.shape:
        got = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else repr(out)
        raise QueryError(f"out must be an array of {result.dtype} and shape {result.shape}, got {got}")
    if not out.flags.writeable:
        raise QueryError("out must be an array that can be written, got one that is read-only")
    out[...] = result
    return out
