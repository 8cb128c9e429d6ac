"""Python of a document, run as a reader would: what it prints is what stands there."""

from __future__ import annotations

import ast
import re
from itertools import takewhile
from pathlib import Path

import pytest


def check_prints(document: Path, capsys: pytest.CaptureFixture[str]) -> int:
    """Run the Python blocks one after the other in one session, and count the lines that were held to what is printed.

    Comments `# → text` state the first lines that the statement above prints.
    """
    blocks = re.findall(r"^```python\n(.*?)^```$", document.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    names: dict[str, object] = {}
    held = 0
    for block in blocks:
        lines = block.splitlines()
        for statement in ast.parse(block).body:
            exec(compile(ast.Module([statement], []), document.name, "exec"), names)
            printed = capsys.readouterr().out.splitlines()
            after = takewhile(lambda line: line.startswith("# → "), lines[statement.end_lineno :])
            expected = [line.removeprefix("# → ") for line in after]
            assert printed[: len(expected)] == expected
            held += len(expected)
    assert held == sum(block.count("# →") for block in blocks)  # none stands where it is not looked for
    return held
