"""Stepper: n lanes of one plant, which advance by a period at a time in machine code.

Each lane equals a run of `simulate` in which its actions are held for a period, to rounding. Lanes do not depend on
each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import ArrayLike

import robot_dyn as rd
from robot_dyn.codegen import thread_count
from robot_dyn.control import Controller
from robot_dyn.foundations import (
    JointValues,
    MissingTimeError,
    QueryError,
    ReadOnly,
    duration,
    instance,
    integer,
    joint_values,
    shaped,
    shown,
    truth,
)
from robot_dyn.integrate import Integrator
from robot_dyn.queries import Dynamics
from robot_dyn.simulation import Periods, batch_of
from robot_dyn.tools.step.action import action_of


@final
@dataclass(frozen=True, eq=False)
class State(ReadOnly):
    """The state of n lanes.

    Attributes:
        t: Time since the reset of each lane, (n,), in [s].
        q: Positions, (n, joints), in [rad] or [m] by joint; nan in a lane that has diverged.
        v: Velocities, (n, joints), in [rad/s] or [m/s].
        z: States of the controller and of the effects, (n, k).
        diverged: True for lanes that have diverged, or were never reset, (n,).
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    z: np.ndarray
    diverged: np.ndarray


@final
class Stepper:
    """Lanes of one plant that advance together by a period, each with its own action, in machine code.

    Args:
        plant: A plant or a robot.
        n: Number of lanes.
        period_s: Time between actions, in [s]; an action is constant in between.
        controller: Controller whose set-point is the action, instead of its reference. It acts continuously, or at its
            own period, which divides `period_s`. An action is then a position of the joints, or of the controlled
            frame at the orientation of the reference at time 0. None if an action is a torque.
        step_s: Largest step of the method, in [s].
        method: A method of fixed step, or its name.
        vary: Values that differ from lane to lane, by name, (n,) or (n, size) each; see `rollouts`.
        uncut: True to step across thresholds of effects, with the error of a step that passes one.
        ledger: True to compute `energy_residual` in each step.
        threads: Number of threads; None for all processors. They pay off from some 10 000 steps, lanes × n, in a call.

    Raises:
        QueryError: If an argument is not allowed, a part depends on the time, the controller has no set-point, or steps
            would have to end within a period, at a stop or at another threshold; the message names the part.
        TraceError: If a part of the plant cannot be compiled.

    Example:
        >>> arms = rd.tools.step.Stepper(rd.load("planar_2r"), 100, period_s=0.02)
        >>> state = arms.reset([0.3, 0.0])
        >>> state = arms.step(np.zeros((100, 2)))
    """

    def __init__(
        self, plant: rd.Plant | Dynamics[np.ndarray], n: int = 4096, *, period_s: float = 0.02,
        controller: Controller | None = None, step_s: float | None = 1e-3, method: str | Integrator = "RK4",
        vary: Mapping[str, ArrayLike] | None = None, uncut: bool = False, ledger: bool = False,
        threads: int | None = 1,
    ) -> None:  # fmt: skip
        self._n, self._period_s = integer("n", n, least=1), duration("period_s", period_s)
        plant = plant if isinstance(plant, rd.Plant) else rd.Plant(plant)
        self._names = plant.dynamics.joint_names
        action = action_of(controller, self._names, self._period_s)
        self._labels, self._ledger = action.labels, truth("ledger", ledger)
        setup = rd.Setup(
            plant, np.zeros(len(self._names)), duration_s=self._period_s, step_s=step_s, method=method,
            controller=action.controller, estimate_error=False, engine="compiled",
        )  # fmt: skip
        check_setup(setup)
        if vary is not None and not isinstance(vary, Mapping):
            raise QueryError(f"vary must give values by name, such as {{'mass_scale': …}}, got {shown(vary)}")
        for name, x in (vary or {}).items():
            if name == action.parameter:
                raise QueryError(f"vary: {name} is the action of `step`; leave it out")
            if len(np.atleast_1d(np.asarray(x))) != self._n:
                raise QueryError(f"vary: give {name} for each of the {self._n} lanes, got shape {np.shape(x)}")
        actions = {action.parameter: np.zeros((self._n, len(action.labels)))}
        batch = batch_of(setup, None, None, {**(vary or {}), **actions}, ())
        switched = () if truth("uncut", uncut) or batch.thresholds is None else batch.thresholds.names
        if why := batch.why_one_by_one or ", ".join(switched):
            remedy = "leave it out, or use rd.rollouts" + ("" if batch.why_one_by_one else "; uncut=True steps across")
            raise QueryError(f"Stepper: steps would end within a period ({why}); {remedy}")
        self._lanes = Periods(batch, action.parameter, thread_count(threads))
        if self._lanes.uses_time:
            name = timed(plant) or action.controller.name
            raise QueryError(f"Stepper: {name} depends on the time, which differs by lane; leave it out")
        self._periods, self._started = np.zeros(self._n, np.int64), np.zeros(self._n, bool)
        self._residual = np.zeros(self._n)

    @property
    def n(self) -> int:
        """Number of lanes."""
        return self._n

    @property
    def period_s(self) -> float:
        """Time between actions, in [s]."""
        return self._period_s

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        return self._names

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the entries of an action: joints, or x, y, z of a frame."""
        return self._labels

    @property
    def has_ledger(self) -> bool:
        """True if the stepper computes `energy_residual`."""
        return self._ledger

    @property
    def energy_residual(self) -> np.ndarray:
        """Energy residual K + V − (K + V before) − Σ W of the latest step of each lane, (n,), in [J].

        It consists of rounding and the error of the method.

        Raises:
            QueryError: If the stepper has no ledger.
        """
        if not self._ledger:
            raise QueryError("energy_residual: this stepper has no ledger; give ledger=True")
        return self._residual.copy()

    def reset(self, q: JointValues, v: JointValues | None = None, mask: ArrayLike | None = None) -> State:
        """Start lanes at q and v, at time 0, with the states of the effects at their start.

        Args:
            q: Positions, (joints,) or (n, joints), in [rad] or [m] by joint; also by joint name, 0 for joints left out.
            v: Velocities, (joints,) or (n, joints), in [rad/s] or [m/s]; 0 by default.
            mask: True for the lanes to start, (n,); all by default. Rows of the other lanes are ignored.

        Returns:
            The state of all lanes.

        Raises:
            QueryError: If an argument has the wrong shape or is not finite.
        """
        chosen = self._chosen(mask)
        rows = [
            self._rows(name, x, chosen) for name, x in (("q", q), ("v", np.zeros(len(self._names)) if v is None else v))
        ]
        y = self._lanes.y
        y[chosen] = self._lanes.start(*rows)
        self._write(chosen, y, np.zeros(self._n, bool), np.zeros(self._n, np.int64))
        return self.state

    def step(self, action: JointValues) -> State:
        """Advance all lanes by a period under torques or set-points, within the effort limits of the plant.

        A lane that diverges is nan from then on, until it is reset. Its action is ignored, and may be nan.

        Args:
            action: Torques in [N m] or [N]; or with a controller, its set-points in [rad] or [m]. (n, k).

        Returns:
            The state of all lanes.

        Raises:
            QueryError: If the action has another shape or is not finite, or a lane was never reset.
        """
        if not self._started.all():
            raise QueryError(f"step: lane {int(np.argmin(self._started))} has not been reset; call reset first")
        names, lanes = self._labels, self._lanes
        rows = shaped("action", action, names)
        if rows.shape != (self._n, len(names)):
            raise QueryError(f"action must have shape ({self._n}, {len(names)}), one row per lane; got {rows.shape}")
        if not np.isfinite(rows).all():
            rows = np.where(lanes.ended[:, None], 0.0, rows)
            if len(wrong := np.argwhere(~np.isfinite(rows))):
                lane, entry = wrong[0].tolist()
                raise QueryError(
                    f"action of lane {lane} is {rows[lane, entry]} at {names[entry]!r}; give finite numbers"
                )
        before = lanes.energies() if self._ledger else self._residual
        lanes.advance(rows, self._periods)
        if self._ledger:
            self._residual = lanes.energies() - before - lanes.y[:, lanes.work :].sum(axis=1)
        self._periods += 1
        return self.state

    @property
    def state(self) -> State:
        """State of all lanes, a copy: keep it to return to it with `set_state`, in this stepper or a similar one."""
        y, n = self._lanes.y, len(self._names)
        parts = y[:, :n], y[:, n : 2 * n], y[:, 2 * n : self._lanes.work]
        return State(self._periods * self._period_s, *parts, self._lanes.ended)

    def set_state(self, state: State, mask: ArrayLike | None = None) -> None:
        """Return lanes to a state, bit by bit.

        Args:
            state: State of a stepper with as many lanes and states.
            mask: True for the lanes concerned, (n,); all by default.

        Raises:
            QueryError: If the state has other shapes.
        """
        instance("state", state, State, "give the `state` of a stepper")
        now, chosen = self.state, self._chosen(mask)
        for name, x in vars(now).items():
            if (shape := getattr(state, name).shape) != x.shape:
                raise QueryError(f"state: {name} must have shape {x.shape}, as in this stepper; got {shape}")
        y = self._lanes.y
        y[:, : self._lanes.work] = np.hstack([state.q, state.v, state.z])
        y[:, self._lanes.work :] = 0.0
        self._write(chosen, y, state.diverged, np.rint(state.t / self._period_s).astype(np.int64))

    def _write(self, chosen: np.ndarray, y: np.ndarray, diverged: np.ndarray, periods: np.ndarray) -> None:
        self._lanes.write(chosen, y, diverged)
        self._periods = np.where(chosen, periods, self._periods)
        self._started |= chosen

    def _chosen(self, mask: ArrayLike | None) -> np.ndarray:
        """Return the lanes of a mask, (n,)."""
        if mask is None:
            return np.ones(self._n, bool)
        try:
            chosen = np.asarray(mask)
        except ValueError:  # rows of different lengths
            chosen = np.zeros(0)
        if chosen.dtype != bool or chosen.shape != (self._n,):
            raise QueryError(f"mask must be True or False for each of the {self._n} lanes, got {shown(mask)}")
        return chosen

    def _rows(self, name: str, x: JointValues, chosen: np.ndarray) -> np.ndarray:
        """Return finite values of the chosen lanes, (k, joints)."""
        n, array = len(self._names), shaped(name, x, self._names)
        if array.shape not in ((n,), (self._n, n)):
            raise QueryError(f"{name} must have shape ({n},) or ({self._n}, {n}), got {array.shape}")
        return joint_values(name, np.broadcast_to(array, (self._n, n))[chosen], self._names)


def check_setup(setup: rd.Setup) -> None:
    """Raise a QueryError unless lanes can step by the method of a setup."""
    method = setup.method
    if method.controls_error or not method.plain or method.canonical or method.nonsmooth:
        raise QueryError(f"method: lanes step by an explicit method of fixed step, not by {method.name}; give 'RK4'")


def timed(plant: rd.Plant) -> str:
    """Return the names of the effects that depend on the time; empty without one."""
    names, q = [], np.zeros(plant.dynamics.n)
    for effect in plant.effects:
        try:
            replace(plant, effects=(effect,)).torque(q, q)
        except MissingTimeError:
            names.append(effect.name)
    return ", ".join(names)
