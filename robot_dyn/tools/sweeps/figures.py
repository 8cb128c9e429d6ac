"""Figures: numbers of a run that a sweep keeps, f(run) → float, and the runs that they are computed from.

`rms_error`, `peak` and `final` are computed for a batch at once; functions that users write are named by import path.
Sums go one term after the other, so that their bits do not depend on the runs next to a run.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np

from robot_dyn import Rollouts, Setup
from robot_dyn.control import CartesianReference
from robot_dyn.foundations import SweepError, Value, choice, nearest, read_only, shown
from robot_dyn.queries import joint_types_of, joint_units
from robot_dyn.simulation import tracking_of
from robot_dyn.tools.sweeps.imported import digest_of, imported, is_import_path, path_of
from robot_dyn.tools.sweeps.texts import call_of, called

_STATES = ("q", "v", "u")  # in the order of what is observed of a run
_RECORDS = (*_STATES, "energy", "work")


@typing.final
@dataclass(frozen=True, eq=False)
class Run(Value):
    """One run, as figures see it: what was recorded of it, up to its end.

    Attributes:
        t: Times of its samples, (m,), in [s].
        q, v, u: Position, velocity, actuation, (m, n); None where not recorded.
        kinetic, potential: Energies, (m,), in [J]; None where not recorded.
        desired, deviation: Same as in `Trajectory`; None without a reference.
        extremes: The least and the largest of q, v and u over all steps, (3, 2, n).
        ended: Time at which it ended, in [s].
        params: Its start, "q0" and "v0", and its values of parameters that vary, by name, (size,).
    """

    t: np.ndarray
    q: np.ndarray | None
    v: np.ndarray | None
    u: np.ndarray | None
    kinetic: np.ndarray | None
    potential: np.ndarray | None
    desired: np.ndarray | None
    deviation: np.ndarray | None
    extremes: np.ndarray
    ended: float
    params: dict[str, np.ndarray]

    def __post_init__(self) -> None:
        read_only(self)


@typing.final
class Runs:
    """Runs of a batch that finished, as figures of the library see them.

    Attributes:
        t: Times of samples, (m,), in [s].
        q, v, u: Position, velocity, actuation, (B, m, n), nan after the end of a run; None where not recorded.
        extremes: The least and the largest of q, v and u over all steps, (B, 3, 2, n).
        ended: Times at which they ended, (B,), in [s].
        known: Which samples each run has, (B, m).
        joint_names: Of the n joints.
    """

    def __init__(self, rollouts: Rollouts, places: np.ndarray) -> None:
        """Take the runs at these places of rollouts."""
        chosen = slice(None) if len(places) == len(rollouts) else places  # all of them are not copied

        def of(x: np.ndarray | None) -> np.ndarray | None:
            return None if x is None else x[chosen]

        assert rollouts.observed is not None
        self._rollouts, self._places = rollouts, places
        self.joint_names, self.t = rollouts.joint_names, rollouts.t
        self.q, self.v, self.u = of(rollouts.q), of(rollouts.v), of(rollouts.u)
        self.kinetic, self.potential = of(rollouts.kinetic), of(rollouts.potential)
        self.extremes, self.ended = rollouts.observed.extremes[chosen], rollouts.ended[chosen]
        self.known = self.t <= self.ended[:, None] if self.q is None else np.isfinite(self.q[:, :, 0])

    def __len__(self) -> int:
        return len(self.ended)

    def __iter__(self) -> Iterator[Run]:
        return map(self.run, range(len(self)))

    @cached_property
    def _references_vary(self) -> bool:
        controller = self._setup.controller
        names = {name.removeprefix("controller.") for name in (controller.references if controller else ())}
        return any(name.rpartition(".")[0] in names for name in self._rollouts.params)

    @property
    def _setup(self) -> Setup:
        assert self._rollouts.setup is not None
        return self._rollouts.setup

    def _setup_of(self, i: int) -> Setup:
        return self._rollouts.setup_of(int(self._places[i])) if self._references_vary else self._setup

    @cached_property
    def deviation(self) -> np.ndarray | None:
        """How far the joints, or the frame, are from the reference, (B, m, k); None without one, or without q."""
        if self.q is None:
            return None
        q = self.q if self.known.all() else np.where(self.known[..., None], self.q, 0.0)
        if not self._references_vary:
            return tracking_of(self._setup, self.t, q).deviation
        deviations = [tracking_of(self._setup_of(i), self.t, q[i]).deviation for i in range(len(self))]
        return None if deviations[0] is None else np.stack(deviations)  # pyright: ignore[reportArgumentType, reportCallIssue]

    def run(self, i: int) -> Run:
        """One of them."""
        runs, place, known = self._rollouts, self._places[i], self.known[i]

        def of(x: np.ndarray | None) -> np.ndarray | None:
            return None if x is None else np.ascontiguousarray(x[i][known])

        t, q = np.ascontiguousarray(self.t[known]), of(self.q)
        desired, _, deviation = (None,) * 3 if q is None else tracking_of(self._setup_of(i), t, q)
        starts = {name: x for name, x in (("q0", runs.q0), ("v0", runs.v0)) if x is not None}
        values = {name: x[place] for name, x in (starts | runs.params).items()}
        return Run(
            t, q, of(self.v), of(self.u), of(self.kinetic), of(self.potential), desired, deviation,
            self.extremes[i], float(self.ended[i]), values,
        )  # fmt: skip

    def only(self, i: int) -> Runs:
        """One of them as a batch."""
        return Runs(self._rollouts, self._places[i : i + 1])

    def of_joint(self, x: np.ndarray | None, joint: str | None) -> np.ndarray:
        """All joints of an array over joints, or one; SweepError if there is no such joint."""
        assert x is not None
        if joint is None:
            return x
        if joint not in self.joint_names or x.shape[-1] != len(self.joint_names):
            raise SweepError(f"joint: no joint {shown(joint)}; {nearest(str(joint), self.joint_names)}")
        k = self.joint_names.index(joint)
        return x[..., k : k + 1]


@typing.final
@dataclass(frozen=True)
class Figure(Value):
    """A number of each run, computed by the library.

    Attributes:
        name: "rms_error", "peak" or "final".
        of_what: "q", "v", "u" or "error".
        joint: Of one joint, or None for all.
    """

    name: str
    of_what: str
    joint: str | None = None

    def __post_init__(self) -> None:
        choice(self.name, self.of_what, (*_STATES, "error"), error=SweepError)
        if self.joint is not None and not isinstance(self.joint, str):
            raise SweepError(f"{self.name}: joint must be the name of one, got {shown(self.joint)}")

    @property
    def record(self) -> tuple[str, ...]:
        """What it needs recorded, of "q", "v", "u", "energy", "work"."""
        if self.of_what == "error":
            return ("q",)
        return ("q", self.of_what) if self.name == "final" else ()  # q shows where a run ends

    def unit(self, setup: Setup) -> str:
        """That of the numbers, empty where it is not known; "m" for the error of a frame that follows a path."""
        is_error, controller, dynamics = self.of_what == "error", setup.controller, setup.plant.dynamics
        if is_error and controller is not None and isinstance(controller.desired, CartesianReference):
            return "m"
        types = dict(zip(dynamics.joint_names, joint_types_of(dynamics), strict=True))
        of = types.values() if self.joint is None else [types.get(self.joint)]
        return joint_units("q" if is_error else self.of_what, of)

    def of(self, runs: Runs) -> np.ndarray:
        """The numbers of finished runs, (B,)."""
        if self.of_what != "error" and self.name == "peak":
            extremes = runs.extremes[:, _STATES.index(self.of_what)]
            return np.abs(runs.of_joint(extremes, self.joint)).max(axis=(1, 2))
        if self.of_what == "error" and runs.deviation is None:
            raise SweepError(
                f"{self.name}: there is no error, since no reference is followed; add a controller with one"
            )
        x = runs.of_joint(runs.deviation if self.of_what == "error" else getattr(runs, self.of_what), self.joint)
        if self.name == "peak":
            return np.abs(np.where(runs.known[..., None], x, 0.0)).max(axis=(1, 2))
        if self.name == "rms_error":
            return _root_mean_square(x, runs.known)
        last = x[np.arange(len(runs)), runs.known.sum(axis=1) - 1]
        if self.of_what != "error" and last.shape[1] > 1:
            names = ", ".join(runs.joint_names)
            raise SweepError(f"final({self.of_what!r}): of which joint? give joint=, one of {names}")
        return np.abs(last).max(axis=1) if self.of_what == "error" else last[:, 0]

    def to_dict(self) -> dict[str, Any]:
        """Its name and arguments, for JSON."""
        what = {} if self.name == "rms_error" else {"of_what": self.of_what}
        return {"figure": self.name} | what | {"joint": self.joint}

    def __str__(self) -> str:
        _, *arguments = self.to_dict().items()
        return f"{self.name}({', '.join(f'{key}={x!r}' for key, x in arguments if x is not None)})"


def _root_mean_square(x: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Of the known samples of each run, (B,), from x (B, m, k)."""
    total = np.zeros((len(x), x.shape[2]))
    for of_runs, sample in zip(known.T, x.swapaxes(0, 1), strict=True):
        total += sample * sample if of_runs.all() else np.where(of_runs[:, None], sample, 0.0) ** 2
    return np.sqrt(reduce(np.add, total.T) / (known.sum(axis=1) * x.shape[2]))


