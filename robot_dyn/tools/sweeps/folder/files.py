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

from robot_dyn.foundations import SweepError, sync_folder, why

_OLD_S = 86_400.0
_UNFINISHED = re.compile(r"\..+\.(?P<host>[\w-]+)\.(?P<process>\d+)\.[0-9a-f]{8}\.unfinished")
_HOST = re.sub(r"[^\w-]", "-", socket.gethostname()) or "host"


def write(path: Path, data: bytes, exclusive: bool = False) -> None:
    """Write a file whole, or leave none.

    Args:
        path: Of the file.
        data: Its content.
        exclusive: Whether a file that has this path stays.

    Raises:
        FileExistsError: If one has it, and stays.
        OSError: If it cannot be written.
    """
    beside = path.with_name(temporary_name(path.name))
    try:
        handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        try:
            left = memoryview(data)
            while left:
                left = left[os.write(handle, left) :]
            os.fsync(handle)
        finally:
            os.close(handle)
        if exclusive:
            os.link(beside, path)  # which refuses one that exists, as os.replace does not
            os.unlink(beside)
        else:
            os.replace(beside, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(beside)
        raise
    sync_folder(path.parent)


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
