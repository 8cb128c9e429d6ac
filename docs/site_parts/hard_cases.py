"""The page of hard cases: counts of docs/data/hard_cases.json, laws of the docstrings in tests/campaigns/hard."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
DATA = ROOT / "docs" / "data" / "hard_cases.json"
VERDICTS = "holds", "said", "silent"


def page(_: str) -> str:
    """What all cases found, the table of families, their figure, and the law of each."""
    return "\n".join(_page(json.loads(DATA.read_text(encoding="utf-8"))))


def laws() -> dict[str, str]:
    """The docstring of each family, by its title; none is run."""
    found = {}
    for path in sorted((ROOT / "tests" / "campaigns" / "hard").glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        titles = [
            node.value.value
            for node in tree.body
            if isinstance(node, ast.Assign)
            and isinstance(node.value, ast.Constant)
            and ast.unparse(node.targets[0]) == "TITLE"
        ]
        found |= {title: ast.get_docstring(tree) or "" for title in titles}
    return found


def _page(known: dict) -> Iterator[str]:
    families = known["families"]
    figures, *counts = (sum(each[key] for each in families) for key in ("figures", *VERDICTS))
    yield f"{figures} figures of robot_dyn: {counts[0]} hold, {counts[1]} said, **{counts[2]} silent**."
    yield ""
    machines = [", ".join(f"{name} {value}" for name, value in each.items()) for each in known["environment"]]
    yield f"{'; '.join(machines)}."
    yield ""
    heads = (
        "family",
        "cases",
        "figures",
        "hold",
        "said",
        "silent",
        "largest found / allowed that holds",
        "said, such as",
    )
    yield f"| {' | '.join(heads)} |"
    yield "|---|--:|--:|--:|--:|--:|--:|---|"
    for each in families:
        cells = [each[key] for key in ("title", "cases", "figures", *VERDICTS)]
        words = "not kept" if each["words"] is None else "; ".join(each["words"])
        yield "| " + " | ".join(map(str, [*cells, f"{each['worst']:.3g}", words if each["said"] else ""])) + " |"
    yield ""
    yield "![Found over allowed, for each figure of each family](../pictures/hard_cases.png)"
    texts = laws()
    for each in families:
        yield ""
        yield f"## {each['title']}"
        yield ""
        yield _plain(texts[each["title"]])


def _plain(text: str) -> str:
    """A docstring as Markdown: signs that mean something there are themselves, equations stay as they are."""
    lines = [line if line.startswith("    ") else re.sub(r"([|*_<\[\]])", r"\\\1", line) for line in text.splitlines()]
    return "\n".join(lines)
