"""Figures: numbers of a run that a sweep keeps, f(run) → float.

`rms_error`, `peak` and `final` are computed for a batch at once; functions that users write are named by import path.
Sums go one term after the other, so that their bits do not depend on the runs beside a run.
"""

from __future__ import annotations

import typing
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import reduce
from typing import Any, ClassVar

import numpy as np

from robot_dyn import Setup
from robot_dyn.control import CartesianReference
from robot_dyn.foundations import SweepError, Value, choice, nearest, shown
from robot_dyn.queries import joint_types_of, joint_units
from robot_dyn.tools.sweeps.imported import digest_of, imported, is_import_path, path_of
from robot_dyn.tools.sweeps.plan.runs import Runs
from robot_dyn.tools.sweeps.texts import called

_ROWS = {"q": 0, "v": 1, "u": 2}  # of what is observed of a run
_RECORDS = ("q", "v", "u", "energy", "work")


class Figure(Value, ABC):
    """A number of each run.

    Attributes:
        name: In specifications.
    """

    name: ClassVar[str]

    @property
    @abstractmethod
    def record(self) -> tuple[str, ...]:
        """What it needs recorded, of "q", "v", "u", "energy", "work"."""

    @abstractmethod
    def unit(self, setup: Setup) -> str:
        """That of the numbers, empty where it is not known."""

    @abstractmethod
    def of(self, runs: Runs) -> np.ndarray:
        """The numbers of finished runs, (B,); nan where a run has none."""

    def to_dict(self) -> dict[str, Any]:
        """Its name and arguments, for JSON."""
        return {"figure": self.name} | {each.name: getattr(self, each.name) for each in fields(self)}  # pyright: ignore[reportArgumentType]

    def check(self, runs: Runs) -> None:
        """Raise SweepError if it cannot be computed of the pilot's runs."""
        self.of(runs)


@typing.final
@dataclass(frozen=True)
class RmsError(Figure):
    """√(mean of (q − q_d)² over samples and joints), in [rad] or [m]; of a frame that follows a path in [m]."""

    name: ClassVar[str] = "rms_error"
    joint: str | None = None

    def __post_init__(self) -> None:
        _check_joint(self.name, self.joint)

    @property
    def record(self) -> tuple[str, ...]:
        return ("q",)

    def unit(self, setup: Setup) -> str:
        return _unit("error", self.joint, setup)

    def of(self, runs: Runs) -> np.ndarray:
        deviation = _chosen(_deviation(runs, self.name), self.joint, runs)
        total = np.zeros((len(runs), deviation.shape[2]))
        for known, x in zip(runs.known.T, deviation.swapaxes(0, 1), strict=True):
            total += x * x if known.all() else np.where(known[:, None], x, 0.0) ** 2
        return np.sqrt(reduce(np.add, total.T) / (runs.known.sum(axis=1) * deviation.shape[2]))


@typing.final
@dataclass(frozen=True)
class Peak(Figure):
    """The largest absolute value: of q, v or u over all steps, of the error over the samples; of one joint or all."""

    name: ClassVar[str] = "peak"
    of_what: str
    joint: str | None = None

    def __post_init__(self) -> None:
        choice("peak", self.of_what, (*_ROWS, "error"), error=SweepError)
        _check_joint(self.name, self.joint)

    @property
    def record(self) -> tuple[str, ...]:
        return ("q",) if self.of_what == "error" else ()

    def unit(self, setup: Setup) -> str:
        return _unit(self.of_what, self.joint, setup)

    def of(self, runs: Runs) -> np.ndarray:
        if self.of_what == "error":
            deviation = _chosen(_deviation(runs, self.name), self.joint, runs)
            return np.abs(np.where(runs.known[..., None], deviation, 0.0)).max(axis=(1, 2))
        extremes = _chosen(runs.extremes[:, _ROWS[self.of_what]], self.joint, runs)
        return np.abs(extremes).max(axis=(1, 2))


