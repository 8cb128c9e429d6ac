"""The command line: parse, call, print. Every command has --help; errors go to stderr with exit code 2."""

from __future__ import annotations

import sys
import warnings
from typing import Any

from robot_dyn.cli import ask, keep, run, show  # noqa: F401  each adds its commands
from robot_dyn.cli.app import app
from robot_dyn.cli.terminal import failed, finish, open_streams, tell
from robot_dyn.errors import RobotDynError, RobotDynWarning


def main() -> None:
    """Entry point: run the command; say what went wrong in one line."""
    open_streams()
    with warnings.catch_warnings():
        warnings.simplefilter("always", RobotDynWarning)
        warnings.showwarning = _show_warning
        sys.exit(_run())


def _run() -> Any:
    """The exit code of the command."""
    try:
        try:
            app()
        except SystemExit as end:
            finish()
            return end.code
        except OSError as error:  # of the help, which typer prints
            raise failed(error) from None
    except RobotDynError as error:
        tell(f"robot-dyn: error: {error}")
    except MemoryError:
        tell("robot-dyn: error: there is not enough memory; ask for less, or free some")
    return 2


def _show_warning(message: Any, *_: Any, **__: Any) -> None:
    tell(f"robot-dyn: warning: {message}")
