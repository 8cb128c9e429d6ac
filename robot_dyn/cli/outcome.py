"""What a study leaves: its files, checked before the work is done, and what is said of it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments
from robot_dyn.cli.terminal import say, say_json, to_stderr


def outputs(of: Any, output: str | None, csv: str | None, inputs: Iterable[str], force: bool) -> list[Path]:
    """The paths to write a figure and a table of a class of results to, those that are given."""
    from robot_dyn.report.figure import ResultError
    from robot_dyn.report.save import table_kind
    from robot_dyn.view.plots.plots import PICTURES

    paths = [arguments.output(output, PICTURES, ResultError, inputs, force)] if output else []
    return paths + ([arguments.output(csv, table_kind(of), ResultError, [*inputs, *paths], force)] if csv else [])


def give(result: Any, paths: Iterable[Path], as_json: bool, dark: bool = False, drawn: Any = None, **more: Any) -> None:
    """Write a result, or the one that is `drawn`, and say it, with more answers by key.

    The exit code is 130 if the user ended it.
    """
    from robot_dyn.foundations.result import plain

    try:  # the files first: a terminal or pipe may be gone
        written = [rd.accuracy.save_result(drawn or result, path, theme="dark" if dark else "light") for path in paths]
    finally:
        said = (part for each in more.values() for part in ("", each))
        say_json(result, **{key: plain(each) for key, each in more.items()}) if as_json else say(result, *said)
    for path in written:
        to_stderr(f"written: {path}")
    if result.interrupted:
        raise typer.Exit(130)
