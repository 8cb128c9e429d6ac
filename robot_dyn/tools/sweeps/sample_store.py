"""Samples of runs: the selection that a sweep keeps, and their files.

The files are Zarr v3: an array over run, t and joint for each quantity, with a shard for each chunk of the sweep. A
shard is encoded in memory and written completely before the rows of its chunk, so a chunk with rows has its samples.
The index of a run in an array is its number; runs that are not kept are nan and take no space.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import file_digest, sha256
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, Value, choice, integer, needs, reading, save, truth, why
from robot_dyn.queries import joint_units
from robot_dyn.simulation import SAMPLED
from robot_dyn.tools.sweeps.texts import called

RECORDED = ("q", "v", "u")
_INNER = 64  # runs that are read together, if all are kept
_TIMES = "t/c/0"


@final
@dataclass(frozen=True)
class Samples(Value):
    """A selection of samples of runs.

    Attributes:
        names: Some of "q", "v" and "u".
        every: k, for the runs 0, k, 2 k, ….
        failed: True to keep only runs among them that diverge, up to their end.
    """

    names: tuple[str, ...]
    every: int = 1
    failed: bool = False

    def __post_init__(self) -> None:
        if not self.names:
            raise SweepError(f"samples: no quantity is named; give some of {', '.join(RECORDED)}")
        for name in self.names:
            choice("samples", name, RECORDED, error=SweepError)
        integer("every", self.every, least=1, most=2**53, error=SweepError)
        truth("failed", self.failed, error=SweepError)

    def selected(self, runs: np.ndarray, diverged: np.ndarray) -> np.ndarray:
        """Return True for runs whose samples are kept, (k,)."""
        return (runs % self.every == 0) & (diverged | (not self.failed))


def samples(*names: str, every: int = 1, failed: bool = False) -> Samples:
    """Select the samples to keep: of every k-th run, or only of those among them that diverge.

    Args:
        *names: Some of "q", "v" and "u".
        every: k.
        failed: True to keep only runs that diverge.

    Raises:
        SweepError: If an argument is invalid.
    """
    return Samples(tuple(dict.fromkeys(names)), every, failed)


def samples_of(value: Any) -> Samples | None:
    """Return the value of `Sweep.samples`: from None, a name, or `samples(…)`, also as a text."""
    if isinstance(value, str) and "(" in value:
        return called("samples", value, {"samples": samples})
    return value if value is None or isinstance(value, Samples) else samples(value)


@final
@dataclass(frozen=True)
class SampleStore:
    """The arrays of a sweep.

    Attributes:
        path: Path of the group.
        runs: Number of runs of the sweep.
        chunk: Number of runs in a shard.
        selection: The selection of samples.
    """

    path: Path
    runs: int
    chunk: int
    selection: Samples

    def create(self, t: np.ndarray, joint_names: tuple[str, ...]) -> None:
        """Write the descriptions of the arrays, and the times of samples, (m,), unless they exist."""
        if (self.path / _TIMES).is_file():
            return
        zarr = needs("zarr", extra="sweeps")
        memory = zarr.storage.MemoryStore()
        group = zarr.create_group(memory, zarr_format=3, attributes={"joint": list(joint_names)})
        for name in self.selection.names:
            self._array(zarr, memory, name, (len(t), len(joint_names)))
        times = group.create_array("t", data=t, dimension_names=("t",), compressors=None)
        times.attrs["units"] = "s"
        for name in sorted(memory._store_dict, key=_TIMES.__eq__):  # the times last, as a mark that all files exist
            _write(self.path / name, memory._store_dict[name].to_bytes())

    def times(self) -> np.ndarray:
        """Return the times of the samples, (m,), in [s]."""
        zarr = needs("zarr", extra="sweeps")
        with self._reading():
            return zarr.open_group(self.path, mode="r")["t"][:]

    def write(self, chunk: int, samples: Mapping[str, np.ndarray]) -> dict[str, str]:
        """Write the samples of a chunk, (k, m, n), nan where not kept; raise a SweepError if that fails.

        Returns:
            SHA-256 of the file of each quantity with samples.
        """
        zarr, digests = needs("zarr", extra="sweeps"), dict[str, str]()
        for name, x in samples.items():
            memory = zarr.storage.MemoryStore()
            start = chunk * self.chunk
            self._array(zarr, memory, name, x.shape[1:])[start : start + len(x)] = x
            shard = memory._store_dict.get(f"{name}/c/{chunk}/0/0")
            if shard is not None:  # there are samples
                data = shard.to_bytes()
                _write(self._shard(name, chunk), data)
                digests[name] = sha256(data).hexdigest()
        return digests

    def check(self, chunk: int, digests: Mapping[str, str]) -> None:
        """Raise a SweepError if a file of a chunk is missing or was changed."""
        remedy = f"remove the rows of chunk {chunk}, and run the sweep again"
        for name, digest in digests.items():
            path = self._shard(name, chunk)
            with reading(path, SweepError, remedy) as stream:
                if file_digest(stream, "sha256").hexdigest() != digest:  # pyright: ignore[reportArgumentType]
                    raise SweepError(f"{path}: was changed after it was written; {remedy}")

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Raise a SweepError about faulty descriptions of the arrays; Zarr itself would open pipes and devices."""
        remedy = "restore it from a copy of the folder, or run the sweep into a new folder"
        for name in ("zarr.json", *(f"{array}/zarr.json" for array in ("t", *self.selection.names)), _TIMES):
            with reading(self.path / name, SweepError, remedy):
                pass
        try:
            yield
        except SweepError:
            raise
        except Exception as error:  # Zarr and xarray do not document the types of their errors
            raise SweepError(f"{self.path}: are not the samples of the sweep ({why(error)}); {remedy}") from None

    def _shard(self, name: str, chunk: int) -> Path:
        return self.path / name / "c" / str(chunk) / "0" / "0"

    def open(self, joint_types: tuple[str | None, ...]) -> Any:
        """Return all samples as a lazy `xarray.Dataset` over run, t and joint, with units."""
        xarray = needs("xarray", extra="sweeps")
        needs("zarr", extra="sweeps")
        with self._reading():
            data = xarray.open_zarr(self.path, consolidated=False, chunks=None)
            for name in self.selection.names:
                data[name].attrs |= {"units": joint_units(name, joint_types), "long_name": SAMPLED[name].title}
            return data.assign_coords(run=np.arange(self.runs), joint=list(data.attrs.pop("joint")))

    def _array(self, zarr: Any, store: Any, name: str, shape: tuple[int, ...]) -> Any:
        """Create an empty array of the store; a run has the shape (m, n)."""
        dense = self.selection.every == 1 and not self.selection.failed
        inner = min(_INNER, self.chunk) if dense and self.chunk % _INNER == 0 else 1
        return zarr.create_array(
            store, name=name, shape=(self.runs, *shape), dtype="float64",
            chunks=(inner, *shape), shards=(self.chunk, *shape), compressors=None,
            fill_value=float("nan"), dimension_names=("run", "t", "joint"), zarr_format=3,
        )  # fmt: skip


def make_folder(path: Path) -> None:
    """Create a folder and its parents; raise a SweepError if that fails."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SweepError(f"{path}: the folder cannot be created ({why(error)}); give another path") from None


def _write(path: Path, data: bytes) -> None:
    make_folder(path.parent)
    save(path, lambda stream: stream.write(data), SweepError)