@typing.final
@dataclass(frozen=True)
class UserFigure(Value):
    """A function f(run) → float of a `Run`, by import path; methods as of `Figure`.

    Its attributes, if it has them: `record`, names of what is to be recorded, ("q", "v") otherwise; `unit`, a text.

    Attributes:
        path: Its import path.
        stated: In a folder that was read without naming the function, SHA-256 of its module and its unit.
    """

    path: str
    stated: tuple[str, str] | None = None

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
        """Return the names of what the function needs recorded."""
        names = getattr(self.function, "record", ("q", "v"))
        return tuple(choice(f"record of {self.path}", name, _RECORDS, error=SweepError) for name in names)

    def unit(self, setup: Setup | None = None) -> str:
        """Return the unit that the function states; empty if it states none."""
        return str(getattr(self.function, "unit", "")) if self.stated is None else self.stated[1]

    def of(self, runs: Runs) -> np.ndarray:
        """Return the numbers of finished runs, (B,); SweepError if the function returns no number."""
        values = list(map(self.function, runs))
        for value in values:
            if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
                raise SweepError(f"{self.path}: returned {shown(value)}; return a number, nan where a run has none")
        return np.array(values, float)

    def __str__(self) -> str:
        return self.path

    def to_dict(self) -> dict[str, Any]:
        """Return the import path, the SHA-256 of its module, and the unit."""
        digest = digest_of(self.path) if self.stated is None else self.stated[0]
        return {"figure": self.path, "sha256": digest, "unit": self.unit()}


