"""STL files, binary and ASCII, as the corners of their triangles; stated normals are checked and made anew."""

from __future__ import annotations

import re
import struct

import numpy as np
from numpy import ndarray

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes: 80 of text and the count
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_BAD_NORMAL = re.compile(rb"\bnormal\b(?!(?:\s+[-+.\deE]+|\s+[-+]?(?:nan|inf)){3}\s)", re.IGNORECASE)


def read_stl(data: bytes, missing: list[str]) -> ndarray:
    """Corners (m, 3, 3) float32 of the triangles in the file; what cannot be read of it is added to `missing`.

    Raises:
        ValueError: If it is cut off, or a corner is not three numbers.
    """
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= _HEADER else 0
    stated = _HEADER + count * _RECORD.itemsize
    ascii_ = data.lstrip()[:5].lower() == b"solid" and stated != len(data)  # exporters write "solid" in binary ones too
    if not ascii_:
        if stated > len(data):
            raise ValueError(f"it states {count} triangles and holds {(len(data) - _HEADER) // _RECORD.itemsize}")
        return np.frombuffer(data, _RECORD, count, _HEADER)["corners"].astype("f4")
    if _BAD_NORMAL.search(data):
        missing.append("a normal is not three numbers")
    corners = np.fromiter((float(word) for match in _VERTEX.finditer(data) for word in match.groups()), "f4")
    if len(corners) % 9:
        raise ValueError("a facet has not three corners")
    return corners.reshape(-1, 3, 3)
