"""The Matplotlib figure that `plot` returns: notebooks show it once, and `save` writes it."""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib.figure import Figure as MatplotlibFigure

from robot_dyn.foundations import files
from robot_dyn.foundations.errors import shorten
from robot_dyn.foundations.validate import number
from robot_dyn.view.plots.pictures import PICTURES, PlotError

_MIN_DPI = 10.0  # below this, letters are smaller than a pixel


class Figure(MatplotlibFigure):
    """A Matplotlib figure outside pyplot: a notebook shows it as the value of a cell, with or without a backend."""

    def save(self, path: str | Path, *, dpi: float = 200) -> Path:
        """Save the figure in the format of the suffix of `path`, completely or not at all; return the path.

        An existing file is replaced only if it has the same format.

        Args:
            path: Path with the suffix .png, .svg or .pdf; .png is added if it has none.
            dpi: Resolution of a PNG in dots per inch, at least 10.

        Raises:
            PlotError: If the suffix is unknown, or the figure cannot be drawn or written.
            QueryError: If `dpi` is invalid.
        """
        dpi = number("dpi", dpi, least=_MIN_DPI)
        path = files.target(path, PICTURES, PlotError)
        picture = io.BytesIO()
        try:
            self.savefig(picture, format=path.suffix[1:].lower(), dpi=dpi)
        except (ValueError, MemoryError, RuntimeError, OverflowError, TypeError) as error:  # Matplotlib, by dpi
            raise PlotError(
                f"{path}: cannot be drawn at {dpi:g} dpi ({shorten(error)}); draw fewer parts, or use dpi=150"
            ) from None
        return files.save(path, lambda stream: stream.write(picture.getvalue()), PlotError)

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()
