"""Errors a user can act on: each message says what, where, the value and the remedy; and calls of user-written code."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from traceback import walk_tb
from typing import Any
from unicodedata import category


def escaped(text: str) -> str:
    r"""The text in one line, its control and invisible characters written as Python writes them: \x1b, \n, \u202e."""
    if text.isprintable():
        return text
    visible = (each if each.isprintable() or category(each) == "Zs" else repr(each)[1:-1] for each in text)
    return "".join(visible)


class PortableError(Exception):
    """An error that survives `pickle` and `copy` with its message and attributes, and so passes between processes."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Rebuild the error from its message and attributes: `__init__` of a subclass may take other arguments."""
        return _rebuilt, (type(self), self.args), self.__dict__


def _rebuilt(kind: type[PortableError], args: tuple[Any, ...]) -> PortableError:
    return kind.__new__(kind, *args)  # which sets args


class RobotDynError(PortableError):
    """Base of every error this library raises; its message has no control characters of the file that it is about.

    Attributes:
        row: Index of the state that has no answer in a batch, None where there is no batch.
    """

    row: tuple[int, ...] | None = None

    def __str__(self) -> str:
        return escaped(super().__str__())


class CatalogError(RobotDynError):
    """No robot, file or package of that name was found."""


class DescriptionError(RobotDynError):
    """A robot description that cannot be read safely or has no single meaning."""


class EditError(RobotDynError):
    """An edit of a robot (lock, payload, armature, gravity) that cannot be applied."""


class MissingExtraError(RobotDynError):
    """A package that an answer needs is not installed."""


class PlanError(RobotDynError):
    """A motion that cannot be planned: limits, way points or samples that are not allowed, or that nothing can meet."""


class VideoError(RobotDynError):
    """A video that cannot be made: of a page without a run, too long, or without a browser that shows the page."""


class TraceError(RobotDynError):
    """A function that cannot be traced: it does what symbols cannot."""


class MachineCodeError(RobotDynError, ArithmeticError):
    """Machine code that ended at an index out of range, an integer that overflows or one divided by zero."""


class ControlError(RobotDynError):
    """A controller or reference with values that are not allowed, or of the wrong shape."""


class ProofError(RobotDynError):
    """A run for which no theorem can be proven: a part of it switches, or is not known to be analytic."""


class EffectError(RobotDynError):
    """An effect with coefficients that have no physical meaning, or of the wrong shape."""


class QueryError(RobotDynError):
    """An argument of a query with the wrong shape, a value that is not finite, or an unknown name."""


class NotFiniteError(QueryError):
    """An argument of a query with a value that is NaN or infinite."""


class OverflowedError(QueryError):
    """Arguments so large that the result is not a finite number."""


class SceneError(RobotDynError):
    """A scene that cannot be read; names file, line, key and value."""


class SweepError(RobotDynError):
    """A sweep that cannot be made, run or read: its specification, its folder or a question to its rows."""


class SingularError(RobotDynError):
    """Forward dynamics that has no answer: M is singular.

    Attributes:
        joint: Name of the joint that carries no inertia.
    """

    def __init__(self, joint: str, where_or_remedy: str) -> None:
        super().__init__(f"no forward dynamics: joint {joint!r} carries no inertia {where_or_remedy}")
        self.joint = joint


class UndecidedError(SingularError):
    """Forward dynamics that is not decided: whether M is singular is lost in the rounding of an arithmetic."""

    def __init__(self, joint: str, where: str, arithmetic: str) -> None:
        RobotDynError.__init__(
            self,
            f"forward dynamics not decided: whether joint {joint!r} carries inertia {where} is lost in the rounding of"
            f" {arithmetic}; ask rd.Lagrangian(robot, rd.accuracy.Ball(bits)) with enough bits",
        )
        self.joint = joint


class RobotDynWarning(UserWarning):
    """Base of the warnings of this library; messages as of the errors."""

    def __str__(self) -> str:
        return escaped(super().__str__())


class ModelWarning(RobotDynWarning):
    """A robot that loads although some of its bodies cannot exist, or cannot be drawn, as described."""


class PlanWarning(RobotDynWarning):
    """A motion of a scene whose samples are doubtful: gaps, jumps, limits passed."""


class PrecisionWarning(RobotDynWarning):
    """An answer with fewer digits than requested by `rd.accuracy.warn_below`, or of a nearly singular robot."""


def announce(robot: str, findings: Sequence[str]) -> None:
    """One ModelWarning of findings about a robot, if there are any, at the line that loads it, three calls above."""
    if findings:
        more = f" (the first of {len(findings)} findings; all of them: Robot.findings, robot-dyn info)"
        text = f"{robot}: {findings[0]}{more if len(findings) > 1 else ''}"
        warnings.warn(text, ModelWarning, stacklevel=4)


_COMPARED = 48  # characters of a name: likeness costs the square of it


def shorten(value: object, most: int = 60) -> str:
    """The text of a value that a message shows, cut if it is long."""
    text = str(value)
    return text if len(text) <= most else text[: most - 1] + "…"


def shown(value: object) -> str:
    """A value in a message."""
    try:
        return shorten(repr(value))
    except Exception:  # an int of many digits, or whatever an object's repr raises
        return f"a value of type {type(value).__name__}"


def nearest(name: str, names: Iterable[str]) -> str:
    """Advice after an unknown name: the nearest valid names, or the first few."""
    names = list(names)
    by_key = {known.casefold()[:_COMPARED]: known for known in names}
    close = [by_key[key] for key in get_close_matches(name.casefold()[:_COMPARED], by_key, n=4, cutoff=0.5)]
    shown = [shorten(each) for each in close or names[:8]]
    if not shown:
        return "there are none"
    more = "" if close or len(names) == len(shown) else f", … ({len(names)} in all)"
    return ("nearest: " if close else "known: ") + ", ".join(shown) + more


# --- user-written code

_NOT_USER_CODE = {"robot_dyn", "numpy", "scipy", "casadi", *sys.stdlib_module_names}


def call(method: Callable[..., Any], *arguments: Any) -> Any:
    """What a method of an effect or controller returns.

    An exception of its code passes as it is, with a note of the part's name; errors of the library name it themselves.
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
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] not in _NOT_USER_CODE:
            found = f"line {line} of {Path(frame.f_code.co_filename).name}"
    return found


def is_mistake(error: RobotDynError) -> bool:
    """Whether user-written code gave the library an invalid argument, such as one of a wrong shape.

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
