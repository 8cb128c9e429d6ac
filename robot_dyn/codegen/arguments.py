"""Results of a query on its general way, and the array `out` that takes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.errors import QueryError


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
