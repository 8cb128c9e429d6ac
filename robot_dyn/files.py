"""Files: read within bounds, and only regular ones; written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex
from stat import S_ISDIR, S_ISREG
from typing import BinaryIO

from robot_dyn.errors import RobotDynError


def target(path: str | Path, suffix: str, error: type[RobotDynError]) -> Path:
    """The path of a file to write, with the suffix if it has none; `error` if it names no file."""
    path = Path(path)
    if not path.name or path.is_dir():
        raise error(f"{path}: is a folder; give the name of a file in it, such as {path / ('run' + suffix)}")
    return path if path.suffix else path.with_suffix(suffix)


def save(path: Path, write: Callable[[BinaryIO], object], error: type[RobotDynError]) -> Path:
    """Write beside the target and rename: a reader sees the old file or the new one, never half of it.

    Raises:
        RobotDynError: Of the kind `error`, if it cannot be written.
    """
    try:
        beside = path.with_name(f".{path.name[:200]}.{token_hex(8)}")  # a tempfile would be its owner's alone
        try:
            with beside.open("xb") as stream:
                write(stream)
            beside.replace(path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
    except OSError as cause:
        raise error(f"{path}: cannot be written ({cause.strerror}); give a path in a folder that is writable") from None
    return path


@contextmanager
def reading(path: str | Path, error: type[RobotDynError], remedy: str) -> Iterator[BinaryIO]:
    """A regular file, open for reading; a device, pipe or folder is refused at once.

    Raises:
        RobotDynError: Of the kind `error`, with the remedy, if it cannot be read.
    """
    with _opened(path, error, remedy) as stream:
        yield stream


def _opened(path: str | Path, error: type[RobotDynError], remedy: str) -> BinaryIO:
    try:
        path = Path(path)
        _refuse_irregular(path, path.stat().st_mode, error, remedy)
        # Opening a pipe would wait for its writer; Windows has no O_NONBLOCK, POSIX no O_BINARY.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        stream = os.fdopen(handle, "rb")
        _refuse_irregular(path, os.fstat(handle).st_mode, error, remedy)  # it may be another by now
        return stream
    except FileNotFoundError:
        raise error(f"{path}: there is no such file; {remedy}") from None
    except (OSError, ValueError, TypeError) as cause:  # ValueError: a NUL in the path
        raise error(f"{path}: cannot be read ({getattr(cause, 'strerror', None) or cause}); {remedy}") from None


def read(path: str | Path, most: int, error: type[RobotDynError], remedy: str) -> bytes:
    """The bytes of a regular file of at most `most`; errors as of `reading`."""
    with reading(path, error, remedy) as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise error(f"{path}: is larger than {most} bytes; {remedy}")
    return data


def _refuse_irregular(path: str | Path, mode: int, error: type[RobotDynError], remedy: str) -> None:
    if not S_ISREG(mode):
        raise error(f"{path}: is {'a folder' if S_ISDIR(mode) else 'not a regular file'}; {remedy}")
