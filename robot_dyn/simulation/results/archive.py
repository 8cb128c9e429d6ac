"""An archive of named arrays: a .npz file with a SHA-256 over the name, type, shape and numbers of every member.

NumPy reads it as any other. Here it is read within bounds: what a member holds is known from its headers before it is
inflated, nothing is unpickled, and whatever is wrong with the file is an ArchiveError that names the member.
"""

from __future__ import annotations

import ast
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from math import prod
from typing import BinaryIO, final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, shorten

DIGEST = "sha256"  # the member that holds it; it covers all others
_MOST_MEMBERS = 10_000
_MOST_HEADER = 4096  # bytes of an array's own header; NumPy writes 118
_MOST_NAME = 10_000  # characters; zip files end at 65 535 bytes
_MAGIC = b"\x93NUMPY\x01\x00"  # version 1.0, which NumPy writes for all arrays without fields
_TYPE = re.compile(r"[<|][bfiuU][1-9]\d{0,9}")  # booleans, numbers and text, in the byte order of files
_START = b"PK"  # of a zip file
_DEFLATED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


class ArchiveError(RobotDynError):
    """An archive that is damaged, incomplete, or holds what arrays of numbers do not."""


@final
@dataclass(frozen=True)
class Header:
    """What a member holds: an array of this shape and type, in `size` bytes."""

    shape: tuple[int, ...]
    dtype: np.dtype

    @property
    def size(self) -> int:
        """In [bytes]."""
        return prod(self.shape) * self.dtype.itemsize

    def __str__(self) -> str:
        return f"{self.dtype.name} {self.shape}"


def write(stream: BinaryIO, arrays: Mapping[str, np.ndarray], compressed: bool = True) -> None:
    """Write arrays with their digest, compressed unless told otherwise.

    Raises:
        ArchiveError: If a name cannot be that of a member.
    """
    for name in arrays:
        if "\0" in name or len(name) > _MOST_NAME:
            raise ArchiveError(f"{shorten(name)!r} cannot be a name in a file; use a shorter one, without NUL")
    contents = {name: np.ascontiguousarray(array).reshape(np.shape(array)) for name, array in arrays.items()}
    contents[DIGEST] = np.array(_digest(contents))
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED) as file:
        for name, array in contents.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, version=(1, 0), allow_pickle=False)


@final
class Archive:
    """An archive open for reading; `headers` describe what each member holds.

    Args:
        stream: Of a regular file.

    Raises:
        ArchiveError: If it is not a zip file of arrays.
    """

    def __init__(self, stream: BinaryIO) -> None:
        with _reading("the file"):
            if (start := stream.read(len(_START))) != _START and start:
                raise ArchiveError("it is not a file that robot-dyn simulate -o writes")
            stream.seek(0)
            self._file = zipfile.ZipFile(stream)
        members = self._file.infolist()
        if len(members) > _MOST_MEMBERS:
            raise ArchiveError(f"holds {len(members)} members, more than {_MOST_MEMBERS}")
        self._members = {member.filename.removesuffix(".npy"): member for member in members}
        if len(self._members) < len(members):
            raise ArchiveError("holds two members of the same name")
        self.headers = {name: self._header(name) for name in self._members}

    @property
    def size(self) -> int:
        """Of all arrays, in [bytes]."""
        return sum(header.size for header in self.headers.values())

    def array(self, name: str) -> np.ndarray:
        """The array of a member."""
        if name not in self.headers:
            raise ArchiveError(f"member {name!r} is missing")
        header, what = self.headers[name], _said(name)
        with _reading(what), self._open(name) as member:
            member.read(self._members[name].file_size - header.size)
            data = member.read(header.size)
            member.read(1)  # at the end of a member its CRC is checked
        array = np.ndarray(header.shape, header.dtype, data).copy()
        if header.dtype == np.bool_ and array.view(np.uint8).max(initial=0) > 1:
            raise ArchiveError(f"{what} holds bytes that are not truth values")
        return array

    def text(self, name: str) -> str:
        """The text of a member."""
        array = self.array(name)
        if array.dtype.kind != "U" or array.shape:
            raise ArchiveError(f"{_said(name)} holds {self.headers[name]}, not one text")
        with _reading(_said(name)):
            return str(array)

    def arrays(self) -> dict[str, np.ndarray]:
        """All arrays; ArchiveError unless the digest is that of their contents."""
        arrays = {name: self.array(name) for name in self.headers if name != DIGEST}
        if self.text(DIGEST) != _digest(arrays):
            raise ArchiveError("its SHA-256 is not that of its contents: it was changed after it was written")
        return arrays

    def _open(self, name: str) -> zipfile.ZipExtFile:
        return self._file.open(self._members[name])  # pyright: ignore[reportReturnType]

    def _header(self, name: str) -> Header:
        """Read without inflating more than itself; sizes in zip and array must agree."""
        what, member = _said(name), self._members[name]
        if member.compress_type not in _DEFLATED or member.flag_bits & 1:
            raise ArchiveError(f"{what} is encrypted, or compressed in a way that run files do not use")
        with _reading(what), self._open(name) as stream:
            start = stream.read(len(_MAGIC) + 2)
            length = int.from_bytes(start[len(_MAGIC) :], "little")
            text = stream.read(length) if start.startswith(_MAGIC) and length <= _MOST_HEADER else b""
            header = _parsed(text)
        if header is None or len(start) + len(text) + header.size != member.file_size:
            raise ArchiveError(f"{what} is not an array of numbers or a text")
        return header


def _parsed(text: bytes) -> Header | None:
    """The header of an array, which is a literal dict of Python; None if it is another one."""
    try:
        fields = ast.literal_eval(text.decode("ascii").strip())
        kind, shape, columns = fields["descr"], fields["shape"], fields["fortran_order"]
        if not (len(fields) == 3 and columns is False and isinstance(shape, tuple) and _TYPE.fullmatch(kind)):
            return None
        if len(shape) > 8 or not all(type(length) is int and 0 <= length < 2**48 for length in shape):
            return None
        return Header(shape, np.dtype(kind))
    except (SyntaxError, ValueError, TypeError, LookupError, RecursionError, MemoryError):
        return None


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of arrays in the order of their names; type and shape precede the numbers, lengths precede all."""
    digest = sha256()
    for name, array in sorted(arrays.items()):
        about = f"{name}\0{array.dtype.str}\0{array.shape}".encode("utf-8", "surrogatepass")
        digest.update(len(about).to_bytes(8, "big") + about)
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _said(name: str) -> str:
    return f"member {shorten(name)!r}"


@contextmanager
def _reading(what: str) -> Iterator[None]:
    """Whatever zipfile and zlib raise of a damaged file, as an ArchiveError: they promise no kinds."""
    try:
        yield
    except ArchiveError:
        raise
    except MemoryError:
        raise ArchiveError(f"{what} does not fit into memory") from None
    except Exception as error:
        raise ArchiveError(f"{what} is damaged or cut short ({type(error).__name__})") from None
