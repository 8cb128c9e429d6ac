"""Excitation: the motion within limits that shows the most about the parameters of an arm.

    max log det A(x)   subject to   |q − q_mid| ≤ half range, |v|, |a|, |τ| ≤ limits, tool point in a box

over the coefficients x of a Fourier series of each joint, by an augmented Lagrangian with L-BFGS from several starts.
[Swevers, Ganseman, Tükel, De Schutter, Van Brussel 1997; Nocedal, Wright 2006, ch. 17]
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.control import PiecewisePolynomial, Plan, Samples
from robot_dyn.foundations import (
    Answer,
    Block,
    FileKind,
    PlanError,
    Table,
    Value,
    choice,
    instance,
    integer,
    numbers,
    save,
    target,
    truth,
)
from robot_dyn.queries import of_joint
from robot_dyn.tools.identify.base_parameters import base_parameters
from robot_dyn.tools.identify.fourier_series import FourierSeries
from robot_dyn.tools.identify.information import ExpectedPrecision, Information, gram

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    LimitsInput = Mapping[str, ArrayLike | Mapping[str, float]]

State = tuple[np.ndarray, np.ndarray, np.ndarray]

_QUANTITIES = "position", "velocity", "acceleration", "torque", "box"
LONGER_S = 10.0  # [s]: the additional time whose gain is reported
_BANDWIDTH_HZ = 0.5  # highest frequency of the series by default
_PER_PERIOD = 20  # rows and knots in the shortest period
_DRAWS = 50  # random series for each start
_PENALTIES, _STEPS = tuple(20.0 * 2.0**k for k in range(6)), 80
_CENTRES, _MIDDLE, _ROOM = 1000, 0.6, 0.9  # mean positions tried, their part of the range, their use of limits
_REDUCTIONS, _REDUCED = 200, 1.001
_NOISE = 0.01  # fraction of the torque limit
_SLOW = 0.05  # fraction of the velocity limit, or of 1 rad/s: below it, Coulomb friction is smooth
_RANGE = 1e-6, 1e6  # range of limits and noise: squares and ratios do not overflow
_TABLE = FileKind("a table of a motion", ".csv", b"t [s],q ")


@final
@dataclass(frozen=True, eq=False, repr=False)
class Excitation(Answer, Value):
    """A motion that excites the parameters of an arm; pass `reference` to a controller.

    Attributes:
        plan: The motion, from rest to rest, with its limits.
        expected: Precision of a log of the motion: log det, standard errors, weak parameters.
        longer: Precision of a motion planned for ten more seconds; None if it was not requested.
        random_log_det: log det of the best of the random series from which the starts were taken.
        blind: Inertial parameters that no motion shows.
        rate_hz: Rows of the log per second.
    """

    plan: Plan
    expected: ExpectedPrecision
    longer: ExpectedPrecision | None
    random_log_det: float
    blind: tuple[str, ...]
    rate_hz: float

    @property
    def reference(self) -> PiecewisePolynomial:
        """The motion q(t)."""
        return self.plan.reference

    @property
    def duration_s(self) -> float:
        """Duration of the motion, in [s]."""
        return self.plan.duration_s

    def save(self, path: str | Path) -> Path:
        """Save t, q, v and a as CSV with `rate_hz` rows per second; return the path.

        `rd.control.from_samples(arm, path, ends="measured")` and the scene's reference kind = "samples" read the file.

        Raises:
            PlanError: If the suffix is not .csv, or the file cannot be written.
        """
        return saved(self.plan, path, self.rate_hz)

    def blocks(self) -> Iterator[Block]:
        yield from self.plan.blocks()
        name, error = self.expected.worst
        yield f"log det {self.expected.log_det:.1f}, best random series {self.random_log_det:.1f}"
        yield f"largest standard error of its size: {error:.2g}, {name}"
        if self.longer is not None:
            name, error = self.longer.worst
            yield f"{LONGER_S:g} s more: log det {self.longer.log_det:.1f}, largest standard error {error:.2g}, {name}"
        if weak := self.expected.weak:
            yield f"weak: {', '.join(weak)}"
        yield f"{len(self.blind)} parameters cannot be seen in any motion: {', '.join(self.blind)}"
        heading = "parameter", "standard error", "of its size"
        rows = zip(self.expected.parameters, self.expected.standard_errors, self.expected.relative, strict=True)
        yield Table(heading, tuple(rows), digits=3)


def excite(
    arm: Robot,
    duration_s: float = 20.0,
    *,
    limits: LimitsInput | None = None,
    box: ArrayLike | None = None,
    tool: str | None = None,
    fraction: float = 0.9,
    harmonics: int | None = None,
    noise: ArrayLike | None = None,
    rate_hz: float = 100.0,
    starts: int = 4,
    seed: int = 0,
    compare_longer: bool = True,
) -> Excitation:
    """Plan the motion within limits that shows the most about base parameters and friction.

    It maximises the log determinant of their information matrix and is the best of several starts; the result is a
    local maximum. Torques are computed without friction: leave room for friction in the torque limits.

    Args:
        arm: The robot; its parameters are used for the torque limits only.
        duration_s: Duration T, in [s].
        limits: Limits by "lower", "upper", "velocity", "acceleration" and "torque", each a number, (n,) or by joint; by
            default the limits of the robot's file. Joints without position limits stay within half a turn to each side.
        box: Lower and upper corner of the region for the origin of `tool`, (2, 3), in [m] in the base; by default none.
        tool: Name of the link or joint that stays in the box.
        fraction: Fraction of the limits that the motion may use.
        harmonics: Number of harmonics of 1/T; by default up to 0.5 Hz, at least 5.
        noise: Standard deviation of the measured torque in one row, a number or (n,), in [N m] or [N]; by default 1 %
            of the torque limits, or 1 without a limit.
        rate_hz: Rows of the log per second, with independent errors, in [Hz].
        starts: Number of starts: the best of 50 random series for each.
        seed: Seed of the random series; equal seeds return the same motion.
        compare_longer: True to plan a second motion with ten more seconds.

    Raises:
        PlanError: If a limit is unknown or not positive, the box has no tool, or no start lies within the limits.

    Source: Swevers et al., Optimal robot excitation and identification, 1997.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=PlanError)
    duration_s = float(_within("duration_s", duration_s, (1.0, 600.0)))
    usual = max(5, round(duration_s * _BANDWIDTH_HZ))
    harmonics = usual if harmonics is None else integer("harmonics", harmonics, least=2, most=500, error=PlanError)
    rate_hz = float(_within("rate_hz", rate_hz, (1.0, 1e4)))
    starts = integer("starts", starts, least=1, most=100, error=PlanError)
    seed = integer("seed", seed, most=2**63, error=PlanError)
    middle, half = _limits(arm, {} if limits is None else limits, float(_within("fraction", fraction, (0.01, 1.0))))
    _, velocity, acceleration, torque = np.split(half, 4)
    if noise is None:
        noise = np.where(np.isfinite(torque), _NOISE * torque / fraction, 1.0)
    sigma = np.broadcast_to(_within("noise", noise, _RANGE, (arm.n,)), arm.n)
    information = Information(arm, base_parameters(arm), sigma, _SLOW * np.where(velocity < np.inf, velocity, 1.0))
    frame, centre, edges = _box(arm, box, tool)
    bounds = np.append(middle, centre), np.append(half, edges)
    problem = Problem(information, FourierSeries(duration_s, harmonics), *bounds, frame)
    x, random = problem.best(starts, seed)
    longer = None
    if truth("compare_longer", compare_longer, error=PlanError):
        whole = duration_s + LONGER_S
        again = replace(problem, series=FourierSeries(whole, round(harmonics * whole / duration_s)))
        longer = again.expected(again.best(1, seed)[0], rate_hz)
    plan = Plan(
        *(arm.name, arm.joint_names, arm.joint_types, problem.reference(x)),
        f"excitation by {harmonics} harmonics of {1 / duration_s:g} Hz, best of {starts} starts",
        {"velocity": velocity, "acceleration": acceleration, "torque": torque},
    )
    best_random = problem.expected(random, rate_hz).log_det
    return Excitation(plan, problem.expected(x, rate_hz), longer, best_random, information.base.blind, rate_hz)


