"""The worst states of an arm: κ of M, the fastest motion, gravity torque over effort limit, lost digits.

    lost = −log₁₀(2⁻⁵³) − digits, computed with balls

A search begins at the worst of random states. A greedy search then finds a state with fewer nonzero entries and fewer
digits that is nearly as bad. [Zeller and Hildebrandt, Simplifying and isolating failure-inducing input, IEEE TSE 28,
2002]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from math import log10

import numpy as np

from robot_dyn import Plant, Robot
from robot_dyn.accuracy import (
    Batch,
    DigitCount,
    Implementation,
    digits_of,
    evaluate,
    implementations,
    worst_state,
)
from robot_dyn.control import gains_from
from robot_dyn.foundations import OverflowedError
from robot_dyn.lagrange import unit_diagonal_conditions
from robot_dyn.queries import FORWARD_DYNAMICS, INVERSE_DYNAMICS, M, N, Quantity
from robot_dyn.report import Budget
from robot_dyn.tools.stress.result import WorstCase
from robot_dyn.tools.stress.work import FAILURES, Work

FASTEST = "fastest motion"
HELD = ("steps", "gain")  # limits at the state where the motion is fastest under a PD
KEPT = 0.9  # fraction of the largest value that a simplified state keeps
NEGLIGIBLE = 1e-12  # relative to an effort limit: smaller torques are rounding of zero
_ROUNDS = 3  # attempts of a search that finds nothing worse
_FREQUENCY = 20.0  # [rad/s], for the gains of a PD
_MOST_DIGITS = 17
_OF_FLOAT64 = -log10(2.0**-53)
_FEW_TRIES = 60  # attempts for a state whose value needs balls
_OTHER_NUMBERS = ("Lagrangian, float32", "Lagrangian, longdouble")
BY_PD = f"PD of ω = {_FREQUENCY:g} rad/s, ζ = 1 for the median of M_ii, gravity balanced"

Measure = Callable[[Batch], np.ndarray]  # values at S states, (S,); nan for missing values
Gains = tuple[np.ndarray, np.ndarray]  # stiffness and damping of a PD
State = dict[str, np.ndarray]  # arrays (n,)


def worst(
    case: WorstCase, states: Batch, rng: np.random.Generator, arguments: tuple[str, ...], measure: Measure,
    budget: Budget,
) -> WorstCase:  # fmt: skip
    """Search for the state at which a measure is largest, and simplify it while time remains.

    Args:
        case: Quantity, joint, unit and note.
        states: Random states.
        rng: Random generator of the search.
        arguments: Names of the coordinates that the measure depends on.
        measure: Function to maximise.
        budget: Time budget of the search.

    Raises:
        OverflowedError: If the measure is not finite at any random state.
        OvertimeError: If the budget ends before the search.
    """

    def timed(batch: Batch) -> np.ndarray:
        budget.check()
        return measure(batch)

    values = measure(states)
    if np.isnan(values).all():
        raise OverflowedError("it is not finite at any random state")
    random, searched, best = float(np.nanmax(values)), -np.inf, states
    for _ in range(_ROUNDS):
        at, size = worst_state(states, rng, timed, values, arguments)
        if size > searched:
            best, searched = at, size
        if searched > random:
            break
    state = {name: best[name][0] for name in arguments}
    return case.at(
        float(np.nanmedian(values)), random, searched, *shrunk_state(state, states, measure, searched, budget)
    )


def shrunk_state(
    state: State, states: Batch, measure: Measure, size: float, budget: Budget, tries: int = 400
) -> tuple[State, float]:
    """Return a state with few digits, within the range of random states, that keeps 0.9 of a measure, and the measure.

    The state is the simplest one that is found before the budget ends.
    """
    names, n = tuple(state), len(next(iter(state.values())))
    low, high = (np.concatenate([end(states[name], axis=0) for name in names]) for end in (np.min, np.max))
    least = KEPT * size if size > 0 else -np.inf

    def at(x: np.ndarray) -> float:
        return float(measure(dict(zip(names, x.reshape(len(names), 1, n), strict=True)))[0])

    def is_as_bad(x: np.ndarray) -> bool:
        try:
            return bool(budget.left > 0 and (low <= x).all() and (x <= high).all() and at(x) >= least)
        except FAILURES:  # for example if an entry is 0
            return False

    small = shrunk(np.concatenate([state[name] for name in names]), is_as_bad, tries)
    return dict(zip(names, small.reshape(len(names), n), strict=True)), at(small)


def shrunk(state: np.ndarray, fails: Callable[[np.ndarray], bool], most: int = 400) -> np.ndarray:
    """Return a failing state with as few nonzero entries and digits as a greedy search finds.

    Args:
        state: A failing state, (k,); a state that does not fail is returned unchanged.
        fails: Function that returns True if a state, (k,), fails.
        most: Largest number of attempts.
    """
    best, tries = np.array(state, dtype=float), iter(range(most))

    def holds(young: np.ndarray) -> bool:
        return next(tries, None) is not None and bool(fails(young))

    if not holds(best):
        return best
    best = _zeroed(best, holds)
    entries = np.flatnonzero(best)
    for part in (entries, *entries[:, None]):  # first all together, then one by one
        best = _rounded(best, part, holds)
    return _zeroed(best, holds)


def _zeroed(best: np.ndarray, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Set entries to zero, one at a time, as long as the state fails."""
    before = None
    while before is not best:
        before = best
        for k in np.flatnonzero(best):
            young = best.copy()
            young[k] = 0.0
            best = young if holds(young) else best
    return best


