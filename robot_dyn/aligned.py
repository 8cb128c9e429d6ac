"""Arrays in memory as vectors of the processor want them."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

LINE = 64  # bytes of a cache line and of the widest vector: one that lies across two lines is two accesses


def aligned(shape: tuple[int, ...], dtype: Any = float) -> np.ndarray:
    """An array of zeros in row-major order that begins at a cache line; of objects, at any address."""
    if np.dtype(dtype).hasobject:
        return np.zeros(shape, dtype)
    size = prod(shape) * np.dtype(dtype).itemsize
    room = np.zeros(size + LINE, np.uint8)
    first = -room.__array_interface__["data"][0] % LINE
    return room[first : first + size].view(dtype).reshape(shape)
