"""The command line: parse, call, print. Every command has --help; errors go to stderr with exit code 2.

Ctrl-C ends any command with exit code 130. The guard stands before anything else is imported.
"""

from __future__ import annotations

import sys

from robot_dyn.cli.interrupts import guard, ignore

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def main() -> None:
    """Entry point: run the command; say what went wrong in one line."""
    guard()
    try:
        code = _run()
    except KeyboardInterrupt:
        code = 130
    ignore()
    if code == 130:
        print("robot-dyn: interrupted", file=sys.stderr)
    sys.exit(code)


def _run() -> Any:
    """The exit code of the command."""
    import warnings

    from robot_dyn.cli.app import app
    from robot_dyn.cli.commands import ask, cache, check, demo, price, prove, run, show, stress  # noqa: F401
    from robot_dyn.cli.terminal import failed, finish, open_streams, tell
    from robot_dyn.errors import RobotDynError, RobotDynWarning

    open_streams()
    with warnings.catch_warnings():
        warnings.simplefilter("always", RobotDynWarning)
        warnings.showwarning = lambda message, *_, **__: tell(f"robot-dyn: warning: {message}")
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
