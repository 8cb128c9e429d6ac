"""Rows of a sweep's table as columns by name, the columns that every sweep has, and those of samples.

To add a column, add an entry to `FIXED`: files, `table()`, exports, reports, events, units and `columns` follow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, final

import numpy as np
from numpy.typing import DTypeLike

from robot_dyn import Rollouts
from robot_dyn.foundations import needs
from robot_dyn.simulation.rollouts.overview import remarks_on_each, texts_by_run

FINISHED, DIVERGED, RAISED = OUTCOMES = ("finished", "diverged", "raised")
Rows = dict[str, np.ndarray]
"""Columns by name, each of shape (k,): numbers are float64, texts have the type of their column."""


@final
@dataclass(frozen=True)
class Column:
    """A column that every sweep has.

    Attributes:
        name: Name in files, tables and events.
        type: Type of values in memory: float, or a type of texts.
        unit: Unit of the numbers, or empty.
        meaning: Description for readers of tables.
        missing: Value for a run that raised an error.
        values: Function that returns the values for a batch of runs, (B,).
    """

    name: str
    type: DTypeLike
    unit: str
    meaning: str
    missing: str | float
    values: Callable[[Rollouts], Sequence[str] | np.ndarray]


FIXED = (
    Column(
        "outcome", "U8", "", f"outcome of the run: {', '.join(OUTCOMES)}", RAISED,
        lambda made: np.where(made.diverged, DIVERGED, FINISHED),
    ),
    Column("ended_s", float, "s", "time of the end of the run; nan if not made", np.nan, lambda made: made.ended_s),
    Column(
        "reason", object, "", "reason of the end, a member of robot_dyn.simulation.Reason; or raised", RAISED,
        lambda made: np.array([outcome.reason.value for outcome in made.outcomes], object),
    ),
    Column(
        "why", object, "", "the reason in a sentence, with the numbers of the run", "",
        lambda made: np.array([outcome.text for outcome in made.outcomes], object),
    ),
    Column(
        "remarks", object, "", "remarks on the run, by kind, quantity and joint", "",
        lambda made: texts_by_run(remarks_on_each(made), len(made)),
    ),
)  # fmt: skip
SAMPLE_COLUMNS = {name: f"samples {name}" for name in ("q", "v", "u")}
"""Columns of lists of samples, by the names of the quantities; see `kept_samples`."""
TYPES = {column.name: column.type for column in FIXED}
TEXTS = tuple(column.name for column in FIXED if column.type is not float)
NUMBERS = tuple(column.name for column in FIXED if column.type is float)


def type_of(name: str) -> DTypeLike:
    """Return the type of a column in memory; varied parameters and figures are float64."""
    return object if name in SAMPLE_COLUMNS.values() else TYPES.get(name, float)


def schema(names: Iterable[str]) -> Any:
    """Return the schema of the files of rows; `names` are varying parameters, figures and columns of samples."""
    pa = needs("pyarrow", extra="sweeps")
    special = dict.fromkeys(TEXTS, pa.string()) | dict.fromkeys(SAMPLE_COLUMNS.values(), pa.list_(pa.float64()))
    return pa.schema({"run": pa.int64()} | {name: special.get(name, pa.float64()) for name in (*names, *TYPES)})


def empty(count: int, varied: Mapping[str, np.ndarray], figures: Iterable[str], samples: Iterable[str] = ()) -> Rows:
    """Return rows to be filled; initially they describe runs that raised an error without a reason."""
    missing: dict[str, Any] = dict.fromkeys(figures, np.nan) | dict.fromkeys(samples)
    missing |= {column.name: column.missing for column in FIXED}
    return {**varied} | {name: np.full(count, value, type_of(name)) for name, value in missing.items()}


def joined(parts: Sequence[Rows]) -> Rows:
    """Concatenate rows."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def digest_of(parts: Iterable[Rows]) -> str:
    """Return the SHA-256 of consecutive rows, independent of their division into parts."""
    digests: dict[str, Any] = {}
    for rows in parts:
        for name, x in rows.items():
            digest = digests.setdefault(name, sha256(name.encode()))
            if name in SAMPLE_COLUMNS.values():
                digest.update(b"".join(b"-" if y is None else np.append(len(y), y).tobytes() for y in x))
            elif name in TEXTS:
                digest.update(b"".join(text.encode() + b"\0" for text in x.tolist()))
            else:
                digest.update(np.where(np.isnan(x), np.nan, x).tobytes())  # nan has many bit patterns
    return sha256(b"".join(digest.digest() for digest in digests.values())).hexdigest()
