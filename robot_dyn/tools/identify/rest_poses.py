"""Parameters from poses at rest: gravity, torque offsets and the tilt of the mounting.

    τ = Y(q; g') π + τ₀ + f + e,   |f| ≤ F,   g' = exp(−φ̂) g

Dry friction f at rest is any torque up to F. The mean over arrivals from both sides cancels it, and least squares then
have a standard error. From one side, only the bound is known: the parameters lie in a set, whose ends are linear
programs. [Gautier, Khalil 1990; Milanese, Vicino 1991]
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import ModelWarning, Robot
from robot_dyn.foundations import Answer, Block, QueryError, Table, Value, instance, numbers, read_only, truth
from robot_dyn.tools.identify.base_parameters import BaseParameters, base_parameters

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

LEVEL = 0.95
_SAME = 1e-3  # [rad] or [m]: largest difference of positions that count as one pose
_SIGMAS = 3.0  # of the noise, in the bound of a row
_PASSES = 4  # Gauss–Newton steps: the tilt multiplies the parameters
_WIDER = 1.2  # on the widths in the bound of the product of tilt and parameters
_NOISE = 1e-9, 1e9  # [N m] or [N]: squares and ratios do not overflow
_STEP = 1e-5  # [rad], of central differences: error 1e-10
_ZERO = 1e-9


class Kind(StrEnum):
    """INTERVAL: of 95 % confidence. SET: of all values within the friction bound, without a probability."""

    INTERVAL = "95 % interval"
    SET = "set"


@final
@dataclass(frozen=True, eq=False)
class Poses(Value):
    """Poses of an arm at rest.

    Attributes:
        q: Positions, (k, n), in [rad] or [m].
        tau: Torques of the motors, (k, n), in [N m] or [N].
        approach: Sign of the last velocity of each joint before it rested, (k, n): 1, −1, or 0 if it is unknown.
    """

    q: np.ndarray
    tau: np.ndarray
    approach: np.ndarray = field(default_factory=lambda: np.zeros(()))

    def __post_init__(self) -> None:
        q = numbers("q", self.q, ("k", "n"))
        approach = numbers("approach", self.approach, (), q.shape)
        if not np.isin(approach, (-1, 0, 1)).all():
            raise QueryError("approach must be 1, -1 or 0 for each joint, the sign of its last velocity")
        for name, x in (("q", q), ("tau", numbers("tau", self.tau, q.shape)), ("approach", approach + 0 * q)):
            object.__setattr__(self, name, x)
        read_only(self)


@final
@dataclass(frozen=True, eq=False, repr=False)
class StaticEstimate(Answer, Value):
    """Gravity parameters, torque offsets and tilt, from poses at rest.

    Attributes:
        arm: Name of the arm.
        kind: Meaning of `lower` and `upper`: a 95 % interval, or a set.
        parameters: Names: base parameters of gravity, "… offset" in [N m] or [N], "tilt about …" in [rad].
        values: Estimates; of a set, its middle.
        lower, upper: Ends of the intervals or sets; infinite for parameters that the poses do not determine.
        stated: Values of the arm's file, with offsets and tilt 0.
        two_sided: Fraction of the rows, one for each pose and joint, that were approached from both sides.
        friction: Largest half difference between both sides, (n,), in [N m] or [N]; nan without such rows.
    """

    arm: str
    kind: Kind
    parameters: tuple[str, ...]
    values: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    stated: np.ndarray
    two_sided: float
    friction: np.ndarray

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def differing(self) -> tuple[str, ...]:
        """Parameters whose value in the file lies outside the interval or set."""
        outside = (self.stated < self.lower) | (self.stated > self.upper)
        return tuple(name for name, out in zip(self.parameters, outside, strict=True) if out)

    @property
    def blind(self) -> tuple[str, ...]:
        """Parameters that the poses do not determine."""
        open_ended = ~(np.isfinite(self.lower) & np.isfinite(self.upper))
        return tuple(name for name, is_open in zip(self.parameters, open_ended, strict=True) if is_open)

    def blocks(self) -> Iterator[Block]:
        yield f"{self.arm}: parameters from poses at rest, {self.two_sided:.0%} approached from both sides"
        if self.kind is Kind.SET:
            yield "friction is known by its bound only: approach each pose from both sides for narrower intervals"
        heading = "parameter", "estimate", "from", "to", "file"
        columns = self.parameters, self.values, self.lower, self.upper, self.stated
        yield Table(heading, tuple(zip(*columns, strict=True)), digits=4)
        if self.blind:
            yield f"not determined by these poses: {', '.join(self.blind)}"


def static(
    arm: Robot, poses: Poses, *, friction: ArrayLike | None = None, noise: ArrayLike | None = None, tilt: bool = True
) -> StaticEstimate:
    """Estimate gravity parameters, torque offsets and the tilt of the mounting from poses at rest.

    If approaches from both sides determine the parameters, their means are fitted and the result is an interval of
    95 %. Otherwise all poses are used, and the result is the set of all parameters with friction up to its bound.

    Args:
        arm: The robot with the numbers of its file, mounted as stated.
        poses: Poses at rest. Rows with equal positions and opposite `approach` of a joint are two sides of one pose.
        friction: Largest torque of static friction, a number or (n,), in [N m] or [N]; by default that of the file.
        noise: Standard deviation of a measured torque, a number or (n,); by default from the residuals of the means.
        tilt: True to estimate small rotations of the base about two of its axes.

    Raises:
        QueryError: If a shape is wrong, the friction bound is unknown and needed, or no parameters are within it.

    Source: Milanese and Vicino, Optimal estimation theory for dynamic systems with set membership uncertainty, 1991.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')")
    instance("poses", poses, Poses, "give rd.tools.identify.Poses(q, tau, approach)")
    if poses.q.shape[1] != arm.n:
        raise QueryError(f"poses have {poses.q.shape[1]} joints, {arm.name} has {arm.n}; give q in its order")
    sigma = None if noise is None else np.broadcast_to(numbers("noise", noise, (), (arm.n,), above=0), arm.n)
    if sigma is not None and not ((sigma >= _NOISE[0]) & (sigma <= _NOISE[1])).all():
        raise QueryError(f"noise must be from {_NOISE[0]:g} to {_NOISE[1]:g}, got {sigma.tolist()}")
    bound = numbers("friction", arm.friction if friction is None else friction, (), (arm.n,), least=0)
    model = Gravity(arm, base_parameters(arm, at_rest=True), truth("tilt", tilt))
    rows = _rows(model, poses, np.broadcast_to(bound, arm.n))
    both = rows.only(rows.is_two_sided)
    kind = Kind.INTERVAL if both.rank(model) == rows.rank(model) else Kind.SET
    if kind is Kind.INTERVAL:
        values, lower, upper = _interval(model, both, sigma)
    else:
        if friction is None and (lacking := [name for name, f in zip(arm.joint_names, bound, strict=True) if not f]):
            raise QueryError(
                f"poses are approached from one side, and the static friction of {lacking[0]!r} is unknown; give"
                " friction=, or approach each pose from both sides"
            )
        values, lower, upper = _set(model, rows, np.zeros(arm.n) if sigma is None else sigma)
    return StaticEstimate(
        *(arm.name, kind, model.parameters, values, lower, upper, model.stated),
        *(float(rows.is_two_sided.mean()), rows.friction),
    )


