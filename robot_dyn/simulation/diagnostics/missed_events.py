"""Detection of torques that act between the ends of two steps and at neither, which companion runs may miss.

Thresholds of positions at which no step ends: the cubic through q and v at the ends of a step gives the extreme
position between them. Parts that do not declare where they switch: their torque is evaluated between the ends of steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Effect, Force
from robot_dyn.foundations.errors import RobotDynError, call
from robot_dyn.simulation.diagnostics.smoothness import LOOKS, cubics, extremes
from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.doubts import Doubt, DoubtKind
from robot_dyn.simulation.run.recording import Path, Recording
from robot_dyn.simulation.setup.schedule import LEAST_STEPS
from robot_dyn.simulation.setup.setup import Setup

_STANDS_OUT = 50.0  # times the change of the torque from step to step


class Missed(NamedTuple):
    """A torque that acted between two steps: start of the step in [s], and the doubt that it causes."""

    t: float
    doubt: Doubt


def stepped_over(setup: Setup, path: Path, error: float) -> Missed | None:
    """Return the first torque that acted between two steps and would move a joint by more than the estimated error.

    Args:
        setup: The setup of the run.
        path: States at the ends of its steps.
        error: Estimated error of q, in [rad] or [m].
    """
    if len(path.t) < 2:
        return None
    equation = setup.equation
    q, v = path.y[:, : equation.plant.dynamics.n], equation.velocities(path.y)
    effects = () if setup.finds_events else setup.plant.effects
    missed = [_crossed(equation, effect, path, q, v, error) for effect in effects]
    missed += [_acts_between(equation, part, path, q, v, error) for part, _ in setup.undeclared]
    return _first([one for one in missed if one is not None])


def cut_alike(setup: Setup, run: Recording) -> Missed | None:
    """Return the first time from which a run of fixed steps and its companions take the same few steps between events.

    From there, a joint switches and switches back within a few steps, or switches in the last step of the run.
    """
    h, end, latest = setup.taken_step_s, float(run.step_log.t[-1]), dict[str, float]()
    missed = []
    for event in run.events:
        if event.joint and event.t - latest.get(event.joint, -np.inf) < LEAST_STEPS * h:
            doubt = Doubt(DoubtKind.SWITCHES_TWICE, {"joint": event.joint, "steps": LEAST_STEPS})
            missed.append(Missed(latest[event.joint], doubt))
        latest[event.joint] = event.t
    for joint, t in latest.items():
        if joint and end - h < t < end:
            missed.append(Missed(t, Doubt(DoubtKind.SWITCHES_LAST, {"joint": joint})))
    return _first(missed)


def _first(missed: list[Missed]) -> Missed | None:
    return min(missed, key=lambda one: one.t, default=None)


def _crossed(
    equation: StateEquation, effect: Effect, path: Path, q: np.ndarray, v: np.ndarray, error: float
) -> Missed | None:
    """Return the first threshold of a position that a joint passed in both directions within a step."""
    if not isinstance(effect, Force):
        return None
    low, high = extremes(path.t, q, v)
    missed = []
    for threshold in effect.thresholds(q.shape[1]):
        if threshold.of_velocity or threshold.own:
            continue
        i, level = threshold.joint, threshold.level
        beyond = np.sign(q[:, i] - level)
        far = np.where(beyond[:-1] > 0, low[:, i], high[:, i])
        back = (beyond[:-1] == beyond[1:]) & (np.sign(far - level) == -beyond[:-1]) & (beyond[:-1] != 0)
        for k in np.flatnonzero(back):
            torque = _change(equation, effect, path, q[k], v[k], int(k), i, far[k])
            if _displacement(equation, path, q, int(k), torque) > error:
                facts: dict[str, float | str] = {
                    "joint": equation.plant.dynamics.joint_names[i],
                    "threshold": threshold.name,
                    "depth": float(abs(far[k] - level)),
                    "step_s": float(path.t[k + 1] - path.t[k]),
                }
                missed.append(Missed(float(path.t[k]), Doubt(DoubtKind.CROSSED_WITHIN_STEP, facts)))
                break
    return _first(missed)


def _change(
    equation: StateEquation, effect: Force, path: Path, q: np.ndarray, v: np.ndarray, k: int, joint: int, far: float
) -> np.ndarray:
    """Return the change of the torque of an effect from the start of step k to where a joint turns, (n,)."""
    n, states = len(q), _states_of(equation, effect)
    z = () if states is None else (path.y[k, 2 * n : 2 * n + equation.states][states],)
    turned, stopped = q.copy(), v.copy()
    turned[joint], stopped[joint] = far, 0.0
    there, here = (call(effect.torque, equation.plant.dynamics, float(path.t[k]), x, stopped, *z) for x in (turned, q))
    return np.broadcast_to(np.abs(np.subtract(there, here)), (n,))


def _acts_between(
    equation: StateEquation, part: object, path: Path, q: np.ndarray, v: np.ndarray, error: float
) -> Missed | None:
    """Return the first step within which the torque of a part differs clearly from its values at both ends."""
    n, m, dynamics = equation.plant.dynamics.n, equation.states, equation.plant.dynamics
    states = slice(0, equation.state_size) if isinstance(part, Controller) else _states_of(equation, part)
    if not isinstance(part, Force | Controller) or (isinstance(part, Controller) and equation.sampled):
        return None

    def torque(t: float, q: np.ndarray, v: np.ndarray, z: np.ndarray) -> np.ndarray:
        if isinstance(part, Controller):
            return np.asarray(call(part.torque, t, q, v, z[states]), dtype=float)
        state = (t, q, v) if states is None else (t, q, v, z[states])
        return np.broadcast_to(np.asarray(call(part.torque, dynamics, *state), dtype=float), (n,))

    every = max(1, len(path.t) // LOOKS)
    t, q, v, z = path.t[::every], q[::every], v[::every], path.y[::every, 2 * n : 2 * n + m]
    count = max(1, LOOKS // len(t))  # points in each step, at fractions that differ from step to step
    s = (np.arange(count)[:, None] + np.random.default_rng(0).uniform(size=len(t) - 1)) / count
    try:
        ends = np.array([torque(*state) for state in zip(t.tolist(), q, v, z, strict=True)])
        jump = np.zeros((len(t) - 1, n))
        for weight in s[:, :, None]:
            time, states_z = (x[:-1] + weight * np.diff(x, axis=0) for x in (t[:, None], z))
            inside = (time, *_between(t, q, v, weight), states_z)
            there = np.array([torque(float(at[0]), *state) for at, *state in zip(*inside, strict=True)])
            jump = np.maximum(jump, np.abs(there - ends[:-1] - weight * np.diff(ends, axis=0)))
    except RobotDynError:
        return None  # the run itself reports this error
    around = np.abs(np.diff(ends, axis=0))
    for k in np.flatnonzero((jump > _STANDS_OUT * around + 1e-9).any(axis=1)).tolist():
        if _displacement(equation, path, path.y[:, :n], k * every, jump[k]) > error:
            start = float(t[k])
            return Missed(start, Doubt(DoubtKind.ACTS_BETWEEN_STEPS, {"part": named(part), "start": start}))
    return None


def _between(t: np.ndarray, q: np.ndarray, v: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities, (k, n) each, at a fraction s (k, 1) of each step, on the cubic of `cubics`.

    The error of straight lines, h² a / 8, would make a stiff controller respond.
    """
    (a, b, c), h = cubics(t, q, v), np.diff(t)[:, None]
    rate = np.divide(s * (2 * b + 3 * s * a), h, out=np.zeros_like(a), where=h > 0)
    return q[:-1] + s * (c + s * (b + s * a)), v[:-1] + rate


def _states_of(equation: StateEquation, part: object) -> slice | None:
    """Return the place of the states of an effect after q and v; None if it has none."""
    for k, place in equation.equation_of_motion.states.items():
        if equation.plant.effects[k] is part:
            return slice(equation.state_size + place.start, equation.state_size + place.stop)
    return None


def _displacement(equation: StateEquation, path: Path, q: np.ndarray, k: int, torque: np.ndarray) -> float:
    """Return the distance by which a torque in step k moves a joint until the end: M⁻¹ τ h (T − t), in [rad] or [m]."""
    try:
        a = np.linalg.solve(equation.plant.at(float(path.t[k])).M(q[k]), torque)
    except (RobotDynError, np.linalg.LinAlgError):
        return np.inf
    return float(np.abs(a).max() * (path.t[k + 1] - path.t[k]) * (path.t[-1] - path.t[k]))
