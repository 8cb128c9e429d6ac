"""Samples of runs: the selection that a sweep keeps, and the samples of all runs as a `xarray.Dataset`.

Samples are columns of the files of rows: for each run a list, sample after sample, up to its end; null if not kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, Value, choice, integer, needs, truth
from robot_dyn.queries import joint_units
from robot_dyn.simulation import SAMPLED
from robot_dyn.tools.sweeps.rows import SAMPLE_COLUMNS
from robot_dyn.tools.sweeps.texts import called


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
            raise SweepError(f"samples: no quantity is named; give some of {', '.join(SAMPLE_COLUMNS)}")
        for name in self.names:
            choice("samples", name, SAMPLE_COLUMNS, error=SweepError)
        integer("every", self.every, least=1, most=2**53, error=SweepError)
        truth("failed", self.failed, error=SweepError)

    @property
    def columns(self) -> dict[str, str]:
        """Columns of the samples in files of rows, by the names of the quantities."""
        return {name: SAMPLE_COLUMNS[name] for name in self.names}

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


def until_end(x: np.ndarray) -> np.ndarray:
    """Return the samples of a run, (m, n), as one list without those after its end, which are nan."""
    known = np.flatnonzero(~np.isnan(x).all(axis=1))
    return x[: known[-1] + 1].ravel() if len(known) else np.empty(0)


def longest(t: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the longer of two arrays of times; raise a SweepError unless it begins with the other one."""
    shorter, longer = sorted((t, other), key=len)
    if (shorter != longer[: len(shorter)]).any():
        raise SweepError("samples: the runs are not sampled at the same times; give the scene a record_every_s")
    return longer


def dataset(
    lists: Mapping[str, np.ndarray], t: np.ndarray, joints: Sequence[str], joint_types: Sequence[str | None]
) -> Any:
    """Return the samples of the kept runs as a `xarray.Dataset` over run, t and joint, with units.

    Args:
        lists: For each quantity an array over all runs of lists of samples, None for a run that is not kept, (N,).
        t: Times of the samples, (m,), in [s].
        joints: Names of the n joints.
        joint_types: Types of the joints.
    """
    xarray = needs("xarray", extra="sweeps")
    runs = np.flatnonzero([x is not None for x in next(iter(lists.values()))])
    data = xarray.Dataset(coords={"run": runs, "t": ("t", t, {"units": "s"}), "joint": list(joints)})
    for name, of_runs in lists.items():
        x = np.full((len(runs), len(t) * len(joints)), np.nan)
        for row, run in zip(x, runs, strict=True):
            row[: len(of_runs[run])] = of_runs[run]
        about = {"units": joint_units(name, joint_types), "long_name": SAMPLED[name].title}
        data[name] = ("run", "t", "joint"), x.reshape(len(runs), len(t), len(joints)), about
    return data
