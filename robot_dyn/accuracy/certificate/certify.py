"""What a digit costs in M, C, N, inverse and forward dynamics: true digits of each implementation beside its time.

    digits = −log₁₀(error),   error against balls of radius 1e-20

Errors of M_ij are relative to √(M_ii M_jj); of accelerations, in the norm of M, to Σ ‖M⁻¹ τ_k‖ of τ, C v and N; of C, N
and inverse dynamics to the largest entry in the units √M_ii of the joints, or its root mean square over the random
states if that is more: an answer that vanishes at a state does not count as lost digits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import inf
from typing import Any

import numpy as np

from robot_dyn.accuracy.certificate.certificate import Certificate, Condition, Held
from robot_dyn.accuracy.certificate.digit_count import DigitCount
from robot_dyn.accuracy.certificate.implementation import Implementation, evaluate, implementations
from robot_dyn.accuracy.certificate.worst_case_search import Batch, random_states, row, worst_state
from robot_dyn.accuracy.correct_digits import QUANTITIES, warn_below
from robot_dyn.foundations.arithmetic import Ball
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.validate import function, integer, joint_values
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.scale import unit_diagonal_conditions
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import M
from robot_dyn.queries.quantity import MOST_DIGITS, Quantity
from robot_dyn.report.environment import processor_and_versions
from robot_dyn.report.result import INTERRUPTED
from robot_dyn.report.timing import in_turns

_AT_LEAST_S = 1e-3  # of a loop that is timed
_MOST_REPEATS, _LEAST_SAMPLES, _MOST_SAMPLES = 1000, 100, 10**6


def certify(
    robot: Robot,
    *,
    q: Any = None,
    v: Any = None,
    a: Any = None,
    tau: Any = None,
    samples: int = 10_000,
    seed: int = 0,
    repeats: int = 11,
    on_progress: Callable[[float, str], object] | None = None,
) -> Certificate:
    """Count the true digits of M, C, N, inverse and forward dynamics by each implementation, and time its queries.

    Implementations are Pinocchio, the Lagrangian in float32, float64 and longdouble, articulated bodies, machine code
    (judged by its own right angles) and balls. Random states are those of `compare`, in numbers of float32, so that no
    implementation rounds them. Errors at these states, and in the search that begins at the worst of them, are taken
    against longdouble; balls judge the worst of each. Errors of longdouble are taken against balls, at 1/250 of the
    states.

    Args:
        robot: The robot.
        q: Positions of a state to look at too, (n,), in [rad] or [m].
        v: Its velocities, (n,), in [rad/s] or [m/s]; 0 unless given.
        a: Its accelerations, (n,), in [rad/s²] or [m/s²]; 0 unless given.
        tau: Its torques, (n,), in [N m] or [N]; 0 unless given.
        samples: Number of random states.
        seed: Of the random generator.
        repeats: How often each query is timed; they take turns, and the least time counts.
        on_progress: Called with the part that is done, from 0 to 1, and with what is being done.

    Raises:
        QueryError: If an argument is wrong.
    """
    robot = warn_below(robot, None)
    samples = integer("samples", samples, least=_LEAST_SAMPLES, most=_MOST_SAMPLES)
    seed, repeats = integer("seed", seed, most=2**128 - 1), integer("repeats", repeats, least=1, most=_MOST_REPEATS)
    report = function("on_progress", on_progress, "(part, what)") or (lambda part, what: None)
    given = _given(robot, q, v, a, tau)
    rng = np.random.default_rng(seed)
    states = random_states(robot, samples, rng)
    report(0.0, "machine code")
    found, left_out = implementations(robot)
    digit_count, held = DigitCount(robot, states, given, rng), list[Held]()
    quantities = [each for each in QUANTITIES.values() if each in found[0].quantities]
    try:
        for k, quantity in enumerate(quantities):
            held += _quantity(
                digit_count, quantity, [each for each in found if quantity in each.quantities], repeats, left_out,
                lambda part, what, k=k: report((k + part) / len(quantities), what),
            )  # fmt: skip
    except KeyboardInterrupt:
        left_out.append(INTERRUPTED)
    return Certificate(
        robot.name, robot.joint_names, tuple(held), digit_count.decimals, digit_count.right_angles,
        _condition(robot, states, given, rng), digit_count.bits, tuple(left_out), processor_and_versions(), seed,
    )  # fmt: skip


def _given(robot: Robot, q: Any, v: Any, a: Any, tau: Any) -> dict[str, np.ndarray] | None:
    """The state to look at, or None."""
    more = {name: x for name, x in {"v": v, "a": a, "tau": tau}.items() if x is not None}
    if q is None:
        if more:
            raise QueryError(f"{next(iter(more))} is given without q; give q, or leave it out")
        return None
    state = {name: np.zeros(robot.n) for name in ("v", "a", "tau")}
    for name, x in ({"q": q} | more).items():
        state[name] = np.array(joint_values(name, x, robot.joint_names))
        if state[name].ndim != 1:
            raise QueryError(f"{name} must have shape ({robot.n},), got {state[name].shape}")
    return state


def _quantity(
    digit_count: DigitCount, quantity: Quantity, found: list[Implementation], repeats: int, left_out: list[str],
    report: Callable[[float, str], object],
) -> list[Held]:  # fmt: skip
    """Return digits and times of one quantity by each implementation; `left_out` takes those without an answer."""
    held, calls, state = list[Held](), {}, digit_count.given or row(digit_count.states, 0)
    for k, implementation in enumerate(found):
        report(k / len(found), f"{quantity.name}: {implementation.name}")
        try:
            held.append(digit_count.count(implementation, quantity))
            calls[implementation.name] = _call(implementation.engine, quantity, state)
        except QueryError as error:
            left_out.append(str(error))
    bits = digit_count.truth(digit_count.robot, quantity, state).bits
    name, most = f"balls, {bits} bits", float(MOST_DIGITS)
    calls[name] = _call(Lagrangian(digit_count.robot, Ball(bits)), quantity, state)
    given = None if digit_count.given is None else most
    at = {key: state[key].tolist() for key in quantity.arguments}
    held.append(Held(quantity.name, name, given, most, most, most, 1, state=at))
    report(1.0, f"{quantity.name}: times")
    times = in_turns(calls, repeats, _AT_LEAST_S)
    return [replace(count, times=tuple(times[count.implementation])) for count in held]


def _call(engine: Any, quantity: Quantity, state: dict[str, np.ndarray]) -> Callable[[], object]:
    """A query of one state, ready to be timed."""
    return partial(getattr(engine, quantity.name), *(state[name] for name in quantity.arguments))


def _condition(robot: Robot, states: Batch, given: dict[str, np.ndarray] | None, rng: np.random.Generator) -> Condition:
    """κ of M, and its largest."""

    def conditions(states: Batch) -> np.ndarray:
        return unit_diagonal_conditions(evaluate(robot, M, states))

    if robot.joint_without_inertia is not None:
        return Condition(None if given is None else inf, inf, inf, inf, ())
    known = conditions(states)
    worst, most = worst_state(states, rng, conditions, known, ("q",))
    own = None if given is None else float(conditions({"q": given["q"][None]})[0])
    return Condition(own, float(np.median(known)), float(known.max()), most, tuple(worst["q"][0].tolist()))
