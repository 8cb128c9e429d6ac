"""A step of Moreau and Jean of a state equation, as its method asks for it: the problem, its solution, what is behind.

    M(q_m) v⁺ = M v + h (τ − C v − N) + r,   r of what holds joints:  −r ∈ h f ∂|v⁺| + N(v⁺)

at q_m = q + h/2 v. The work of each force is that of its impulse at the mean velocity (v + v⁺)/2, so that the ledger
tells what stops and friction took. In floats, or in symbols for machine code. [As of `integrate.time_stepping`]
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.effects.effect import Conservative
from robot_dyn.effects.set_valued import SetValued, impulses_of, in_a_step
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.convex import PASSES, newton
from robot_dyn.foundations.linear_algebra import NotPositiveDefiniteError
from robot_dyn.integrate.time_stepping import problem_rows
from robot_dyn.simulation.dynamics.state_equation import StateEquation


def problem(equation: StateEquation, t: Any, x: Array, held: Array | None) -> Array:
    """The numbers of the convex problem of a step, from `Problem.M` on.

    Args:
        equation: The state equation.
        t: Time in the middle of the step, in [s].
        x: The state at its start and, last, its length in [s].
        held: The actuation in zero-order hold; None of a controller that acts continuously.
    """
    motion, n, (y, h) = equation.equation_of_motion, equation.plant.dynamics.n, (x[:-1], x[-1])
    q, v, z, _ = equation.state(y)
    q = q + v * (h / 2)
    of_controller, of_effects = z[: equation.state_size], z[equation.state_size :]
    u, reached = motion.applied(equation.command(t, q, v, z) if held is None else held, of_effects)
    torques = [
        (force, torque)
        for force, torque in zip(motion.forces, motion.torques(t, q, v, z=of_effects), strict=True)
        if not isinstance(force, SetValued)
    ]
    M = equation.plant.M(q)
    load = sum((torque for _, torque in torques), start=u) - equation.plant.dynamics.inverse_dynamics(q, v, 0 * v)
    friction, lower, upper, shares = in_a_step(motion.set_valued, q, v)
    working = [torque for force, torque in torques if not isinstance(force, Conservative)]
    rates = np.zeros_like(z)
    if held is None and equation.controller is not None and equation.state_size:
        rates[: equation.state_size] = equation.controller.state_rate(t, q, v, of_controller)
    for place, rate in motion.state_rates(t, q, v, u, reached, of_effects):
        rates[equation.state_size + place.start : equation.state_size + place.stop] = rate
    rates = rates[: len(rates) - equation.impulses]
    of_joints = M @ v + h * load, h * friction, lower, upper, u
    return np.concatenate([M[np.triu_indices(n)], *of_joints, *working, rates, *shares])


def solution(n: int, known: Array, place: Array) -> Array:
    """v⁺ and its places by one Newton step, and how many of these have changed.

    Args:
        n: Number of joints.
        known: The numbers of `problem`.
        place: The places before.
    """
    M, given = _of(n, known)
    x, after = newton(M, given["p"], given["f"], given["lower"], given["upper"], place)
    return np.concatenate([x, after, np.abs(after - place) @ np.ones((n, 1))])


def stepped(equation: StateEquation, t: float, x: Array, held: Array | None) -> Array:
    """y⁺, v⁺ and its places, how many have changed, and the numbers of `problem`; in floats.

    Args:
        equation: The state equation.
        t: Time in the middle of the step, in [s].
        x: The state, the step, and the places to start from.
        held: As of `problem`.
    """
    n = equation.plant.dynamics.n
    known = problem(equation, t, x[:-n], held)
    found = np.concatenate([_solved(n, known, x[-n:]), known])
    return np.concatenate([behind(equation, x[:-n], found), found])


def _solved(n: int, known: Array, place: Array) -> Array:
    """The solution after as many Newton steps as it takes, but for PASSES at most; nan where M is not definite."""
    try:
        made = solution(n, known, place)
        for _ in range(PASSES - 1):
            if made[2 * n] > 0:
                made = solution(n, known, made[n : 2 * n])
    except NotPositiveDefiniteError:  # of a state far beyond all bounds: the run ends there, as in machine code
        return np.full(2 * n + 1, np.nan)
    return made


def behind(equation: StateEquation, x: Array, found: Array) -> Array:
    """The state behind a step.

    Args:
        equation: The state equation.
        x: As of `problem`.
        found: v⁺, its places, how many changed, and the numbers of `problem`.
    """
    n, motion, (y, h) = equation.plant.dynamics.n, equation.equation_of_motion, (x[:-1], x[-1])
    v, after, known = y[n : 2 * n], found[:n], found[problem_rows(n).M :]
    M, given = _of(n, known)
    mean = (v + after) / 2
    reaction = M @ after - given["p"]
    f, lower, upper = given["f"], given["lower"], given["upper"]
    rubbing = np.where(after > 0, -f, np.where(after < 0, f, np.minimum(np.maximum(reaction, -f), f)))
    left = reaction - rubbing
    stopping = np.where(after <= lower, left, np.where(after >= upper, left, 0 * f))
    own = [force for force in motion.forces if not isinstance(force, Conservative)]
    at, works = problem_rows(n).rest - problem_rows(n).M, [h * (given["u"] @ mean)]
    smooth = sum(not isinstance(force, SetValued) for force in own)
    rates = known[at + n * smooth :][: equation.states - equation.impulses]
    impulses = impulses_of(motion.set_valued, rubbing, stopping, known[at + n * smooth + len(rates) :])
    for force in own:
        if isinstance(force, SetValued):
            works.append(next(impulses) @ mean)
        else:
            works.append(h * (known[at : at + n] @ mean))
            at += n
    total = y[2 * n :].copy()
    total[: len(rates)] = total[: len(rates)] + h * rates
    if equation.impulses:
        total[len(rates) : len(rates) + n] = total[len(rates) : len(rates) + n] + reaction
    for k, work in enumerate(works):
        total[len(total) - len(works) + k] = total[len(total) - len(works) + k] + work
    return np.concatenate([y[:n] + mean * h, after, total])


def _of(n: int, known: Array) -> tuple[Array, dict[str, Array]]:
    """The mass matrix, and the other numbers of joints by their names in `Problem`."""
    rows = problem_rows(n)
    i, j = np.triu_indices(n)
    M = np.empty((n, n), dtype=known.dtype).view(type(known))
    M[i, j] = M[j, i] = known[: rows.p - rows.M]
    return M, {name: known[getattr(rows, name) - rows.M :][:n] for name in ("p", "f", "lower", "upper", "u")}
