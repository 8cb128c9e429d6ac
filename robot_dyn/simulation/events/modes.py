"""The modes of a run with dry friction or rigid stops: the arrays that the loop has of them, and names of events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np

from robot_dyn.effects.effect import Conservative
from robot_dyn.effects.rigid_backlash import RigidBacklash
from robot_dyn.effects.rigid_stops import RigidStops, touching
from robot_dyn.effects.set_valued import Mode
from robot_dyn.effects.settling import settling
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.event_log import What, event_log
from robot_dyn.simulation.events.holding import Holding, Laws, Places, Room
from robot_dyn.simulation.events.mode_change import REACTIONS, at_once, start, width

_IMPACTS = 64  # that are stored
_STOP = {-1: "lower stop", 1: "upper stop"}
_END = {-1: "backward end", 1: "forward end"}
_PHRASES = {
    What.STRIKES: "strikes {}", What.RESTS_AT_LAST: "comes to rest at {}", What.STICKS: "sticks",
    What.RESTS: "rests at {}", What.SLIDES: "slides", What.LEAVES: "leaves {}", What.REVERSES: "reverses",
}  # fmt: skip


@final
class Modes:
    """The mode of a run.

    Args:
        equation: Its state equation, of effects without a mode.
        holding: The mode, as numbers.
    """

    def __init__(self, equation: StateEquation, holding: Holding) -> None:
        self.equation, self.holding = equation, holding

    def start(self, y: np.ndarray) -> None:
        """The mode at the start: all that may be held is, until the reactions are known."""
        start(self.holding, y[:, None].copy())

    @property
    def mode(self) -> Mode:
        """The mode of the joints."""
        of, n = self.holding, self.holding.laws.n
        contact = of.contact.copy() if len(of.laws.motors) else None
        return Mode(of.held[:n].copy(), of.direction[:n].copy(), contact)

    @property
    def guards(self) -> tuple[np.ndarray, np.ndarray]:
        """The entry of y of each guard, and whether it is its rate, (K,)."""
        laws = self.holding.laws
        stops = [laws.rows] * (width(laws) - REACTIONS - 1)
        rows = np.column_stack([laws.impulses, laws.impulses, laws.speeds, *stops])
        return rows.ravel(), np.tile(np.arange(width(laws)) < REACTIONS, len(laws.rows))

    def joint(self, guard: int) -> str:
        """The joint of a guard, by name."""
        laws = self.holding.laws
        return self._joint(guard // width(laws))

    def _joint(self, i: int) -> str:
        return self.equation.plant.dynamics.joint_names[self.holding.laws.joints[i]]

    def occurrence(self, row: Sequence[float]) -> Occurrence:
        """The event of a row of the log."""
        n, (t, i, what, side, direction, *state) = self.holding.laws.n, row
        joint, end = self._joint(int(i)), ""
        if side:
            end = f"its {_STOP[int(side)]}" if i < n else f"the {_END[int(side)]} of its backlash"
        name = f"{joint} {_PHRASES[What(int(what))].format(end)}"
        return Occurrence(t, name, int(direction), tuple(state[:n]), tuple(state[n:]), joint)


def modes_of(equation: StateEquation, run_parameters: np.ndarray, places: Places, most: int, brief: float) -> Modes:
    """The modes of a state equation of effects without a mode; nothing is held yet.

    Args:
        equation: The state equation.
        run_parameters: Those of it in which nothing is held, (O, 1).
        places: Where they have the mode.
        most: Changes of the mode that are too many in a brief time.
        brief: That time, in [s].
    """
    laws = laws_of(equation)
    n, N = laws.n, len(laws.rows)
    held, direction = np.zeros((2, N))
    none, changed = np.zeros((2, 1), np.int64)
    holding = Holding(
        laws, places, held, direction, np.zeros(n), run_parameters, n * equation.sampled, np.zeros(_IMPACTS),
        np.zeros((_IMPACTS, max(N, 2))), none, np.zeros(most), changed, brief, event_log(n, at_once(laws), brief),
        _room(equation, N, n),
    )  # fmt: skip
    return Modes(equation, holding)


def laws_of(equation: StateEquation) -> Laws:
    """The laws of what may hold the joints of a state equation."""
    n, motion = equation.plant.dynamics.n, equation.equation_of_motion
    works: list[Any] = [each for each in equation.plant.forces if not isinstance(each, Conservative)]
    first_work, of_states = equation.size - len(equation.sources) + 1, 2 * n + equation.state_size
    contacts = []
    for k, place in motion.states.items():
        if isinstance(effect := motion.effects[k], RigidBacklash):
            contacts.append(_contact_coordinates(effect, n, of_states + place.start, first_work + works.index(effect)))
    columns = [np.concatenate(each) for each in zip(*contacts, strict=True)] if contacts else [np.zeros(0)] * 9
    joints, delta, speed, motors, impulse, work, inertia, level, e = columns
    others = [each for each in motion.set_valued if not isinstance(each, RigidStops)]
    stops = [each for each in motion.set_valued if isinstance(each, RigidStops)]
    intervals = [each.at_rest(np.zeros(n)) for each in others]
    least, most = (sum((each[k] for each in intervals), start=np.zeros(n)) for k in (0, 1))
    sliding = sum((each.sliding(np.zeros(n)) for each in motion.set_valued), start=np.zeros(n))
    lower, upper, restitution = _stops(stops, n, level, e)
    works_of_stops = [first_work + works.index(each) for each in stops] or [-1] * bool(contacts)

    def rows(of_joints: np.ndarray, of_gaps: np.ndarray) -> np.ndarray:
        return np.concatenate([of_joints, of_gaps.astype(np.int64)])

    def wide(of_joints: np.ndarray) -> np.ndarray:
        return np.concatenate([of_joints, np.zeros(len(joints), of_joints.dtype)])

    i, end = np.arange(n), 2 * n + equation.states
    return Laws(
        n, rows(i, joints), rows(i, delta), rows(n + i, speed), rows(end - n + i, impulse), motors.astype(np.int64),
        work.astype(np.int64), inertia, wide(least), wide(most), wide(sliding), wide(most > 0), lower, upper,
        restitution, touching(lower, -1), touching(upper, 1), np.array(works_of_stops, np.int64),
    )  # fmt: skip


def _stops(stops: Sequence[RigidStops], n: int, level: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Lower and upper stops and e of each effect, with the ends of gaps, (3, S, N), and two columns at least."""
    known: list[Any] = [[each.lower, each.upper, each.restitution] for each in stops]
    known = known or [[-np.inf, np.inf, 0.0]] * (len(level) > 0)
    of_joints = np.array([[np.broadcast_to(x, n) for x in each] for each in known], float).reshape(-1, 3, n)
    of_gaps = np.broadcast_to(np.array([-level, level, e]), (len(known), 3, len(level)))
    unused = np.zeros((len(known), 3, max(0, 2 - n - len(level))))
    return np.ascontiguousarray(np.concatenate([of_joints, of_gaps, unused], axis=2).swapaxes(0, 1))


