"""Compiled kernels on disk: a folder of entries, each the bytes of one kernel under the digest of all it came from.

A stored kernel is executed, so an entry is read only from a folder that belongs to you alone and a file that you
wrote. The SHA-256 inside it detects damage; it does not prove who wrote it.

An entry is lines of text and then the payload: the format, the SHA-256 of all that follows, the key, what it is about.
"""

from __future__ import annotations

import os
import re
import tempfile
import time
import warnings
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from stat import S_IMODE, S_ISDIR, S_ISLNK, S_ISREG
from typing import final

import platformdirs

from robot_dyn.foundations.errors import QueryError, RobotDynWarning, shorten

VARIABLE = "ROBOT_DYN_CACHE"  # names another folder; empty or "off": no cache
_OTHER = f"name another folder in {VARIABLE}, or set it to off"

_MAGIC = b"robot_dyn kernel 1\n"  # the number is the format's
_KEY = re.compile("[0-9a-f]{64}")
_ENTRY, _UNFINISHED = re.compile(_KEY.pattern + r"\.kernel"), re.compile(_KEY.pattern + r"\w+\.unfinished")
_ABANDONED_S = 3600.0  # after which an unfinished file has no writer any more
# O_NOFOLLOW: a link could lead anywhere. O_NONBLOCK: opening a pipe would wait for its writer. Windows has neither.
_OPEN = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


class CacheWarning(RobotDynWarning):
    """Compiled kernels are not stored on disk; everything else works, with a slower start."""


@final
@dataclass(frozen=True)
class Entry:
    """A kernel in the cache.

    Attributes:
        key: Its key.
        about: What it computes, as text.
        size: Of its file, in [bytes].
        used: When it was last written or read, in [s] since 1970.
    """

    key: str
    about: str
    size: int
    used: float


@final
@dataclass(frozen=True)
class Store:
    """A folder of kernels. Nothing on disk makes a method raise; an entry that cannot be trusted counts as missing.

    Processes may share it without locks: entries appear whole or not at all, and equal keys have equal contents.

    Attributes:
        folder: Its full path; created, for you alone, at the first `save`.
        most_bytes: Size limit, in [bytes]; above it the entries not used for longest are removed.
    """

    folder: Path
    most_bytes: int = 512 * 2**20

    def load(self, key: str) -> bytes | None:
        """The payload saved under `key`; None unless one is there that is intact and yours (a bad one is removed).

        Raises:
            QueryError: If `key` is not a digest.
        """
        path = self._path(key)
        if _objection(self.folder):
            return None
        try:
            payload = _payload(_read(path), key)
        except OSError:  # missing, or not readable at the moment
            return None
        with suppress(OSError):
            path.unlink() if payload is None else os.utime(path)
        return payload

    def save(self, key: str, payload: bytes, about: str = "") -> None:
        """Store a payload, whole or not at all; a CacheWarning gives the reason if it cannot; QueryError as `load`."""
        path = self._path(key)
        label = " ".join(shorten(about, 200).split())  # one line
        entry = _sealed(f"{key}\n{label}\n".encode("utf-8", "replace") + payload)
        if len(entry) > self.most_bytes:
            return
        why = _objection(self.folder)
        try:
            if not why:
                _write(path, entry)
                self._evict(path)
        except OSError as error:
            why = f"cannot be written ({error.strerror}); make room, or {_OTHER}"
        if why:
            _warn(self.folder, why)

    def entries(self) -> tuple[Entry, ...]:
        """All entries, the latest used first."""
        return tuple(Entry(path.stem, _about(path), stat.st_size, stat.st_mtime) for path, stat in self._files())

    def clear(self) -> int:
        """Remove all entries, and no other file; return how many."""
        self._evict(None)
        return sum(_remove(path) for path, _ in self._files())

    def _path(self, key: str) -> Path:
        if not _KEY.fullmatch(key):  # it becomes the name of a file
            raise QueryError(f"key must be 64 hexadecimal digits, got {shorten(key)!r}; give one of store.keys.digest")
        return self.folder / f"{key}.kernel"

    def _files(self, name: re.Pattern[str] = _ENTRY) -> list[tuple[Path, os.stat_result]]:
        """The files of the cache with their status (links not followed), the latest used first."""
        files: list[tuple[Path, os.stat_result]] = []
        with suppress(OSError):
            for path in () if _objection(self.folder) else self.folder.iterdir():
                if name.fullmatch(path.name):
                    with suppress(OSError):  # another process removed it
                        files.append((path, path.lstat()))
        return sorted(files, key=lambda file: -file[1].st_mtime_ns)

    def _evict(self, newest: Path | None) -> None:
        """Remove entries above the size limit, except the newest, and files that killed writers left behind."""
        for path, status in self._files(_UNFINISHED):
            if time.time() - status.st_mtime > _ABANDONED_S:
                _remove(path)
        files = self._files()
        excess = sum(status.st_size for _, status in files) - self.most_bytes
        for path, status in reversed(files):
            if excess > 0 and path != newest and _remove(path):
                excess -= status.st_size


