"""The command line: parse, call, print. Every command has --help; errors go to stderr with exit code 2."""

from __future__ import annotations

import sys
import warnings
from typing import Any

from robot_dyn.cli import ask, keep, run, show  # noqa: F401  each adds its commands
from robot_dyn.cli.app import app
from robot_dyn.errors import RobotDynError, RobotDynWarning


def main() -> None:
    """Entry point: run the command; say what went wrong in one line."""
    for stream in (sys.stdout, sys.stderr):  # a terminal without mathematical signs shows ? for them
        stream.reconfigure(errors="replace")  # pyright: ignore[reportAttributeAccessIssue]
    with warnings.catch_warnings():
        warnings.simplefilter("always", RobotDynWarning)
        warnings.showwarning = _show_warning
        try:
            app()
        except RobotDynError as error:
            print(f"robot-dyn: error: {error}", file=sys.stderr)
            sys.exit(2)
        except BrokenPipeError:  # the reader of a pipe has seen enough
            sys.stderr.close()
            sys.exit(0)


def _show_warning(message: Any, *_: Any, **__: Any) -> None:
    print(f"robot-dyn: warning: {message}", file=sys.stderr)
