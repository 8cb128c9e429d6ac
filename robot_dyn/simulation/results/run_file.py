"""Run files: one .npz that holds a trajectory, or the runs of a batch, and all it came from.

Each array is a member, under the path of its field; what is text (joint names, outcome, statistics, URDF, edits, scene,
versions) is one JSON text, `about`. A SHA-256 covers all of it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar, final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, shorten
from robot_dyn.foundations.files import FileKind, file_path, reading, save, target
from robot_dyn.foundations.validate import integer
from robot_dyn.simulation.results.archive import DIGEST, Archive, ArchiveError, Header, write
from robot_dyn.simulation.results.provenance import packed, unpacked
from robot_dyn.simulation.results.serialise import (
    Arrays,
    SerialError,
    build,
    check_headers,
    layout_of,
    layouts,
    take_apart,
)
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import LONGEST_S

FORMAT = 6
ROLLOUTS_FORMAT = "rollouts 4"
RUN = FileKind("a run file", ".npz", b"PK\x03\x04")
MAX_BYTES = 4 * 2**30  # of the arrays of a run that is read, unless more is requested
_MAX_TEXT = 2**28  # bytes of `about`, 4 a character; the largest URDF that loads has 2^24

Run = TypeVar("Run", bound=Any)


class RunFileError(RobotDynError):
    """A run file that cannot be written or read."""


@final
@dataclass(frozen=True)
class Format(Generic[Run]):
    """A format of run files.

    Attributes:
        name: As a file states it.
        kind: Type of what it holds, a dataclass with `about`.
        check: Raises an ArchiveError if the numbers cannot be those of runs.
    """

    name: int | str
    kind: type[Run]
    check: Callable[[Run], None]

    def write(self, run: Run, path: str | Path) -> Path:
        """Write a run, or many, after the checks of a reader; errors as of `save_run`."""
        path = target(path, RUN, RunFileError)
        try:
            arrays, plain = take_apart(replace(run, about=packed(run.about, path.parent)))
            text = json.dumps({"format": self.name} | plain)
            self._built(arrays, json.loads(text))
            return save(path, lambda stream: write(stream, arrays | {"about": np.array(text)}), RunFileError)
        except (ArchiveError, SerialError, TypeError, ValueError) as error:
            raise RunFileError(
                f"the run cannot be written to {path}: {error}; save one that rd.simulate gives"
            ) from None

    def read(self, path: str | Path, max_bytes: int) -> Run:
        """Read what `write` wrote; errors as of `load_run`."""
        path = file_path(path, RunFileError)
        max_bytes = integer("max_bytes", max_bytes, most=2**63 - 1, error=RunFileError)
        named = Path(path).with_suffix(".npz") if Path(path).name else "run.npz"
        writes = "rd.save_rollouts" if self.name == ROLLOUTS_FORMAT else f"robot-dyn simulate … -o {named}"
        with reading(path, RunFileError, f"write one with {writes}") as stream:
            try:
                archive = Archive(stream)
                about, found = _about(archive)
                _check_format(found, self.name, path)
                described = {name: header for name, header in archive.headers.items() if name not in ("about", DIGEST)}
                check_headers(self.kind, described, about)
                if archive.size > max_bytes:
                    held = f"{archive.size / 2**30:.3g} GiB, more than {max_bytes / 2**30:.3g} GiB"
                    raise RunFileError(f"{path}: holds {held}; if you trust it, raise max_bytes of the load")
                run = self._built(archive.arrays(), about)
                return replace(run, about=unpacked(run.about, Path(path)))
            except (ArchiveError, SerialError) as error:
                raise RunFileError(f"{path}: is not a complete run file: {error}; simulate again") from None

    def _built(self, arrays: Arrays, about: dict[str, Any]) -> Run:
        """The value of arrays and plain data, checked."""
        arrays = {name: x for name, x in arrays.items() if name != "about"}
        check_headers(self.kind, {name: Header(x.shape, x.dtype) for name, x in arrays.items()}, about)
        run = build(self.kind, {key: value for key, value in about.items() if key != "format"}, arrays)
        if arrays:
            raise ArchiveError(f"member {min(arrays)!r} belongs to nothing")
        self.check(run)
        return run


def save_run(trajectory: Trajectory, path: str | Path) -> Path:
    """Write a trajectory to `path` (.npz is added if it has no suffix), whole or not at all.

    Another run file under that name is replaced; a file of another kind is not.

    Raises:
        RunFileError: If it cannot be written.
    """
    if not isinstance(trajectory, Trajectory):
        kind = type(trajectory).__name__
        raise RunFileError(f"save_run takes the Trajectory of rd.simulate, got {kind}; save_rollouts takes Rollouts")
    return _RUN.write(trajectory, path)


def load_run(path: str | Path, *, max_bytes: int = MAX_BYTES) -> Trajectory:
    """Return the trajectory of a run file.

    Args:
        path: Of the file.
        max_bytes: The largest size of its arrays that is read.

    Raises:
        RunFileError: If it is missing, damaged, cut short, larger, of another format, or was changed.
    """
    return _RUN.read(path, max_bytes)


def _about(archive: Archive) -> tuple[dict[str, Any], Any]:
    """The plain data, and the format that it states."""
    if "about" in archive.headers and archive.headers["about"].size > _MAX_TEXT:
        raise ArchiveError(f"member 'about' is larger than {_MAX_TEXT >> 20} MiB")
    try:
        about = json.loads(archive.text("about"))
        return about, about["format"]
    except (ValueError, TypeError, KeyError, RecursionError, MemoryError) as error:
        raise ArchiveError(f"member 'about' is not the JSON of a run ({type(error).__name__})") from None


def _check_format(found: Any, form: int | str, path: Path) -> None:
    """Raise for a format other than the one that is read; names a file of the other kind."""
    if found == form:
        return
    if found == ROLLOUTS_FORMAT:
        raise RunFileError(
            f"{path}: is a file of rollouts, which are many runs; rd.load_rollouts reads it, and rd.save_run writes one"
            " of them, such as rd.load_rollouts(…)[0], to a run file"
        )
    if found == FORMAT:
        raise RunFileError(f"{path}: is a file of one run, not of rollouts; rd.load_run reads it")
    raise ArchiveError(f"it has format {shorten(repr(found))}, this version reads {form!r}")


def _check(run: Trajectory) -> None:
    """That the arrays of a run fit together, and its numbers can be those of one."""
    if run.outcome.ending is not Ending.DIVERGED:
        known = layouts(Trajectory)
        for name, array in take_apart(run)[0].items():
            layout = layout_of(name, known)
            if layout.finite and not np.isfinite(array).all() and not (layout.absent and np.isnan(array).all()):
                raise ArchiveError(f"member {shorten(name)!r} of a run that did not diverge holds nan or inf")
    for name, t in (("t", run.t), *((f"wrenches/{link}", F[:, 0]) for link, F in run.wrenches.items())):
        if not are_times(t) or len(t) < len(run.t):
            raise ArchiveError(f"the times of member {shorten(name)!r} are not those of a run, or do not grow")
    if run.error is not None and not are_times(run.error.t):
        raise ArchiveError("the times of member 'error/t' are not those of a run, or do not grow")
    if run.power.keys() != run.ledger.work.keys():
        raise ArchiveError("members of 'power' and of the ledger's 'work' have different names")
    if run.desired is not None and run.deviation is not None and run.deviation.shape != run.desired.shape:
        raise ArchiveError("members 'desired' and 'deviation' differ in shape")
    if run.desired is None and run.deviation is not None and run.deviation.shape[1] != 3:
        raise ArchiveError("member 'deviation' of joints needs 'desired', which is missing")
    if not are_times(np.array([run.outcome.t])):
        raise ArchiveError(f"'outcome/t' holds {run.outcome.t!r}, not a time in [s]")


def are_times(t: np.ndarray) -> bool:
    """Whether these are times of a run: as long as one can be, and none before the last."""
    return bool(np.all((t >= 0) & (t <= LONGEST_S)) and np.all(t[1:] >= t[:-1]))


_RUN = Format(FORMAT, Trajectory, _check)