@typing.final
@dataclass(frozen=True)
class Final(Figure):
    """The last sample: q or v of a joint, or the largest absolute error over the joints."""

    name: ClassVar[str] = "final"
    of_what: str
    joint: str | None = None

    def __post_init__(self) -> None:
        choice("final", self.of_what, ("q", "v", "u", "error"), error=SweepError)
        _check_joint(self.name, self.joint)

    @property
    def record(self) -> tuple[str, ...]:
        return ("q",) if self.of_what in ("q", "error") else ("q", self.of_what)

    def unit(self, setup: Setup) -> str:
        return _unit(self.of_what, self.joint, setup)

    def of(self, runs: Runs) -> np.ndarray:
        last = runs.known.sum(axis=1) - 1
        if self.of_what == "error":
            deviation = _chosen(_deviation(runs, self.name), self.joint, runs)
            return np.abs(deviation[np.arange(len(runs)), last]).max(axis=1)
        if self.joint is None and len(runs.joint_names) > 1:
            names = ", ".join(runs.joint_names)
            raise SweepError(f"final({self.of_what!r}): of which joint? give joint=, one of {names}")
        x = _chosen(getattr(runs, self.of_what), self.joint, runs)
        return x[np.arange(len(runs)), last, 0]


@typing.final
@dataclass(frozen=True)
class UserFigure(Figure):
    """A function f(run) → float of a `Run`, by import path.

    Its attributes, if it has them: `record`, names of what is to be recorded, ("q", "v") otherwise; `unit`, a text;
    `batch`, a function of `Runs` that gives the same numbers (B,) of many at once, to the bit.
    """

    name: ClassVar[str] = "function"
    path: str
    stated: tuple[str, str] | None = None
    """In a folder that was read without naming the function: SHA-256 of its module, and unit. It is not imported."""

    @property
    def function(self) -> Any:
        """The function; SweepError if a folder names it and its reader has not."""
        if self.stated is not None:
            raise SweepError(
                f"the folder names the function {self.path} as a figure, which is called only if you name it:"
                f" sw.read(folder, figures={{NAME: {self.path!r}}}), or --figure NAME={self.path}"
            )
        return imported(self.path)

    @property
    def record(self) -> tuple[str, ...]:
        needed = getattr(self.function, "record", ("q", "v"))
        return tuple(choice(f"record of {self.path}", each, _RECORDS, error=SweepError) for each in needed)

    def unit(self, setup: Setup) -> str:
        return self._unit

    @property
    def _unit(self) -> str:
        return str(getattr(self.function, "unit", "")) if self.stated is None else self.stated[1]

    def of(self, runs: Runs) -> np.ndarray:
        function = self.function
        batch = getattr(function, "batch", None)
        if batch is not None:
            return np.asarray(batch(runs), dtype=float)
        return np.array([_number(self.path, function(run)) for run in runs])

    def to_dict(self) -> dict[str, Any]:
        digest = digest_of(self.path) if self.stated is None else self.stated[0]
        return {"figure": self.path, "sha256": digest, "unit": self._unit}

    def check(self, runs: Runs) -> None:
        function = self.function
        if getattr(function, "batch", None) is None:
            return
        single = np.array([_number(self.path, function(run)) for run in runs])
        together = self.of(runs)
        if together.shape != single.shape:
            raise SweepError(f"{self.path}.batch: gives shape {together.shape} of {len(runs)} runs, not ({len(runs)},)")
        differ = np.flatnonzero(together.view(np.int64) != single.view(np.int64))
        if len(differ):
            i = int(differ[0])
            raise SweepError(
                f"{self.path}.batch: gives {together[i]!r} of run {i} of the pilot, the function itself {single[i]!r};"
                " make them equal to the bit, or remove the batch form"
            )


