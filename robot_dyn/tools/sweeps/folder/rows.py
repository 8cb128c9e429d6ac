"""Rows: what a sweep keeps of runs start, …, stop − 1, as columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import final

import numpy as np

from robot_dyn.foundations import Value

FINISHED, DIVERGED, RAISED = range(3)
TEXTS = ("reason", "remarks")  # columns of them


@final
@dataclass(frozen=True, eq=False)
class Rows(Value):
    """Rows of runs, in their order.

    Attributes:
        start: Number of the first run.
        outcome: FINISHED, DIVERGED or RAISED, (k,).
        ended: Time at which each ended, in [s], (k,); nan of one that raised.
        reason: Why it failed, or which event ended it, (k,), texts; empty otherwise.
        remarks: What is noteworthy in it, by kind, quantity and joint, (k,), texts; empty where nothing is.
        varied: What varies, by column, (k,).
        figures: By name, (k,); nan of a run that failed.
    """

    start: int
    outcome: np.ndarray
    ended: np.ndarray
    reason: np.ndarray
    remarks: np.ndarray
    varied: dict[str, np.ndarray]
    figures: dict[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.outcome)

    @classmethod
    def empty(cls, start: int, stop: int, varied: Mapping[str, np.ndarray], figures: Iterable[str]) -> Rows:
        """Rows to be filled; as they are, those of runs that raised without a reason."""
        k = stop - start
        reason, remarks = np.full(k, "", object), np.full(k, "", object)
        outcome, ended = np.full(k, RAISED, np.int8), np.full(k, np.nan)
        of_each = {name: np.full(k, np.nan) for name in figures}
        return cls(start, outcome, ended, reason, remarks, dict(varied), of_each)

    @classmethod
    def joined(cls, parts: Sequence[Rows]) -> Rows:
        """Rows that follow each other, as one."""
        first = parts[0]
        if len(parts) == 1:
            return first

        def of(name: str) -> dict[str, np.ndarray]:
            return {key: np.concatenate([getattr(each, name)[key] for each in parts]) for key in getattr(first, name)}

        outcome, ended, reason, remarks = (
            np.concatenate([getattr(each, name) for each in parts]) for name in ("outcome", "ended", *TEXTS)
        )
        return cls(first.start, outcome, ended, reason, remarks, of("varied"), of("figures"))

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """All but the texts, in the order of files."""
        return {"outcome": self.outcome, "ended": self.ended} | self.varied | self.figures

    def digest(self) -> str:
        """SHA-256 of all that rows hold, to the bit."""
        return digest_of([self])


def digest_of(parts: Iterable[Rows]) -> str:
    """SHA-256 of rows that follow each other, to the bit; it does not depend on how they are parted."""
    of_numbers, of_texts = sha256(), {name: sha256() for name in TEXTS}
    for each in parts:
        numbers = np.column_stack([np.asarray(x, float) for x in each.columns.values()])
        numbers[np.isnan(numbers)] = np.nan  # whose bits are many
        of_numbers.update(numbers.tobytes())
        for name, digest in of_texts.items():
            digest.update(b"".join(text.encode() + b"\0" for text in getattr(each, name).tolist()))
    return sha256(b"".join(each.digest() for each in (of_numbers, *of_texts.values()))).hexdigest()
