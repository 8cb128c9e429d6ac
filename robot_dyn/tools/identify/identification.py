"""Identify an arm from a log: estimate, physical parameters, held-out error, verdict, corrected URDF."""

from __future__ import annotations

import warnings
from collections.abc import Container, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn import Plant, Robot
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.effects import DryFriction, Effect, RegularisedCoulombFriction, ViscousFriction
from robot_dyn.foundations import instance, number, numbers
from robot_dyn.report import processor_and_versions
from robot_dyn.tools.identify.corrected import corrected
from robot_dyn.tools.identify.estimation import (
    COULOMB,
    LATEST_S,
    STRIBECK,
    VISCOUS,
    Estimate,
    Friction,
    Model,
    estimate,
    model_of,
)
from robot_dyn.tools.identify.log import Log, LogError, read_log, swapped
from robot_dyn.tools.identify.physical import Links, links_of, nearest_possible
from robot_dyn.tools.identify.regression import Fit, Rows, fit, rms
from robot_dyn.tools.identify.result import HeldOut, Identification, Parameter
from robot_dyn.tools.identify.signals import Signals
from robot_dyn.tools.identify.verdict import verdict_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

CUTOFF_HZ = 8.0
_SLOW = 0.05  # of the largest speed of a joint
_TRAINING = 0.75  # part of the log, at its start, that fits the numbers of the held-out error
_PERIODS = 10  # of the cutoff, in a log
_LEAST_ROWS = 20  # of a joint
_DEPENDENT = 1e-7  # least singular value of columns of unit length
_FOREIGN = 0.5  # held-out error, of the torque's deviation, of a log of another arm


