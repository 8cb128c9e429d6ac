"""The command line: parse, call, print. Every command has --help; errors go to stderr with exit code 2.

Ctrl-C ends any command with exit code 130; its handler is installed before anything else is imported.

commands/        the commands, by topic; the tools add theirs as entry points `robot_dyn.commands`
application.py   the application, its groups of commands, progress bars; completion.py and interrupts.py
options.py       options shared by commands: for a robot, and for a result with its figure and table
arguments.py     values of arguments; terminal.py: prints answers as text or JSON, with escapes
report.py        documents and tables of comparisons and runs
"""

from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def _end(*_: object) -> None:
    """End the process at once: nothing that needs cleaning up has started."""
    os.write(2, b"robot-dyn: interrupted\n")
    os._exit(130)


def _is_command() -> bool:
    """Return True if this process was started as robot-dyn, and is not a child that imports its main module again."""
    program = os.path.basename(sys.argv[0]) if sys.argv else ""
    return program.removesuffix(".exe") in ("robot-dyn", "__main__.py") and "multiprocessing" not in sys.modules


if _is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _end)  # until main() has imported more

from robot_dyn.foundations.public import public_names  # noqa: E402

__getattr__, __dir__, _ = public_names(__spec__)


def main() -> None:
    """Entry point: run the command; report errors in one line."""
    from robot_dyn.cli.interrupts import guard, ignore
    from robot_dyn.foundations.errors import MissingExtraError

    guard()
    try:
        code = _run()
    except KeyboardInterrupt:
        code = 130
    except MissingExtraError as error:  # of the command line itself
        print(f"robot-dyn: error: {error}", file=sys.stderr)
        code = 2
    ignore()
    if code == 130:
        print("robot-dyn: interrupted", file=sys.stderr)
    sys.exit(code)


def _run() -> Any:
    """Run the command and return its exit code."""
    import warnings

    from robot_dyn.cli.application import program
    from robot_dyn.cli.terminal import failed, finish, logged_to_stderr, open_streams, to_stderr
    from robot_dyn.foundations.errors import RobotDynError, RobotDynWarning

    run = program()
    open_streams()
    with warnings.catch_warnings(), logged_to_stderr():
        warnings.simplefilter("always", RobotDynWarning)
        warnings.showwarning = lambda message, *_, **__: to_stderr(f"robot-dyn: warning: {message}")
        try:
            try:
                run(prog_name="robot-dyn")
            except SystemExit as end:
                finish()
                return end.code
            except OSError as error:  # while typer prints the help
                raise failed(error) from None
        except RobotDynError as error:
            to_stderr(f"robot-dyn: error: {error}")
        except MemoryError:
            to_stderr("robot-dyn: error: out of memory; use fewer runs or samples, or free some memory")
    return 2
