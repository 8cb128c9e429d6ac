"""A Moreau–Jean step of a state equation: the convex problem, its solution, and the state after the step.

    M(q_m) v⁺ = M v + h (τ − C v − N) + r,   r the impulses of friction and stops:  −r ∈ h f ∂|v⁺| + Nc(v⁺)

at q_m = q + h/2 v, with Nc the normal cone of the bounds of v⁺. The work of a force is its impulse times the mean
velocity (v + v⁺)/2, so that the energy ledger contains the energy removed by stops and friction. Functions work on
floats, or on symbols for machine code; see `integrate.time_stepping`.
"""

from __future__ import annotations

import numpy as np

from robot_dyn.effects.effect import Conservative
from robot_dyn.effects.set_valued import SetValued, friction_and_bounds, split_impulses
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.convex import PASSES, newton
from robot_dyn.foundations.linear_algebra import NotPositiveDefiniteError
from robot_dyn.integrate.time_stepping import problem_rows
from robot_dyn.simulation.dynamics.state_equation import StateEquation


def problem(equation: StateEquation, t: float, x: Array, held: Array | None) -> Array:
    """Return the numbers of the convex problem of a step, from `Problem.M` on.

    Args:
        equation: The state equation.
        t: Time in the middle of the step, in [s].
        x: The state at the start of the step, then the length of the step in [s], (m + 1,).
        held: The actuation in zero-order hold; None if the controller acts continuously.
    """
    motion, n, (y, h) = equation.equation_of_motion, equation.plant.dynamics.n, (x[:-1], x[-1])
    q, v, z, _ = equation.state(y)
    q = q + v * (h / 2)
    z_controller, z_effects = z[: equation.state_size], z[equation.state_size :]
    u, reached = motion.applied(equation.command(t, q, v, z) if held is None else held, v, z_effects)
    torques = [
        (force, torque)
        for force, torque in zip(motion.forces, motion.torques(t, q, v, z=z_effects), strict=True)
        if not isinstance(force, SetValued)
    ]
    M = equation.plant.M(q)
    load = sum((torque for _, torque in torques), start=u) - equation.plant.dynamics.inverse_dynamics(q, v, 0 * v)
    friction, lower, upper, shares = friction_and_bounds(motion.set_valued, q, v)
    working = [torque for force, torque in torques if not isinstance(force, Conservative)]
    rates = np.zeros_like(z)
    if held is None and equation.controller is not None and equation.state_size:
        rates[: equation.state_size] = equation.controller.state_rate(t, q, v, z_controller)
    for place, rate in motion.state_rates(t, q, v, u, reached, z_effects):
        rates[equation.state_size + place.start : equation.state_size + place.stop] = rate
    rates = rates[: len(rates) - equation.impulses]
    of_joints = M @ v + h * load, h * friction, lower, upper, u
    return np.concatenate([M[np.triu_indices(n)], *of_joints, *working, rates, *shares])


def solution(n: int, numbers: Array, place: Array) -> Array:
    """Return v⁺ and its places by one Newton step, and the number of places that changed, (2 n + 1,).

    Args:
        n: Number of joints.
        numbers: The result of `problem`.
        place: Places at the start of the Newton step, see `foundations.convex.newton`, (n,).
    """
    M, vectors = _split(n, numbers)
    x, after = newton(M, vectors["p"], vectors["f"], vectors["lower"], vectors["upper"], place)
    return np.concatenate([x, after, np.abs(after - place) @ np.ones((n, 1))])


def stepped(equation: StateEquation, t: float, x: Array, held: Array | None) -> Array:
    """Return y⁺, v⁺ and its places, the number of places that changed, and the result of `problem`; in floats.

    Args:
        equation: The state equation.
        t: Time in the middle of the step, in [s].
        x: The state, the length of the step in [s], and the places to start from, (m + 1 + n,).
        held: See `problem`.
    """
    n = equation.plant.dynamics.n
    numbers = problem(equation, t, x[:-n], held)
    solved = np.concatenate([_solved(n, numbers, x[-n:]), numbers])
    return np.concatenate([after_step(equation, x[:-n], solved), solved])


def _solved(n: int, numbers: Array, place: Array) -> Array:
    """Return the solution after at most PASSES Newton steps; nan if M is not positive definite."""
    try:
        result = solution(n, numbers, place)
        for _ in range(PASSES - 1):
            if result[2 * n] > 0:
                result = solution(n, numbers, result[n : 2 * n])
    except NotPositiveDefiniteError:  # the state has diverged: nan ends the run, as in machine code
        return np.full(2 * n + 1, np.nan)
    return result


def after_step(equation: StateEquation, x: Array, solved: Array) -> Array:
    """Return the state after a step, (m,).

    Args:
        equation: The state equation.
        x: See `problem`.
        solved: v⁺, its places, the number of places that changed, and the result of `problem`.
    """
    n, motion, (y, h) = equation.plant.dynamics.n, equation.equation_of_motion, (x[:-1], x[-1])
    v, after, numbers = y[n : 2 * n], solved[:n], solved[problem_rows(n).M :]
    M, vectors = _split(n, numbers)
    mean = (v + after) / 2
    reaction = M @ after - vectors["p"]
    f, lower, upper = vectors["f"], vectors["lower"], vectors["upper"]
    friction = np.where(after > 0, -f, np.where(after < 0, f, np.minimum(np.maximum(reaction, -f), f)))
    rest = reaction - friction
    stops = np.where(after <= lower, rest, np.where(after >= upper, rest, 0 * f))
    working = [force for force in motion.forces if not isinstance(force, Conservative)]
    at, works = problem_rows(n).rest - problem_rows(n).M, [h * (vectors["u"] @ mean)]
    smooth = sum(not isinstance(force, SetValued) for force in working)
    rates = numbers[at + n * smooth :][: equation.states - equation.impulses]
    impulses = split_impulses(motion.set_valued, friction, stops, numbers[at + n * smooth + len(rates) :])
    for force in working:
        if isinstance(force, SetValued):
            works.append(next(impulses) @ mean)
        else:
            works.append(h * (numbers[at : at + n] @ mean))
            at += n
    total = y[2 * n :].copy()
    total[: len(rates)] = total[: len(rates)] + h * rates
    if equation.impulses:
        total[len(rates) : len(rates) + n] = total[len(rates) : len(rates) + n] + reaction
    for k, work in enumerate(works):
        total[len(total) - len(works) + k] = total[len(total) - len(works) + k] + work
    return np.concatenate([y[:n] + mean * h, after, total])


def _split(n: int, numbers: Array) -> tuple[Array, dict[str, Array]]:
    """Return the mass matrix, and the vectors of the problem by their names in `Problem`."""
    rows = problem_rows(n)
    i, j = np.triu_indices(n)
    M = np.empty((n, n), dtype=numbers.dtype).view(type(numbers))
    M[i, j] = M[j, i] = numbers[: rows.p - rows.M]
    return M, {name: numbers[getattr(rows, name) - rows.M :][:n] for name in ("p", "f", "lower", "upper", "u")}
