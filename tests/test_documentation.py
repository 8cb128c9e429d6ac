"""The documentation hangs together: links resolve, named files exist, records of decisions are short and listed."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.rglob("*.md")])
INDEX = DOCS / "developers" / "decisions" / "README.md"
RECORDS = [path for path in PAGES if path.parent == INDEX.parent and path != INDEX]
MOST_WORDS = 250
CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """What links to headings of a page may name, as GitHub makes them of their text."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def resolves(page: Path, target: str) -> bool:
    """Whether a link of a page leads to a file, and to a heading of it if it names one; addresses of the web do."""
    path, _, anchor = target.partition("#")
    file = page.parent / path if path else page
    return bool(re.match(r"\w+:", target)) or (file.exists() and (not anchor or anchor in anchors(file)))


def test_links_between_pages_resolve() -> None:
    links = [
        (page, each) for page in PAGES for each in re.findall(r"\]\(([^)\s]+)\)", CODE.sub("", page.read_text("utf-8")))
    ]
    assert len(links) > 50
    assert [f"{target} of {page.name}" for page, target in links if not resolves(page, target)] == []


def test_records_of_decisions_are_short() -> None:
    assert RECORDS
    texts = {record.name: record.read_text(encoding="utf-8") for record in RECORDS}
    assert {name: len(text.split()) for name, text in texts.items() if len(text.split()) > MOST_WORDS} == {}
    parts = ("**Context.**", "**Decision.**", "**Consequences.**")
    assert [name for name, text in texts.items() if not all(part in text for part in parts)] == []


def test_the_index_lists_each_record_once_by_its_title() -> None:
    listed = re.findall(r"^- \[(.*)\]\((.*)\)$", INDEX.read_text(encoding="utf-8"), flags=re.MULTILINE)
    titles = [(record.read_text(encoding="utf-8").partition("\n")[0], record.name) for record in RECORDS]
    assert sorted((f"# {title}", name) for title, name in listed) == sorted(titles)
