"""The verdict: ranked causes of the difference between an arm's file and a log.

    r = τ − Y θ_file,   S(cause) = min_x ‖W (r − C x)‖²,   BIC = S/ĉ + k log N,   ĉ = max(1, min S/N)

C are the derivatives of the torque by the cause. What the best cause leaves above the noise counts as noise (ĉ). Causes
whose BIC differs by less than 6 are not distinguished by the log and are named together.
[Schwarz 1978; Kass, Raftery 1995; Burnham, Anderson 2002]
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.foundations import Value, hat, read_only, reported
from robot_dyn.queries import of_joint
from robot_dyn.tools.identify.discrimination import Experiment, experiment_of
from robot_dyn.tools.identify.physical import Links

if TYPE_CHECKING:
    from robot_dyn.tools.identify.estimation import Estimate, Friction, Model
    from robot_dyn.tools.identify.excitation import State

    Columns = Callable[..., np.ndarray]

SEEN = 3.0  # rms of the residual of a joint, in units of its noise, from which a difference is seen
ALONE = 0.9  # part of the difference that a single cause explains
SAME = 6.0  # difference in BIC: "strong" evidence
_SMALL = 1e-5  # [rad] or [m]
_SHOWN = 4  # coefficients of a cause
_NOTHING = 1e-9  # [N m] per unit


@final
@dataclass(frozen=True, eq=False)
class Cause(Value):
    """A possible cause of the difference between file and log.

    Attributes:
        kind: "load", "mass", "centre of mass", "friction", "torque offset", "position offset", "mounting", "gain" or
            "time offset".
        where: Link or joint; empty for the whole arm.
        values: Estimates of its coefficients; of a load, mass and first moment.
        half_widths: Half widths of their 95 % intervals.
        unit: Unit of the coefficients.
        explained: Part of the difference that it explains, of what the whole model explains.
        bic: S/ĉ + k log N.
    """

    kind: str
    where: str
    values: np.ndarray
    half_widths: np.ndarray
    unit: str
    explained: float
    bic: float

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def name(self) -> str:
        """Kind and place."""
        return f"{self.kind} of {self.where}" if self.where else self.kind

    @property
    def text(self) -> str:
        """The cause with its values and intervals."""
        values = ", ".join(f"{x:+.3g} ± {w:.2g}" for x, w in zip(self.values, self.half_widths, strict=True))
        return f"{self.name}: {values} {self.unit}"


@final
@dataclass(frozen=True, eq=False)
class Verdict(Value):
    """Causes of the difference between file and log.

    Attributes:
        ratios: Rms of the residuals of the file in units of the noise, (n,).
        causes: All causes, the most probable first.
        experiment: Poses and a motion that would tell the first causes apart; None if there is one or none.
    """

    ratios: np.ndarray
    causes: tuple[Cause, ...]
    experiment: Experiment | None = None

    def __post_init__(self) -> None:
        read_only(self)

    @reported
    def seen(self) -> bool:
        """True if the residual of a joint is at least three times its noise; otherwise no cause can be seen."""
        return bool(np.nanmax(self.ratios) >= SEEN)

    @reported
    def has_single_cause(self) -> bool:
        """True if the first cause explains at least 90 % of the difference; otherwise there are several."""
        return self.seen and self.causes[0].explained >= ALONE

    @property
    def first(self) -> tuple[Cause, ...]:
        """The most probable cause, with those that the log cannot distinguish from it; empty if nothing is seen."""
        return tuple(x for x in self.causes if x.bic - self.causes[0].bic < SAME) if self.seen else ()


def verdict_of(model: Model, links: Links, found: Estimate, friction: Friction | None) -> Verdict:
    """Return the causes of the difference between the file and a log.

    Args:
        model: Model of the log.
        links: Links of the arm.
        found: Estimate of all parameters, which gives the noise.
        friction: The friction that the arm is supposed to have; None if it is fitted with each cause, which then cannot
            be friction.
    """
    signals, rows, n = found.signals, found.rows, model.arm.n
    arm, state = model.arm.with_(armature=0.0), found.state
    r, own = len(model.stated), np.zeros(len(rows.names))
    own[:r] = model.stated
    if friction is not None:
        own[r:-1] = friction.values
    shifted = rows.tau - rows.Y[..., -1] * found.fit.values[-1]  # back to the times of the log
    candidates, shown = [], {}
    for *name, columns in _candidates(arm, links, model, rows.Y, own, friction):
        C = columns(*state)
        C = (C if len(C) == len(rows.tau) else signals.second(C)).reshape(rows.tau.size, -1)
        seen = (np.abs(C).max(axis=0) > _NOTHING) | (name[0] == "load")  # whose first coefficient is its mass
        candidates.append((*name, C[:, seen]))
        shown[tuple(name[:2])] = seen
    y, used = (shifted - rows.Y @ own).ravel(), rows.used.reshape(-1)
    noise = _noise(
        y, np.column_stack([rows.Y.reshape(len(y), -1), *(C for *_, C in candidates)]), rows.used, found.fit.rms
    )
    w = used / np.broadcast_to(noise, rows.tau.shape).ravel()
    y = w * y
    nuisance = rows.Y[..., r : r + 2 * n].reshape(-1, 2 * n) * w[:, None] if friction is None else np.zeros((len(w), 0))
    count, full = int(used.sum()), float(used.sum())
    rest = y - _fitted(nuisance, y)[0]
    start = float(rest @ rest)
    ratios = np.sqrt((rest.reshape(-1, n) ** 2).sum(axis=0) / np.maximum(rows.used.sum(axis=0), 1))
    causes, estimates = [], {}
    for kind, where, unit, factor, columns in candidates:
        if not columns.shape[1]:  # for example gravity along the axes of all joints
            continue
        C = columns * w[:, None]
        fitted, x, covariance = _fitted(np.column_stack([C, nuisance]), y)
        k, chi2 = C.shape[1], float(((y - fitted) ** 2).sum())
        spread = 1.96 * np.sqrt(np.diag(covariance)[:k] * max(chi2 / count, 1.0))
        if kind == "load" and x[0] <= spread[0]:  # without mass, it stands for another cause
            continue
        part = (start - chi2) / max(start - full, 1e-300)
        estimates[kind, where] = x[:k]
        values, widths = (x[:k] * factor)[:_SHOWN], (spread * factor)[:_SHOWN]
        causes.append((chi2, k * np.log(count), partial(Cause, kind, where, values, widths, unit, part)))
    dispersion = max(1.0, min((chi2 for chi2, *_ in causes), default=0.0) / count)
    ranked = (cause(float(chi2 / dispersion + penalty)) for chi2, penalty, cause in causes)
    verdict = Verdict(ratios, tuple(sorted(ranked, key=lambda cause: cause.bic)))
    if len(verdict.first) < 2:
        return verdict

    def rivals(state: State, step_s: float) -> tuple[np.ndarray, list[np.ndarray]]:
        Y = model.columns(*state)
        Y = np.concatenate([Y, np.gradient(Y @ own[:-1], step_s, axis=0)[..., None]], axis=2)
        columns = {tuple(name[:2]): columns for *name, columns in _candidates(arm, links, model, Y, own, friction)}
        unknown = Y[..., r : r + 2 * n] if friction is None else Y[..., :0]
        return unknown, [columns[x.kind, x.where](*state)[..., shown[x.kind, x.where]] for x in verdict.first]

    named = {x.name: estimates[x.kind, x.where] for x in verdict.first}
    return replace(verdict, experiment=experiment_of(model.arm, named, rivals, noise * np.sqrt(dispersion)))


def _noise(y: np.ndarray, columns: np.ndarray, used: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return the rms of what the parameters and all causes together leave of y, (n,).

    The residual of the estimate alone contains causes that no parameters stand for, such as the mounting.
    """
    w = (used / scale).ravel()
    rest = (w * y - _fitted(columns * w[:, None], w * y)[0]).reshape(used.shape) * scale
    free = used.sum() - np.linalg.matrix_rank(columns * w[:, None])
    fraction = max(free / max(used.sum(), 1), 0.1)  # rows that columns do not fit away
    return np.sqrt((rest**2).sum(axis=0) / np.maximum(used.sum(axis=0) * fraction, 1e-300))


