"""Compiled kernels on disk: a folder of entries, each with the bytes of one kernel, named by a digest of its origin.

A stored kernel is executed, so entries are read only from a folder that belongs to you alone and from files that you
wrote. The SHA-256 inside detects damage; it does not prove who wrote the file.

An entry consists of lines of text and the payload: the format, the SHA-256 of the rest, the key, and a description.
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

VARIABLE = "ROBOT_DYN_CACHE"  # path of another folder; empty or "off": no cache
_OTHER = f"name another folder in {VARIABLE}, or set it to off"

_MAGIC = b"robot_dyn kernel 1\n"  # the number is the format's
_KEY = re.compile("[0-9a-f]{64}")
_ENTRY, _UNFINISHED = re.compile(_KEY.pattern + r"\.kernel"), re.compile(_KEY.pattern + r"\w+\.unfinished")
_ABANDONED_S = 3600.0  # age at which an unfinished file counts as abandoned
# O_NOFOLLOW: a link could lead anywhere. O_NONBLOCK: opening a pipe would wait for its writer. Windows has neither.
_OPEN = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


class CacheWarning(RobotDynWarning):
    """Compiled kernels are not stored on disk; only the start is slower."""


@final
@dataclass(frozen=True)
class Entry:
    """A kernel in the cache.

    Attributes:
        key: Key of the kernel.
        about: Description of the kernel.
        size: Size of the file, in [bytes].
        used: Time of the last write or read, in [s] since 1970.
    """

    key: str
    about: str
    size: int
    used: float


@final
@dataclass(frozen=True)
class Store:
    """A folder of kernels. No method raises because of files on disk; an untrusted entry counts as missing.

    Processes can share it without locks: entries are written atomically, and equal keys have equal contents.

    Attributes:
        folder: Absolute path; the first `save` creates it with access for you alone.
        max_bytes: Size limit, in [bytes]; above it the least recently used entries are removed.
    """

    folder: Path
    max_bytes: int = 512 * 2**20

    def load(self, key: str) -> bytes | None:
        """Return the payload saved under `key`; None if it is missing, or damaged or not yours, which is then removed.

        Raises:
            QueryError: If `key` is not a digest.
        """
        path = self._path(key)
        if _objection(self.folder):
            return None
        try:
            payload = _payload(_read(path), key)
        except OSError:  # missing, or temporarily unreadable
            return None
        with suppress(OSError):
            path.unlink() if payload is None else os.utime(path)
        return payload

    def save(self, key: str, payload: bytes, about: str = "") -> None:
        """Store a payload atomically; issue a CacheWarning with the reason if impossible; QueryError as in `load`."""
        path = self._path(key)
        label = " ".join(shorten(about, 200).split())  # one line
        entry = _sealed(f"{key}\n{label}\n".encode("utf-8", "replace") + payload)
        if len(entry) > self.max_bytes:
            return
        why = _objection(self.folder)
        try:
            if not why:
                _write(path, entry)
                self._evict(path)
        except OSError as error:
            why = f"cannot be written ({error.strerror}); free some space, or {_OTHER}"
        if why:
            _warn(self.folder, why)

    def entries(self) -> tuple[Entry, ...]:
        """Return all entries, most recently used first."""
        return tuple(Entry(path.stem, _about(path), stat.st_size, stat.st_mtime) for path, stat in self._files())

    def clear(self) -> int:
        """Remove all entries, and no other file; return their number."""
        self._evict(None)
        return sum(_remove(path) for path, _ in self._files())

    def _path(self, key: str) -> Path:
        if not _KEY.fullmatch(key):  # it becomes the name of a file
            raise QueryError(
                f"key must be 64 hexadecimal digits, got {shorten(key)!r}; use a key from store.keys.digest"
            )
        return self.folder / f"{key}.kernel"

    def _files(self, name: re.Pattern[str] = _ENTRY) -> list[tuple[Path, os.stat_result]]:
        """Return the files of the cache with their status (links not followed), most recently used first."""
        files: list[tuple[Path, os.stat_result]] = []
        with suppress(OSError):
            for path in () if _objection(self.folder) else self.folder.iterdir():
                if name.fullmatch(path.name):
                    with suppress(OSError):  # another process removed it
                        files.append((path, path.lstat()))
        return sorted(files, key=lambda file: -file[1].st_mtime_ns)

    def _evict(self, newest: Path | None) -> None:
        """Remove entries above the size limit, except the newest, and abandoned unfinished files."""
        for path, status in self._files(_UNFINISHED):
            if time.time() - status.st_mtime > _ABANDONED_S:
                _remove(path)
        files = self._files()
        excess = sum(status.st_size for _, status in files) - self.max_bytes
        for path, status in reversed(files):
            if excess > 0 and path != newest and _remove(path):
                excess -= status.st_size


def default_store() -> Store | None:
    """Return the cache of this user; None if it is off or, with a CacheWarning, if its folder is not trusted.

    It is in the user's cache directory, or in the folder given by ROBOT_DYN_CACHE (empty or off: no cache).
    """
    configured = os.environ.get(VARIABLE)
    if configured is not None and configured.strip().lower() in ("", "off"):
        return None
    own = platformdirs.user_cache_path("robot_dyn", appauthor=False)
    folders = (own, own / "kernels") if configured is None else (Path(os.path.expanduser(configured)),)
    for folder in folders:
        if why := _objection(folder):
            _warn(folder, why)
            return None
    return Store(folders[-1])


def _objection(folder: Path) -> str:
    """Return the reason why a folder is not trusted, with the remedy; "" if it is trusted or does not exist yet."""
    if not folder.is_absolute():
        return f"is not a full path; {_OTHER}"
    try:
        status = folder.lstat()
    except OSError:  # if it is unreachable, reading and writing fail too
        return ""
    if not S_ISDIR(status.st_mode):
        return f"is {'a link' if S_ISLNK(status.st_mode) else 'not a folder'}; {_OTHER}"
    if not _is_private(status, 0o077):
        mode = S_IMODE(status.st_mode)
        return f"is not yours alone (owner {status.st_uid}, mode {mode:04o}); chmod 700 it if it is yours, or {_OTHER}"
    return ""


def _is_private(status: os.stat_result, forbidden: int) -> bool:
    """Return True if a file is this user's, without forbidden permissions; Windows uses access lists instead."""
    return os.name != "posix" or (status.st_uid == os.geteuid() and not status.st_mode & forbidden)


