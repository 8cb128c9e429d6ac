"""Regular files, read within bounds; a device, pipe or folder is refused at once."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any, BinaryIO

from robot_dyn.errors import RobotDynError, shown

# Opening a pipe would wait for its writer; Windows has no O_NONBLOCK, POSIX no O_BINARY.
READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


@contextmanager
def reading(path: str | Path, error: type[RobotDynError], remedy: str) -> Iterator[BinaryIO]:
    """A regular file, open for reading; a device, pipe or folder is refused at once.

    Raises:
        RobotDynError: Of the kind `error`, with the remedy, if it cannot be read.
    """
    with _opened(path, error, remedy) as stream:
        yield stream


def read(path: str | Path, most: int, error: type[RobotDynError], remedy: str) -> bytes:
    """The bytes of a regular file of at most `most`; errors as of `reading`."""
    data = read_start(path, most + 1, error, remedy)
    if len(data) > most:
        raise error(f"{path}: is larger than {most / 2**20:.3g} MiB; {remedy}")
    return data


def read_start(path: str | Path, count: int, error: type[RobotDynError], remedy: str) -> bytes:
    """The first bytes of a regular file, all if it has fewer; errors as of `reading`."""
    with reading(path, error, remedy) as stream:
        try:
            return stream.read(count)
        except OSError as cause:
            raise error(f"{path}: cannot be read ({why(cause)}); {remedy}") from None


def _opened(path: str | Path, error: type[RobotDynError], remedy: str) -> BinaryIO:
    path = file_path(path, error)
    try:
        _refuse_irregular(path, path.stat().st_mode, error, remedy)
        handle = os.open(path, READ)
        stream = os.fdopen(handle, "rb")
        _refuse_irregular(path, os.fstat(handle).st_mode, error, remedy)  # it may be another by now
        return stream
    except FileNotFoundError:
        raise error(f"{path}: there is no such file; {remedy}") from None
    except (OSError, ValueError, TypeError) as cause:
        raise error(f"{path}: cannot be read ({why(cause)}); {remedy}") from None


def _refuse_irregular(path: Path, mode: int, error: type[RobotDynError], remedy: str) -> None:
    if not S_ISREG(mode):
        raise error(f"{path}: is {'a folder' if S_ISDIR(mode) else 'not a regular file'}; {remedy}")


def file_path(value: Any, error: type[RobotDynError]) -> Path:
    """The path of a file."""
    if not isinstance(value, str | os.PathLike):
        raise error(f"path: give the path of a file, got {shown(value)}")
    return Path(value)


def why(cause: Exception) -> str:
    """What the system says of an error."""
    return getattr(cause, "strerror", None) or str(cause)
