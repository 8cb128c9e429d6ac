"""Errors whose messages name the fault, its place, the value and the remedy; and calls of user-written code."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from traceback import walk_tb
from typing import TypeVar
from unicodedata import category

Result = TypeVar("Result")


def escaped(text: str) -> str:
    r"""Return the text in one line, with control and invisible characters escaped as in Python: \x1b, \n, \u202e."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or category(c) == "Zs" else repr(c)[1:-1] for c in text)


class PortableError(Exception):
    """An error that keeps its message and attributes through `pickle` and `copy`, and so between processes."""

    def __reduce__(self) -> tuple[object, ...]:
        """Rebuild the error from its message and attributes: `__init__` of a subclass may take other arguments."""
        return _rebuilt, (type(self), self.args), self.__dict__


def _rebuilt(kind: type[PortableError], args: tuple[object, ...]) -> PortableError:
    return kind.__new__(kind, *args)  # __new__ sets args


class RobotDynError(PortableError):
    """Base class of all errors of this library; control characters in its message are escaped.

    Attributes:
        row: Index of the state in a batch that caused the error; None without a batch.
    """

    row: tuple[int, ...] | None = None

    def __str__(self) -> str:
        return escaped(super().__str__())


class CatalogError(RobotDynError):
    """No robot, file or package of that name exists."""


class DescriptionError(RobotDynError):
    """A robot description that cannot be read safely or has no single meaning."""


class EditError(RobotDynError):
    """An edit of a robot (lock, payload, armature, gravity) that cannot be applied."""


class MissingExtraError(RobotDynError, ImportError):
    """A required package is not installed."""


class PlanError(RobotDynError):
    """A motion that cannot be planned: limits, way points or samples are invalid or cannot be satisfied."""


class VideoError(RobotDynError):
    """A video that cannot be rendered: the page has no run, the video is too long, or there is no browser."""


class TraceError(RobotDynError):
    """A function that cannot be traced: it uses operations that symbols do not support."""


class MachineCodeError(RobotDynError, ArithmeticError):
    """Machine code that stopped at an index out of range, an integer overflow or an integer division by zero."""


class ControlError(RobotDynError):
    """A controller or reference with invalid values or shapes."""


class ExportError(RobotDynError):
    """Equations that cannot be exported as C or a CasADi Function: an effect switches, or a file is in the way."""


class ProofError(RobotDynError):
    """A run for which no theorem can be proven: a part of it switches, or may not be analytic."""


class EffectError(RobotDynError):
    """An effect with coefficients that have no physical meaning, or the wrong shape."""


class QueryError(RobotDynError):
    """An argument of a query with the wrong shape, a value that is not finite, or an unknown name."""


class NotFiniteError(QueryError):
    """An argument of a query with a value that is NaN or infinite."""


class MissingTimeError(QueryError):
    """A query without t of a plant with an effect that depends on the time."""


class OverflowedError(QueryError):
    """Arguments so large that the result is not a finite number."""


class SceneError(RobotDynError):
    """A scene that cannot be read; the message names file, line, key and value."""


class SweepError(RobotDynError):
    """A sweep that cannot be specified, run or read: an invalid specification, folder or query."""


class SingularError(RobotDynError):
    """Forward dynamics without a solution: M is singular.

    Attributes:
        joint: Name of the joint that carries no inertia.
    """

    def __init__(self, joint: str, where_or_remedy: str) -> None:
        super().__init__(f"no forward dynamics: joint {joint!r} carries no inertia {where_or_remedy}")
        self.joint = joint


class UndecidedError(SingularError):
    """Undecided forward dynamics: rounding hides whether M is singular."""

    def __init__(self, joint: str, where: str, arithmetic: str) -> None:
        RobotDynError.__init__(
            self,
            f"forward dynamics not decided: rounding of {arithmetic} hides whether joint {joint!r} carries inertia"
            f" {where}; use rd.Lagrangian(robot, rd.accuracy.Ball(bits)) with enough bits",
        )
        self.joint = joint


class RobotDynWarning(UserWarning):
    """Base class of all warnings of this library; control characters in its message are escaped."""

    def __str__(self) -> str:
        return escaped(super().__str__())