@final
@dataclass(frozen=True, eq=False)
class Rows(Value):
    """Torques at rest, one row for each pose and joint.

    Attributes:
        Y: Regressor for gravity 1 m/s² along x, y and z, (m, 3, 10 N).
        joint: Index of the joint, (m,).
        tau: Torque, (m,).
        bound: Bound of the friction in it, (m,); 0 for a mean over both sides.
        half_difference: Half of the difference of both sides, (m,); nan for one side.
    """

    Y: np.ndarray
    joint: np.ndarray
    tau: np.ndarray
    bound: np.ndarray
    half_difference: np.ndarray

    @property
    def is_two_sided(self) -> np.ndarray:
        """True for means over both sides, (m,)."""
        return ~np.isnan(self.half_difference)

    @property
    def friction(self) -> np.ndarray:
        """Largest half difference of each joint, (n,); nan without two-sided rows."""
        by_joint = [self.half_difference[self.is_two_sided & (self.joint == j)] for j in range(self.joint.max() + 1)]
        return np.array([x.max() if len(x) else np.nan for x in by_joint])

    def only(self, used: np.ndarray) -> Rows:
        """Return some of the rows."""
        columns = self.Y, self.joint, self.tau, self.bound, self.half_difference
        return Rows(*(x[used] for x in columns))

    def rank(self, model: Gravity) -> int:
        """Return the number of parameters that the rows determine at the file's values."""
        W = model.slope(self, model.stated)
        return int(np.linalg.matrix_rank(W / model.scale, tol=_ZERO * len(W))) if len(W) else 0


