"""The gallery: each script of docs/gallery makes a page that plays a run; all of them share one file of the viewer.

A script ends with a variable `page`, of `rd.replay` or `rd.show`. Its first line is the title. The pages are written
into the site at build, and kept in build/docs_gallery for as long as script and library are the same.
"""

from __future__ import annotations

import ast
import html
import runpy
from hashlib import sha256
from pathlib import Path
from shutil import copyfile
from typing import Any

from robot_dyn.view.picture import picture
from robot_dyn.view.web.text import page_text, shared_viewer

DOCS = Path(__file__).parents[1]
SCRIPTS = sorted((DOCS / "gallery").glob("*.py"))
KEPT = DOCS.parent / "build" / "docs_gallery"
VIEWER = "viewer.js"


def page(_: str) -> str:
    """A section for each script: title, what it shows, its page in a frame, its text."""
    return "\n\n".join(_section(path) for path in SCRIPTS)


def _section(path: Path) -> str:
    title, _, words = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")
    still = f'<img src="pages/{path.stem}.png" width="480" height="320" alt="" loading="lazy">'
    link = f'<a class="replay" href="pages/{path.stem}.html">{still}<br>Play: {html.escape(title.rstrip("."))}</a>'
    return (
        f"## {title.rstrip('.')}\n\n{words.strip()}\n\n"
        f"```{{raw}} html\n{link}\n```\n\n"
        f"```{{literalinclude}} {path.name}\n:language: python\n:start-at: import\n```"
    )


def setup(app: Any) -> None:
    app.add_config_value("package_digest", "", "")
    app.connect("build-finished", _write)


def _write(app: Any, error: Exception | None) -> None:
    """Write all pages; a script that fails fails the build."""
    if error is not None or app.builder.name != "html":
        return
    folder = Path(app.outdir) / "gallery" / "pages"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / VIEWER).write_text(shared_viewer(), encoding="utf-8")
    for path in SCRIPTS:
        for made in made_by(path, app.config.package_digest):
            copyfile(made, folder / f"{path.stem}{made.suffix}")


def made_by(path: Path, sources: str) -> tuple[Path, Path]:
    """Page and still picture of a script, from what was kept if neither it nor the library has changed."""
    digest = sha256(path.read_bytes() + sources.encode()).hexdigest()[:16]
    page_file, still = (KEPT / f"{path.stem}-{digest}{suffix}" for suffix in (".html", ".png"))
    if not still.exists():
        document = runpy.run_path(str(path))["page"].document
        KEPT.mkdir(parents=True, exist_ok=True)
        page_file.write_text(page_text(document, viewer=VIEWER), encoding="utf-8")
        still.write_bytes(picture(document))  # last: then both are there
    return page_file, still
