"""Which tests of a tree are asked about a fault, those that are likely to notice it first."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

# Folders of tests for each folder of the package: its own, then its neighbours. A name that a tree lacks is left out.
HOMES = {
    "description": ("description", "model", "cross_check"),
    "shapes": ("shapes", "description"),
    "model": ("model", "cross_check", "lagrange"),
    "lagrange": ("lagrange", "cross_check", "model"),
    "queries": ("model", "lagrange", "cross_check"),
    "effects": ("effects", "simulation"),
    "control": ("control", "plan", "simulation"),
    "integrate": ("integrate", "simulation"),
    "simulation": ("simulation", "effects"),
    "codegen": ("codegen", "model", "simulation"),
    "studies": ("studies",),
    "accuracy": ("accuracy",),
}
OWN = 100  # for a file of tests named after the file
WORD = re.compile(r"[A-Za-z_]\w+")


def tests_of(tree: Path, file: str, scope: str, first: str = "") -> list[str]:
    """Files of tests in the order in which they are asked; `first` is a name of one that is asked before all others."""
    package = tree / "robot_dyn" / file
    defined = [each.name for each in ast.parse(package.read_text()).body if hasattr(each, "name")]
    names = {name for name in (*defined, *scope.split(".")) if name}
    near, stem = HOMES[file.split("/")[0]], package.stem
    scores = {}
    for place, folder in enumerate(near):
        for path in sorted((tree / "tests" / folder).glob("test_*.py")):
            words = _words(path)
            score = sum(words.get(name, 0) > 0 for name in names) + 3 * (scope.rpartition(".")[2] in words)
            score += OWN * (path.stem == f"test_{stem}") + 10 * (stem in words) + 5 * (len(near) - place)
            scores[path.relative_to(tree).as_posix()] = score + 10 * OWN * (path.name == first)
    return sorted(scores, key=lambda each: (-scores[each], each))


@cache
def _words(path: Path) -> dict[str, int]:
    counts: dict[str, int] = {}
    for word in WORD.findall(path.read_text()):
        counts[word] = counts.get(word, 0) + 1
    return counts
