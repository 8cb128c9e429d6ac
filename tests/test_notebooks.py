"""Every notebook runs from its first cell to its last, shows short answers, and is a page that a browser opens."""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from pathlib import Path
from runpy import run_path
from typing import Any

import pytest

from tests.browser import View
from tests.long import long

DOCS = Path(__file__).parents[1] / "docs"
PAGES = [DOCS / "start" / "ten_minutes.md", DOCS / "explanation" / "which_method.md"]  # whose cells the site shows too
NOTEBOOKS = [*sorted((DOCS / "notebooks").glob("[0-9]*.md")), *PAGES]
MOST_CELLS, MOST_LINES, MOST_WORDS, MOST_CHARACTERS = 12, 8, 25, 1500

pytestmark = pytest.mark.filterwarnings("default")  # of Jupyter; in the notebook they would show on stderr


def read(path: Path) -> Any:
    import jupytext  # it and its parts take seconds to import, in every process that collects tests

    return jupytext.read(path)


def code(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_there_are_five_and_all_cells_are_of_notebooks() -> None:
    assert len(NOTEBOOKS) == 5 + len(PAGES)
    with_cells = {page for page in DOCS.rglob("*.md") if "\n```{code-cell}" in page.read_text(encoding="utf-8")}
    assert with_cells == set(NOTEBOOKS)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_short(path: Path) -> None:
    """Blank lines, which the formatter puts around functions, do not count."""
    notebook = read(path)
    lengths = [sum(map(bool, map(str.strip, cell.source.splitlines()))) for cell in code(notebook)]
    assert len(lengths) <= MOST_CELLS and max(lengths) <= MOST_LINES, lengths
    words = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    assert "## Read next" in words[-1]
    prose = re.sub(r"\]\([^)]*\)|\$\$.*?\$\$|^#.*$", "\n\n", "\n\n".join(words), flags=re.DOTALL | re.MULTILINE)
    sentences = re.split(r"(?<=[.:?])\s+(?=[A-Z`*$])|\n\n|\n- ", prose)
    assert [each for each in sentences if len(each.split()) > MOST_WORDS] == []


@pytest.mark.parametrize("path", [NOTEBOOKS[0], *long(NOTEBOOKS[1:])], ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, browser: Any) -> None:
    """In a kernel of this Python, without settings of the user; a cell that raises fails the test."""
    from nbconvert import HTMLExporter

    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    monkeypatch.setattr(sys, "path", [*sys.path])  # which the settings of the site extend
    notebook = executed(read(path), tmp_path)
    for output in (output for cell in code(notebook) for output in cell.outputs):
        shown = output.data if "data" in output else {"text/plain": output.text}
        assert output.get("name") != "stderr", output.text
        assert "text/html" in shown or len(shown.get("text/plain", "")) <= MOST_CHARACTERS, shown["text/plain"]
    for theme in ("light", "dark"):
        page = tmp_path / f"{path.stem}_{theme}.html"
        page.write_text(HTMLExporter(theme=theme).from_notebook_node(notebook)[0], encoding="utf-8")
        assert complaints(browser, page) == []


def executed(notebook: Any, folder: Path) -> Any:
    """The notebook with its outputs: those of the site, if it was built from these sources and cells."""
    from jupyter_cache import get_cache
    from nbclient import NotebookClient

    outputs = Path(run_path(str(DOCS / "conf.py"))["nb_execution_cache_path"])
    if outputs.exists():
        with suppress(KeyError):
            return get_cache(outputs).merge_match_into_notebook(notebook)[1]
    return NotebookClient(notebook, timeout=180, resources={"metadata": {"path": str(folder)}}).execute()


def complaints(browser: Any, page: Path) -> list[str]:
    """Errors of a page and its scripts; those from the web (MathJax, RequireJS) are answered by nothing."""
    context = browser.new_context(viewport={"width": 1000, "height": 900})
    view = View(context.new_page())
    view.page.on("console", lambda m: view.complaints.append(m.text) if m.type == "error" else None)
    view.page.on("pageerror", lambda error: view.complaints.append(str(error)))
    view.page.route(re.compile("^https?://"), lambda route: route.fulfill(body=""))
    view.page.goto(page.as_uri(), wait_until="load")
    context.close()
    return view.complaints
