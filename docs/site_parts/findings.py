"""The table of kinds of findings: the docstring of each member of `FindingKind`."""

from __future__ import annotations

from robot_dyn.tools.doctor.kinds import FindingKind
from site_parts.reasons import docstrings


def page(_: str) -> str:
    """Kind, criterion and repair, a row for each kind."""
    rows = ["| kind | criterion | repaired |", "|---|---|---|"]
    for kind, text in docstrings(FindingKind).items():
        criterion, _, repair = " ".join(text.split()).partition(" Repaired: ")
        rows.append(f"| `{kind}` | {criterion.removesuffix('.')} | {repair.removesuffix('.')} |")
    return "\n".join(rows)