def rms_error(joint: str | None = None) -> Figure:
    """Root mean square of q − q_d over the samples, which are a `record_period_s` apart, and the joints, or of one.

    In [rad] or [m]; of a frame that follows a path in [m].
    """
    return Figure("rms_error", "error", joint)


def peak(of_what: str, joint: str | None = None) -> Figure:
    """Largest absolute value of "q", "v" or "u" over all steps, or of "error" over the samples; of one joint or all."""
    return Figure("peak", of_what, joint)


def final(of_what: str, joint: str | None = None) -> Figure:
    """Last value of "q", "v" or "u" of a joint, or of the "error", the largest absolute one over the joints."""
    return Figure("final", of_what, joint)


FIGURES: Mapping[str, Callable[..., Figure]] = {each.__name__: each for each in (rms_error, peak, final)}


def figure(name: str, given: Any) -> Figure | UserFigure:
    """Return a figure as it is or as a text; of a function, or its import path, one that calls it.

    Raises:
        SweepError: If it is none of them.
    """
    if isinstance(given, Figure | UserFigure):
        return given
    try:
        if isinstance(given, str) and not is_import_path(given):
            return called("figure", given, FIGURES)
        user = UserFigure(path_of(given))
        imported(user.path)
    except SweepError as error:
        raise SweepError(f"figures: {name}: {error}") from None
    return user


def from_dict(stored: Mapping[str, Any], may_import: bool = False) -> Figure | UserFigure:
    """The figure of a dictionary that `to_dict` made; SweepError, KeyError or TypeError if it has another form.

    Args:
        stored: The dictionary.
        may_import: Whether a function may be imported, since the reader of the folder named it.
    """
    given = dict(stored)
    kind = given.pop("figure")
    if ":" in kind:
        return UserFigure(path_of(kind), None if may_import else (str(given["sha256"]), str(given["unit"])))
    return call_of("figure", kind, FIGURES, (), given)
