"""Files of values: the arrays of a dataclass as .npz, other fields as JSON by pydantic, with limits on sizes.

The member `about` is JSON with the format and the fields of the value. Each array is another member, named by the path
of its field, for example `ledger/kinetic`; the field in the JSON contains this name.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from os import SEEK_END
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Generic, TypeVar, final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, shorten
from robot_dyn.foundations.files import FileKind, reading, save, target

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

ABOUT = "about"
_LONGEST = 10_000  # largest number of characters in a name
_MAX = 20  # largest ratio of unpacked to packed bytes; an array of zeros has 1000
_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)

Stored = TypeVar("Stored")
Other = TypeVar("Other")
Axis = int | str | None  # length of an axis: a number; a letter for one length in a file; None for any length


class StoreError(RobotDynError):
    """A file without the expected arrays or value."""


@final
@dataclass
class Members:
    """State of reading a file: its arrays, and facts about those already read.

    Attributes:
        arrays: Arrays that no field has read yet, by name.
        lengths: Lengths of axes, by letter.
        not_finite: Names of arrays that should be finite but contain nan or inf.
    """

    arrays: dict[str, np.ndarray]
    lengths: dict[str, int] = field(default_factory=dict)
    not_finite: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Layout:
    """Form of an array in a file, stated in the type of its field: `Annotated[np.ndarray, Layout(("m", "n"))]`.

    Attributes:
        shape: Length of each axis: a number; a letter for the same length in all arrays of a file; None for any length;
            or a tuple of alternatives.
        dtype: Type of the entries.
        finite: True if nan and inf are errors unless the run diverged.
        absent: True if the whole array may be nan, for quantities that a run of rollouts did not record.
    """

    shape: tuple[Axis | tuple[Axis, ...], ...]
    dtype: str = "float64"
    finite: bool = True
    absent: bool = False

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        from pydantic import PlainValidator, ValidationInfo

        def take(name: object, info: ValidationInfo) -> np.ndarray:
            return self._take(name, info.context)

        return PlainValidator(take).__get_pydantic_core_schema__(source, handler)

    def _take(self, name: object, members: Any) -> np.ndarray:
        """Remove and return the array of a name; raise ValueError if it is missing or does not have this layout."""
        if not isinstance(name, str) or name not in members.arrays:
            raise ValueError("its array is missing")
        x, lengths = members.arrays.pop(name), members.lengths
        fits = x.ndim == len(self.shape) and x.dtype == self.dtype
        if not fits or not all(_fits(*pair, lengths) for pair in zip(x.shape, self.shape, strict=True)):
            shape = ", ".join(f"{axis} = {lengths[axis]}" if axis in lengths else str(axis) for axis in self.shape)
            raise ValueError(f"contains {x.dtype.name} {x.shape}, not {self.dtype} ({shape})")
        if x.dtype == np.bool_ and x.view(np.uint8).max(initial=0) > 1:
            raise ValueError("contains bytes other than 0 and 1")
        if self.finite and not np.isfinite(x).all() and not (self.absent and np.isnan(x).all()):
            members.not_finite.append(name)
        return x


def _fits(length: int, allowed: Axis | tuple[Axis, ...], lengths: dict[str, int]) -> bool:
    if isinstance(allowed, tuple):
        return any(_fits(length, alternative, lengths) for alternative in allowed)
    if isinstance(allowed, str):
        return lengths.setdefault(allowed, length) == length
    return allowed in (None, length)


@final
class _NotStored:
    """Marker for fields that are None in files."""

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return handler(type(None))


NOT_STORED = _NotStored()
"""Metadata of the type of a field that is None in files: `Annotated[Setup | None, NOT_STORED]`."""


@final
@dataclass(frozen=True)
class StoredFormat(Generic[Stored]):
    """A format of files of values.

    Attributes:
        name: Name or number of the format; it changes whenever the content of the files changes.
        value_type: Type of the values, a dataclass whose arrays have a `Layout`.
        kind: Kind of the files.
        error: Type of the errors.
        remedy: Remedy in messages about files that cannot be read.
        check: Function that raises a StoreError if the parts of a value do not fit together.
        other: Function that returns the remedy for a file of another format, from its JSON.
    """

    name: int | str
    value_type: type[Stored]
    kind: FileKind
    error: type[RobotDynError]
    remedy: str
    check: Callable[[Stored, Members], None]
    other: Callable[[Mapping[str, object]], str]

    @cached_property
    def _adapter(self) -> Any:
        from pydantic import ConfigDict, TypeAdapter

        config = ConfigDict(strict=True, extra="forbid")
        return TypeAdapter(list[self.value_type], config=config)  # pyright: ignore[reportInvalidTypeForm]

    def save(self, value: Stored, path: str | Path) -> Path:
        """Write a value, completely or not at all, after the checks of a reader.

        Raises:
            RobotDynError: Of type `error`, if the file cannot be written.
        """
        path = target(path, self.kind, self.error)
        arrays: dict[str, np.ndarray] = {}
        try:
            plain = _without_arrays(self._adapter.dump_python([value], warnings=False)[0], "", arrays)
            arrays[ABOUT] = np.array(json.dumps({"format": self.name, "value": plain}))
            self.value(dict(arrays))
            return save(path, lambda stream: write_arrays(stream, arrays), self.error)
        except (StoreError, TypeError, ValueError) as error:
            raise self.error(f"{path}: cannot be written: {error}; save the value as the library returned it") from None

    def load(self, path: str | Path, *others: StoredFormat[Other]) -> Stored | Other:
        """Return the value of a file in this format, or in another format of the same kind of file.

        Raises:
            RobotDynError: Of type `error`, if the file is missing, damaged, cut short or of an unknown format.
        """
        with reading(path, self.error, self.remedy) as stream:
            try:
                arrays = _read_arrays(stream)
                name = _about(dict(arrays))["format"]
                return next((form for form in others if form.name == name), self).value(arrays)
            except StoreError as error:
                raise self.error(f"{path}: cannot be read as {self.kind.name}: {error}; {self.remedy}") from None

    def value(self, arrays: dict[str, np.ndarray]) -> Stored:
        """Return the checked value of arrays; the array `about` contains the JSON.

        Raises:
            StoreError: If the arrays are not a value of this format.
        """
        from pydantic import ValidationError

        about = _about(arrays)
        if about["format"] != self.name:
            form = shorten(repr(about["format"]))
            raise StoreError(f"it has format {form}, but this version reads {self.name!r}; {self.other(about)}")
        if about.keys() != {"format", "value"}:
            raise StoreError(f"{ABOUT!r} has the keys {shorten(', '.join(map(str, about)))}, not format and value")
        members = Members(arrays)
        try:
            value = self._adapter.validate_json(json.dumps([about["value"]]), context=members)[0]
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            message = f"{first['msg']}, got {shorten(repr(first['input']))}"
            cause = first.get("ctx", {}).get("error", message)  # the error of a Layout is more precise
            raise StoreError(f"{shorten('/'.join(map(str, first['loc'][1:])) or ABOUT)!r}: {cause}") from None
        if arrays:
            raise StoreError(f"member {shorten(min(arrays))!r} is unknown to this version")
        self.check(value, members)
        return value


def _about(arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Remove the JSON of a file from its arrays and return it."""
    text = arrays.pop(ABOUT, None)
    if text is None or text.dtype.kind != "U" or text.shape:
        raise StoreError(f"it has no text {ABOUT!r}")
    try:
        about = json.loads(str(text))
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{ABOUT!r} is not JSON ({error})") from None
    if not isinstance(about, dict) or "format" not in about:
        raise StoreError(f"{ABOUT!r} has no format")
    return about


