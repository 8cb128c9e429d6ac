"""Figures: numbers of a run that a sweep keeps, f(run) → float, and the runs that they are computed from.

`rms_tracking_error`, `peak` and `final` are computed for a batch at once; your own functions are named by import path.
Sums add one term after the other, so that their bits do not depend on other runs in the batch.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np

from robot_dyn import Rollouts, Setup
from robot_dyn.control import CartesianReference
from robot_dyn.foundations import ReadOnly, SweepError, Value, choice, nearest, shown
from robot_dyn.queries import joint_types_of, joint_units
from robot_dyn.simulation import tracking_of
from robot_dyn.tools.sweeps.imported import digest_of, imported, is_import_path, path_of
from robot_dyn.tools.sweeps.texts import call_of, called

_STATES = ("q", "v", "u")  # in the order of `extremes`
_RECORDS = (*_STATES, "energy", "work")


@typing.final
@dataclass(frozen=True, eq=False)
class Run(ReadOnly):
    """The recorded data of one run, up to its end, for figures.

    Attributes:
        t: Times of the samples, (m,), in [s].
        q, v, u: Position, velocity, actuation, (m, n); None where not recorded.
        kinetic, potential: Energies, (m,), in [J]; None where not recorded.
        desired, tracking_error: Same as in `Trajectory`; None without a reference.
        extremes: Smallest and largest values of q, v and u over all steps, (3, 2, n).
        ended_s: Time at which the run ended, in [s].
        varied: Start, "q0" and "v0", and values of varying parameters, by name, (size,).
    """

    t: np.ndarray
    q: np.ndarray | None
    v: np.ndarray | None
    u: np.ndarray | None
    kinetic: np.ndarray | None
    potential: np.ndarray | None
    desired: np.ndarray | None
    tracking_error: np.ndarray | None
    extremes: np.ndarray
    ended_s: float
    varied: dict[str, np.ndarray]


@typing.final
class Runs:
    """The finished runs of a batch, for figures of the library.

    Attributes:
        t: Times of samples, (m,), in [s].
        q, v, u: Position, velocity, actuation, (B, m, n), nan after the end of a run; None where not recorded.
        extremes: Smallest and largest values of q, v and u over all steps, (B, 3, 2, n).
        ended_s: Times at which the runs ended, (B,), in [s].
        known: True for samples that a run has, (B, m).
        joint_names: Names of the n joints.
    """

    def __init__(self, rollouts: Rollouts, places: np.ndarray) -> None:
        """Select the runs at these places of rollouts."""
        chosen = slice(None) if len(places) == len(rollouts) else places  # avoids a copy of all runs

        def select(x: np.ndarray | None) -> np.ndarray | None:
            return None if x is None else x[chosen]

        assert rollouts.observed is not None
        self._rollouts, self._places = rollouts, places
        self.joint_names, self.t = rollouts.joint_names, rollouts.t
        self.q, self.v, self.u = select(rollouts.q), select(rollouts.v), select(rollouts.u)
        self.kinetic, self.potential = select(rollouts.kinetic), select(rollouts.potential)
        self.extremes, self.ended_s = rollouts.observed.extremes[chosen], rollouts.ended_s[chosen]
        self.known = self.t <= self.ended_s[:, None] if self.q is None else np.isfinite(self.q[:, :, 0])

    def __len__(self) -> int:
        return len(self.ended_s)

    def __iter__(self) -> Iterator[Run]:
        return map(self.run, range(len(self)))

    @cached_property
    def _references_vary(self) -> bool:
        controller = self._setup.controller
        names = {name.removeprefix("controller.") for name in (controller.references if controller else ())}
        return any(name.rpartition(".")[0] in names for name in self._rollouts.varied)

    @property
    def _setup(self) -> Setup:
        assert self._rollouts.setup is not None
        return self._rollouts.setup

    def _setup_of(self, i: int) -> Setup:
        return self._rollouts.setup_of(int(self._places[i])) if self._references_vary else self._setup

    @cached_property
    def tracking_error(self) -> np.ndarray | None:
        """Reference minus position of the joints, or of the frame, (B, m, k); None without a reference or q."""
        if self.q is None:
            return None
        q = self.q if self.known.all() else np.where(self.known[..., None], self.q, 0.0)
        if not self._references_vary:
            return tracking_of(self._setup, self.t, q).tracking_error
        errors = [tracking_of(self._setup_of(i), self.t, q[i]).tracking_error for i in range(len(self))]
        return None if errors[0] is None else np.stack(errors)  # pyright: ignore[reportArgumentType, reportCallIssue]

    def run(self, i: int) -> Run:
        """Return one run."""
        runs, place, known = self._rollouts, self._places[i], self.known[i]

        def select(x: np.ndarray | None) -> np.ndarray | None:
            return None if x is None else np.ascontiguousarray(x[i][known])

        t, q = np.ascontiguousarray(self.t[known]), select(self.q)
        desired, _, tracking_error = (None,) * 3 if q is None else tracking_of(self._setup_of(i), t, q)
        starts = {name: x for name, x in (("q0", runs.q0), ("v0", runs.v0)) if x is not None}
        values = {name: x[place] for name, x in (starts | runs.varied).items()}
        return Run(
            t=t,
            q=q,
            v=select(self.v),
            u=select(self.u),
            kinetic=select(self.kinetic),
            potential=select(self.potential),
            desired=desired,
            tracking_error=tracking_error,
            extremes=self.extremes[i],
            ended_s=float(self.ended_s[i]),
            varied=values,
        )

    def only(self, i: int) -> Runs:
        """Return one run as a batch."""
        return Runs(self._rollouts, self._places[i : i + 1])

    def of_joint(self, x: np.ndarray | None, joint: str | None) -> np.ndarray:
        """Return all joints of an array over joints, or one; raise a SweepError if the joint is unknown."""
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
        name: "rms_tracking_error", "peak" or "final".
        quantity: "q", "v", "u" or "tracking_error".
        joint: Name of a joint, or None for all joints.
    """

    name: str
    quantity: str
    joint: str | None = None

    def __post_init__(self) -> None:
        choice(self.name, self.quantity, (*_STATES, "tracking_error"), error=SweepError)
        if self.joint is not None and not isinstance(self.joint, str):
            raise SweepError(f"{self.name}: joint must be the name of a joint, got {shown(self.joint)}")

    @property
    def record(self) -> tuple[str, ...]:
        """Quantities to record, some of "q", "v", "u", "energy", "work"."""
        if self.quantity == "tracking_error":
            return ("q",)
        return ("q", self.quantity) if self.name == "final" else ()  # q shows where a run ends

    def unit(self, setup: Setup) -> str:
        """Return the unit of the numbers; empty if unknown, "m" for the error of a frame that follows a path."""
        is_error, controller, dynamics = self.quantity == "tracking_error", setup.controller, setup.plant.dynamics
        if is_error and controller is not None and isinstance(controller.desired, CartesianReference):
            return "m"
        types = dict(zip(dynamics.joint_names, joint_types_of(dynamics), strict=True))
        joint_types = types.values() if self.joint is None else [types.get(self.joint)]
        return joint_units("q" if is_error else self.quantity, joint_types)

    def values(self, runs: Runs) -> np.ndarray:
        """Compute the numbers of finished runs, (B,)."""
        if self.quantity != "tracking_error" and self.name == "peak":
            extremes = runs.extremes[:, _STATES.index(self.quantity)]
            return np.abs(runs.of_joint(extremes, self.joint)).max(axis=(1, 2))
        if self.quantity == "tracking_error" and runs.tracking_error is None:
            raise SweepError(
                f"{self.name}: there is no tracking error without a reference; add a controller with a reference"
            )
        x = runs.of_joint(
            runs.tracking_error if self.quantity == "tracking_error" else getattr(runs, self.quantity), self.joint
        )
        if self.name == "peak":
            return np.abs(np.where(runs.known[..., None], x, 0.0)).max(axis=(1, 2))
        if self.name == "rms_tracking_error":
            return _root_mean_square(x, runs.known)
        last = x[np.arange(len(runs)), runs.known.sum(axis=1) - 1]
        if self.quantity != "tracking_error" and last.shape[1] > 1:
            names = ", ".join(runs.joint_names)
            raise SweepError(f"final({self.quantity!r}) needs a joint; give joint=, one of {names}")
        return np.abs(last).max(axis=1) if self.quantity == "tracking_error" else last[:, 0]

    def to_dict(self) -> dict[str, object]:
        """Return name and arguments, for JSON."""
        quantity: dict[str, object] = {} if self.name == "rms_tracking_error" else {"quantity": self.quantity}
        return {"figure": self.name, **quantity, "joint": self.joint}

    def __str__(self) -> str:
        _, *arguments = self.to_dict().items()
        return f"{self.name}({', '.join(f'{key}={x!r}' for key, x in arguments if x is not None)})"


