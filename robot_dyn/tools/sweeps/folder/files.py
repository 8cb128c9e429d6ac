"""Files written whole or not there: beside the target under a name with host and process, synchronised, renamed.

Two writers of one file harm nothing: each writes its own, and the later one replaces the earlier, which has the same
rows. What dead writers left is removed by processes of the same host, and by others after a day.
"""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from time import time
from typing import final

from robot_dyn.foundations import SweepError, sync_folder, why

_OLD_S = 86_400.0
_UNFINISHED = re.compile(r"\..+\.(?P<host>[\w-]+)\.(?P<process>\d+)\.[0-9a-f]{8}\.unfinished")
_HOST = re.sub(r"[^\w-]", "-", socket.gethostname()) or "host"


class Files:
    """The calls to the system that a write consists of, in their order; tests let each of them fail."""

    def open(self, path: Path) -> int:
        """A handle of a new file."""
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)

    def write(self, handle: int, data: memoryview) -> int:
        """Write some of the bytes; how many."""
        return os.write(handle, data)

    def sync(self, handle: int) -> None:
        """Wait until the disk has the file."""
        os.fsync(handle)

    def close(self, handle: int) -> None:
        """Close a handle."""
        os.close(handle)

    def rename(self, source: Path, target: Path) -> None:
        """Give a file its name, in place of one that has it."""
        os.replace(source, target)

    def sync_folder(self, folder: Path) -> None:
        """Wait until the disk has the names in a folder."""
        sync_folder(folder)


@final
class Exclusive(Files):
    """Files of which the first writer's stays: a later one raises FileExistsError."""

    def rename(self, source: Path, target: Path) -> None:
        os.link(source, target)  # which refuses one that exists, as os.replace does not
        source.unlink()


def write(path: Path, data: bytes, files: Files | None = None) -> None:
    """Write a file whole, or leave none.

    Raises:
        OSError: If it cannot be written.
    """
    files = files or Files()
    beside = path.with_name(temporary_name(path.name))
    try:
        handle = files.open(beside)
        try:
            left = memoryview(data)
            while left:
                left = left[files.write(handle, left) :]
            files.sync(handle)
        finally:
            files.close(handle)
        files.rename(beside, path)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise
    files.sync_folder(path.parent)


def temporary_name(stem: str) -> str:
    """A new name of a file that `remove_abandoned` removes once this process has died."""
    return f".{stem}.{_HOST}.{os.getpid()}.{os.urandom(4).hex()}.unfinished"


def make_folder(path: Path) -> None:
    """A folder, and those above it; SweepError if it cannot be made."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SweepError(f"{path}: the folder cannot be made ({why(error)}); give another path") from None


def remove_abandoned(folders: Iterable[Path]) -> int:
    """Remove what writers that have died left in folders; how many files there were."""
    removed = 0
    for folder in folders:
        with suppress(OSError), os.scandir(folder) as entries:
            for each in [each for each in entries if each.name.endswith(".unfinished")]:
                with suppress(OSError):  # removed meanwhile, or another user's
                    if _is_abandoned(each):
                        os.unlink(each.path)
                        removed += 1
    return removed


def _is_abandoned(each: os.DirEntry[str]) -> bool:
    found = _UNFINISHED.fullmatch(each.name)
    if found is None:
        return False
    if time() - each.stat(follow_symlinks=False).st_mtime > _OLD_S:
        return True
    return found["host"] == _HOST and not _lives(int(found["process"]))


def _lives(process: int) -> bool:
    if os.name != "posix":  # there, signal 0 would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
