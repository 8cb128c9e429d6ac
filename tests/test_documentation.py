"""The documentation hangs together: links resolve, records of decisions are short and listed, one notation."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from pathlib import Path

import pytest

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


def test_paths_that_contributing_names_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    named = re.findall(r"\b(?:tests|docs|scripts|robot_dyn)/[\w./]*", text)
    assert len(named) > 5
    assert [path for path in named if not (ROOT / path.rstrip(".")).exists()] == []


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


PAGE = ROOT / "docs" / "start" / "notation.md"
LETTER = re.compile(r"[\u0370-\u03ff\u2110-\u2138\U0001d400-\U0001d7ff]")
COMPETING = re.compile(r"\b(?:tau_cmd|u_cmd|tau_c|qdot|q_dot|qddot|q_ddot|ddq|qdd|Gamma|Upsilon)\b|Υ|\\tau|\\Upsilon")
EQUATION = re.compile(r"C(?:\(q, v\))? v \+ N(?:\([^)]*\))? = ([^\W\d]\w*)")
OF_OTHERS = {"docs/start/notation.md"}  # what books write
TAU = ("τ", "Y", "Q", "ID", "Σ")  # Y θ of the regressor; Q of coordinates that are no joints; computed otherwise


def texts() -> Iterator[tuple[str, str]]:
    """What the project says: name and text of its code, pages, scripts and examples."""
    places = [
        *ROOT.glob("*.md"),
        *(path for room in ("docs", "robot_dyn", "scripts", "examples") for path in (ROOT / room).rglob("*")),
    ]
    for path in places:
        if path.suffix in (".py", ".pyi", ".md", ".toml", ".ipynb"):
            yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def listed() -> set[str]:
    """Letters in the first column of the tables of the page."""
    rows = re.findall(r"^\| ([^|]*) \|", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {letter for row in rows for letter in LETTER.findall(row)}


def unlisted(text: str) -> set[str]:
    """Letters of a text that are not on the page."""
    return set(LETTER.findall(text)) - listed()


def test_every_letter_is_on_the_page() -> None:
    missing = {name: found for name, text in texts() if (found := unlisted(text)) and name not in OF_OTHERS}
    assert {name: [unicodedata.name(x) for x in each] for name, each in missing.items()} == {}


def test_no_name_competes() -> None:
    found = {name: COMPETING.findall(text) for name, text in texts() if name not in OF_OTHERS}
    assert {name: each for name, each in found.items() if each} == {}


def test_the_equation_of_motion_ends_with_tau() -> None:
    ends = [(name, end) for name, text in texts() for end in EQUATION.findall(text)]
    assert len(ends) > 10
    assert [each for each in ends if not each[1].startswith(TAU)] == []


@pytest.mark.parametrize("page", ["README.md", "docs/developers/architecture.md"])
def test_the_page_is_linked(page: str) -> None:
    assert "notation.md)" in (ROOT / page).read_text(encoding="utf-8")