def _read(path: Path, most: int = -1) -> bytes:
    """Return the first bytes of an entry; none if another user could have written the file. OSError if missing."""
    if path.is_symlink():  # not an error; if it becomes a link after this, O_NOFOLLOW refuses it
        return b""
    handle = os.open(path, _OPEN)
    status = os.fstat(handle)  # status of the open file, not of the current file of that name
    if not S_ISREG(status.st_mode) or not _is_private(status, 0o022):
        os.close(handle)
        return b""
    with os.fdopen(handle, "rb") as stream:
        return stream.read(most)


def _sealed(body: bytes) -> bytes:
    return _MAGIC + sha256(body).hexdigest().encode() + b"\n" + body


def _payload(entry: bytes, key: str) -> bytes | None:
    """Return the payload of an entry; None if it is damaged, truncated, or of another format or key."""
    body = entry[len(_sealed(b"")) :]
    if entry != _sealed(body) or not body.startswith(key.encode() + b"\n"):
        return None
    return body.partition(b"\n")[2].partition(b"\n")[2]


def _about(path: Path) -> str:
    """Return the description of an entry, printable even if damaged; empty if unreadable."""
    with suppress(OSError, IndexError):
        text = _read(path, 1024).split(b"\n")[3].decode("utf-8", "replace")
        return "".join(letter if letter.isprintable() else "?" for letter in text)
    return ""


def _write(path: Path, data: bytes) -> None:
    """Write a temporary file and rename it, so that readers see no entry or a whole one; create missing folders."""
    folders = (path.parent, *path.parent.parents)
    for missing in reversed([folder for folder in folders if not os.path.lexists(folder)]):
        with suppress(FileExistsError):
            missing.mkdir(mode=0o700)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".unfinished")  # mode 0600
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.replace(name, path)
    finally:
        _remove(Path(name))  # exists only after a failure


def _remove(path: Path) -> bool:
    with suppress(OSError):
        path.unlink()
        return True
    return False


def _warn(folder: Path, why: str) -> None:
    # No stacklevel: Python shows a warning once for each line it comes from, and this is that line.
    warnings.warn(f"compiled kernels are not stored: {folder} {why}", CacheWarning, stacklevel=1)
