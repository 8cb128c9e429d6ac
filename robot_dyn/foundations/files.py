"""Files: read if regular and within a size limit; written completely or not at all, and only over files of their kind.

A file is written next to its target, synchronised and renamed, so that readers see the old file or the new one, even
after a power loss. Links are followed, permissions are kept, and leftovers of killed writers are removed.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from stat import S_IMODE, S_ISDIR, S_ISREG
from time import time
from typing import Any, BinaryIO, final

from robot_dyn.foundations.errors import RobotDynError, shown

_NEW_S = 10.0  # [s]: a younger file may be open and not yet locked
# Locks distinguish files being written from abandoned ones; Windows needs none, because open files cannot be removed.
_locks: Any = import_module("fcntl") if os.name == "posix" else None
_PART = 2**24  # bytes per read
# Without O_NONBLOCK, opening a pipe would wait for its writer; Windows has no O_NONBLOCK, POSIX no O_BINARY.
_READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)


@final
@dataclass(frozen=True)
class FileKind:
    """A kind of file: its name, its suffix, and the first bytes that all files of the kind share."""

    name: str
    suffix: str
    start: bytes = b""


def target(
    path: str | Path,
    kinds: FileKind | tuple[FileKind, ...],
    error: type[RobotDynError],
    inputs: Iterable[str | Path] = (),
    force: bool = True,
) -> Path:
    """Check the path of an output file before any work; return it, with the suffix of the first kind if it has none.

    Args:
        path: Path of the file.
        kinds: Allowed kinds of file.
        error: Type of the errors.
        inputs: Files and folders that are read; they are never replaced, even with `force`.
        force: True if an existing file of the same kind may be replaced.

    Raises:
        RobotDynError: Of type `error`, if the suffix is wrong; the folder is missing or not writable; the path is
            not a file of its kind, or exists and `force` is False; or the path is one of `inputs` or inside one, even
            through a link.
    """
    kinds = kinds if isinstance(kinds, tuple) else (kinds,)
    try:
        path = file_path(path, error)
        if not path.name or path.is_dir():
            raise error(
                f"{path}: is a folder; give the name of a file in it, such as {path / ('run' + kinds[0].suffix)}"
            )
        path = path if path.suffix else path.with_suffix(kinds[0].suffix)
        kind = next((kind for kind in kinds if kind.suffix == path.suffix.lower()), None)
        if kind is None:
            suffixes = ", ".join(kind.suffix for kind in kinds)
            raise error(f"{path}: {path.suffix!r} is not a suffix for {kinds[0].name}; use {suffixes}")
        _check(path, Path(os.path.realpath(path)), kind, error, inputs)
        if path.exists() and not force:
            raise error(
                f"{path}: already exists; add --force to replace it (in Python force=True), or give another path"
            )
    except (OSError, TypeError, ValueError) as cause:  # ValueError: a NUL in the path
        raise error(f"{path}: cannot be written ({why(cause)}); give another path") from None
    return path


def _check(path: Path, real: Path, kind: FileKind, error: type[RobotDynError], inputs: Iterable[str | Path]) -> None:
    """Check that a file can be written, and that it replaces only a file of its kind."""
    if not real.parent.is_dir():
        raise error(f"{path}: there is no folder {real.parent}; create it first, or give another path")
    if real.is_symlink():
        raise error(f"{path}: is a link to itself; remove it, or give another path")
    for other in map(Path, inputs):
        if os.path.realpath(other) == str(real) or (real.exists() and other.exists() and real.samefile(other)):
            raise error(f"{path}: is the same file as the input {other}; give another path")
        if real.is_relative_to(os.path.realpath(other)):
            raise error(f"{path}: is in the input folder {other}; give a path in another folder")
    if not real.exists():
        if not os.access(real.parent, os.W_OK | os.X_OK):
            raise error(f"{path}: the folder {real.parent} is not writable; give a path in another folder")
        return
    start = read_start(path, len(kind.start), error, "give another path")
    if not os.access(real, os.W_OK):
        raise error(f"{path}: is write-protected; change its permissions, or give another path")
    if start and start != kind.start:
        raise error(f"{path}: is not {kind.name}, so it is not replaced; remove it, or give another path")


def check_folder(path: Path, error: type[RobotDynError]) -> None:
    """Check, before any work, that a folder can be written or created.

    Raises:
        RobotDynError: Of type `error`, if the path is not a folder, or it, or the folder above it, is not writable.
    """
    try:
        real = Path(os.path.realpath(path))
        existing = next(folder for folder in (real, *real.parents) if os.path.lexists(folder))
        if not existing.is_dir():
            raise error(f"{path}: {existing} is not a folder; give another path")
        if not os.access(existing, os.W_OK | os.X_OK) or _is_read_only(existing):
            raise error(f"{path}: the folder {existing} is not writable; give a path in another folder")
    except (OSError, ValueError) as cause:  # ValueError: a NUL in the path
        raise error(f"{shown(str(path))}: cannot be written ({why(cause)}); give another path") from None


def _is_read_only(folder: Path) -> bool:
    """Return True if a file cannot be created, for example on a read-only disk."""
    handle, name = -1, folder / f".{os.urandom(8).hex()}.unfinished"
    try:
        handle = os.open(name, _NEW, 0o600)
    except OSError:
        return True
    os.close(handle)
    name.unlink()
    return False


def save(path: Path, write: Callable[[BinaryIO], object], error: type[RobotDynError]) -> Path:
    """Write a file that readers see completely or not at all; `path` comes from `target`.

    Raises:
        RobotDynError: Of type `error`, if the file cannot be written; any old file is then unchanged.
    """
    real = Path(os.path.realpath(path))
    try:
        _remove_abandoned(real)
        old = real.stat() if real.exists() else None
        with _unfinished(real, 0o600 if old else 0o666) as (temporary, stream):
            write(stream)
            stream.flush()
            if old:
                _copy_permissions(temporary, old)
            os.fsync(stream.fileno())
            if not _locks:
                stream.close()  # Windows cannot rename open files; elsewhere it stays locked until renamed
            os.replace(temporary, real)
        sync_folder(real.parent)
    except MemoryError:
        raise error(f"{path}: cannot be written (not enough memory); free memory, or save less") from None
    except OSError as cause:
        raise error(f"{path}: cannot be written ({why(cause)}); free disk space, or give another path") from None
    return path


def _copy_permissions(temporary: Path, old: os.stat_result) -> None:
    """Copy the owner and permissions of the file that is replaced."""
    if hasattr(os, "chown"):
        with suppress(OSError):  # only root may change the owner
            os.chown(temporary, old.st_uid, old.st_gid)
    os.chmod(temporary, S_IMODE(old.st_mode))


@contextmanager
def _unfinished(real: Path, mode: int) -> Iterator[tuple[Path, BinaryIO]]:
    """Open and lock a new file next to the target; remove it if anything fails."""
    temporary = real.with_name(f"{_prefix(real)}{os.urandom(8).hex()}.unfinished")
    handle = os.open(temporary, _NEW, mode)
    try:
        with os.fdopen(handle, "wb") as stream:
            _lock(handle)
            yield temporary, stream
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def _lock(handle: int, only_if_free: bool = False) -> None:
    """Lock a file until it is closed; a failure to lock is ignored unless `only_if_free`."""
    if _locks and only_if_free:
        _locks.flock(handle, _locks.LOCK_EX | _locks.LOCK_NB)
    elif _locks:
        with suppress(OSError):
            _locks.flock(handle, _locks.LOCK_EX)


def _remove_abandoned(real: Path) -> None:
    """Remove leftovers of killed writers of this file: neighbouring files that are neither new nor locked."""
    name = re.compile(re.escape(_prefix(real)) + r"[0-9a-f]{16}\.unfinished")
    for leftover in [path for path in real.parent.iterdir() if name.fullmatch(path.name)]:
        with suppress(OSError):  # locked, removed meanwhile, or owned by another user
            if time() - leftover.lstat().st_mtime < _NEW_S:
                continue
            handle = os.open(leftover, _READ)
            try:
                _lock(handle, only_if_free=True)
                leftover.unlink()
            finally:
                os.close(handle)


def _prefix(real: Path) -> str:
    return f".{os.fsencode(real.name)[:180].decode('utf-8', 'ignore')}."


def sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to disk, if the system supports it."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def reading(path: str | Path, error: type[RobotDynError], remedy: str) -> Iterator[BinaryIO]:
    """Open a regular file for reading; devices, pipes and folders are errors.

    Raises:
        RobotDynError: Of type `error`, with the remedy, if the file cannot be read.
    """
    with _opened(path, error, remedy) as stream:
        yield stream


def read(path: str | Path, most: int, error: type[RobotDynError], remedy: str) -> bytes:
    """Return the content of a regular file of at most `most` bytes; for errors, see `reading`."""
    data = read_start(path, most + 1, error, remedy)
    if len(data) > most:
        raise error(f"{path}: is larger than {most / 2**20:.3g} MiB; {remedy}")
    return data


def csv_rows(
    path: str | Path, most: int, error: type[RobotDynError], remedy: str, *, skip_blank: bool = False
) -> Iterator[tuple[str, list[str]]]:
    """Yield the location, for messages, and the entries of each line of a CSV file; the first line names the columns.

    Empty lines are skipped; if `skip_blank`, so are lines of only spaces and commas.

    Raises:
        RobotDynError: Of type `error`, if the file cannot be read, or a line does not have one entry for each column.
    """
    data = read(path, most, error, remedy)
    try:
        lines = csv.reader(data.decode("utf-8-sig").splitlines(), strict=True)
        heads = next(lines, [])
        yield str(path), heads
        for row in filter(None, lines):
            if skip_blank and not any(map(str.strip, row)):
                continue
            if len(row) != len(heads):
                counts = f"{len(row)} entries for {len(heads)} columns"
                raise error(f"{path}: line {lines.line_num} has {counts}; correct it")
            yield f"{path}: line {lines.line_num}", row
    except (UnicodeDecodeError, csv.Error) as cause:
        raise error(f"{path}: is not a CSV file in UTF-8 ({cause}); save it again as CSV") from None


def read_start(path: str | Path, count: int, error: type[RobotDynError], remedy: str) -> bytes:
    """Return the first bytes of a regular file, all if it has fewer; for errors, see `reading`."""
    with reading(path, error, remedy) as stream:
        try:
            parts, left = [], count
            while left and (part := stream.read(min(left, _PART))):  # one read would allocate `count` bytes
                parts.append(part)
                left -= len(part)
            return b"".join(parts)
        except OSError as cause:
            raise error(f"{path}: cannot be read ({why(cause)}); {remedy}") from None


def _opened(path: str | Path, error: type[RobotDynError], remedy: str) -> BinaryIO:
    path = file_path(path, error)
    try:
        _refuse_irregular(path, path.stat().st_mode, error, remedy)
        handle = os.open(path, _READ)
        stream = os.fdopen(handle, "rb")
        _refuse_irregular(path, os.fstat(handle).st_mode, error, remedy)  # the path may name another file by now
        return stream
    except FileNotFoundError:
        raise error(f"{path}: there is no such file; {remedy}") from None
    except MemoryError:
        raise error(f"{path}: cannot be read (not enough memory); free memory, or {remedy}") from None
    except (OSError, ValueError, TypeError) as cause:
        raise error(f"{path}: cannot be read ({why(cause)}); {remedy}") from None


def _refuse_irregular(path: Path, mode: int, error: type[RobotDynError], remedy: str) -> None:
    if not S_ISREG(mode):
        raise error(f"{path}: is {'a folder' if S_ISDIR(mode) else 'not a regular file'}; {remedy}")


def file_path(value: object, error: type[RobotDynError]) -> Path:
    """Return the path of a file or folder."""
    if not isinstance(value, str | os.PathLike):
        raise error(f"path must be the path of a file, got {shown(value)}")
    try:
        path = Path(value)
    except TypeError as cause:  # an os.PathLike of bytes
        raise error(f"path must be a text, got {shown(value)} ({cause})") from None
    if "\0" in str(path):
        raise error(f"path: {shown(str(path))} has an embedded null character; give another path")
    return path


_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")  # OWASP, CSV injection


def table_cell(value: object) -> object:
    """Return a cell of a CSV table, with an apostrophe before a text that spreadsheets would run as a formula."""
    if not isinstance(value, str) or not value.startswith(_FORMULA):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def why(cause: Exception) -> str:
    """Return the system's message for an error."""
    return getattr(cause, "strerror", None) or str(cause)
