"""What acts between the ends of two steps and at neither, so that no companion run need see it.

Thresholds of positions, where no step ends at them: the cubic through q and v at the ends of a step tells how far the
joint went between them. Parts that do not declare where they switch: their torque is looked at between the ends of
steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Force
from robot_dyn.foundations.errors import RobotDynError, call
from robot_dyn.simulation.diagnostics.smoothness import LOOKS, cubics, extremes
from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.run.recording import Path, Recording
from robot_dyn.simulation.setup.schedule import LEAST_STEPS
from robot_dyn.simulation.setup.setup import Setup

_STANDS_OUT = 50.0  # times the change of the torque from step to step


@final
@dataclass(frozen=True)
class Missed:
    """Something that acted between two steps: start of the step in [s], and what it was."""

    t: float
    why: str


def stepped_over(setup: Setup, path: Path, error: float) -> Missed | None:
    """The first thing that acted between two steps and would move a joint by more than the estimated error.

    Args:
        setup: What was run.
        path: The states at the ends of its steps.
        error: Estimated error of q, in [rad] or [m].
    """
    if len(path.t) < 2:
        return None
    equation = setup.equation
    q, v = path.y[:, : equation.plant.dynamics.n], equation.velocities(path.y)
    effects = () if setup.finds_events else setup.plant.effects
    found = [_crossed(equation, effect, path, q, v, error) for effect in effects]
    found += [_code(equation, part, path, q, v, error) for part, _ in setup.undeclared]
    return min((each for each in found if each is not None), key=lambda each: each.t, default=None)


def cut_alike(setup: Setup, run: Recording) -> Missed | None:
    """The first time from which a run of fixed steps and its companions take the same few steps between switches.

    That is where a joint switches and switches back within a few steps, or switches in the last step of the run.
    """
    h, before = setup.taken_step_s, dict[str, float]()
    found = []
    for each in run.events:
        if each.joint and each.t - before.get(each.joint, -np.inf) < LEAST_STEPS * h:
            why = f"joint {each.joint!r} switches and switches back within {LEAST_STEPS} steps"
            found.append(Missed(before[each.joint], why))
        before[each.joint] = each.t
    end = float(run.step_log.t[-1])
    late = [(t, joint) for joint, t in before.items() if joint and end - h < t < end]
    found += [Missed(t, f"joint {joint!r} switches in the last step") for t, joint in late]
    return min(found, key=lambda each: each.t, default=None)


def _crossed(
    equation: StateEquation, effect: Any, path: Path, q: np.ndarray, v: np.ndarray, error: float
) -> Missed | None:
    """A threshold of a position that a joint passed and passed back within a step."""
    levels = effect.thresholds(q.shape[1]) if isinstance(effect, Force) else ()
    low, high = extremes(path.t, q, v)
    missed = []
    for each in levels:
        if each.of_velocity or each.own:
            continue
        i, beyond = each.joint, np.sign(q[:, each.joint] - each.level)
        far = np.where(beyond[:-1] > 0, low[:, i], high[:, i])
        back = (beyond[:-1] == beyond[1:]) & (np.sign(far - each.level) == -beyond[:-1]) & (beyond[:-1] != 0)
        for k in np.flatnonzero(back):
            torque = _change(equation, effect, path, q[k], v[k], int(k), i, far[k])
            if _displacement(equation, path, q, int(k), torque) > error:
                name, h = equation.plant.dynamics.joint_names[i], path.t[k + 1] - path.t[k]
                depth = abs(far[k] - each.level)
                why = f"joint {name!r} passes its {each.name} by {depth:.1e} and leaves it within one step of {h:.1e} s"
                missed.append(Missed(float(path.t[k]), why))
                break
    return min(missed, key=lambda found: found.t, default=None)


def _change(
    equation: StateEquation, effect: Any, path: Path, q: np.ndarray, v: np.ndarray, k: int, joint: int, far: float
) -> np.ndarray:
    """How far the torque of an effect in step k, where a joint turns, is from that at its start, (n,)."""
    n, states = len(q), _states_of(equation, effect)
    z = () if states is None else (path.y[k, 2 * n : 2 * n + equation.states][states],)
    turned, stands = q.copy(), v.copy()
    turned[joint], stands[joint] = far, 0.0
    there, here = (call(effect.torque, equation.plant.dynamics, float(path.t[k]), x, stands, *z) for x in (turned, q))
    return np.broadcast_to(np.abs(np.subtract(there, here)), (n,))


def _code(equation: StateEquation, part: Any, path: Path, q: np.ndarray, v: np.ndarray, error: float) -> Missed | None:
    """A torque that stands out between two steps from what it is at their ends."""
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
    looks = max(1, LOOKS // len(t))  # in each step, at times that differ from step to step
    s = (np.arange(looks)[:, None] + np.random.default_rng(0).uniform(size=len(t) - 1)) / looks
    try:
        ends = np.array([torque(*state) for state in zip(t.tolist(), q, v, z, strict=True)])
        jump = np.zeros((len(t) - 1, n))
        for weight in s[:, :, None]:
            time, states_z = (x[:-1] + weight * np.diff(x, axis=0) for x in (t[:, None], z))
            inside = (time, *_between(t, q, v, weight), states_z)
            there = np.array([torque(float(at[0]), *state) for at, *state in zip(*inside, strict=True)])
            jump = np.maximum(jump, np.abs(there - ends[:-1] - weight * np.diff(ends, axis=0)))
    except RobotDynError:
        return None  # the run itself reports what is wrong
    around = np.abs(np.diff(ends, axis=0))
    for k in np.flatnonzero((jump > _STANDS_OUT * around + 1e-9).any(axis=1)).tolist():
        if _displacement(equation, path, path.y[:, :n], k * every, jump[k]) > error:
            why = f"{named(part)} acts between steps after t = {t[k]:g} s and not at their ends"
            return Missed(float(t[k]), f"{why}; declare its times as `switches`")
    return None


def _between(t: np.ndarray, q: np.ndarray, v: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities at a part s of each step, (k, 1), by the cubic through q and v at its ends; (k, n) each.

    Straight lines would be off by h² a / 8, which a stiff controller answers.
    """
    (a, b, c), h = cubics(t, q, v), np.diff(t)[:, None]
    rate = np.divide(s * (2 * b + 3 * s * a), h, out=np.zeros_like(a), where=h > 0)
    return q[:-1] + s * (c + s * (b + s * a)), v[:-1] + rate


def _states_of(equation: StateEquation, part: Any) -> slice | None:
    """Where the states of an effect stand behind q and v; None if it has none."""
    for k, place in equation.equation_of_motion.states.items():
        if equation.plant.effects[k] is part:
            return slice(equation.state_size + place.start, equation.state_size + place.stop)
    return None


def _displacement(equation: StateEquation, path: Path, q: np.ndarray, k: int, torque: np.ndarray) -> float:
    """How far, at the end of the run, a torque during step k moves a joint: M⁻¹ τ h (T − t), in [rad] or [m]."""
    try:
        a = np.linalg.solve(equation.plant.at(float(path.t[k])).M(q[k]), torque)
    except (RobotDynError, np.linalg.LinAlgError):
        return np.inf
    return float(np.abs(a).max() * (path.t[k + 1] - path.t[k]) * (path.t[-1] - path.t[k]))
