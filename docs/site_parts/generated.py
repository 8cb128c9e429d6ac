"""Parts of pages that are written at build: a comment `<!-- made by NAME -->` of a page is replaced by what NAME makes.

The makers read what they show where it stands, in stubs, commands and data files, so that pages repeat none of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from site_parts import commands, findings, gallery, hard_cases, reasons, rooms

ROOT = Path(__file__).parents[2]


def root_file(name: str) -> str:
    """A file beside docs/, such as CHANGELOG; its links lead to pages of the site."""
    text = (ROOT / f"{name}.md").read_text(encoding="utf-8")
    return text.partition("\n")[2].replace("](docs/", "](../")


MAKERS: dict[str, Callable[[str], str]] = {
    "rooms": rooms.page,  # the public names of a room, from its stub and docstrings
    "commands": commands.page,  # the commands, from the command line itself
    "hard cases": hard_cases.page,  # counts from docs/data/hard_cases.json, laws from tests/campaigns/hard
    "reasons": reasons.page,  # why a run ended, from the docstrings of Reason
    "finding kinds": findings.page,  # what check-urdf reports, from the docstrings of FindingKind
    "gallery": gallery.page,  # the scripts of docs/gallery
    "root file": root_file,
}
NAMES = "|".join([*MAKERS, "table of contents"])
COMMENT = re.compile(rf"^<!-- made by ({NAMES})(?: of ([\w.]+))? -->$", flags=re.MULTILINE)


def replaced(text: str) -> str:
    """The text of a page with its made parts."""

    def made(found: re.Match[str]) -> str:
        return contents(text) if found[1] == "table of contents" else MAKERS[found[1]](found[2] or "")

    return re.sub(r"\]\((?:\.\./)+(SECURITY|CHANGELOG)\.md", _of_root, COMMENT.sub(made, text))


def _of_root(link: re.Match[str]) -> str:
    return f"](/developers/{link[1].lower()}.md"


def contents(text: str) -> str:
    """A hidden table of contents: the pages below that the lists and tables of a page link to, in its order."""
    rows = "\n".join(line for line in text.splitlines() if re.match(r"\||- |\d+\. ", line))
    pages = dict.fromkeys(re.findall(r"\]\((?!\.\.)([\w/-]+)\.md\)", rows))
    return "\n".join(["```{toctree}", ":hidden:", "", *pages, "```"])


def setup(app: Any) -> None:
    app.connect("source-read", _replace)


def _replace(app: Any, page: str, content: list[str]) -> None:
    text = replaced(content[0])
    if text != content[0]:
        app.env.note_reread()  # what it is made of may have changed, though the page has not
        content[0] = text