def _rounded(best: np.ndarray, part: np.ndarray, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Round part of the entries to the fewest digits."""
    for digits in range(1, _MOST_DIGITS):
        young = best.copy()
        young[part] = [float(f"{x:.{digits - 1}e}") for x in best[part]]
        if np.array_equal(young, best) or holds(young):
            return young
    return best


def worst_configurations(
    robot: Robot, states: Batch, rng: np.random.Generator, gains: Gains | None, work: Work
) -> Iterator[WorstCase]:
    """Yield κ, the fastest motion, and gravity torque of each joint with an effort limit."""
    for case, measure in _measures(robot, gains, work):
        detail = case.note if case.quantity == FASTEST else case.joint
        name, needed_for = f"worst {case.quantity}{f', {detail}' if detail else ''}", HELD if case.note == BY_PD else ()
        result = work.do(name, partial(worst, case, states, rng, ("q",), measure), needed_for)
        if result is not None and result.searched > NEGLIGIBLE:  # otherwise gravity has no torque on the joint
            yield result


def _measures(robot: Robot, gains: Gains | None, work: Work) -> Iterator[tuple[WorstCase, Measure]]:
    """Yield the quantities to maximise; the fastest decay is computed with gravity compensated."""
    if robot.joint_without_inertia is None:
        yield WorstCase("κ of M"), lambda batch: unit_diagonal_conditions(evaluate(robot, M, batch))
        damping = work.do("friction at rest", lambda _: _slopes(robot))
        if damping is not None and damping.any():
            by_friction = WorstCase(FASTEST, unit="1/s", note="friction of the file, at rest")
            yield by_friction, lambda batch: _rates(robot, batch, damping)
        if gains is not None:
            yield WorstCase(FASTEST, unit="1/s", note=BY_PD), lambda batch: _rates_of_pd(robot, batch, gains[1])
    for i, joint in enumerate(robot.joint_names):
        limit = robot.effort_limit[i]
        if 0 < limit < np.inf:
            case = WorstCase("gravity torque / effort limit", joint, note=f"effort limit {limit:g}")
            yield case, lambda batch, i=i, limit=limit: np.abs(evaluate(robot, N, batch)[:, i]) / limit


def _slopes(robot: Robot) -> np.ndarray:
    """Return −∂τ/∂v of the friction of the file at rest, (n,)."""
    plant, zeros = Plant(robot, "urdf"), np.zeros(robot.n)
    h = 1e-9  # far below the velocities over which friction is regularised
    return np.array([-plant.torque(zeros, h * unit, t=0.0)[i] / h for i, unit in enumerate(np.eye(robot.n))])


def _rates(robot: Robot, batch: Batch, damping: np.ndarray) -> np.ndarray:
    """Return the largest eigenvalue of M⁻¹ diag(b) at each state, by b^½ M⁻¹ b^½."""
    inertia, root = evaluate(robot, M, batch), np.sqrt(damping)
    return np.linalg.eigvalsh(root[:, None] * np.linalg.solve(inertia, np.diag(root)[None]))[:, -1]


def _rates_of_pd(robot: Robot, batch: Batch, kd: np.ndarray) -> np.ndarray:
    """Return the fastest decay at each state under the gains of `pd_gains`."""
    mu = _rates(robot, batch, kd) / (2 * _FREQUENCY)
    return _FREQUENCY * np.where(mu > 1, mu + np.sqrt(np.maximum(mu * mu - mu, 0)), np.sqrt(mu))


def pd_gains(robot: Robot, states: Batch) -> Gains:
    """Return stiffness and damping of a critically damped PD for the median of M_ii at random states."""
    few = {name: x[:1000] for name, x in states.items()}
    return gains_from(np.median(np.diagonal(evaluate(robot, M, few), axis1=-2, axis2=-1), axis=0), _FREQUENCY)


def lost_digits(robot: Robot, states: Batch, rng: np.random.Generator, work: Work) -> Iterator[WorstCase | None]:
    """Yield the states at which implementations in float64 lose most digits of inverse and forward dynamics."""
    names = {quantity: f"digits lost in {quantity.name}" for quantity in (INVERSE_DYNAMICS, FORWARD_DYNAMICS)}
    built = work.do("implementations, machine code among them", lambda _: implementations(robot), tuple(names.values()))
    if built is None:
        return
    options, left_out = built
    work.left_out += left_out
    digit_count = DigitCount(robot, states, None, rng)
    for quantity, what in names.items():
        for implementation in options:
            if quantity in implementation.quantities and implementation.name not in _OTHER_NUMBERS:
                piece = partial(_lost, digit_count, implementation, quantity, what)
                yield work.do(f"{what} by {implementation.name}", piece)


def _lost(
    digit_count: DigitCount, implementation: Implementation, quantity: Quantity, what: str, budget: Budget
) -> WorstCase:
    """Return the case with the fewest digits of several searches."""

    def losses(batch: Batch) -> np.ndarray:
        state = {name: batch[name][0] for name in quantity.arguments}
        return np.array([_OF_FLOAT64 - digits_of(digit_count.error_at(implementation, quantity, state))])

    counts = [digit_count.count(implementation, quantity, budget.check)]
    while counts[-1].searched >= counts[-1].random and len(counts) < _ROUNDS:
        counts.append(digit_count.count(implementation, quantity, budget.check))
    lowest = min(counts, key=lambda count: count.searched)
    typical, random, lost = (_OF_FLOAT64 - digits for digits in (lowest.typical, lowest.random, lowest.searched))
    state = {name: np.array(x) for name, x in lowest.state.items()}
    note = f"{implementation.name}: {lowest.searched:.1f} digits hold, {lowest.typical:.1f} typically"
    small = shrunk_state(state, digit_count.states, losses, lost, budget, _FEW_TRIES)
    return WorstCase(what, unit="digits", note=note).at(typical, random, lost, *small)