def _contact_coordinates(effect: Any, n: int, at: int, work: int) -> tuple[Any, ...]:
    """Of the contact coordinate of each gap: joint, entries of y for δ, δ̇, θ̇, the impulse and the work; B, β and e."""
    joints = np.array(effect.driven(n))
    k = len(joints)
    numbers = [effect.reflected(n), effect.of("gap", n), effect.of("restitution", n)]
    rows = [at + i * k + np.arange(k) for i in range(4)]
    return joints, *rows, np.full(k, work), *(np.asarray(each, float) for each in numbers)


def _room(equation: StateEquation, N: int, n: int) -> Room:
    side, v, first, after, ended, least, most, forced, a, held, direction, was_held, was_direction = np.zeros((13, N))
    return Room(
        np.zeros((n * n + n + N - n, 1)), np.zeros((equation.size, 1)), np.zeros((n, max(n, 2))),
        np.zeros((N, max(N, 2))), np.zeros(N), side, v, first, after, ended, least, most, forced, a, held, direction,
        was_held, was_direction, np.zeros(n), settling(N),
    )  # fmt: skip


_NONE, _ROWS, _TABLE = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 0))
NOTHING_HELD = Holding(  # of an equation without anything that may hold joints
    Laws._make([0, *[_ROWS] * 6, *[_NONE] * 4, np.zeros(0, bool), *[_TABLE] * 5, _ROWS]), Places._make([_ROWS] * 3),
    _NONE, _NONE, _NONE, _TABLE, 0, _NONE, _TABLE, _ROWS, _NONE, _ROWS, 0.0, event_log(0, 0, 0.0),
    Room._make([*[_TABLE] * 4, *[_NONE] * 15, settling(0)]),
)  # fmt: skip
