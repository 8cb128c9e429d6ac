"""Detection of torques that act between the ends of two steps and at neither, which companion runs may miss.

Thresholds of positions at which no step ends: the cubic through q and v at the ends of a step gives the extreme
position between them. Parts that do not declare where they switch: their torque is evaluated between the ends of steps.
"""

from __future__ import annotations

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Effect, Force
from robot_dyn.foundations.errors import RobotDynError, call
from robot_dyn.simulation.diagnostics.smoothness import LOOKS, cubics, extremes
from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.doubts import Doubt, DoubtKind, Onset, first_onset
from robot_dyn.simulation.run.recording import Path, Recording
from robot_dyn.simulation.setup.schedule import LEAST_STEPS
from robot_dyn.simulation.setup.setup import Setup

_STANDS_OUT = 50.0  # times the change of the torque from step to step


def stepped_over(setup: Setup, path: Path, error: float) -> Onset:
    """Return the start of the first step within which a torque acted and would move a joint by more than the error.

    Args:
        setup: The setup of the run.
        path: States at the ends of its steps.
        error: Estimated error of q, in [rad] or [m].
    """
    if len(path.t) < 2:
        return Onset()
    equation = setup.equation
    q, v = equation.motion(path.y)
    effects = () if setup.finds_events else setup.plant.effects
    missed = [_crossed(equation, effect, path, q, v, error) for effect in effects]
    missed += [_acts_between(equation, part, path, q, v, error) for part, _ in setup.undeclared]
    return first_onset(missed)


def cut_alike(setup: Setup, run: Recording) -> Onset:
    """Return the first time from which a run of fixed steps and its companions take the same few steps between events.

    From there, a joint switches and switches back within a few steps, or switches in the last step of the run.
    """
    h, end, latest = setup.taken_step_s, float(run.step_log.t[-1]), dict[str, float]()
    missed = []
    for event in run.events:
        if event.joint and event.t - latest.get(event.joint, -np.inf) < LEAST_STEPS * h:
            doubt = Doubt(DoubtKind.SWITCHES_TWICE, {"joint": event.joint, "steps": LEAST_STEPS})
            missed.append(Onset(latest[event.joint], doubt))
        latest[event.joint] = event.t
    for joint, t in latest.items():
        if joint and end - h < t < end:
            missed.append(Onset(t, Doubt(DoubtKind.SWITCHES_LAST, {"joint": joint})))
    return first_onset(missed)


def _crossed(equation: StateEquation, effect: Effect, path: Path, q: np.ndarray, v: np.ndarray, error: float) -> Onset:
    """Return the first step within which a joint passed a threshold of its position in both directions."""
    if not isinstance(effect, Force):
        return Onset()
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
                missed.append(Onset(float(path.t[k]), Doubt(DoubtKind.CROSSED_WITHIN_STEP, facts)))
                break
    return first_onset(missed)


def _change(
    equation: StateEquation, effect: Force, path: Path, q: np.ndarray, v: np.ndarray, k: int, joint: int, far: float
) -> np.ndarray:
    """Return the change of the torque of an effect from the start of step k to where a joint turns, (n,)."""
    n, place = len(q), equation.place_of(effect)
    z = () if place is None else (path.y[k, place],)
    turned, stopped = q.copy(), v.copy()
    turned[joint], stopped[joint] = far, 0.0
    there, here = (call(effect.torque, equation.plant.dynamics, float(path.t[k]), x, stopped, *z) for x in (turned, q))
    return np.broadcast_to(np.abs(np.subtract(there, here)), (n,))


def _acts_between(
    equation: StateEquation, part: object, path: Path, q: np.ndarray, v: np.ndarray, error: float
) -> Onset:
    """Return the first step within which the torque of a part differs clearly from its values at both ends."""
    n, place = equation.plant.dynamics.n, equation.place_of(part)
    if not isinstance(part, Force | Controller) or (isinstance(part, Controller) and equation.sampled):
        return Onset()

    def torque(t: float, q: np.ndarray, v: np.ndarray, z: np.ndarray) -> np.ndarray:
        state = (t, q, v) if place is None else (t, q, v, z)
        first = () if isinstance(part, Controller) else (equation.plant.dynamics,)
        return np.broadcast_to(np.asarray(call(part.torque, *first, *state), dtype=float), (n,))

    every = max(1, len(path.t) // LOOKS)
    t, q, v, z = path.t[::every], q[::every], v[::every], path.y[::every, place or slice(0)]
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
        return Onset()  # the run itself reports this error
    around = np.abs(np.diff(ends, axis=0))
    for k in np.flatnonzero((jump > _STANDS_OUT * around + 1e-9).any(axis=1)).tolist():
        if _displacement(equation, path, path.y[:, :n], k * every, jump[k]) > error:
            start = float(t[k])
            return Onset(start, Doubt(DoubtKind.ACTS_BETWEEN_STEPS, {"part": named(part), "start": start}))
    return Onset()


def _between(t: np.ndarray, q: np.ndarray, v: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities, (k, n) each, at a fraction s (k, 1) of each step, on the cubic of `cubics`.

    The error of straight lines, h² a / 8, would make a stiff controller respond.
    """
    (a, b, c), h = cubics(t, q, v), np.diff(t)[:, None]
    rate = np.divide(s * (2 * b + 3 * s * a), h, out=np.zeros_like(a), where=h > 0)
    return q[:-1] + s * (c + s * (b + s * a)), v[:-1] + rate


def _displacement(equation: StateEquation, path: Path, q: np.ndarray, k: int, torque: np.ndarray) -> float:
    """Return the distance by which a torque in step k moves a joint until the end: M⁻¹ τ h (T − t), in [rad] or [m]."""
    try:
        a = np.linalg.solve(equation.plant.at(float(path.t[k])).M(q[k]), torque)
    except (RobotDynError, np.linalg.LinAlgError):
        return np.inf
    return float(np.abs(a).max() * (path.t[k + 1] - path.t[k]) * (path.t[-1] - path.t[k]))