def _fitted(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A x, x and its covariance, by least squares."""
    if not A.shape[1]:
        return np.zeros_like(y), np.zeros(0), np.zeros((0, 0))
    scale = np.linalg.norm(A, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    U, s, V = np.linalg.svd(A / scale, full_matrices=False)
    inverse = np.where(s > 1e-9 * s[0], 1 / np.maximum(s, 1e-300), 0.0)
    x = V.T @ (inverse * (U.T @ y)) / scale
    return A @ x, x, (V.T * inverse**2) @ V / np.outer(scale, scale)


Candidate = tuple[str, str, str, float, "Columns"]


def _candidates(
    arm: Robot, links: Links, model: Model, Y: np.ndarray, own: np.ndarray, friction: Friction | None
) -> Iterator[Candidate]:
    """Yield kind, place, unit, factor of the unit and derivative columns of each cause."""
    base = model.base
    joints = list(enumerate(zip(arm.joint_names, arm.joint_types, strict=True)))
    zero = np.zeros(len(own))

    def by_parameters(directions: np.ndarray) -> Columns:
        full = np.zeros((len(own), len(directions)))
        full[: len(base.columns)] = base.R @ directions.T
        return lambda q, v, a: Y @ full

    def of_joint_alone(i: int, *columns: int) -> Columns:
        def alone(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
            result = np.zeros((*Y.shape[:2], len(columns)))
            result[:, i] = Y[:, i][:, list(columns)]
            return result

        return alone

    for b, name in enumerate(links.names):
        whole, m = np.zeros((3, links.theta.size)), links.theta[b, 0]
        place = slice(10 * b, 10 * b + 10)
        whole[0, place] = links.X[b] @ links.theta[b]
        yield "mass", name, "kg", m, by_parameters(whole[:1])
        for k in range(3):
            whole[k, place] = links.X[b] @ shifted_centre(links.theta[b], k)
        yield "centre of mass", name, "m", 1.0, by_parameters(whole)
    last = slice(links.theta.size - 10, links.theta.size)
    load = np.zeros((10, links.theta.size))
    load[:, last] = links.X[-1].T
    yield "load", links.names[-1], "kg, kg m", 1.0, by_parameters(load)
    c = len(base.columns) + len(model.rotors)
    n = arm.n
    for i, (joint, kind) in joints:
        yield "torque offset", joint, of_joint("N m", kind), 1.0, of_joint_alone(i, c + 2 * n + i)
        yield "position offset", joint, of_joint("rad", kind), 1.0, _position_offset(arm, model, i)
        if friction is not None:
            curve = [c + 3 * n + s for s, j in enumerate(model.stribeck) if i == j]
            yield "friction", joint, "N m s/rad, N m", 1.0, of_joint_alone(i, c + i, c + n + i, *curve)

        def gain(q: np.ndarray, v: np.ndarray, a: np.ndarray, i: int = i) -> np.ndarray:
            result = np.zeros((*Y.shape[:2], 1))
            result[:, i, 0] = Y[:, i] @ own
            return result

        yield "gain", joint, "%", 100.0, gain
    if friction is not None:
        both = np.stack([zero, zero], axis=1)
        both[c : c + n, 0], both[c + n : -1, 1] = own[c : c + n], own[c + n : -1]
        yield "friction", "", "%", 100.0, lambda q, v, a: Y @ both
    yield "mounting", "", "°", 180 / np.pi, _mounting(arm)
    yield "time offset", "", "ms", 1e3, lambda q, v, a: -Y[..., -1:]


def shifted_centre(theta: np.ndarray, k: int) -> np.ndarray:
    """Return the derivative of parameters (10,) by a shift of the centre of mass along axis k."""
    m, c = theta[0], theta[1:4] / theta[0]
    e = np.eye(3)[k]
    dI = m * (2 * (c @ e) * np.eye(3) - np.outer(c, e) - np.outer(e, c))
    return np.array([0.0, *(m * e), dI[0, 0], dI[0, 1], dI[1, 1], dI[0, 2], dI[1, 2], dI[2, 2]])


def _position_offset(arm: Robot, model: Model, i: int) -> Columns:
    def columns(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        h = _SMALL * np.eye(arm.n)[i]
        return ((arm.inverse_dynamics(q - h, v, a) - arm.inverse_dynamics(q + h, v, a)) / (2 * _SMALL))[..., None]

    return columns


def _mounting(arm: Robot) -> Columns:
    """Return the derivatives of gravity torques by rotations of the base about two axes orthogonal to gravity."""

    def columns(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        g = np.array(arm.gravity)
        across = np.linalg.svd(g[None])[2][1:]
        turned = [hat(axis) @ g for axis in across]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # gravity along the axes of all joints
            arms = [arm.with_(gravity=g) for g in turned]
        return np.stack([np.asarray(tilted.N(q)) for tilted in arms], axis=-1)

    return columns
