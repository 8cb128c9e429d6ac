"""The joints that dry friction, rigid stops or backlash may hold in a run: arrays for the loop, and names of events."""

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
from robot_dyn.simulation.events.contact_mode import ContactLaws, ContactMode, EventWorkspace, Places
from robot_dyn.simulation.events.event_log import EventKind, event_log
from robot_dyn.simulation.events.mode_change import REACTIONS, guard_count, rows_of_event

_IMPACTS = 64  # that are stored
_STOP = {-1: "lower stop", 1: "upper stop"}
_END = {-1: "backward end", 1: "forward end"}
_PHRASES = {
    EventKind.STRIKES: "strikes {}",
    EventKind.RESTS_AT_LAST: "comes to rest at {}",
    EventKind.STICKS: "sticks",
    EventKind.RESTS: "rests at {}",
    EventKind.SLIDES: "slides",
    EventKind.LEAVES: "leaves {}",
    EventKind.REVERSES: "reverses",
}


@final
class Contacts:
    """The joints that may be held in a run.

    Args:
        equation: The state equation, of effects without a mode.
        mode: The contact mode, as arrays.
    """

    def __init__(self, equation: StateEquation, mode: ContactMode) -> None:
        self.equation, self.mode = equation, mode

    @property
    def mode_of_effects(self) -> Mode:
        """The mode of the joints, for effects."""
        mode, n = self.mode, self.mode.laws.n
        contact = mode.contact.copy() if len(mode.laws.motors) else None
        return Mode(mode.held[:n].copy(), mode.direction[:n].copy(), contact)

    @property
    def guards(self) -> tuple[np.ndarray, np.ndarray]:
        """The entry of y of each guard, and True for each that is the rate of its entry, (K,)."""
        laws = self.mode.laws
        stops = [laws.rows] * (guard_count(laws) - REACTIONS - 1)
        rows = np.column_stack([laws.impulses, laws.impulses, laws.speeds, *stops])
        return rows.ravel(), np.tile(np.arange(guard_count(laws)) < REACTIONS, len(laws.rows))

    def joint(self, guard: int) -> str:
        """Return the name of the joint of a guard."""
        return self._joint(guard // guard_count(self.mode.laws))

    def _joint(self, i: int) -> str:
        return self.equation.plant.dynamics.joint_names[self.mode.laws.joints[i]]

    def occurrence(self, row: Sequence[float]) -> Occurrence:
        """Return the event of a row of the log."""
        n, (t, i, kind, side, direction, *state) = self.mode.laws.n, row
        joint, end = self._joint(int(i)), ""
        if side:
            end = f"its {_STOP[int(side)]}" if i < n else f"the {_END[int(side)]} of its backlash"
        name = f"{joint} {_PHRASES[EventKind(int(kind))].format(end)}"
        return Occurrence(t, name, int(direction), tuple(state[:n]), tuple(state[n:]), joint)


def contacts_of(
    equation: StateEquation, run_parameters: np.ndarray, places: Places, most: int, brief: float
) -> Contacts:
    """Return the contacts of a state equation of effects without a mode; nothing is held yet.

    Args:
        equation: The state equation.
        run_parameters: Run parameters of the equation, with nothing held, (O, 1).
        places: Places of the mode among them.
        most: Number of changes of the mode that accumulate if they lie within a brief time.
        brief: That time, in [s].
    """
    laws = laws_of(equation)
    n, N = laws.n, len(laws.rows)
    held, direction = np.zeros((2, N))
    mode = ContactMode(
        laws=laws,
        places=places,
        held=held,
        direction=direction,
        contact=np.zeros(n),
        run_parameters=run_parameters,
        held_actuation=n * equation.sampled,
        impacts=np.zeros(_IMPACTS),
        strikes=np.zeros((_IMPACTS, max(N, 2))),
        impact_count=np.zeros(1, np.int64),
        changes=np.zeros(most),
        change_count=np.zeros(1, np.int64),
        brief=brief,
        log=event_log(n, rows_of_event(laws), brief),
        work=_workspace(equation.size, N, n),
    )
    return Contacts(equation, mode)


def laws_of(equation: StateEquation) -> ContactLaws:
    """Return the laws of the coordinates of a state equation that may be held: all joints, and gaps of backlash.

    Without stops of the joints, gaps get one effect of unlimited stops, to which their ends belong.
    """
    n, motion = equation.plant.dynamics.n, equation.equation_of_motion
    working: list[Any] = [effect for effect in equation.plant.forces if not isinstance(effect, Conservative)]
    first_work = equation.size - len(equation.sources) + 1
    gaps = [
        _gap_columns(effect, n, place.start, first_work + working.index(effect))
        for effect in motion.effects
        if isinstance(effect, RigidBacklash) and (place := equation.place_of(effect)) is not None
    ]
    columns = [np.concatenate(column) for column in zip(*gaps, strict=True)] if gaps else [np.zeros(0)] * 9
    joints, delta, speed, motors, impulse, work, inertia, half_gap, e = columns
    others = [effect for effect in motion.set_valued if not isinstance(effect, RigidStops)]
    stops = [effect for effect in motion.set_valued if isinstance(effect, RigidStops)]
    intervals = [effect.at_rest(np.zeros(n)) for effect in others]
    least, most = (sum((interval[k] for interval in intervals), start=np.zeros(n)) for k in (0, 1))
    sliding = sum((effect.sliding(np.zeros(n)) for effect in motion.set_valued), start=np.zeros(n))
    lower, upper, restitution = _stops(stops, n, half_gap, e)
    works_of_stops = [first_work + working.index(effect) for effect in stops] or [-1] * bool(gaps)

    def rows(of_joints: np.ndarray, of_gaps: np.ndarray) -> np.ndarray:
        return np.concatenate([of_joints, of_gaps.astype(np.int64)])

    def zero_for_gaps(of_joints: np.ndarray) -> np.ndarray:
        return np.concatenate([of_joints, np.zeros(len(joints), of_joints.dtype)])

    i, end = np.arange(n), 2 * n + equation.states  # the last n states are the impulses of joints
    return ContactLaws(
        n=n,
        joints=rows(i, joints),
        rows=rows(i, delta),
        speeds=rows(n + i, speed),
        impulses=rows(end - n + i, impulse),
        motors=motors.astype(np.int64),
        works=work.astype(np.int64),
        inertia=inertia,
        least=zero_for_gaps(least),
        most=zero_for_gaps(most),
        sliding=zero_for_gaps(sliding),
        has_friction=zero_for_gaps(most > 0),
        lower=lower,
        upper=upper,
        restitution=restitution,
        lowest=touching(lower, -1),
        highest=touching(upper, 1),
        works_of_stops=np.array(works_of_stops, np.int64),
    )


def _stops(stops: Sequence[RigidStops], n: int, half_gap: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return lower stops, upper stops and e of each effect, with the ends of gaps, (3, S, N), N ≥ 2."""
    effects: list[Any] = [[effect.lower, effect.upper, effect.restitution] for effect in stops]
    effects = effects or [[-np.inf, np.inf, 0.0]] * (len(half_gap) > 0)
    of_joints = np.array([[np.broadcast_to(x, n) for x in row] for row in effects], float).reshape(-1, 3, n)
    of_gaps = np.broadcast_to(np.array([-half_gap, half_gap, e]), (len(effects), 3, len(half_gap)))
    unused = np.zeros((len(effects), 3, max(0, 2 - n - len(half_gap))))
    return np.ascontiguousarray(np.concatenate([of_joints, of_gaps, unused], axis=2).swapaxes(0, 1))


def _gap_columns(effect: Any, n: int, first: int, work: int) -> tuple[Any, ...]:
    """Return joint, entries of y for δ, δ̇, θ̇, the impulse and the work, and B, β and e, of each gap of an effect."""
    joints = np.array(effect.driven(n))
    k = len(joints)
    numbers = [effect.reflected(n), effect.per_joint("half_gap", n), effect.per_joint("restitution", n)]
    rows = [first + i * k + np.arange(k) for i in range(4)]
    return joints, *rows, np.full(k, work), *(np.asarray(values, float) for values in numbers)


def _workspace(m: int, N: int, n: int) -> EventWorkspace:
    """Return work arrays for states of m entries and N coordinates, n of them joints."""
    names = "load", "side", "v", "v_impact", "v_rest", "rest_time"
    names += "held", "direction", "previous_held", "previous_direction"
    return EventWorkspace(
        out=np.zeros((n * n + n + N - n, 1)),
        y=np.zeros((m, 1)),
        M=np.zeros((n, max(n, 2))),
        M_all=np.zeros((N, max(N, 2))),
        struck=np.zeros(n),
        settling=settling(N),
        **dict(zip(names, np.zeros((len(names), N)), strict=True)),
    )


def _without(kind: Any, **fields: Any) -> Any:
    """Return a named tuple whose other fields are empty arrays."""
    return kind(**dict.fromkeys(kind._fields, np.zeros(0)) | fields)


NO_CONTACT = _without(  # for an equation in which nothing holds joints
    ContactMode,
    laws=_without(ContactLaws, n=0),
    places=Places._make([np.zeros(0, np.int64)] * 3),
    log=event_log(0, 0, 0.0),
    work=_workspace(0, 0, 0),
)