def _rows(model: Gravity, poses: Poses, bound: np.ndarray) -> Rows:
    """Return one row for each distinct pose and joint: means over both sides if there are two."""
    rows, rest = [], list(range(len(poses.q)))
    while rest:
        same = [k for k in rest if np.abs(poses.q[k] - poses.q[rest[0]]).max() <= _SAME]
        rest = [k for k in rest if k not in same]
        for j, Y in enumerate(model.by_axis(poses.q[same].mean(axis=0))):
            tau, side = poses.tau[same, j], poses.approach[same, j]
            if (side > 0).any() and (side < 0).any():
                up, down = tau[side > 0].mean(), tau[side < 0].mean()
                rows.append((Y, j, (up + down) / 2, 0.0, abs(up - down) / 2))
            else:
                rows.append((Y, j, tau.mean(), bound[j], np.nan))
    return Rows(*(np.array(x) for x in zip(*rows, strict=True)))


@final
@dataclass(frozen=True, eq=False)
class Gravity(Value):
    """The torque at rest as a function of x = (π, τ₀, φ)."""

    arm: Robot
    base: BaseParameters
    tilt: bool

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes of the base about which a rotation turns gravity."""
        along = int(np.argmax(np.abs(self.arm.gravity)))
        return tuple(k for k in range(3) if k != along) if self.tilt and self.arm.gravity.any() else ()

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of x."""
        offsets = (f"{name} offset" for name in self.arm.joint_names)
        return (*self.base.names, *offsets, *(f"tilt about {'xyz'[k]}" for k in self.axes))

    @cached_property
    def stated(self) -> np.ndarray:
        """The file's x."""
        return np.concatenate([self.base.R @ self.arm.inertial_parameters, np.zeros(self.arm.n + len(self.axes))])

    @cached_property
    def scale(self) -> np.ndarray:
        """Typical size of a column."""
        g = max(float(np.linalg.norm(self.arm.gravity)), 1.0)
        return np.concatenate([np.full(len(self.base.columns), g), np.ones(self.arm.n), np.full(len(self.axes), g)])

    @cached_property
    def _units(self) -> list[Robot]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)  # gravity along one axis may turn no joint
            return [self.arm.with_(gravity=axis) for axis in np.eye(3)]

    def by_axis(self, q: np.ndarray) -> np.ndarray:
        """Return the regressor at rest for gravity 1 m/s² along x, y and z, (n, 3, 10 N)."""
        return np.stack([unit.regressor(q, 0 * q, 0 * q) for unit in self._units], axis=1)

    def _gravity(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return g' and its derivatives by the tilt, (3,) and (tilts, 3)."""
        from scipy.spatial.transform import Rotation

        axes, g, tilt = list(self.axes), np.array(self.arm.gravity), np.zeros(3)
        tilt[axes] = x[len(x) - len(axes) :]
        above, below = (
            Rotation.from_rotvec(-(tilt + step)).apply(g)[axes] for step in (_STEP * np.eye(3), -_STEP * np.eye(3))
        )
        return Rotation.from_rotvec(-tilt).apply(g), (above - below) / (2 * _STEP)

    def theta(self, x: np.ndarray) -> np.ndarray:
        """Return inertial parameters with these base parameters; what torques do not show is the file's."""
        r, theta = len(self.base.columns), np.array(self.arm.inertial_parameters)
        theta[self.base.columns] += (x - self.stated)[:r]
        return theta

    def torque(self, rows: Rows, x: np.ndarray) -> np.ndarray:
        """Return the torques of the rows without friction, (m,)."""
        r = len(self.base.columns)
        return np.einsum("i,mik,k->m", self._gravity(x)[0], rows.Y, self.theta(x)) + x[r:][rows.joint]

    def slope(self, rows: Rows, x: np.ndarray) -> np.ndarray:
        """Return the derivative of the torque by x, (m, p)."""
        g, by_tilt = self._gravity(x)
        offsets = (rows.joint[:, None] == np.arange(self.arm.n)).astype(float)
        tilts = np.einsum("ti,mik,k->mt", by_tilt, rows.Y, self.theta(x))
        return np.hstack([np.einsum("i,mik->mk", g, rows.Y)[:, self.base.columns], offsets, tilts])

    def second_order(self, rows: Rows, widths: np.ndarray) -> np.ndarray:
        """Return a bound of the product of changes of tilt and parameters up to `widths`, (m,)."""
        r, t = len(self.base.columns), len(self.axes)
        change = np.abs(self._gravity(self.stated)[1]).T @ widths[len(widths) - t :]
        return np.einsum("i,mik,k->m", change, np.abs(rows.Y[..., self.base.columns]), widths[:r])


def _fitted(model: Gravity, rows: Rows, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return weighted least squares near the file's x, the residuals, and the pseudoinverse of the scaled rows."""
    x, inverse = model.stated, np.zeros(0)
    for _ in range(_PASSES):
        W = model.slope(rows, x) / model.scale * weights[:, None]
        inverse = np.linalg.pinv(W, rcond=_ZERO)
        x = x + inverse @ (weights * (rows.tau - model.torque(rows, x))) / model.scale
    return x, rows.tau - model.torque(rows, x), inverse


def _interval(model: Gravity, rows: Rows, sigma: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return estimates and 95 % intervals from means over both sides, whose variance is half that of a torque."""
    from scipy import stats

    n, rank = model.arm.n, rows.rank(model)
    free = len(rows.tau) - rank
    if sigma is None:
        if free < 1:
            raise QueryError(
                f"{len(rows.tau)} rows for {rank} parameters leave none for the noise; give noise=, or more poses"
            )
        residuals = _fitted(model, rows, np.ones(len(rows.tau)))[1]
        by_joint = [
            np.sqrt(np.mean(residuals[rows.joint == j] ** 2)) if (rows.joint == j).any() else 1.0 for j in range(n)
        ]
        spread = np.maximum(np.array(by_joint), _ZERO + 1e-3 * max(by_joint))
    else:
        spread = sigma / np.sqrt(2)
    weights = 1 / spread[rows.joint]
    x, residuals, inverse = _fitted(model, rows, weights)
    variance = 1.0 if sigma is not None else float(np.sum((weights * residuals) ** 2)) / free
    quantile = stats.norm.ppf((1 + LEVEL) / 2) if sigma is not None else stats.t.ppf((1 + LEVEL) / 2, free)
    width = quantile * np.sqrt(variance * np.sum(inverse**2, axis=1)) / model.scale
    W = model.slope(rows, x) / model.scale * weights[:, None]
    is_blind = np.abs(np.eye(len(x)) - inverse @ W).max(axis=0) > np.sqrt(_ZERO)
    width[is_blind] = np.inf
    return x, x - width, x + width


def _set(model: Gravity, rows: Rows, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the middle and the ends of the set of parameters with friction and 3 σ of noise within their bounds."""
    x, residuals, _ = _fitted(model, rows, np.ones(len(rows.tau)))
    bound = rows.bound + _SIGMAS * sigma[rows.joint]
    W = model.slope(rows, x) / model.scale
    ends = _extremes(W, residuals, bound)
    if model.axes and np.isfinite(ends).all():
        widths = _WIDER * np.abs(ends).max(axis=0) / model.scale
        ends = _extremes(W, residuals, bound + model.second_order(rows, widths))
    lower, upper = x + ends / model.scale
    with np.errstate(invalid="ignore"):
        middle = np.where(np.isfinite(lower + upper), (lower + upper) / 2, x)
    return middle, lower, upper


def _extremes(W: np.ndarray, residuals: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Return the least and the greatest of each component of d with |r − W d| ≤ bound, (2, p)."""
    from scipy.optimize import linprog

    p = W.shape[1]
    A, b = np.vstack([W, -W]), np.concatenate([bound + residuals, bound - residuals])
    options = {"bounds": (None, None), "method": "highs"}
    column = np.tile(bound, 2)[:, None]  # of s in |r − W d| ≤ s bound
    scaled = linprog(np.eye(p + 1)[p], A_ub=np.hstack([A, -column]), b_ub=b - column[:, 0], **options)
    if scaled.status != 0 or scaled.fun > 1 + _ZERO:
        factor = f"it must be {scaled.fun:.3g} times as large" if scaled.status == 0 else "give noise= too"
        raise QueryError(f"no parameters explain the poses with this friction: {factor}")
    ends = [[linprog(sign * e, A_ub=A, b_ub=b, **options) for e in np.eye(p)] for sign in (1.0, -1.0)]
    return np.array(
        [[sign * (x.fun if x.status == 0 else -np.inf) for x in row] for sign, row in zip((1, -1), ends, strict=True)]
    )
