"""What a kernel reports of its arguments and results; the words are found on the slow path."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """What a kernel reports; of several states the largest counts."""

    FINE = 0
    FAR = 1  # an angle beyond the range of the sine and cosine
    SHAPE = 2
    ARGUMENT = 3  # not finite, or large
    RESULT = 4  # not finite, or doubtfully large