class ModelWarning(RobotDynWarning):
    """A robot that loads although some bodies, as described, are physically impossible or cannot be drawn."""


class PlanWarning(RobotDynWarning):
    """A motion of a scene with doubtful samples: gaps, jumps, or values beyond limits."""


class PrecisionWarning(RobotDynWarning):
    """A result with fewer digits than requested by `rd.accuracy.warn_below`, or of a nearly singular robot."""


def announce(robot: str, findings: Sequence[str], total: int) -> None:
    """Issue one ModelWarning with the first finding about a robot, attributed to the line that loads it.

    Args:
        robot: Name of the robot.
        findings: Findings to warn of; if empty, there is no warning.
        total: Number of all findings.
    """
    if findings:
        more = f" (the first of {total} findings; see Robot.findings or robot-dyn info for all)"
        text = f"{robot}: {findings[0]}{more if total > 1 else ''}"
        warnings.warn(text, ModelWarning, stacklevel=4)  # the line is three calls above


_COMPARED = 48  # number of characters of a name that are compared: the time grows with its square


def shorten(value: object, most: int = 60) -> str:
    """Return the text of a value for a message, cut if it is long."""
    text = str(value)
    return text if len(text) <= most else text[: most - 1] + "…"


def shown(value: object) -> str:
    """Return the `repr` of a value for a message, cut if it is long."""
    try:
        return shorten(repr(value))
    except Exception:  # an int of many digits, or any error in the repr of an object
        return f"a value of type {type(value).__name__}"


def nearest(name: str, names: Iterable[str]) -> str:
    """Return advice after an unknown name: the nearest valid names, or the first few."""
    names = list(names)
    by_key = {valid.casefold()[:_COMPARED]: valid for valid in names}
    close = [by_key[key] for key in get_close_matches(name.casefold()[:_COMPARED], by_key, n=4, cutoff=0.5)]
    shown = [shorten(valid) for valid in close or names[:8]]
    if not shown:
        return "there are none"
    more = "" if close or len(names) == len(shown) else f", … ({len(names)} in all)"
    return ("nearest: " if close else "known: ") + ", ".join(shown) + more


# --- user-written code

_NOT_USER_CODE = {"robot_dyn", "numpy", "scipy", "casadi", *sys.stdlib_module_names}


def call(method: Callable[..., Result], *arguments: object) -> Result:
    """Call a method of an effect or controller and return its result.

    An exception in its code gets a note with the name of the part; errors of the library already contain it.
    """
    try:
        return method(*arguments)
    except MissingTimeError as error:
        if (name := getattr(getattr(method, "__self__", None), "name", None)) is not None:
            error.args = (f"{name} depends on the time: pass t=, in [s]",)
        raise
    except RobotDynError:
        raise
    except Exception as error:
        part = getattr(method, "__self__", None)
        owner = "" if part is None else f" of {getattr(part, 'name', type(part).__name__)}"  # None: a plain function
        error.add_note(f"in {getattr(method, '__name__', 'a method')}{owner}")
        raise


def users_line(error: BaseException) -> str:
    """Return the innermost line of user code in a traceback, such as "line 12 of arm.py"; empty without one."""
    innermost = ""
    for frame, line in walk_tb(error.__traceback__):
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] not in _NOT_USER_CODE:
            innermost = f"line {line} of {Path(frame.f_code.co_filename).name}"
    return innermost


def is_mistake(error: RobotDynError) -> bool:
    """Return True if user-written code passed an invalid argument to the library, for example of a wrong shape.

    A step that cannot be traced, or fails as machine code, is a mistake, too. Other errors in user code are outcomes
    of a run: overflow, or a singular M.
    """
    if isinstance(error, TraceError | MachineCodeError):
        return True
    is_invalid = isinstance(error, QueryError) and not isinstance(error, NotFiniteError | OverflowedError)
    return is_invalid and bool(users_line(error))


def located_message(error: BaseException) -> str:
    """Return the message of an exception, with the line of user code that raised it."""
    line = users_line(error)
    message = str(error) if isinstance(error, RobotDynError) else f"{type(error).__name__}: {error}"
    return f"{line}: {message}" if line else str(error)
