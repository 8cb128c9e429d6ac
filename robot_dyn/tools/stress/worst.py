"""The configurations at which an arm is hardest: κ of M, the fastest motion, gravity torque over effort limit.

Each is searched for from the worst of random states on. A greedy search then finds a state with fewer entries that are
not zero and fewer digits, which is nearly as bad. [Zeller and Hildebrandt, Simplifying and isolating failure-inducing
input, IEEE TSE 28, 2002]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robot_dyn import Plant, Robot
from robot_dyn.accuracy import Batch, evaluate, worst_state
from robot_dyn.control import gains_from
from robot_dyn.foundations import OverflowedError
from robot_dyn.lagrange import unit_diagonal_conditions
from robot_dyn.queries import M, N
from robot_dyn.report import Budget
from robot_dyn.tools.stress.result import WorstCase
from robot_dyn.tools.stress.work import Work

FASTEST = "fastest motion"
HELD = ("steps", "gain")  # limits that are looked for where the motion is fastest under a PD
KEPT = 0.9  # of what was found, that a shrunk state keeps
_ROUNDS = 3  # of a search that finds nothing worse
_NOTHING = 1e-12  # of an effort limit: rounding of zero
_FREQUENCY = 20.0  # [rad/s], of the gains of a PD
_MOST_DIGITS = 17
BY_PD = f"PD of ω = {_FREQUENCY:g} rad/s, ζ = 1 for the median of M_ii, gravity balanced"

Measure = Callable[[Batch], np.ndarray]  # at each of S states, (S,); nan where there is none
Gains = tuple[np.ndarray, np.ndarray]  # stiffness and damping of a PD
Sizes = dict[str, float]
State = dict[str, np.ndarray]  # (n,) each


def worst(
    states: Batch,
    rng: np.random.Generator,
    arguments: tuple[str, ...],
    measure: Measure,
    work: Work,
    name: str,
    needed_for: tuple[str, ...] = (),
) -> tuple[Sizes, State] | None:
    """Typical, random, searched and minimal size of a measure, and the shrunk state; None for lack of time.

    Args:
        states: Random ones.
        rng: Of the search.
        arguments: Names of those coordinates that the measure depends on.
        measure: What is made large.
        work: Does it.
        name: Of the measure.
        needed_for: As of `Work.do`.
    """
    found = work.do(name, lambda budget: _searched(states, rng, arguments, measure, budget), needed_for)
    if found is None:
        return None
    sizes, state = found
    state, minimal = shrunk_state(state, states, measure, sizes["searched"], name, work)
    largest = max(sizes["searched"], minimal)  # where the largest value lies at few digits
    return sizes | {"searched": largest, "minimal": minimal}, state


def _searched(
    states: Batch, rng: np.random.Generator, arguments: tuple[str, ...], measure: Measure, budget: Budget
) -> tuple[Sizes, State]:
    """Typical, random and searched size of a measure, and the state."""

    def timed(batch: Batch) -> np.ndarray:
        budget.check()
        return measure(batch)

    known = measure(states)
    if np.isnan(known).all():
        raise OverflowedError("it has a finite value at none of the random states")
    random, found, best = float(np.nanmax(known)), -np.inf, states
    for _ in range(_ROUNDS):
        at, size = worst_state(states, rng, timed, known, arguments)
        if size > found:
            best, found = at, size
        if found > random:
            break
    sizes = {"typical": float(np.nanmedian(known)), "random": random, "searched": found}
    return sizes, {name: best[name][0] for name in arguments}


def shrunk_state(
    state: State, states: Batch, measure: Measure, size: float, name: str, work: Work, tries: int = 400
) -> tuple[State, float]:
    """A state of few digits, within the range of random ones, at which a measure keeps 0.9 of its size; and how much.

    The state and size themselves for lack of time.
    """
    names, n = tuple(state), len(next(iter(state.values())))
    low, high = (np.concatenate([end(states[name], axis=0) for name in names]) for end in (np.min, np.max))
    least = KEPT * size if size > 0 else -np.inf

    def shrink(budget: Budget) -> tuple[State, float]:
        def at(x: np.ndarray) -> float:
            budget.check()
            rows = dict(zip(names, x.reshape(len(names), 1, n), strict=True))
            return float(measure({name: rows.get(name, each[:1]) for name, each in states.items()})[0])

        def fails(x: np.ndarray) -> bool:
            return bool((low <= x).all() and (x <= high).all() and at(x) >= least)

        small = shrunk(np.concatenate([state[name] for name in names]), fails, tries)
        return dict(zip(names, small.reshape(len(names), n), strict=True)), at(small)

    return work.do(f"shrinking of {name}", shrink) or (state, size)


def shrunk(state: np.ndarray, fails: Callable[[np.ndarray], bool], most: int = 400) -> np.ndarray:
    """A state that fails too, with as few entries and digits as a greedy search finds.

    Args:
        state: One that fails, (k,); it is given back as it is if it does not.
        fails: Whether a state (k,) has the property.
        most: How many states are tried at most.
    """
    best, left = np.array(state, dtype=float), most

    def holds(young: np.ndarray) -> bool:
        nonlocal left
        left -= 1
        return left >= 0 and bool(fails(young))

    if not holds(best):
        return best
    best = _zeroed(best, holds)
    entries = np.flatnonzero(best)
    for part in (entries, *entries[:, None]):  # all of them first, then each alone
        best = _rounded(best, part, holds)
    return _zeroed(best, holds)


def _zeroed(best: np.ndarray, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Parts of the entries set to zero: all of them, halves, and so on to single ones, until no more can be."""
    before = None
    while before is None or np.count_nonzero(best) < before:
        before = np.count_nonzero(best)
        for part in _parts(np.flatnonzero(best)):
            young = best.copy()
            young[part] = 0.0
            if np.any(best[part]) and holds(young):
                best = young
    return best