def _root_mean_square(x: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the root mean square over the known samples of each run, (B,), from x, (B, m, k)."""
    total = np.zeros((len(x), x.shape[2]))
    for has_sample, sample in zip(known.T, x.swapaxes(0, 1), strict=True):
        total += sample * sample if has_sample.all() else np.where(has_sample[:, None], sample, 0.0) ** 2
    return np.sqrt(reduce(np.add, total.T) / (known.sum(axis=1) * x.shape[2]))


@typing.final
@dataclass(frozen=True)
class UserFigure(Value):
    """A function f(run) → float of a `Run`, by import path; same methods as `Figure`.

    The function may have the attributes `record`, names of quantities to record, by default ("q", "v"), and `unit`.

    Attributes:
        path: Import path of the function.
        stated: SHA-256 of the module and unit, if a folder was read without naming the function; else None.
    """

    path: str
    stated: tuple[str, str] | None = None

    @property
    def function(self) -> Callable[..., object]:
        """The function; a SweepError if a folder names it, but its reader has not."""
        if self.stated is not None:
            raise SweepError(
                f"the folder names the function {self.path} as a figure, which is called only if you name it:"
                f" sw.read_sweep(folder, figures={{NAME: {self.path!r}}}), or --figure NAME={self.path}"
            )
        return imported(self.path)

    @property
    def record(self) -> tuple[str, ...]:
        """Quantities to record."""
        names = getattr(self.function, "record", ("q", "v"))
        return tuple(choice(f"record of {self.path}", name, _RECORDS, error=SweepError) for name in names)

    def unit(self, setup: Setup | None = None) -> str:
        """Return the unit that the function states; empty if it states none."""
        return str(getattr(self.function, "unit", "")) if self.stated is None else self.stated[1]

    def values(self, runs: Runs) -> np.ndarray:
        """Compute the numbers of finished runs, (B,); raise a SweepError if the function does not return a number."""
        values = list(map(self.function, runs))
        for value in values:
            if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
                raise SweepError(f"{self.path}: returned {shown(value)}; return a number, or nan")
        return np.array(values, float)

    def __str__(self) -> str:
        return self.path

    def to_dict(self) -> dict[str, object]:
        """Return the import path, the SHA-256 of its module, and the unit."""
        digest = digest_of(self.path) if self.stated is None else self.stated[0]
        return {"figure": self.path, "sha256": digest, "unit": self.unit()}


def rms_tracking_error(joint: str | None = None) -> Figure:
    """Return the figure: root mean square of q_d − q over the samples, and over the joints or for one.

    Samples are `record_every_s` apart. The unit is [rad] or [m]; for a frame that follows a path, [m].
    """
    return Figure("rms_tracking_error", "tracking_error", joint)


def peak(quantity: str, joint: str | None = None) -> Figure:
    """Return the figure: largest |q|, |v| or |u| over all steps, or largest tracking error over the samples.

    It is of one joint, or of all joints by default.
    """
    return Figure("peak", quantity, joint)


def final(quantity: str, joint: str | None = None) -> Figure:
    """Return the figure: last "q", "v" or "u" of a joint, or largest absolute last "tracking_error" over the joints."""
    return Figure("final", quantity, joint)


FIGURES: Mapping[str, Callable[..., Figure]] = {
    function.__name__: function for function in (rms_tracking_error, peak, final)
}


def figure(name: str, value: object) -> Figure | UserFigure:
    """Return a figure from a figure, its text, a function, or the import path of a function.

    Raises:
        SweepError: If the value is none of these.
    """
    if isinstance(value, Figure | UserFigure):
        return value
    try:
        if isinstance(value, str) and not is_import_path(value):
            return called("figure", value, FIGURES)
        user = UserFigure(path_of(value))
        imported(user.path)
    except SweepError as error:
        raise SweepError(f"figures: {name}: {error}") from None
    return user


def from_dict(stored: Mapping[str, object], may_import: bool = False) -> Figure | UserFigure:
    """Return the figure of a dictionary from `to_dict`; raise SweepError, KeyError or TypeError for other forms.

    Args:
        stored: The dictionary.
        may_import: True if a function may be imported, because the reader of the folder named it.
    """
    arguments = dict(stored)
    kind = str(arguments.pop("figure"))
    if ":" in kind:
        return UserFigure(path_of(kind), None if may_import else (str(arguments["sha256"]), str(arguments["unit"])))
    return call_of("figure", kind, FIGURES, (), arguments)