def default_store() -> Store | None:
    """The cache of this user; None if it is switched off or, with a CacheWarning, if its folder cannot be trusted.

    It lies in the user's cache directory, or in the folder that ROBOT_DYN_CACHE names (empty or off: no cache).
    """
    named = os.environ.get(VARIABLE)
    if named is not None and named.strip().lower() in ("", "off"):
        return None
    own = platformdirs.user_cache_path("robot_dyn", appauthor=False)
    folders = (own, own / "kernels") if named is None else (Path(os.path.expanduser(named)),)
    for folder in folders:
        if why := _objection(folder):
            _warn(folder, why)
            return None
    return Store(folders[-1])


def _objection(folder: Path) -> str:
    """Why a folder cannot be trusted and the remedy; empty if it can, or does not exist yet."""
    if not folder.is_absolute():
        return f"is not a full path; {_OTHER}"
    try:
        status = folder.lstat()
    except OSError:  # where it cannot be reached, reading and writing fail of themselves
        return ""
    if not S_ISDIR(status.st_mode):
        return f"is {'a link' if S_ISLNK(status.st_mode) else 'not a folder'}; {_OTHER}"
    if not _is_private(status, 0o077):
        mode = S_IMODE(status.st_mode)
        return f"is not yours alone (owner {status.st_uid}, mode {mode:04o}); chmod 700 it if it is yours, or {_OTHER}"
    return ""


def _is_private(status: os.stat_result, forbidden: int) -> bool:
    """Whether it is this user's, without the forbidden permissions; Windows has access lists in their place."""
    return os.name != "posix" or (status.st_uid == os.geteuid() and not status.st_mode & forbidden)


def _read(path: Path, most: int = -1) -> bytes:
    """The first bytes of an entry; none if another user could have written the file. OSError if it is missing."""
    if path.is_symlink():  # a link is not an error to raise; if it becomes one only now, O_NOFOLLOW refuses it
        return b""
    handle = os.open(path, _OPEN)
    status = os.fstat(handle)  # of what is read, not of what has the name by now
    if not S_ISREG(status.st_mode) or not _is_private(status, 0o022):
        os.close(handle)
        return b""
    with os.fdopen(handle, "rb") as stream:
        return stream.read(most)


def _sealed(body: bytes) -> bytes:
    return _MAGIC + sha256(body).hexdigest().encode() + b"\n" + body


def _payload(entry: bytes, key: str) -> bytes | None:
    """The payload of an entry; None if it is damaged, cut short, of another format or of another key."""
    body = entry[len(_sealed(b"")) :]
    if entry != _sealed(body) or not body.startswith(key.encode() + b"\n"):
        return None
    return body.partition(b"\n")[2].partition(b"\n")[2]


def _about(path: Path) -> str:
    """The text about an entry, printable even if it is damaged; empty if it cannot be read."""
    with suppress(OSError, IndexError):
        text = _read(path, 1024).split(b"\n")[3].decode("utf-8", "replace")
        return "".join(letter if letter.isprintable() else "?" for letter in text)
    return ""


def _write(path: Path, data: bytes) -> None:
    """Write beside the target and rename, so that a reader sees no entry or a whole one; makes missing folders."""
    folders = (path.parent, *path.parent.parents)
    for each in reversed([folder for folder in folders if not os.path.lexists(folder)]):
        with suppress(FileExistsError):
            each.mkdir(mode=0o700)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".unfinished")  # mode 0600
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.replace(name, path)
    finally:
        _remove(Path(name))  # exists only if the above failed


def _remove(path: Path) -> bool:
    with suppress(OSError):
        path.unlink()
        return True
    return False


def _warn(folder: Path, why: str) -> None:
    # No stacklevel: Python shows a warning once for each line it comes from, and this is that line.
    warnings.warn(f"compiled kernels are not kept: {folder} {why}", CacheWarning, stacklevel=1)
