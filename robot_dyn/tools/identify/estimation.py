"""From a log to base parameters, friction, offsets and a time offset, by weighted instrumental variables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.foundations import Value
from robot_dyn.tools.identify.base_parameters import BaseParameters, base_parameters
from robot_dyn.tools.identify.regression import Fit, Rows, fit
from robot_dyn.tools.identify.signals import Signals, low_pass

if TYPE_CHECKING:
    from robot_dyn.tools.identify.log import Log

    State = tuple[np.ndarray, np.ndarray, np.ndarray]

VISCOUS, COULOMB, OFFSET, STRIBECK = "viscous", "coulomb", "torque offset", "static - coulomb"
TIME, ROTOR = "time offset", "rotor inertia"
LATEST_S = 0.02  # largest time offset, in [s]
_ITERATIONS, _SAME_S = 6, 2e-5
_SMOOTH = 0.35  # cutoff of instruments from positions: noise of 3e-4 rad shifts no estimate by half a standard error


@final
@dataclass(frozen=True, eq=False)
class Model(Value):
    """The linear model of a log.

    Attributes:
        arm: The arm.
        base: Its base parameters.
        rotors: Joints whose rotor inertia can be distinguished from the inertia of the bodies.
        stribeck: Stribeck velocity by joint whose friction follows Stribeck's curve, in [rad/s] or [m/s].
    """

    arm: Robot
    base: BaseParameters
    rotors: tuple[int, ...]
    stribeck: dict[int, float] = field(default_factory=dict)

    @cached_property
    def known_rotors(self) -> np.ndarray:
        """Rotor inertias of the other joints as the arm states them, (n,), 0 for `rotors`."""
        result = np.array(self.arm.armature, float)
        result[list(self.rotors)] = 0.0
        return result

    @cached_property
    def stated(self) -> np.ndarray:
        """Base parameters and distinguishable rotor inertias as the arm states them."""
        return np.concatenate(
            [self.base.R @ self.arm.inertial_parameters, np.array(self.arm.armature)[list(self.rotors)]]
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, without the time offset."""
        kinds = (VISCOUS, COULOMB, OFFSET)
        joints = self.arm.joint_names
        rotors = tuple(f"{joints[i]} {ROTOR}" for i in self.rotors)
        curved = (f"{joints[i]} {STRIBECK}" for i in self.stribeck)
        return (*self.base.names, *rotors, *(f"{joint} {kind}" for kind in kinds for joint in joints), *curved)

    def columns(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the regressor of all parameters except the time offset, (k, n, p)."""
        (k, n), r, i = q.shape, len(self.base.columns), np.arange(self.arm.n)
        c, d = len(self.rotors), r + len(self.rotors)
        Y = np.zeros((k, n, d + 3 * n + len(self.stribeck)))
        Y[..., :r] = self.arm.regressor(q, v, a)[..., self.base.columns]
        Y[:, list(self.rotors), r + np.arange(c)] = a[:, list(self.rotors)]
        Y[:, i, d + i], Y[:, i, d + n + i], Y[:, i, d + 2 * n + i] = v, np.sign(v), 1.0
        for s, (j, v_s) in enumerate(self.stribeck.items()):
            Y[:, j, d + 3 * n + s] = np.sign(v[:, j]) * np.exp(-((v[:, j] / v_s) ** 2))
        return Y


@final
@dataclass(frozen=True, eq=False)
class Friction(Value):
    """The friction that an arm is supposed to have.

    Attributes:
        viscous, coulomb: Coefficients, each (n,).
        excess: Static less Coulomb friction of joints with a Stribeck velocity, (n,).
        stribeck: Stribeck velocity by joint, in [rad/s] or [m/s].
    """

    viscous: np.ndarray
    coulomb: np.ndarray
    excess: np.ndarray
    stribeck: dict[int, float]

    @property
    def values(self) -> np.ndarray:
        """The coefficients in the order of the parameters of a `Model`, without torque offsets."""
        return np.concatenate([self.viscous, self.coulomb, 0 * self.viscous, self.excess[list(self.stribeck)]])


def model_of(arm: Robot, stribeck: dict[int, float] | None = None) -> Model:
    """Return the model of an arm; a rotor inertia that base parameters contain already is left out."""
    base, rng = base_parameters(arm), np.random.default_rng(1)
    q, v, a = rng.uniform(-np.pi, np.pi, (3, 200, arm.n))
    Y = np.asarray(arm.regressor(q, v, a))[..., base.columns].reshape(200 * arm.n, -1)
    distinct = []
    for i in range(arm.n):
        column = (a * np.eye(arm.n)[i]).ravel()
        rest = column - Y @ np.linalg.lstsq(Y, column, rcond=None)[0]
        if np.linalg.norm(rest) > 1e-6 * np.linalg.norm(column):
            distinct.append(i)
            Y = np.column_stack([Y, column])
    return Model(arm, base, tuple(distinct), stribeck or {})


@final
@dataclass(frozen=True, eq=False)
class Estimate(Value):
    """Estimate of all parameters of a log.

    Attributes:
        fit: The fit; its last parameter is the time offset, in [s].
        rows: Its rows, with torques that were shifted by the time offset, less those of known rotor inertias.
        times: Times of the rows, (m,), in [s].
        signals: Filters of the rows.
        state: Positions, velocities and accelerations before the second filter, each (k, n).
        instruments: The same for the instruments.
    """

    fit: Fit
    rows: Rows
    times: np.ndarray
    signals: Signals
    state: State
    instruments: State


def estimate(
    model: Model, log: Log, signals: Signals, slow: np.ndarray, check: Callable[..., None] = lambda *_: None
) -> Estimate:
    """Return the estimate from a log; `check` is called with the rows and the motion before the fit.

    Rows of a joint slower than `slow`, (n,), and rows within the filter's memory of such rows, are left out.
    """
    q = signals.first(log.q)
    state, tau = signals.rates(q), signals.first(log.tau)
    instruments = _instruments(log, signals)
    independent = model.columns(*instruments)
    Y, Z = signals.second(model.columns(*state)), signals.second(independent)
    used = signals.second_of(_eroded(np.abs(state[1]) > slow, signals))
    rate, known = np.gradient(tau, signals.step_s, axis=0), state[2] * model.known_rotors
    at, times, delta = signals.row_times, signals.times, 0.0

    def rows_at(delta: float, values: np.ndarray | None) -> Rows:
        """Return the rows with torques shifted by a time offset; its instrument is the torque of `values`."""
        shifted, rates = (np.stack([np.interp(at + delta, times, x) for x in y.T], axis=1) for y in (tau, rate))
        of_model = rates if values is None else np.gradient(independent @ values, signals.row_step_s, axis=0)
        regressor, instrument = (
            np.concatenate([A, signals.second(x)[..., None]], axis=2) for A, x in ((Y, rates), (Z, of_model))
        )
        return Rows((*model.names, TIME), regressor, instrument, signals.second(shifted - known), used)

    rows = rows_at(delta, None)
    check(rows, *map(signals.second_of, state))
    result = fit(rows)
    for _ in range(_ITERATIONS):
        delta = float(np.clip(delta - result.values[-1], -LATEST_S, LATEST_S))
        rows = rows_at(delta, result.values[:-1])
        result = fit(rows)
        if abs(result.values[-1]) < _SAME_S or abs(delta) == LATEST_S:
            break
    result = replace(result, values=np.append(result.values[:-1], delta))
    return Estimate(result, rows, signals.second_of(at), signals, state, instruments)


def _instruments(log: Log, signals: Signals) -> State:
    """Return the motion of the instruments at the row times: smoothed positions, of a second log if any.

    With a desired motion, only the deviation from it is smoothed: instruments that follow the arm are stronger.
    """
    desired = [np.zeros_like(log.q)] * 3 if log.reference is None else log.reference
    q = (log.q if log.repeated is None else log.repeated) - desired[0]
    smooth = signals.rates(low_pass(q, _SMOOTH * signals.cutoff_hz * signals.step_s))
    q, v, a = (x[:: signals.every] + y for x, y in zip(desired, smooth, strict=True))
    return q, v, a


def _eroded(moving: np.ndarray, signals: Signals) -> np.ndarray:
    """Return True for times whose neighbours within a period of the cutoff are True."""
    from scipy.ndimage import binary_erosion

    half = int(1 / (signals.cutoff_hz * signals.step_s * signals.every))
    return binary_erosion(moving, np.ones((2 * half + 1, 1), bool), border_value=1)