def _parts(entries: np.ndarray) -> Iterator[np.ndarray]:
    pieces = 1
    while len(entries) and pieces < 2 * len(entries):
        yield from np.array_split(entries, min(pieces, len(entries)))
        pieces *= 2


def _rounded(best: np.ndarray, part: np.ndarray, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Part of the entries in the fewest digits, the others as they are."""
    for digits in range(1, _MOST_DIGITS):
        young = best.copy()
        young[part] = [float(f"{x:.{digits - 1}e}") for x in best[part]]
        if np.array_equal(young, best) or holds(young):
            return young
    return best


def worst_configurations(
    robot: Robot, states: Batch, rng: np.random.Generator, gains: Gains | None, work: Work
) -> Iterator[WorstCase]:
    """κ, the fastest motion, and gravity torque of each joint with an effort limit."""
    for what, joint, unit, measure, note in _measures(robot, gains, work):
        of = note if what == FASTEST else joint
        name, needed_for = f"worst {what}{f', {of}' if of else ''}", HELD if note == BY_PD else ()
        found = worst(states, rng, ("q",), measure, work, name, needed_for)
        if found is None or not found[0]["searched"] > _NOTHING:
            continue  # gravity has no torque on the joint
        sizes, state = found
        yield WorstCase(what, joint, unit, **sizes, state=listed(state), note=note)


def listed(state: State) -> dict[str, list[float]]:
    """The state in plain numbers."""
    return {name: x.tolist() for name, x in state.items()}


def _measures(robot: Robot, gains: Gains | None, work: Work) -> Iterator[tuple[str, str, str, Measure, str]]:
    """What is looked for: quantity, joint, unit, measure and note; the fastest decay where gravity is balanced."""
    if robot.joint_without_inertia is None:
        yield "κ of M", "", "", lambda batch: unit_diagonal_conditions(evaluate(robot, M, batch)), ""
        if damping := work.do("friction at rest", lambda _: _slopes(robot)):
            note = "friction of the file, at rest"
            yield FASTEST, "", "1/s", lambda batch: _rates(robot, batch, np.array(damping)), note
        if gains is not None:
            yield FASTEST, "", "1/s", lambda batch: _rates_of_pd(robot, batch, gains[1]), BY_PD
    for i, joint in enumerate(robot.joint_names):
        limit = robot.effort_limit[i]
        if 0 < limit < np.inf:
            note = f"effort limit {limit:g}"

            def loaded(batch: Batch, i: int = i, limit: float = limit) -> np.ndarray:
                return np.abs(evaluate(robot, N, batch)[:, i]) / limit

            yield "gravity torque / effort limit", joint, "", loaded, note


def _slopes(robot: Robot) -> list[float]:
    """−∂τ/∂v of the friction of the file at rest, (n,); nothing without any."""
    plant, n = Plant(robot, "urdf"), robot.n
    if not plant.effects:
        return []
    h = 1e-9  # far below the velocities over which friction is regularised
    zeros = np.zeros(n)
    return [float(-plant.torque(0.0, zeros, h * unit)[i] / h) for i, unit in enumerate(np.eye(n))]


def _rates(robot: Robot, batch: Batch, damping: np.ndarray) -> np.ndarray:
    """The largest eigenvalue of M⁻¹ diag(b) at each state, that of b^½ M⁻¹ b^½."""
    inertia, root = evaluate(robot, M, batch), np.sqrt(damping)
    return np.linalg.eigvalsh(root[:, None] * np.linalg.solve(inertia, np.diag(root)[None]))[:, -1]


def _rates_of_pd(robot: Robot, batch: Batch, kd: np.ndarray) -> np.ndarray:
    """The fastest decay at each state under the gains of `pd_gains`."""
    mu = _rates(robot, batch, kd) / (2 * _FREQUENCY)
    return _FREQUENCY * np.where(mu > 1, mu + np.sqrt(np.maximum(mu * mu - mu, 0)), np.sqrt(mu))


def pd_gains(robot: Robot, states: Batch) -> Gains:
    """Stiffness and damping of a critically damped PD for the median of M_ii at random states."""
    few = {name: x[:1000] for name, x in states.items()}
    return gains_from(np.median(np.diagonal(evaluate(robot, M, few), axis1=-2, axis2=-1), axis=0), _FREQUENCY)