def _without_arrays(value: Any, path: str, arrays: dict[str, np.ndarray]) -> Any:
    """Return plain data for JSON in which names replace arrays; store the arrays in `arrays`."""
    if isinstance(value, np.ndarray):
        arrays[path] = value
        return path
    if isinstance(value, dict):
        return {key: _without_arrays(x, f"{path}/{key}" if path else str(key), arrays) for key, x in value.items()}
    if isinstance(value, tuple | list):
        return [_without_arrays(x, f"{path}/{k}", arrays) for k, x in enumerate(value)]
    return value.item() if isinstance(value, np.generic) else value


def write_arrays(stream: BinaryIO, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays as .npz, compressed unless the ratio exceeds half the readers' limit.

    Raises:
        StoreError: If a name is not a valid name of a member.
    """
    if any("\0" in name or len(name) > _LONGEST for name in arrays):
        raise StoreError(f"a name has a NUL, or more than {_LONGEST} characters; use a shorter one, without NUL")
    ordered: dict[str, Any] = {name: np.asarray(x, order="C") for name, x in arrays.items()}
    np.savez_compressed(stream, **ordered)
    if sum(x.nbytes for x in ordered.values()) > _MAX / 2 * stream.tell():
        stream.seek(0)
        stream.truncate()
        np.savez(stream, **ordered)


def _read_arrays(stream: BinaryIO) -> dict[str, np.ndarray]:
    """Return the arrays of a .npz file; nothing is unpickled.

    Raises:
        StoreError: If the file is damaged or cut short, contains other data, or unpacks to over 20 times its size.
    """
    try:
        most = _MAX * stream.seek(0, SEEK_END)
        with zipfile.ZipFile(stream) as file:
            members = {member.filename.removesuffix(".npy"): member for member in file.infolist()}
            if len(members) < len(file.infolist()):
                raise StoreError("it contains two members with the same name")
            if (size := sum(member.file_size for member in members.values())) > most:
                raise StoreError(f"it unpacks to {size / 2**20:.3g} MiB, more than {_MAX} times its size")
            return {name: _array(file, name, member) for name, member in members.items()}
    except StoreError:
        raise
    except MemoryError:
        raise StoreError("it does not fit into memory") from None
    except Exception as error:  # zipfile and zlib do not document the types of their errors
        raise StoreError(f"it is damaged, cut short or not a .npz file ({type(error).__name__})") from None


def _array(file: zipfile.ZipFile, name: str, member: zipfile.ZipInfo) -> np.ndarray:
    """Return the array of a member; its header and size are compared before anything is allocated."""
    with file.open(member) as stream:
        supported = member.compress_type in _COMPRESSIONS and np.lib.format.read_magic(stream) == (1, 0)
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream) if supported else ((), False, np.dtype(object))
        if dtype.hasobject or stream.tell() + prod(shape) * dtype.itemsize != member.file_size:
            raise StoreError(f"member {shorten(name)!r} is not an array of numbers or a text")
    with file.open(member) as stream:
        return np.lib.format.read_array(stream, allow_pickle=False)