def saved(plan: Plan, path: str | Path, rate_hz: float) -> Path:
    """Save t, q, v and a of a plan as CSV and return the path; see `Excitation.save`."""
    path, stream = target(path, _TABLE, PlanError), io.StringIO()
    t = np.linspace(0.0, plan.duration_s, round(plan.duration_s * rate_hz) + 1)
    joints = list(zip(plan.joint_names, plan.joint_types, strict=True))
    units = {"q": "rad", "v": "rad/s", "a": "rad/s²"}
    heads = [f"{name} {joint} [{of_joint(unit, kind)}]" for name, unit in units.items() for joint, kind in joints]
    writer = csv.writer(stream)
    writer.writerow(["t [s]", *heads])
    writer.writerows(np.column_stack([t, *plan.reference.at(t)]).tolist())
    return save(path, lambda file: file.write(stream.getvalue().encode()), PlanError)


def problem_of(arm: Robot, duration_s: float) -> Problem:
    """Return the optimisation within 90 % of the limits of the arm's file, for unit noise."""
    information = Information(arm, base_parameters(arm), np.ones(arm.n), np.ones(arm.n))
    series = FourierSeries(duration_s, max(5, round(duration_s * _BANDWIDTH_HZ)))
    return Problem(information, series, *_limits(arm, {}, 0.9))


