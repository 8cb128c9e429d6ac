"""Discrimination: the poses or the motion that tell rival causes of a difference apart.

    Δ_ij = min_z ‖Σ^(−1/2) (C_i x_i − [C_j, F] z)‖²/ĉ + (k_j − k_i) log N

is the difference in BIC to expect if cause i, with its estimate x_i, is the true one and cause j is fitted instead. F
is unknown friction. Of random poses and motions within the limits, those with the largest Σ log(1 + min(Δ_ij, Δ_ji))
are proposed. Torques of joints cannot separate a pair whose columns are equal in all of them.
[Atkinson, Fedorov 1975: T-optimality]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.control import PiecewisePolynomial, Plan
from robot_dyn.foundations import UNREPORTED, PlanError, Value, read_only
from robot_dyn.tools.identify.excitation import State, problem_of, saved

if TYPE_CHECKING:
    Rivals = Callable[[State, float], tuple[np.ndarray, Sequence[np.ndarray]]]

DECISIVE = 6.0  # difference in BIC, as in the verdict
_DURATION_S, _ROW_S = 20.0, 0.05  # of the motion, and the time between independent rows
_TRIALS, _POSES = 60, 8
_RATE_HZ = 100.0  # of a saved motion
_MOST = 5  # rivals that are compared


@final
@dataclass(frozen=True, eq=False)
class Experiment(Value):
    """Poses and a motion that tell rival causes apart.

    Attributes:
        pairs: Names of the rivals, two by two.
        by_poses: Difference in BIC of each pair to expect from the poses, (k,).
        by_motion: The same from the motion, (k,).
        poses: Poses at rest, (8, n), in [rad] or [m]; approach each from both sides.
        plan: A motion of 20 s within 90 % of the limits of the file.
    """

    pairs: tuple[tuple[str, str], ...]
    by_poses: np.ndarray
    by_motion: np.ndarray
    poses: np.ndarray
    plan: Plan = field(metadata=UNREPORTED)

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def reference(self) -> PiecewisePolynomial:
        """The motion q(t)."""
        return self.plan.reference

    def save(self, path: str | Path) -> Path:
        """Save t, q, v and a of the motion as CSV with 100 rows per second; return the path.

        Raises:
            PlanError: If the suffix is not .csv, or the file cannot be written.
        """
        return saved(self.plan, path, _RATE_HZ)

    @property
    def undecided(self) -> tuple[tuple[str, str], ...]:
        """Pairs that neither the poses nor the motion tell apart."""
        best = np.maximum(self.by_poses, self.by_motion)
        return tuple(pair for pair, x in zip(self.pairs, best, strict=True) if x < DECISIVE)

    @property
    def text(self) -> str:
        """The proposal in a sentence."""
        same = "; ".join(" and ".join(pair) for pair in self.undecided)
        rest = f"neither poses nor motions tell apart: {same}; weigh or measure the parts" if same else ""
        if len(self.undecided) == len(self.pairs):
            return rest
        seen = np.maximum(self.by_poses, self.by_motion) >= DECISIVE
        ways = {"a log of the motion verdict.experiment.reference": self.by_motion}
        ways[f"torques in the {len(self.poses)} poses at rest verdict.experiment.poses"] = self.by_poses
        enough = [way for way, x in ways.items() if (x[seen] >= DECISIVE).all()] or [" and ".join(ways)]
        return f"to decide: {', or '.join(enough)}{f'; {rest}' if rest else ''}"


def experiment_of(
    arm: Robot, estimates: Mapping[str, np.ndarray], rivals: Rivals, noise: np.ndarray
) -> Experiment | None:
    """Return the poses and the motion that tell causes apart; None if the arm cannot rest within its limits.

    Args:
        arm: The arm of the file.
        estimates: Coefficients of each cause, by name.
        rivals: Function of a motion (q, v, a), each (m, n), and of the time between its rows. It returns the columns of
            unknown friction, (m, n, f), and of each cause, (m, n, k).
        noise: Standard deviation of a row of each joint, (n,), with what the best cause leaves unexplained.
    """
    names = list(estimates)[:_MOST]
    rng, problem = np.random.default_rng(0), problem_of(arm, _DURATION_S)
    t = np.arange(0.0, _DURATION_S, _ROW_S)

    def differences(state: State, step_s: float) -> np.ndarray:
        friction, columns = rivals(state, step_s)
        parts = [(C / noise[:, None]).reshape(state[0].size, C.shape[2]) for C in (friction, *columns[: len(names)])]
        x = [estimates[name] for name in names]
        pairs = combinations(range(len(names)), 2)
        return np.array([min(_expected(parts, x, i, j), _expected(parts, x, j, i)) for i, j in pairs])

    try:
        motions = [problem.reference(problem.random(rng)) for _ in range(_TRIALS)]
        at_rest = problem.poses(rng, _TRIALS * _POSES).reshape(_TRIALS, _POSES, -1)
    except PlanError:
        return None
    of_motions = [differences(motion.at(t), _ROW_S) for motion in motions]
    of_poses = [differences((q, 0 * q, 0 * q), np.inf) for q in at_rest]
    k, p = (int(np.argmax([np.log1p(np.maximum(x, 0.0)).sum() for x in all_])) for all_ in (of_motions, of_poses))
    method = f"best of {_TRIALS} random motions to tell causes apart"
    plan = Plan(arm.name, arm.joint_names, arm.joint_types, motions[k], method, {})
    return Experiment(tuple(combinations(names, 2)), of_poses[p], of_motions[k], at_rest[p], plan)


def _expected(parts: Sequence[np.ndarray], estimates: Sequence[np.ndarray], i: int, j: int) -> float:
    """Return Δ_ij; `parts` are the columns of friction, then those of the causes, in units of the noise."""
    y, A = parts[1 + i] @ estimates[i], np.hstack([parts[1 + j], parts[0]])
    sizes = np.linalg.norm(A, axis=0)
    A = A[:, sizes > 0] / sizes[sizes > 0]
    left = y - A @ np.linalg.lstsq(A, y, rcond=1e-9)[0]
    return float(left @ left + (parts[1 + j].shape[1] - parts[1 + i].shape[1]) * np.log(len(y)))
