"""What the site adds to Sphinx: parts of pages that are written at build, docstrings as text, formulas, the gallery."""

from __future__ import annotations

from typing import Any

from site_parts import docstrings, formulas, gallery, generated


def setup(app: Any) -> dict[str, Any]:
    for part in (docstrings, formulas, gallery, generated):
        part.setup(app)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
