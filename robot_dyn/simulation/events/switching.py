"""The switching functions of a state equation: thresholds of its parts, user-defined events; the equation between."""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant, in_mode
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.integrate.bernstein import work_array
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import Function
from robot_dyn.simulation.dynamics.state_equation import CONTROLLER, StateEquation
from robot_dyn.simulation.events.contacts import Contacts
from robot_dyn.simulation.events.event_table import ROUNDING, SCANS, EventTable
from robot_dyn.simulation.events.mode_change import write_guards

_MOST = 256  # cached equations, one for each set of sides of all thresholds
Quantity = tuple[int, bool]  # a joint, and True for its actuation, False for its motion


@final
class Switching:
    """The switching functions of a run: of coordinates, of the actuation, and user-defined ones.

    Args:
        equation: The state equation, with user-defined events; its parts switch within steps.
        dropped: Quantities whose thresholds are ignored, so that the parts switch within steps.
        contacts: The joints that may be held; None if no effect can hold a joint.

    Attributes:
        thresholds: Thresholds of coordinates, each once, and then those of the actuation, part by part.
        guards: Number of guards of the contact mode, which come between the two.
    """

    def __init__(
        self, equation: StateEquation, dropped: frozenset[Quantity] = frozenset(), contacts: Contacts | None = None
    ) -> None:
        self.equation, self.events, self.dropped = equation, equation.events, dropped
        self._n = n = equation.plant.dynamics.n
        parts = {k: effect.thresholds(n) for k, effect in enumerate(equation.plant.effects)}
        if equation.controller is not None and not equation.sampled:
            parts[CONTROLLER] = equation.controller.thresholds()
        self._of_part = {k: tuple(x for x in declared if self._is_active(k, x)) for k, declared in parts.items()}
        active = [(k, x) for k, declared in self._of_part.items() for x in declared]
        coordinates = dict.fromkeys((k if x.own else None, x) for k, x in active if not x.of_actuation)
        actuation = [(k, x) for k in equation.limited for x in self._of_part[k] if x.of_actuation]
        self.coordinates = len(coordinates)
        self.thresholds: tuple[Threshold, ...] = tuple(x for _, x in (*coordinates, *actuation))
        self._parts: tuple[int | None, ...] = tuple(k for k, _ in (*coordinates, *actuation))
        self.contacts, self.guards = contacts, 0 if contacts is None else len(contacts.guards[0])
        self._equations: dict[bytes, StateEquation] = {}

    @property
    def quantities(self) -> frozenset[Quantity]:
        """All quantities that have a threshold."""
        return frozenset((threshold.joint, threshold.of_actuation) for threshold in self.thresholds)

    def _is_active(self, part: int, threshold: Threshold) -> bool:
        if (threshold.joint, threshold.of_actuation) in self.dropped:  # the formulas of a joint depend on each other
            return False
        if threshold.of_actuation:
            return part in self.equation.limited
        return not (threshold.of_velocity and self.equation.canonical)

    @property
    def rows(self) -> np.ndarray:
        """The row of each threshold: an entry of y, or of the actuation of the limited parts."""
        place: dict[int | None, int] = {k: self._n * i for i, k in enumerate(self.equation.limited)}
        pairs = list(zip(self._parts, self.thresholds, strict=True))
        coordinates = [self.equation.row(part, threshold) for part, threshold in pairs[: self.coordinates]]
        actuation = [place[part] + threshold.joint for part, threshold in pairs[self.coordinates :]]
        return np.array([*coordinates, *actuation], np.int64)

    @property
    def levels(self) -> np.ndarray:
        """The levels of the thresholds."""
        return np.array([threshold.level for threshold in self.thresholds])

    def at(self, t: float, y: np.ndarray, degree: int, functions: Function | None, held: Array | None) -> EventTable:
        """Return the table of switching functions, on their sides of a state and of the contact mode.

        Args:
            t: Time, in [s].
            y: State, (m,).
            degree: Degree of the dense output.
            functions: The function that writes the values of the functions.
            held: The actuation in zero-order hold; None if the controller acts continuously.
        """
        n, E, G = self._n, self.coordinates, len(self.events)
        guard_rows, is_reaction = (np.zeros(0), np.zeros(0)) if self.contacts is None else self.contacts.guards
        K = len(guard_rows)
        rows, actuation = np.split(self.rows, [E])
        levels = self.levels
        distances = y[rows] - levels[:E]
        moving = self._moving(t, y, held, rows, distances)  # on the level itself, the direction of motion counts
        sides = np.where(distances + (distances == 0) * moving > 0, 1.0, -1.0)
        for i in np.flatnonzero((distances == 0) & (moving == 0)):  # a stop is touched, and not passed
            sides[i] = 1.0 if self.thresholds[i].falling == "touched" else -1.0
        first = n * len(self.equation.limited)
        if first and self.equation.sampled and (held is None or np.isnan(held).any()):  # before the first tick
            held = self.equation.tick(t, y)[1]
        values = self.equation.event_values(t, y, held)
        distances = values[actuation] - levels[E:]
        # at distance 0 a limit is reached
        sides = np.concatenate([sides, np.where(distances == 0, -np.sign(levels[E:]), np.sign(distances))])
        sides = np.append(sides, np.sign(values[first:]))  # 0 where y is a root: the next step decides
        rows = np.concatenate([rows, guard_rows, actuation, first + np.arange(G)]).astype(np.int64)
        levels = np.insert(np.append(levels, np.zeros(G)), E, np.zeros(K))
        sides = np.insert(sides, E, np.ones(K))
        rounding = ROUNDING * np.maximum(1.0, np.abs(levels[: E + K]))
        slack = np.maximum(rounding, [threshold.slack for threshold in self.thresholds[:E]] + [0.0] * K)
        table = EventTable(
            rows=rows,
            levels=levels,
            sides=sides,
            is_rate=np.append(np.zeros(E, bool), is_reaction > 0),
            active=np.arange(E + K) < E,
            thresholds=E,
            guards=K,
            zeroed=np.zeros(0, np.int64) if self.contacts is None else self.contacts.mode.laws.impulses,
            functions=functions,
            user_defined=G,
            values=np.zeros((len(values), 1)),
            previous=values,
            change=np.zeros(len(values)),
            rounding=rounding,
            slack=slack,
            coefficients=np.zeros(degree + 1),
            stack=work_array(degree),
            scanned=np.zeros((len(rows) - E - K, SCANS)),
        )
        if self.contacts is not None:
            write_guards(self.contacts.mode, y[:, None].copy(), table)
        return table

    def _moving(
        self, t: float, y: np.ndarray, held: Array | None, rows: np.ndarray, distances: np.ndarray
    ) -> np.ndarray:  # fmt: skip
        """Return the rates of these entries of y; exact ones if a velocity lies on its level, else of positions."""
        n = self._n
        if not (distances[rows >= n] == 0).any():
            return y[np.where(rows < n, rows + n, rows)]
        if self.equation.sampled and (held is None or np.isnan(held).any()):  # before the first tick
            y, held = self.equation.tick(t, y)
        return self.equation.rate(t, y, held)[0][rows]

    def on(self, sides: np.ndarray) -> StateEquation:
        """Return the state equation with each threshold on its side, in the contact mode; it is smooth there."""
        mode, sides = None if self.contacts is None else self.contacts.mode_of_effects, self.of_thresholds(sides)
        key = sides.tobytes() + (b"" if mode is None else np.concatenate([x for x in mode if x is not None]).tobytes())
        if key not in self._equations:
            side_of: dict[tuple[int | None, Threshold], int] = {
                (part, threshold): int(side)
                for part, threshold, side in zip(self._parts, self.thresholds, sides, strict=False)
            }
            at = {k: {x: side_of[k if x.own else None, x] for x in declared} for k, declared in self._of_part.items()}
            equation, n = self.equation, self._n
            effects: list[Effect] = [
                effect.on_side(n, at[k]) if at[k] else effect for k, effect in enumerate(equation.plant.effects)
            ]
            plant, controller = Plant(equation.plant.dynamics, effects), equation.controller
            if controller is not None and at.get(CONTROLLER):
                controller = controller.on_side(at[CONTROLLER])
            plant = plant if mode is None else in_mode(plant, mode)
            on_sides = replace(equation, plant=plant, controller=controller)
            if len(self._equations) >= _MOST:
                return on_sides
            self._equations[key] = on_sides
        return self._equations[key]

    def number(self, index: int) -> int:
        """Return the number of a switching function among thresholds and user-defined events."""
        return index - (self.guards if index >= self.coordinates else 0)

    def of_thresholds(self, sides: np.ndarray) -> np.ndarray:
        """Return the sides of the thresholds, (T,), from the sides of all switching functions."""
        E = self.coordinates
        return np.concatenate([sides[:E], sides[E + self.guards :][: len(self.thresholds) - E]])

    def occurrence(self, index: int, t: float, y: np.ndarray, side: float) -> Occurrence:
        """Return the event of a threshold, or of a user-defined event, by number; its sign is now `side`."""
        q, v, joint = *self.equation.state(y)[:2], ""
        if index < len(self.thresholds):
            threshold = self.thresholds[index]
            joint = self.equation.plant.dynamics.joint_names[threshold.joint]
            name = f"{threshold.name} of {joint} {threshold.rising if side > 0 else threshold.falling}"
        else:
            name = self.events[index - len(self.thresholds)].name
        return Occurrence(t, name, int(side), tuple(q.tolist()), tuple(v.tolist()), joint)