def identify(
    arm: Robot,
    log: object,
    *,
    reference: PiecewisePolynomial | None = None,
    repeat: object = None,
    gains: ArrayLike | None = None,
    effects: Iterable[Effect] | str | None = None,
    cutoff_hz: float = CUTOFF_HZ,
    slow: ArrayLike | None = None,
) -> Identification:
    """Estimate the parameters of an arm, its friction and offsets from a log of its motion.

    Torques are linear in base parameters, rotor inertias, viscous and Coulomb friction, offsets and a time offset. They
    are estimated by weighted instrumental variables, without rows of a joint near rest. The instruments are the desired
    motion, or the positions of a second log.

    Args:
        arm: The arm of the file; joints that do not move are locked.
        log: CSV file, data frame, columns by heading, or `Trajectory`: "t", "q JOINT", "tau JOINT" or "current JOINT",
            and "desired JOINT" if known. In a dict, "t", "q", "tau", "current" and "desired" may be arrays (m, n).
        reference: The desired motion at the times of the log, if the log has no desired positions.
        repeat: A second log of the same motion, the source of instruments if there is no reference. Without both and
            without desired positions, they are smoothed positions, and intervals are less reliable.
        gains: Drive gains, a number or (n,), in [N m/A], if the log has currents.
        effects: Friction that the arm is supposed to have, `ViscousFriction`, `DryFriction` or
            `RegularisedCoulombFriction`, or "urdf" for that of the file; then wrong friction can be a cause in the
            verdict. With the Stribeck velocity of `DryFriction`, static friction is estimated too.
        cutoff_hz: Cutoff of the zero-phase filters of regressor and torque, in [Hz].
        slow: Speed below which rows of a joint are left out, a number or (n,), in [rad/s] or [m/s]; by default 5 % of
            the largest speed of the joint.

    Raises:
        LogError: If the log lacks positions or torques, a joint does not move, a torque is constant or saturated, two
            columns are swapped, torques are late or early by 20 ms, the motion does not determine the parameters, or
            the log is of another arm.
        PlanError: If times are missing, or angles look like degrees.
        MissingExtraError: If cvxpy or clarabel is not installed: pip install 'robot-dyn[identify]'.

    Source: Janot, Vandanjon, Gautier, A generic instrumental variable approach for industrial robot identification,
    2014; Wensing, Kim, Slotine 2018.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=LogError)
    links, friction = links_of(arm), _friction(arm, effects)
    record = read_log(arm, log, reference, gains, repeat)
    model, result = estimated(arm, record, cutoff_hz, slow, {} if friction is None else friction.stribeck)
    held_out = _held_out(model, result)
    _refuse_foreign(arm, result, held_out)
    _refuse_late(result)
    found, r = result.fit, len(model.base.columns)
    theta = nearest_possible(links, model.base.R, found.values[:r], found.covariance[:r, :r])
    parameters = tuple(_parameters(model, found))
    robot, text = _corrected(model, links, theta, found, parameters)
    determined, blind = _determined(model, found, links, theta)
    confounded = (joint for i, joint in enumerate(arm.joint_names) if i not in model.rotors)
    return Identification(
        arm=arm.name,
        parameters=parameters,
        determined=determined,
        blind=blind,
        confounded=tuple(f"rotor inertia of {joint} with {joint} Izz" for joint in confounded),
        time_offset_s=float(found.values[-1]),
        time_offset_half_width_s=float(found.half_widths[-1]),
        held_out=held_out,
        verdict=verdict_of(model, links, result, friction),
        instruments=record.instruments,
        cutoff_hz=cutoff_hz,
        environment=processor_and_versions(),
        robot=robot,
        urdf=text,
        file=arm,
    )


def estimated(
    arm: Robot, log: Log, cutoff_hz: float, slow: ArrayLike | None, stribeck: dict[int, float] | None = None
) -> tuple[Model, Estimate]:
    """Return the linear model of an arm and its estimate from a log; for arguments and errors see `identify`."""
    cutoff_hz = number("cutoff_hz", cutoff_hz, above=0, error=LogError)
    if not _PERIODS / np.ptp(log.t) <= cutoff_hz <= 0.5 / log.step_s:
        raise LogError(
            f"cutoff_hz must be from {_PERIODS / np.ptp(log.t):.3g} Hz, for {np.ptp(log.t):.4g} s, to"
            f" {0.5 / log.step_s:.4g} Hz, half the rate of the log; got {cutoff_hz:g}"
        )
    model = model_of(arm, stribeck)
    signals = Signals(float(log.t[0]), log.step_s, len(log.t), cutoff_hz)
    speed = np.abs(np.gradient(signals.first(log.q), log.step_s, axis=0)).max(axis=0)
    least = numbers("slow", _SLOW * speed if slow is None else slow, (), (arm.n,), error=LogError, least=0)
    found = estimate(model, log, signals, np.broadcast_to(least, (arm.n,)), _refuse(arm))
    return model, found


def _friction(arm: Robot, effects: Iterable[Effect] | str | None) -> Friction | None:
    """Return the friction of effects; None without effects."""
    if effects is None:
        return None
    viscous, coulomb, excess, stribeck = *np.zeros((3, arm.n)), {}
    for effect in Plant(arm, effects).effects:
        if isinstance(effect, ViscousFriction):
            viscous += effect.viscous
        elif isinstance(effect, DryFriction | RegularisedCoulombFriction):
            coulomb += effect.coulomb
            if isinstance(effect, DryFriction) and effect.static is not None and effect.stribeck_velocity is not None:
                excess += np.subtract(effect.static, effect.coulomb)
                stribeck = dict(enumerate(np.broadcast_to(effect.stribeck_velocity, arm.n).tolist()))
        else:
            raise LogError(f"effects: {type(effect).__name__} is not friction; remove it from the log's torques first")
    return Friction(viscous, coulomb, excess, stribeck)


def _refuse(arm: Robot) -> Any:
    """Return a check of rows before a fit."""

    def check(rows: Rows, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
        for i, j in swapped(rows.tau, np.asarray(arm.inverse_dynamics(q, v, a)), v):
            names = arm.joint_names
            raise LogError(
                f"the torques of {names[i]} and {names[j]} seem to be swapped: each follows the model of the other;"
                " exchange the columns"
            )
        count = rows.used.sum(axis=0)
        for i in np.flatnonzero(count < _LEAST_ROWS)[:1]:
            raise LogError(
                f"{arm.joint_names[i]} moves in {count[i]} independent rows only, {_LEAST_ROWS} are needed; record a"
                " longer motion"
            )
        W = (rows.Y[..., :-1] * rows.used[..., None]).reshape(-1, rows.Y.shape[2] - 1)
        s, V = np.linalg.svd(W / np.maximum(np.linalg.norm(W, axis=0), 1e-300), full_matrices=False)[1:]
        if rank := int((s <= _DEPENDENT * s[0]).sum()):
            names = [rows.names[k] for k in np.argsort(-np.abs(V[-1]))[:3]]
            raise LogError(
                f"the motion does not determine {rank} of {len(s)} parameters, for example {', '.join(names)}; record a"
                " motion of rd.tools.identify.excite(arm)"
            )

    return check


def _held_out(model: Model, found: Estimate) -> HeldOut:
    """Return rms errors of the last quarter of the log, with numbers from its first three."""
    rows, m = found.rows, len(found.rows.tau)
    training = np.arange(m)[:, None] < _TRAINING * m
    last = rows.used & ~training
    own = model.stated
    rest = rows.tau - rows.Y[..., : len(own)] @ own
    joints = np.arange(len(own), len(rows.names) - 1)
    fitted = fit(rows.where(training).only(joints, rest))
    new = fit(rows.where(training))
    return HeldOut(
        model.arm.joint_names,
        rms(rest, last),
        rms(rest - rows.Y[..., joints] @ fitted.values, last),
        rms(rows.tau - rows.Y @ new.values, last),
        rms(rows.tau - rows.tau.mean(axis=0), last),
    )


def _refuse_foreign(arm: Robot, found: Estimate, held_out: HeldOut) -> None:
    ratio = np.median(held_out.identified / held_out.deviation)  # one joint may have another cause, such as a tilt
    if not ratio <= _FOREIGN:
        raise LogError(
            f"the torques do not follow the equations of {arm.name}: with the best numbers the held-out error is"
            f" {ratio:.0%} of their deviation; is the log of another arm, or are its columns in another order?"
        )


def _refuse_late(found: Estimate) -> None:
    if abs(offset := float(found.fit.values[-1])) >= LATEST_S:
        raise LogError(
            f"torques are {'late' if offset > 0 else 'early'} by {1e3 * LATEST_S:g} ms or more; shift their columns in"
            " time, or log positions and torques by one clock"
        )


def _parameters(model: Model, found: Fit) -> Iterable[Parameter]:
    own = np.concatenate([model.stated, np.full(len(found.names) - len(model.stated), np.nan)])
    for name, *columns in zip(found.names[:-1], found.values, found.half_widths, own, strict=False):
        yield Parameter(name, *map(float, columns))


def _determined(
    model: Model, found: Fit, links: Links, theta: np.ndarray
) -> tuple[tuple[Parameter, ...], tuple[str, ...]]:
    """Return the inertial parameters of bodies that the log determines alone, and the names of the others."""
    R, own = model.base.R, model.arm.inertial_parameters
    C, unit = found.covariance[: len(R), : len(R)], np.eye(len(own))
    bodies = (np.einsum("bij,bj->bi", links.X, theta) + links.rest).ravel()
    alone, blind = [], []
    for k, (name, c) in enumerate(zip(model.base.full_names, np.linalg.lstsq(R.T, unit, rcond=None)[0].T, strict=True)):
        if np.linalg.norm(R.T @ c - unit[k]) < 1e-6:
            width = found.quantile * float(np.sqrt(c @ C @ c))
            alone.append(Parameter(name, float(bodies[k]), width, float(own[k])))
        else:
            blind.append(name)
    return tuple(alone), tuple(blind)


def _corrected(
    model: Model, links: Links, theta: np.ndarray, found: Fit, parameters: tuple[Parameter, ...]
) -> tuple[Robot, bytes]:
    """Return the arm of the corrected file, with the edits of the model's arm, and the text of the file."""

    def listed(part: str, names: Container[str]) -> str:
        own = [p for p in parameters if p.name.startswith(f"{part} ") and p.name in names]
        return "; ".join(f"{p.name.removeprefix(part).strip()} {p.value:.4g} +/- {p.half_width:.2g}" for p in own)

    arm, c, r = model.arm, len(model.stated), len(model.base.columns)
    notes: dict[str, str] = {}
    for body, link in zip(arm.body_names, links.names, strict=True):
        values = listed(body, model.base.names) or "none"
        notes[link] = f"identified base parameters (95 %): {values}; the rest is nearest to the old file"
    for joint in arm.joint_names:
        names = {f"{joint} {kind}" for kind in (VISCOUS, COULOMB, STRIBECK)}
        notes[joint] = f"identified friction (95 %): {listed(joint, names)}"
    friction = np.maximum(found.values[c : c + 2 * arm.n].reshape(2, arm.n), 0.0)
    text = corrected(arm, links, theta, friction, notes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # findings about the file, which the arm has shown already
        robot = Robot.from_text(text, source=arm.description.source)
    if arm.edits.lock:
        robot = robot.with_(lock=dict(arm.edits.lock))
    armature = np.array(arm.armature, float)
    armature[list(model.rotors)] = np.maximum(found.values[r:c], 0.0)
    return robot.with_(gravity=arm.gravity, armature=armature), text
