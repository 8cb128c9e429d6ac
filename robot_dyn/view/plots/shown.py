"""A figure that a notebook shows once, as a picture, whether or not its inline backend is active."""

from __future__ import annotations

import io

from matplotlib.figure import Figure as MatplotlibFigure


class Figure(MatplotlibFigure):
    """A figure of Matplotlib that pyplot does not know, so that it is shown where it is returned and nowhere else."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()