def rms_error(joint: str | None = None) -> RmsError:
    """Root mean square of q − q_d over the samples, which are a `record_period_s` apart, and the joints, or of one."""
    return RmsError(joint)


def peak(of_what: str, joint: str | None = None) -> Peak:
    """Largest absolute value of "q", "v" or "u" over all steps, or of "error" over the samples; of one joint or all."""
    return Peak(of_what, joint)


def final(of_what: str, joint: str | None = None) -> Final:
    """Last value of "q", "v" or "u" of a joint, or of the "error", the largest absolute one over the joints."""
    return Final(of_what, joint)


FIGURES: Mapping[str, Callable[..., Figure]] = {each.__name__: each for each in (rms_error, peak, final)}


def figure(name: str, given: Any) -> Figure:
    """Return a figure as it is or as a text; of a function, or its import path, one that calls it.

    Raises:
        SweepError: If it is none of them.
    """
    if isinstance(given, Figure):
        return given
    try:
        if isinstance(given, str) and not is_import_path(given):
            return called("figure", given, FIGURES)
        user = UserFigure(path_of(given))
        imported(user.path)
    except SweepError as error:
        raise SweepError(f"figures: {name}: {error}") from None
    return user


def from_dict(stored: Mapping[str, Any], may_import: bool = False) -> Figure:
    """The figure of a dictionary that `to_dict` made; SweepError if it has another form.

    Args:
        stored: The dictionary.
        may_import: Whether a function may be imported, since the reader of the folder named it.
    """
    given = dict(stored) if isinstance(stored, Mapping) else {}
    kind = given.pop("figure", None)
    if not isinstance(kind, str):
        raise SweepError(f'a stored figure is a table with the key "figure", got {shown(stored)}')
    if ":" in kind:
        digest, unit = given.get("sha256"), given.get("unit")
        if not isinstance(digest, str) or not isinstance(unit, str):
            raise SweepError(f'figure {kind}: a stored function has the keys "sha256" and "unit"')
        return UserFigure(path_of(kind), None if may_import else (digest, unit))
    if kind not in FIGURES:
        raise SweepError(f"no figure {shown(kind)}; {nearest(kind, FIGURES)}")
    try:
        return FIGURES[kind](**given)
    except TypeError as error:
        raise SweepError(f"figure {kind}: {error}") from None


def _check_joint(name: str, joint: Any) -> None:
    if joint is not None and not isinstance(joint, str):
        raise SweepError(f"{name}: joint must be the name of one, got {shown(joint)}")


def _unit(of_what: str, joint: str | None, setup: Setup) -> str:
    """That of q, v, u or the error of a joint, or of all; of a frame that follows a path "m"."""
    if of_what == "error" and setup.controller is not None and isinstance(setup.controller.desired, CartesianReference):
        return "m"
    dynamics = setup.plant.dynamics
    of_joint = dict(zip(dynamics.joint_names, joint_types_of(dynamics), strict=True))
    return joint_units(
        "q" if of_what == "error" else of_what, of_joint.values() if joint is None else [of_joint.get(joint)]
    )


def _number(path: str, value: Any) -> float:
    """What a user's function returned, as a float."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        raise SweepError(f"{path}: returned {shown(value)}; return a number, nan where a run has none")
    return float(value)


def _deviation(runs: Runs, name: str) -> np.ndarray:
    if runs.deviation is None:
        raise SweepError(f"{name}: there is no error, since no reference is followed; add a controller with one")
    return runs.deviation


def _chosen(x: np.ndarray, joint: str | None, runs: Runs) -> np.ndarray:
    """All joints of an array over joints, or one."""
    if joint is None:
        return x
    if joint not in runs.joint_names or x.shape[-1] != len(runs.joint_names):
        raise SweepError(f"joint: no joint {shown(joint)}; {nearest(str(joint), runs.joint_names)}")
    k = runs.joint_names.index(joint)
    return x[..., k : k + 1]
