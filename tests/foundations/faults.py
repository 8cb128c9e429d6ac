"""A layer under `robot_dyn.foundations.files` in which the k-th system call fails, as SQLite's tests do."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO
from unittest import mock

from robot_dyn.foundations import files

CALLS = ("open", "fdopen", "chmod", "chown", "fsync", "replace", "close")  # of `os`; and write, flush of the stream


class Faults:
    """Counts the calls; at the k-th it calls `fail`. A write that fails has written half of its data."""

    def __init__(self, k: int, fail: Callable[[], object]) -> None:
        self.left, self.fail = k, fail

    @property
    def happened(self) -> bool:
        return self.left <= 0

    def count(self) -> None:
        self.left -= 1
        if self.left == 0:
            self.fail()

    def __getattr__(self, name: str) -> Any:
        """As the module `os`."""
        real = getattr(os, name)
        if name not in CALLS:
            return real

        def call(*args: Any, **options: Any) -> Any:
            if name == "close":  # a file is closed, whatever close says
                real(*args, **options)
            self.count()
            done = None if name == "close" else real(*args, **options)
            return Stream(done, self) if name == "fdopen" else done

        return call


class Stream:
    """A stream whose write and flush are counted."""

    def __init__(self, stream: BinaryIO, faults: Faults) -> None:
        self._stream, self._faults = stream, faults

    def write(self, data: Any) -> int:
        if self._faults.left == 1:
            self._stream.write(memoryview(data).cast("B")[: len(data) // 2])
        self._faults.count()
        return self._stream.write(data)

    def flush(self) -> None:
        self._faults.count()
        self._stream.flush()

    def __enter__(self) -> Stream:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def failing_at(k: int, fail: Callable[[], object]) -> Iterator[Faults]:
    """The k-th call of `robot_dyn.foundations.files` to the system fails; k = 0: none."""
    faults = Faults(k, fail)
    with mock.patch.object(files, "os", faults):
        yield faults


def raising(error: BaseException) -> Callable[[], object]:
    """A failure that is an exception."""

    def fail() -> None:
        raise error

    return fail
