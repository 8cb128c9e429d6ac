"""The page of a replay: one HTML file with the viewer, the plots, the slider and all data in it."""

from __future__ import annotations

import html
import json
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any

from robot_dyn.view.commands import as_text

# Nothing is loaded from anywhere: code and style stand in the page, pictures are data; only the live page has a socket.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


def page(document: dict[str, Any]) -> str:
    """The HTML text of a document: title, outcome, notes, duration, scene, plots, and commands unless it is `live`."""
    own = Path(__file__).parent / "web"
    text = json.dumps(as_text(document))  # base64 has no character that HTML would read
    return Template(_read(own / "replay.html")).substitute(
        policy=_POLICY + ("; connect-src 'self' ws://127.0.0.1:* ws://localhost:*" if document["live"] else ""),
        title=html.escape(document["title"]),
        uplot_style=_read(own / "uplot" / "uPlot.min.css"),
        style=_read(own / "replay.css"),
        meshcat=_inline(_read(_meshcat() / "viewer" / "dist" / "main.min.js")),
        uplot=_inline(_read(own / "uplot" / "uPlot.iife.min.js")),
        data=text,
        script=_inline(_read(own / "replay.js")),
    )


def _meshcat() -> Path:
    """The folder of the package meshcat, whose import takes IPython along and is not needed for a file of it."""
    found = find_spec("meshcat")
    assert found is not None and found.submodule_search_locations, "meshcat is a dependency"
    return Path(found.submodule_search_locations[0])


def _read(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def _inline(script: str) -> str:
    """A script that no HTML parser ends before its end."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")
