"""What figures are computed from: the finished runs of a batch, and one of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.foundations import Value, read_only
from robot_dyn.simulation import tracking_of

if TYPE_CHECKING:
    from robot_dyn import Rollouts, Trajectory


@final
@dataclass(frozen=True, eq=False)
class Run(Value):
    """One run, as figures see it: what was recorded of it, up to its end.

    Attributes:
        t: Times of its samples, (m,), in [s].
        q, v, u: Position, velocity, actuation, (m, n); None where not recorded.
        kinetic, potential: Energies, (m,), in [J]; None where not recorded.
        desired, deviation: As of `Trajectory`; None without a reference.
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


@final
class Runs:
    """Runs of a batch that finished, as batch forms of figures see them.

    Attributes:
        t: Times of samples, (m,), in [s].
        q, v, u: Position, velocity, actuation, (B, m, n), nan after the end of a run; None where not recorded.
        extremes: The least and the largest of q, v and u over all steps, (B, 3, 2, n).
        ended: Times at which they ended, (B,), in [s].
        known: Which samples each run has, (B, m).
        joint_names: Of the n joints.
    """

    def __init__(self, rollouts: Rollouts) -> None:
        self._rollouts = rollouts
        self.t, self.q, self.v, self.u = rollouts.t, rollouts.q, rollouts.v, rollouts.u
        assert rollouts.observed is not None
        self.extremes, self.ended = rollouts.observed.extremes, rollouts.ended
        self.joint_names = rollouts.joint_names
        self.known = rollouts.t <= rollouts.ended[:, None]
        if self.q is not None:
            self.known = np.isfinite(self.q[:, :, 0])

    def __len__(self) -> int:
        return len(self.ended)

    def __iter__(self) -> Iterator[Run]:
        return map(self.run, range(len(self)))

    @cached_property
    def _references_vary(self) -> bool:
        setup = self._rollouts.setup
        references = () if setup is None or setup.controller is None else setup.controller.references
        names = {each.removeprefix("controller.") for each in references}
        return any(name.rpartition(".")[0] in names for name in self._rollouts.params)

    @cached_property
    def deviation(self) -> np.ndarray | None:
        """How far the joints, or the frame, are from the reference, (B, m, k); None without one, or without q."""
        setup, runs = self._rollouts.setup, self._rollouts
        if setup is None or setup.controller is None or self.q is None:
            return None
        q = self.q if self.known.all() else np.where(self.known[..., None], self.q, 0.0)
        if not self._references_vary:
            return tracking_of(setup, self.t, q).deviation
        each = [tracking_of(runs.setup_of(i), self.t, q[i]).deviation for i in range(len(self))]
        return None if each[0] is None else np.stack(each)  # pyright: ignore[reportArgumentType, reportCallIssue]

    def run(self, i: int) -> Run:
        """One of them."""
        runs, known = self._rollouts, self.known[i]

        def of(x: np.ndarray | None) -> np.ndarray | None:
            return None if x is None else np.ascontiguousarray(x[i][known])

        t, q, setup = np.ascontiguousarray(self.t[known]), of(self.q), None
        if runs.setup is not None and runs.setup.controller is not None and q is not None:
            setup = runs.setup_of(i) if self._references_vary else runs.setup
        desired = deviation = None
        if setup is not None and q is not None:
            desired, _, deviation = tracking_of(setup, t, q)
        starts = {name: x[i] for name, x in (("q0", runs.q0), ("v0", runs.v0)) if x is not None}
        values = starts | {name: x[i] for name, x in runs.params.items()}
        return Run(
            t, q, of(self.v), of(self.u), of(runs.kinetic), of(runs.potential), desired, deviation,
            self.extremes[i], float(self.ended[i]), values,
        )  # fmt: skip

    def only(self, i: int) -> Runs:
        """One of them as a batch."""
        return Runs(taken(self._rollouts, np.array([i])))

    def trajectory(self, i: int) -> Trajectory:
        """One of them as a trajectory."""
        return self._rollouts[i]


def taken(result: Rollouts, runs: np.ndarray) -> Rollouts:
    """Some runs of rollouts, in any order."""

    def of(x: Any) -> Any:
        if isinstance(x, dict):
            return {name: each[runs] for name, each in x.items()}
        return None if x is None else x[runs]

    names = ("q", "v", "u", "kinetic", "potential", "work", "ended", "diverged", "stopped", "steps", "evaluations")
    more = {name: of(getattr(result, name)) for name in (*names, "params", "q0", "v0", "numbers", "observed")}
    return replace(result, **more, advice=tuple(result.advice[i] for i in runs), saved=None)
