"""The report of hard cases: every figure as a page and as JSON, and the counts of which docs/ keeps a copy."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from inspect import cleandoc
from pathlib import Path
from typing import final

from robot_dyn.report import processor_and_versions
from tests.campaigns.hard.case import Row
from tests.campaigns.hard.families import FAMILIES
from tests.campaigns.hard.figure import save

PICTURE = "pictures/hard_cases.png"
VERDICTS = "holds", "said", "silent"
MOST_SAID = 100  # characters of what was said, of which the counts keep the three most frequent


@final
@dataclass(frozen=True)
class Result:
    """What came of a case.

    Attributes:
        family: Its family.
        case: Its name.
        seed: Of its random numbers.
        rows: Its figures.
        seconds: How long it took, of one process.
    """

    family: str
    case: str
    seed: int
    rows: tuple[Row, ...]
    seconds: float


def write(result: Result, folder: Path) -> None:
    """Write a result into figures.json and figures.md; cases that were run before are kept as they were."""
    path = folder / "figures.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    known.setdefault(result.family, {})[result.case] = {
        "seed": result.seed,
        "seconds": round(result.seconds, 1),
        "environment": processor_and_versions(),
        "rows": [_finite(asdict(row)) | {"verdict": row.verdict} for row in result.rows],
    }
    known = {
        name: {case.name: known[name][case.name] for case in family.CASES if case.name in known[name]}
        for name, family in FAMILIES.items()
        if name in known
    }
    path.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n")
    (folder / "figures.md").write_text("\n".join(_every_figure(known)) + "\n")


def summarise(folder: Path) -> None:
    """Write counts and picture of all figures in a folder, in the form that docs/ keeps."""
    known = json.loads((folder / "figures.json").read_text())
    (folder / "hard_cases.json").write_text(json.dumps(counts(known), indent=1, ensure_ascii=False) + "\n")
    save({FAMILIES[name].TITLE: each for name, each in rows(known).items()}, folder / PICTURE)


def rows(known: dict) -> dict[str, list[Row]]:
    return {name: [_row(each) for case in of.values() for each in case["rows"]] for name, of in known.items()}


def counts(known: dict) -> dict:
    """What docs/data/hard_cases.json holds: environments, and for each family how its figures are spread."""
    environments = {tuple(case["environment"].items()) for of in known.values() for case in of.values()}
    return {
        "environment": [dict(each) for each in sorted(environments)],
        "families": [_counts(name, [row for row in those if row.ours], known) for name, those in rows(known).items()],
    }


def _counts(name: str, figures: list[Row], known: dict) -> dict:
    number = Counter(row.verdict.lower() for row in figures)
    ratios = [row.found / row.allowed for row in figures if row.holds and row.allowed > 0]
    words = Counter(_plain(row.said)[:MOST_SAID] for row in figures if row.verdict == "said")
    return {
        "title": FAMILIES[name].TITLE,
        "cases": len(known[name]),
        "figures": len(figures),
        **{verdict: number[verdict] for verdict in VERDICTS},
        "worst": float(f"{max(ratios, default=0.0):.3g}"),
        "words": [text for text, _ in words.most_common(3)],
    }


def _law(name: str) -> Iterator[str]:
    yield f"## {FAMILIES[name].TITLE}"
    yield ""
    yield cleandoc(FAMILIES[name].__doc__ or "")


def _every_figure(known: dict) -> Iterator[str]:
    yield "# Figures of the hard cases"
    for name, those in rows(known).items():
        yield ""
        yield from _law(name)
        yield ""
        seeds = ", ".join(str(seed) for seed in sorted({case["seed"] for case in known[name].values()}))
        seconds = sum(case["seconds"] for case in known[name].values())
        yield f"Seed {seeds}; {seconds:.0f} s of one core.{_not_run(name, known[name])}"
        yield ""
        yield from _matrix(those) if getattr(FAMILIES[name], "MATRIX", False) else _table(those)


def _not_run(name: str, family: dict) -> str:
    missing = [case.name for case in FAMILIES[name].CASES if case.name not in family]
    return f" Not run: {'; '.join(missing)}." if missing else ""


def _table(rows: Sequence[Row]) -> Iterator[str]:
    several = any(not row.ours for row in rows)
    heads = ["case", *(["program"] if several else []), "figure", "found", "allowed", "verdict"]
    yield "| " + " | ".join(heads) + " |"
    yield "|" + " --- |" * len(heads)
    for row in rows:
        said = f"{row.verdict}: {row.said}" if row.said and not row.holds else row.verdict
        cells = [row.case, *([row.program] if several else []), row.measure, _number(row.found)]
        yield "| " + " | ".join(_plain(each) for each in (*cells, _number(row.allowed), said)) + " |"


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
    return _plain(f"{_number(row.found)}, {row.verdict}: {row.said}") if row.said else "**SILENT**"


def _plain(text: str) -> str:
    """In one line of a table."""
    return " ".join(text.replace("|", "\\|").split())


def _number(x: float) -> str:
    return "—" if math.isnan(x) else f"{x:.3g}"


def _finite(row: dict) -> dict:
    return {key: str(x) if isinstance(x, float) and not math.isfinite(x) else x for key, x in row.items()}


def _row(stored: dict) -> Row:
    figures = {key: float(stored[key]) for key in ("found", "allowed")}
    return Row(**{key: x for key, x in stored.items() if key != "verdict"} | figures)
