"""Docstrings as reStructuredText: they are plain text, so that what would be markup there is escaped first.

A block that is indented after an empty line is an equation, or code: it is shown as it stands, as an example after
`>>>` is. `name` is code.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.domains.python import PyObject

SECTION = re.compile(r"^(Args|Arguments|Attributes|Returns|Yields|Raises|Note|Example|Examples|Warns):$")
MARKUP = re.compile(r"([|*_\\])")
LETTER = re.compile(r"(?<=: )(?=\w\.$)")  # "runs: N." would begin an enumeration


def escaped(lines: list[str]) -> list[str]:
    """The lines of a docstring, as `inspect.cleandoc` leaves them."""
    out: list[str] = []
    section = block = False
    for number, line in enumerate(lines):
        before_is_empty = number > 0 and not lines[number - 1].strip()
        if SECTION.match(line):
            section = True
        elif line and not line.startswith(" "):
            section = section and not before_is_empty
        if block and line.strip() and not line.startswith(" "):
            block = False
        if not section and not block and line.startswith("  ") and before_is_empty:
            out += ["::", ""]
            block = True
        out.append(line if block or line.lstrip().startswith((">>>", "...")) else _escape(line))
    return out


def _escape(line: str) -> str:
    """Code in backticks stays code; between it, signs that mean something to reStructuredText are themselves."""
    parts = re.split(r"`+([^`]+)`+", line)
    parts[::2] = [LETTER.sub(r"\\", MARKUP.sub(r"\\\1", x)) if not SECTION.match(line) else x for x in parts[::2]]
    parts[1::2] = [f"``{part}``\\ " if _glued(after) else f"``{part}``" for part, after in _pairs(parts)]
    return _heading(_keywords("".join(parts)))


def _pairs(parts: list[str]) -> list[tuple[str, str]]:
    return [(parts[i], parts[i + 1]) for i in range(1, len(parts), 2)]


def _glued(after: str) -> bool:
    """Whether a letter follows code at once."""
    return bool(re.match(r"[^\s\-.,:;!?'\")\]}/\\>]", after))


def _keywords(line: str) -> str:
    """`**options: …` of Args is one name for napoleon, whose stars it escapes itself."""
    return re.sub(r"^(\s+)\\\*(\\\*)?(\w[\w\\]*:)", lambda m: f"{m[1]}*{'*' if m[2] else ''}{m[3]}", line)


def _heading(line: str) -> str:
    """Names before a colon of Args and Attributes are not escaped: napoleon does it."""
    return re.sub(r"^(\s+)([\w\\]+)(:)", lambda m: m[1] + m[2].replace("\\_", "_") + m[3], line)


def setup(app: Any) -> None:
    app.connect("autodoc-process-docstring", _process, priority=400)  # before napoleon
    for field in PyObject.doc_field_types:
        if field.name == "variable":
            field.label = "Attributes"


def _process(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    # of an attribute napoleon takes what stands before a colon in the first line for its type
    lines[:] = [*["\\ "] * (what in ("attribute", "data", "property")), *escaped(lines)]
