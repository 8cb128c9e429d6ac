"""Kinds of files of figures, and the error of figures."""

from __future__ import annotations

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.files import FileKind

PICTURES = (
    FileKind("a plot", ".png", b"\x89PNG"),
    FileKind("a plot", ".svg", b"<?xml"),
    FileKind("a plot", ".pdf", b"%PDF"),
)


class PlotError(RobotDynError):
    """A run without data to draw, or a figure that cannot be written."""
