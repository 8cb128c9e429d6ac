"""The report of hard cases: a page with a table for each family, and the same rows as JSON."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import final

from robot_dyn.accuracy.environment import environment
from tests.hard.case import Row
from tests.hard.families import FAMILIES


@final
@dataclass(frozen=True)
class Result:
    """What came of a case.

    Attributes:
        family: Its family.
        case: Its name.
        rows: Its figures.
        seconds: How long it took.
    """

    family: str
    case: str
    rows: tuple[Row, ...]
    seconds: float


def write(results: Sequence[Result], seed: int, folder: Path) -> None:
    """Write hard_cases.md and hard_cases.json."""
    document = {
        "seed": seed,
        "environment": environment(),
        "rows": [
            {"family": result.family, **_finite(asdict(row)), "verdict": row.verdict}
            for result in results
            for row in result.rows
        ],
        "seconds": {f"{each.family}: {each.case}": round(each.seconds, 1) for each in results},
    }
    (folder / "hard_cases.json").write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
    (folder / "hard_cases.md").write_text("\n".join(_page(results, seed)) + "\n")


def _page(results: Sequence[Result], seed: int) -> Iterator[str]:
    rows = [row for result in results for row in result.rows]
    ours = [row for row in rows if row.ours]
    count = Counter(row.verdict for row in ours)
    yield "# Hard cases"
    yield ""
    yield (
        "Written by `python -m tests.hard --full --write`, which `make stress` runs; the same rows are in"
        " `hard_cases.json`. Each figure is held to what is allowed, with the reason of it above its table. A figure"
        " that does not hold and was said to be so (a refusal, a finding, the verdict of a run) counts as *said*; one"
        " without a word as *SILENT*."
    )
    yield ""
    yield (
        f"Seed {seed}: {len(ours)} figures of robot_dyn, {count['holds']} hold, {count['said']} said,"
        f" **{count['SILENT']} silent**. {', '.join(f'{name} {value}' for name, value in environment().items())}."
    )
    for name, family in FAMILIES.items():
        those = [result for result in results if result.family == name]
        if not those:
            continue
        yield ""
        yield f"## {family.TITLE}"
        yield ""
        yield from (line.strip() for line in (family.__doc__ or "").strip().splitlines())
        yield ""
        if getattr(family, "MATRIX", False):
            yield from _matrix([row for result in those for row in result.rows])
            continue
        several = any(not row.ours for result in those for row in result.rows)
        heads = ["case", *(["program"] if several else []), "figure", "found", "allowed", "verdict"]
        yield "| " + " | ".join(heads) + " |"
        yield "|" + " --- |" * len(heads)
        for result in those:
            for row in result.rows:
                program = [row.program] if several else []
                said = f"{row.verdict}: {row.said}" if row.said and not row.holds else row.verdict
                cells = [row.case, *program, row.measure, _number(row.found), _number(row.allowed), said]
                yield "| " + " | ".join(" ".join(each.replace("|", "\\|").split()) for each in cells) + " |"


def _matrix(rows: Sequence[Row]) -> Iterator[str]:
    """A row for each case, a column for each figure."""
    measures = dict.fromkeys(row.measure for row in rows)
    most = {measure: max(row.allowed for row in rows if row.measure == measure) for measure in measures}
    yield "| case | " + " | ".join(f"{measure} (≤ {_number(most[measure])})" for measure in measures) + " |"
    yield "|" + " --- |" * (len(measures) + 1)
    for case in dict.fromkeys(row.case for row in rows):
        own = {row.measure: row for row in rows if row.case == case}
        cells = [_cell(own[measure]) if measure in own else "" for measure in measures]
        yield f"| {case} | " + " | ".join(cells) + " |"


def _cell(row: Row) -> str:
    if row.holds:
        return _number(row.found)
    return f"{_number(row.found)}, {row.verdict}: {row.said}".replace("|", "\\|") if row.said else "**SILENT**"


def _number(x: float) -> str:
    return "—" if math.isnan(x) else f"{x:.3g}"


def _finite(row: dict) -> dict:
    return {key: None if isinstance(x, float) and not math.isfinite(x) else x for key, x in row.items()}
