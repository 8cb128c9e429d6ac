"""Code written outside the library: calls of it that name the part in an exception, and the line that raised one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from traceback import walk_tb
from typing import Any

from robot_dyn.errors import (
    MachineCodeError,
    NotFiniteError,
    OverflowedError,
    QueryError,
    RobotDynError,
    TraceError,
)  # fmt: skip

_NOT_A_USERS = {"robot_dyn", "numpy", "scipy", "casadi", *sys.stdlib_module_names}


def call(method: Callable[..., Any], *arguments: Any) -> Any:
    """What a method of an effect or controller returns.

    An exception of its code passes as it is, with a note of the part's name; errors of the library say theirs.
    """
    try:
        return method(*arguments)
    except RobotDynError:
        raise
    except Exception as error:
        part: Any = getattr(method, "__self__", None)
        of = "" if part is None else f" of {getattr(part, 'name', type(part).__name__)}"  # None: a plain function
        error.add_note(f"in {getattr(method, '__name__', 'a method')}{of}")
        raise


def users_line(error: BaseException) -> str:
    """The innermost line of a user's code on the way to an exception, "line 12 of arm.py"; empty without one."""
    found = ""
    for frame, line in walk_tb(error.__traceback__):
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] not in _NOT_A_USERS:
            found = f"line {line} of {Path(frame.f_code.co_filename).name}"
    return found


def is_mistake(error: RobotDynError) -> bool:
    """Whether a user's code gave the library an argument that it refuses, such as one of a wrong shape.

    So does a step that cannot be machine code, or fails as such. Other errors of the library, raised or met there, are
    outcomes of a run: numbers that overflow, a singular M.
    """
    if isinstance(error, TraceError | MachineCodeError):
        return True
    refused = isinstance(error, QueryError) and not isinstance(error, NotFiniteError | OverflowedError)
    return refused and bool(users_line(error))


def because(error: BaseException) -> str:
    """The message of an exception, with the line of a user's code that raised it."""
    line = users_line(error)
    message = str(error) if isinstance(error, RobotDynError) else f"{type(error).__name__}: {error}"
    return f"{line}: {message}" if line else str(error)
