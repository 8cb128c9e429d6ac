"""Samples of runs: which a sweep keeps, and their files.

These are Zarr v3: an array over run, t and joint for each quantity, a shard for each chunk of the sweep. A shard is
encoded in memory and written whole, before the rows of its chunk: a chunk with rows has its samples. The place of a run
in an array is its number; runs that are not kept are nan, and take no room.
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
_INNER = 64  # runs that are read together, where all are kept
_TIMES = "t/c/0"


@final
@dataclass(frozen=True)
class Samples(Value):
    """Samples of runs.

    Attributes:
        names: Of "q", "v" and "u".
        every: Of run 0, k, 2 k, ….
        failed: Of those among them alone that diverge, up to their end.
    """

    names: tuple[str, ...]
    every: int = 1
    failed: bool = False

    def __post_init__(self) -> None:
        if not self.names:
            raise SweepError(f"samples: of what? give some of {', '.join(RECORDED)}")
        for name in self.names:
            choice("samples", name, RECORDED, error=SweepError)
        integer("every", self.every, least=1, most=2**53, error=SweepError)
        truth("failed", self.failed, error=SweepError)

    def of(self, runs: np.ndarray, diverged: np.ndarray) -> np.ndarray:
        """Which of these runs are kept, (k,)."""
        return (runs % self.every == 0) & (diverged | (not self.failed))


def samples(*names: str, every: int = 1, failed: bool = False) -> Samples:
    """Samples to keep of runs: of every k-th, or of those among them alone that diverge.

    Args:
        *names: Of "q", "v" and "u".
        every: k.
        failed: Whether only of runs that diverge.

    Raises:
        SweepError: If an argument is not allowed.
    """
    return Samples(tuple(dict.fromkeys(names)), every, failed)


def samples_of(given: Any) -> Samples | None:
    """What `Sweep.samples` may be: None, a name, or `samples(…)`, also as a text; SweepError otherwise."""
    if isinstance(given, str) and "(" in given:
        return called("samples", given, {"samples": samples})
    return given if given is None or isinstance(given, Samples) else samples(given)


@final
@dataclass(frozen=True)
class SampleStore:
    """The arrays of a sweep.

    Attributes:
        path: Of the group.
        runs: Of the sweep.
        chunk: Runs of a shard.
        kept: Which samples are kept.
    """

    path: Path
    runs: int
    chunk: int
    kept: Samples

    def create(self, t: np.ndarray, joint_names: tuple[str, ...]) -> None:
        """Write what describes the arrays, and the times of samples, (m,), unless they are there."""
        if (self.path / _TIMES).is_file():
            return
        zarr = needs("zarr", extra="sweeps")
        memory = zarr.storage.MemoryStore()
        group = zarr.create_group(memory, zarr_format=3, attributes={"joint": list(joint_names)})
        for name in self.kept.names:
            self._array(zarr, memory, name, (len(t), len(joint_names)))
        times = group.create_array("t", data=t, dimension_names=("t",), compressors=None)
        times.attrs["units"] = "s"
        for name in sorted(memory._store_dict, key=_TIMES.__eq__):  # the times are last: then all is there
            _write(self.path / name, memory._store_dict[name].to_bytes())

    def times(self) -> np.ndarray:
        """Of the samples, (m,), in [s]."""
        zarr = needs("zarr", extra="sweeps")
        with self._reading():
            return zarr.open_group(self.path, mode="r")["t"][:]

    def write(self, chunk: int, samples: Mapping[str, np.ndarray]) -> dict[str, str]:
        """Write the samples (k, m, n) of the runs of a chunk, nan where they are not kept; SweepError if that fails.

        Returns:
            SHA-256 of the file of each quantity that has some.
        """
        zarr, digests = needs("zarr", extra="sweeps"), dict[str, str]()
        for name, x in samples.items():
            memory = zarr.storage.MemoryStore()
            start = chunk * self.chunk
            self._array(zarr, memory, name, x.shape[1:])[start : start + len(x)] = x
            shard = memory._store_dict.get(f"{name}/c/{chunk}/0/0")
            if shard is not None:  # it has something
                data = shard.to_bytes()
                _write(self._shard(name, chunk), data)
                digests[name] = sha256(data).hexdigest()
        return digests

    def check(self, chunk: int, digests: Mapping[str, str]) -> None:
        """Raise SweepError where a file of a chunk is missing, or is not what was written."""
        remedy = f"remove the rows of chunk {chunk}, and run the sweep again"
        for name, digest in digests.items():
            path = self._shard(name, chunk)
            with reading(path, SweepError, remedy) as stream:
                if file_digest(stream, "sha256").hexdigest() != digest:  # pyright: ignore[reportArgumentType]
                    raise SweepError(f"{path}: was changed after it was written; {remedy}")

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """What is wrong with the files that describe the arrays, as a SweepError; Zarr opens pipes and devices too."""
        remedy = "take it from a copy of the folder, or run the sweep into a new one"
        for name in ("zarr.json", *(f"{array}/zarr.json" for array in ("t", *self.kept.names)), _TIMES):
            with reading(self.path / name, SweepError, remedy):
                pass
        try:
            yield
        except SweepError:
            raise
        except Exception as error:  # Zarr and xarray promise no kinds
            raise SweepError(f"{self.path}: are not the samples of the sweep ({why(error)}); {remedy}") from None

    def _shard(self, name: str, chunk: int) -> Path:
        return self.path / name / "c" / str(chunk) / "0" / "0"

    def open(self, joint_types: tuple[str | None, ...]) -> Any:
        """All as a lazy `xarray.Dataset` over run, t and joint, with units."""
        xarray = needs("xarray", extra="sweeps")
        needs("zarr", extra="sweeps")
        with self._reading():
            data = xarray.open_zarr(self.path, consolidated=False, chunks=None)
            for name in self.kept.names:
                data[name].attrs |= {"units": joint_units(name, joint_types), "long_name": SAMPLED[name].title}
            return data.assign_coords(run=np.arange(self.runs), joint=list(data.attrs.pop("joint")))

    def _array(self, zarr: Any, store: Any, name: str, shape: tuple[int, ...]) -> Any:
        """An array of the store without numbers; `shape` (m, n) is that of a run."""
        dense = self.kept.every == 1 and not self.kept.failed
        inner = min(_INNER, self.chunk) if dense and self.chunk % _INNER == 0 else 1
        return zarr.create_array(
            store, name=name, shape=(self.runs, *shape), dtype="float64",
            chunks=(inner, *shape), shards=(self.chunk, *shape), compressors=None,
            fill_value=float("nan"), dimension_names=("run", "t", "joint"), zarr_format=3,
        )  # fmt: skip


def make_folder(path: Path) -> None:
    """Make a folder, and those above it; SweepError if it cannot be made."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SweepError(f"{path}: the folder cannot be made ({why(error)}); give another path") from None


def _write(path: Path, data: bytes) -> None:
    make_folder(path.parent)
    save(path, lambda stream: stream.write(data), SweepError)