@final
@dataclass(frozen=True, eq=False)
class Problem:
    """The optimisation over the coefficients x, (size, n), of the series of all joints.

    Limits are |u − middle| ≤ half for each row u = (q, v, a, τ, p), (c,), p of the frame in the box, if there is one.

    Attributes:
        information: Information of motions of the arm.
        series: The series of one joint.
        middle, half: Limits, (c,).
        frame: Link or joint that stays in a box, or None.
    """

    information: Information
    series: FourierSeries
    middle: np.ndarray
    half: np.ndarray
    frame: str | None = None

    @cached_property
    def basis(self) -> State:
        """Φ, Φ' and Φ'' at 20 times in the shortest period."""
        return self._basis(_PER_PERIOD)

    @cached_property
    def fine_basis(self) -> State:
        """Φ, Φ' and Φ'' at 100 times in the shortest period, for the last check of the limits."""
        return self._basis(5 * _PER_PERIOD)

    def _basis(self, per_period: int) -> State:
        m = per_period * self.series.harmonics
        return self.series.basis((np.arange(m) + 0.5) * self.series.duration_s / m)

    def reference(self, x: np.ndarray) -> PiecewisePolynomial:
        """Return the motion through 20 knots in the shortest period, with velocities and accelerations."""
        t = np.linspace(0.0, self.series.duration_s, _PER_PERIOD * self.series.harmonics + 1)
        return Samples(t, *motion(x, self.series.basis(t)))

    def expected(self, x: np.ndarray, rate_hz: float) -> ExpectedPrecision:
        """Return the precision of a log of the motion."""
        t = (np.arange(round(rate_hz * self.series.duration_s)) + 0.5) / rate_hz
        return self.information.expected(*self.reference(x).at(t))

    def best(self, starts: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients of the best local maximum and of the best random series."""
        rng = np.random.default_rng(seed)
        draws = sorted((self.random(rng) for _ in range(starts * _DRAWS)), key=self.log_det, reverse=True)
        return max(map(self.optimised, draws[:starts]), key=self.log_det), draws[0]

    def log_det(self, x: np.ndarray) -> float:
        """Return log det of the information matrix."""
        sign, value = np.linalg.slogdet(gram(self.information.rows(*motion(x, self.basis))))
        return float(value) if sign > 0 else -np.inf

    def random(self, rng: np.random.Generator) -> np.ndarray:
        """Return a random series, as large as the limits allow, with mean positions within 60 % of the range."""
        n = self.information.arm.n
        x, centre = rng.normal(size=(self.series.size, n)), self.poses(rng, 1)[0]
        x[0] = 0.0
        largest = np.hstack([np.abs(part).max(axis=0) for part in motion(x, self.basis)])
        room = self.half[: 3 * n] - np.abs(np.append(centre, np.zeros(2 * n)) - self.middle[: 3 * n])
        x *= (room / largest).reshape(3, n).min(axis=0)
        x[0] = centre
        return self.within(x, self.basis)  # pyright: ignore[reportReturnType] # rest at the centre is within limits

    def poses(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Return random positions, (count, n), at which the arm can rest with room to move.

        Raises:
            PlanError: If none of 1000 is within the limits.
        """
        n = self.information.arm.n
        q = self.middle[:n] + rng.uniform(-_MIDDLE, _MIDDLE, (_CENTRES, n)) * self.half[:n]
        uses = np.abs(self.uses((q, 0 * q, 0 * q)))
        free = np.flatnonzero(uses.max(axis=1) <= _ROOM)
        if not len(free):
            tightest = int(uses.min(axis=0).argmax())
            raise PlanError(
                f"no motion was found within the limits: of {_CENTRES} poses none can rest with room to move; the"
                f" {_QUANTITIES[tightest // n]} limit is the tightest, used by {uses[:, tightest].min():.2g} at least;"
                " widen it"
            )
        return q[np.resize(free, count)]

    def within(self, x: np.ndarray, basis: State) -> np.ndarray | None:
        """Return the motion with its amplitude reduced until it is within all limits; None if that does not suffice."""
        for _ in range(_REDUCTIONS):
            use = float(np.abs(self.uses(motion(x, basis))).max())
            if use <= 1.0:
                return x
            x = np.concatenate([x[:1], x[1:] / (_REDUCED * use)])
        return None

    def optimised(self, x: np.ndarray) -> np.ndarray:
        """Return a local maximum from x, by L-BFGS on an augmented Lagrangian whose penalty doubles each round."""
        from scipy.optimize import minimize

        start, options = self.within(x, self.fine_basis), {"maxiter": _STEPS, "maxcor": 20}
        multipliers = np.zeros((2, len(self.basis[0]), len(self.half)))
        for penalty in _PENALTIES:
            args = multipliers, penalty
            x = minimize(self.lagrangian, x.ravel(), args, "L-BFGS-B", jac=True, options=options).x.reshape(x.shape)
            multipliers = _multipliers(self.uses(motion(x, self.basis)), *args)
        end = self.within(x, self.fine_basis)
        return max((y for y in (start, end) if y is not None), key=self.log_det)

    def lagrangian(self, flat: np.ndarray, multipliers: np.ndarray, penalty: float) -> tuple[float, np.ndarray]:
        """Return −log det A + Σ (μ² − λ²)/(2ρ), μ = max(0, λ + ρ c) for each limit c ≤ 0, and its derivative by x."""
        state = motion(flat.reshape(self.series.size, -1), self.basis)
        W = self.information.rows(*state)
        A = gram(W)
        sign, log_det = np.linalg.slogdet(A)
        if sign <= 0:
            return np.inf, np.zeros_like(flat)
        new = _multipliers(self.uses(state), multipliers, penalty)
        value = ((new**2).sum() - (multipliers**2).sum()) / (2 * penalty) - log_det
        n = self.information.arm.n
        *by_state, by_torque, by_place = np.split((new[0] - new[1]) / self.half, [n, 2 * n, 3 * n, 4 * n], axis=1)
        slopes = [x - y for x, y in zip(by_state, self.information.slope(state, W, A, -by_torque), strict=True)]
        if self.frame is not None:
            J = self.information.compiled.jacobian(state[0], self.frame)[:, :3]
            slopes[0] += np.einsum("mij,mi->mj", J, by_place)
        return float(value), np.ravel(sum(B.T @ slope for B, slope in zip(self.basis, slopes, strict=True)))

    def uses(self, state: State) -> np.ndarray:
        """Return the signed use of each limit, −1 to 1 within it, (m, c)."""
        limited = [*state, self.information.compiled.inverse_dynamics(*state)]
        if self.frame is not None:
            limited.append(self.information.compiled.placement(state[0], self.frame)[:, :3, 3])
        return (np.hstack(limited) - self.middle) / self.half


def motion(x: np.ndarray, basis: State) -> State:
    """Return q, v and a, each (m, n)."""
    position, velocity, acceleration = basis
    return position @ x, velocity @ x, acceleration @ x


def _multipliers(use: np.ndarray, old: np.ndarray, penalty: float) -> np.ndarray:
    """Return the multipliers of use ≤ 1 and −use ≤ 1, (2, ...)."""
    return np.maximum(0.0, old + penalty * (np.stack([use, -use]) - 1.0))


def _within(what: str, values: object, limits: tuple[float, float], *shapes: tuple[int, ...]) -> np.ndarray:
    """Return numbers, one or of a shape, that lie between two limits; raise a PlanError for others."""
    array = numbers(what, values, (), *shapes, infinite=limits[1] == np.inf, error=PlanError)
    if not ((limits[0] <= array) & (array <= limits[1])).all():
        raise PlanError(f"{what} must be from {limits[0]:g} to {limits[1]:g}, got {np.ravel(array).tolist()}")
    return array


def _limits(arm: Robot, limits: LimitsInput, fraction: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle and the half of the range of q, v, a and τ, (4 n,), times the fraction."""
    instance("limits", limits, Mapping, "give limits by kind, such as {'velocity': 1.0}", error=PlanError)
    stated = {
        "lower": np.where(np.isfinite(arm.lower), arm.lower, -np.pi),
        "upper": np.where(np.isfinite(arm.upper), arm.upper, np.pi),
        "velocity": np.where(arm.velocity_limit > 0, arm.velocity_limit, np.inf),
        "acceleration": np.full(arm.n, np.inf),
        "torque": np.where(arm.effort_limit > 0, arm.effort_limit, np.inf),
    }
    for kind, values in limits.items():
        choice("limit", kind, stated, error=PlanError)
        if isinstance(values, Mapping):
            for joint in values:
                choice("joint", joint, arm.joint_names, error=PlanError)
            values = [values.get(name, old) for name, old in zip(arm.joint_names, stated[kind], strict=True)]
        low = -_RANGE[1] if kind in ("lower", "upper") else _RANGE[0]
        stated[kind] = np.broadcast_to(_within(kind, values, (low, np.inf), (arm.n,)), arm.n)
    lower, upper, *others = stated.values()
    for name, size in zip(arm.joint_names, upper - lower, strict=True):
        if not _RANGE[0] < size / 2 < _RANGE[1]:
            raise PlanError(f"joint {name!r} has a range of {size:g}; give finite limits with lower below upper")
    middle = np.append((lower + upper) / 2, np.zeros(3 * arm.n))
    return middle, fraction * np.concatenate([(upper - lower) / 2, *others])


def _box(arm: Robot, box: ArrayLike | None, tool: str | None) -> tuple[str | None, np.ndarray, np.ndarray]:
    """Return the frame in the box, its middle and the half of its edges; None and empty arrays without a box."""
    if tool is not None:
        choice("tool", tool, arm.frame_names, error=PlanError)
    if box is None:
        return None, np.zeros(0), np.zeros(0)
    lower, upper = numbers("box", box, (2, 3), error=PlanError)
    if not (lower + _RANGE[0] < upper).all() or max(np.abs(lower).max(), np.abs(upper).max()) > _RANGE[1]:
        raise PlanError(f"box: the lower corner {lower.tolist()} must be below the upper one {upper.tolist()}")
    return choice("tool", tool, arm.frame_names, error=PlanError), (lower + upper) / 2, (upper - lower) / 2
