"""The configurations at which an arm is hardest: κ of M, the fastest motion, gravity torque over effort limit.

Each is searched for from the worst of random states on (`certificate.worst_case_search`), and shrunk to few digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robot_dyn import Plant, Robot
from robot_dyn.accuracy import Batch, Search, evaluate
from robot_dyn.control import gains_from
from robot_dyn.foundations import OverflowedError
from robot_dyn.lagrange import unit_diagonal_conditions
from robot_dyn.queries import M, N
from robot_dyn.report import Budget
from robot_dyn.tools.stress.finding import WorstCase
from robot_dyn.tools.stress.shrink import shrunk
from robot_dyn.tools.stress.work import Work

FASTEST = "fastest motion"
HELD = ("steps", "gain")  # limits that are looked for where the motion is fastest under a PD
KEPT = 0.9  # of what was found, that a shrunk state keeps
_ROUNDS = 3  # of a search that finds nothing worse
_NOTHING = 1e-12  # of an effort limit: rounding of zero
_FREQUENCY = 20.0  # [rad/s], of the gains of a PD
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
    found = work.do(name, lambda budget: searched(states, rng, arguments, measure, budget), needed_for)
    if found is None:
        return None
    sizes, state = found
    least = KEPT * sizes["searched"]
    small = work.do(f"shrinking of {name}", lambda until: shrunk_state(state, states, measure, least, until))
    state, minimal = small or (state, sizes["searched"])
    largest = max(sizes["searched"], minimal)  # where the largest value lies at few digits
    return sizes | {"searched": largest, "minimal": minimal}, state


def searched(
    states: Batch, rng: np.random.Generator, arguments: tuple[str, ...], measure: Measure, budget: Budget
) -> tuple[Sizes, State]:
    """Typical, random and searched size of a measure, and the state."""
    known = measure(states)
    if np.isnan(known).all():
        raise OverflowedError("it has a finite value at none of the random states")
    random, found, best = float(np.nanmax(known)), -np.inf, states
    for _ in range(_ROUNDS):
        at, size = Search(states, rng).worst(_timed(measure, budget), known, arguments)
        if size > found:
            best, found = at, size
        if found > random:
            break
    sizes = {"typical": float(np.nanmedian(known)), "random": random, "searched": found}
    return sizes, {name: best[name][0] for name in arguments}


def _timed(measure: Measure, budget: Budget) -> Measure:
    """A measure that asks first whether there is time."""

    def made(batch: Batch) -> np.ndarray:
        budget.check()
        return measure(batch)

    return made


def shrunk_state(
    state: State, states: Batch, measure: Measure, least: float, budget: Budget, most: int = 400
) -> tuple[State, float]:
    """A state of few digits, within the range of random ones, at which a measure is at least so much; and how much."""
    measure = _timed(measure, budget)
    names, n = tuple(state), len(next(iter(state.values())))
    low = np.concatenate([states[name].min(axis=0) for name in names])
    high = np.concatenate([states[name].max(axis=0) for name in names])

    def at(x: np.ndarray) -> float:
        rows = dict(zip(names, x.reshape(len(names), 1, n), strict=True))
        return float(measure({name: rows.get(name, each[:1]) for name, each in states.items()})[0])

    def fails(x: np.ndarray) -> bool:
        return bool((low <= x).all() and (x <= high).all() and at(x) >= least)

    made = shrunk(np.concatenate([state[name] for name in names]), fails, most)
    return dict(zip(names, made.reshape(len(names), n), strict=True)), at(made)


def worst_configurations(
    robot: Robot, states: Batch, rng: np.random.Generator, gains: Gains | None, work: Work
) -> Iterator[WorstCase]:
    """κ, the fastest motion, and gravity torque of each joint with an effort limit."""
    for what, joint, unit, measure, note in _asked(robot, gains, work):
        of = note if what == FASTEST else joint
        name, needed_for = f"worst {what}{f', {of}' if of else ''}", HELD if note == BY_PD else ()
        found = worst(states, rng, ("q",), measure, work, name, needed_for)
        if found is None or not found[0]["searched"] > _NOTHING:
            continue  # gravity has no torque on the joint
        sizes, state = found
        yield WorstCase(what, joint, unit, **sizes, state=listed(state), note=note)


def listed(state: dict[str, np.ndarray]) -> dict[str, list[float]]:
    """The state in plain numbers."""
    return {name: x.tolist() for name, x in state.items()}


def _asked(robot: Robot, gains: Gains | None, work: Work) -> Iterator[tuple[str, str, str, Measure, str]]:
    """What is looked for: quantity, joint, unit, measure and note."""
    if robot.joint_without_inertia is None:
        yield "κ of M", "", "", lambda batch: unit_diagonal_conditions(evaluate(robot, M, batch)), ""
        yield from _fastest(robot, gains, work)
    for i, joint in enumerate(robot.joint_names):
        limit = robot.effort_limit[i]
        if 0 < limit < np.inf:
            note = f"effort limit {limit:g}"

            def loaded(batch: Batch, i: int = i, limit: float = limit) -> np.ndarray:
                return np.abs(evaluate(robot, N, batch)[:, i]) / limit

            yield "gravity torque / effort limit", joint, "", loaded, note


def _fastest(robot: Robot, gains: Gains | None, work: Work) -> Iterator[tuple[str, str, str, Measure, str]]:
    """The fastest decay by the friction of the file, and by a PD of stated gains, both where gravity is balanced."""
    if damping := work.do("friction at rest", lambda _: _slopes(robot)):
        note = "friction of the file, at rest"
        yield FASTEST, "", "1/s", lambda batch: _rates(robot, batch, np.array(damping)), note
    if gains is None:
        return
    _, kd = gains

    def by_pd(batch: Batch) -> np.ndarray:
        mu = _rates(robot, batch, kd) / (2 * _FREQUENCY)
        return _FREQUENCY * np.where(mu > 1, mu + np.sqrt(np.maximum(mu * mu - mu, 0)), np.sqrt(mu))

    yield FASTEST, "", "1/s", by_pd, BY_PD


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


def pd_gains(robot: Robot, states: Batch, frequency: float = _FREQUENCY) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping of a critically damped PD for the median of M_ii at random states."""
    few = {name: x[:1000] for name, x in states.items()}
    return gains_from(np.median(np.diagonal(evaluate(robot, M, few), axis1=-2, axis2=-1), axis=0), frequency)
