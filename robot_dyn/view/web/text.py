"""The HTML text of a page: one file that contains the viewer, the plots, the slider and all data.

The viewer's script, most of the text, is compressed. The page decompresses it, and the browser runs it only if its
digest is in the content policy. Pages of one folder may share it: a compressed file next to them inserts it into the
page, and the digest is checked, too.
"""

from __future__ import annotations

import html
import json
import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any

from robot_dyn.view.commands import as_text, packed

# Nothing is loaded, and only the scripts in the page run; pictures are data.
_POLICY = "default-src 'none'; base-uri 'none'; form-action 'none'; script-src {}; style-src {}; img-src data: blob:"
# One concept per file; all share one namespace.
_SCRIPTS = (
    "keys.js", "clock.js", "sliders.js", "camera.js", "layers.js", "plots.js", "panels.js", "why.js", "film.js",
    "replay.js",
)  # fmt: skip
_PANEL = re.compile(r'\}\("(\.dg ul\{(?:[^"\\]|\\.)*)"\)')  # the style that meshcat's panel, dat.gui, adds


def page_text(document: Mapping[str, Any], *, viewer: str = "") -> str:
    """Return the HTML text of a document: title, outcome, notes, duration, scene, plots, commands.

    Args:
        document: Result of `document` or `still`.
        viewer: Name of a file next to the page with the text of `shared_viewer`; if empty, the page contains it.
    """
    web = Path(__file__).parent
    meshcat = _viewer()
    scripts = {
        "uplot": _inline(_read(web / "uplot" / "uPlot.iife.min.js")),
        "script": _inline("\n".join(_read(web / name) for name in _SCRIPTS)),
    }
    styles = {"uplot_style": _read(web / "uplot" / "uPlot.min.css"), "style": _read(web / "replay.css")}
    allowed = ("'self' " if viewer else "") + _hashes([meshcat, *scripts.values()])
    policy = _POLICY.format(allowed, _hashes([*styles.values(), *_own_styles(meshcat)]))
    return Template(_read(web / "replay.html")).substitute(
        policy=policy,
        title=html.escape(document["title"]),
        data=json.dumps(as_text(dict(document))),
        meshcat="" if viewer else packed(meshcat.encode()),
        shared=f'<script src="{html.escape(viewer)}"></script>' if viewer else "",
        **scripts,
        **styles,
    )


def shared_viewer() -> str:
    """Return the script that several pages share; it inserts the compressed viewer into the page."""
    return f'document.getElementById("meshcat").textContent = "{packed(_viewer().encode())}";\n'


def _hashes(texts: Iterable[str]) -> str:
    """Return the sources of a content policy that allow only these texts [CSP 3, §2.3.1]."""
    digests = (sha256(text.encode()).digest() for text in texts)
    return " ".join(f"'sha256-{b64encode(digest).decode()}'" for digest in digests)


def _own_styles(meshcat: str) -> Iterator[str]:
    """Yield the styles that meshcat adds to its page: an empty one, filled later, and that of its panel."""
    yield ""
    for text in _PANEL.findall(meshcat):
        yield json.loads(f'"{text}"')


def _viewer() -> str:
    return _read(_meshcat() / "viewer" / "dist" / "main.min.js")


def _meshcat() -> Path:
    """Return the folder of the package meshcat without importing it, which would import IPython."""
    found = find_spec("meshcat")
    assert found is not None and found.submodule_search_locations, "meshcat is a dependency"
    return Path(found.submodule_search_locations[0])


def _read(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def _inline(script: str) -> str:
    """Return a script that HTML parsers do not end early."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")
