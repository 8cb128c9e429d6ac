"""Where a state equation switches: thresholds of its parts, user-defined events, and the equation on either side."""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant, in_mode
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.threshold import Threshold
from robot_dyn.integrate.bernstein import room
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.state_equation import CONTROLLER, StateEquation
from robot_dyn.simulation.events.crossings import LOOKS, ROUNDING, Switches
from robot_dyn.simulation.events.mode_change import guards
from robot_dyn.simulation.events.modes import Modes

_MOST = 256  # equations that are cached, each of the sides of all thresholds
Quantity = tuple[int, bool]  # a joint, and whether it is its actuation that passes a level


@final
class Switching:
    """The switching functions of a run: of coordinates, of the actuation, and user-defined ones.

    Args:
        equation: The state equation, of parts that switch by themselves, and with user-defined events.
        dropped: What is no longer looked at: there the parts switch by themselves.
        modes: What is held; None where nothing may hold a joint.

    Attributes:
        thresholds: Those of coordinates, each once, and then those of the actuation, part by part.
        guards: Number of the guards of the modes: these switching functions come between the two.
    """

    def __init__(
        self, equation: StateEquation, dropped: frozenset[Quantity] = frozenset(), modes: Modes | None = None
    ) -> None:
        self.equation, self.events, self.dropped = equation, equation.events, dropped
        self._n = n = equation.plant.dynamics.n
        parts = {k: effect.thresholds(n) for k, effect in enumerate(equation.plant.effects)}
        if equation.controller is not None and not equation.sampled:
            parts[CONTROLLER] = equation.controller.thresholds()
        self._of = {k: tuple(each for each in of if self._looked_for(k, each)) for k, of in parts.items()}
        coordinates = dict.fromkeys(
            (k if each.own else None, each) for k, of in self._of.items() for each in of if not each.of_actuation
        )
        actuation = [(k, each) for k in equation.limited for each in self._of[k] if each.of_actuation]
        self.coordinates = len(coordinates)
        self.thresholds: tuple[Threshold, ...] = tuple(each for _, each in (*coordinates, *actuation))
        self._parts: tuple[int | None, ...] = tuple(k for k, _ in (*coordinates, *actuation))
        self.modes, self.guards = modes, 0 if modes is None else len(modes.guards[0])
        self._known: dict[bytes, StateEquation] = {}

    @property
    def quantities(self) -> frozenset[Quantity]:
        """All that pass a threshold."""
        return frozenset((each.joint, each.of_actuation) for each in self.thresholds)

    def _looked_for(self, part: int, each: Threshold) -> bool:
        if (each.joint, each.of_actuation) in self.dropped:  # the formulas of a joint hang together
            return False
        if each.of_actuation:
            return part in self.equation.limited
        return not (each.of_velocity and self.equation.canonical)

    @property
    def rows(self) -> np.ndarray:
        """What passes each of the thresholds: entries of y, and then of what reaches the limited parts."""
        place: dict[int | None, int] = {k: self._n * i for i, k in enumerate(self.equation.limited)}
        each = list(zip(self._parts, self.thresholds, strict=True))
        coordinates = [self._row(*one) for one in each[: self.coordinates]]
        return np.array([*coordinates, *(place[k] + one.joint for k, one in each[self.coordinates :])], np.int64)

    @property
    def levels(self) -> np.ndarray:
        """The levels of the thresholds."""
        return np.array([each.level for each in self.thresholds])

    def at(self, t: float, y: np.ndarray, degree: int, functions: object, held: Array | None) -> Switches:
        """The switching functions, on their sides of a state y at t and of the mode, for dense output of a degree."""
        n, E, G = self._n, self.coordinates, len(self.events)
        of_guards, reactions = (np.zeros(0), np.zeros(0)) if self.modes is None else self.modes.guards
        K = len(of_guards)
        rows, actuation = np.split(self.rows, [E])
        levels = self.levels
        distances = y[rows] - levels[:E]
        moving = self._moving(t, y, held, rows, distances)  # on the level itself, where it is going
        sides = np.where(distances + (distances == 0) * moving > 0, 1.0, -1.0)
        for i in np.flatnonzero((distances == 0) & (moving == 0)):  # a stop is touched, and not passed
            sides[i] = 1.0 if self.thresholds[i].falling == "touched" else -1.0
        first = n * len(self.equation.limited)
        values = self.equation.event_values(t, y, held)
        distances = values[actuation] - levels[E:]
        # at distance 0 a limit is reached
        sides = np.concatenate([sides, np.where(distances == 0, -np.sign(levels[E:]), np.sign(distances))])
        sides = np.append(sides, np.sign(values[first:]))  # 0 where y is a root: the next step tells
        rows = np.concatenate([rows, of_guards, actuation, first + np.arange(G)]).astype(np.int64)
        levels = np.insert(np.append(levels, np.zeros(G)), E, np.zeros(K))
        sides = np.insert(sides, E, np.ones(K))
        exact = ROUNDING * np.maximum(1.0, np.abs(levels[: E + K]))
        slack = np.maximum(exact, [each.slack for each in self.thresholds[:E]] + [0.0] * K)
        rates, active = np.append(np.zeros(E, bool), reactions > 0), np.arange(E + K) < E
        zeroed = np.zeros(0, np.int64) if self.modes is None else self.modes.holding.laws.impulses
        switches = Switches(
            rows, levels, sides, rates, active, E, K, zeroed, functions, G, np.zeros((len(values), 1)), values,
            np.zeros(len(values)), exact, slack, np.zeros(degree + 1), room(degree),
            np.zeros((len(rows) - E - K, LOOKS)),
        )  # fmt: skip
        if self.modes is not None:
            guards(self.modes.holding, y[:, None].copy(), switches)
        return switches

    def _row(self, part: int | None, each: Threshold) -> int:
        """The entry of y that passes a threshold."""
        if each.state is None or part is None:
            return each.joint + self._n * each.of_velocity
        if part not in self.equation.equation_of_motion.states:
            raise EffectError(f"{each.name}: is a threshold of a state, and what declares it has none")
        first = 2 * self._n + self.equation.state_size
        return first + self.equation.equation_of_motion.states[part].start + each.state

    def _moving(
        self, t: float, y: np.ndarray, held: Array | None, rows: np.ndarray, distances: np.ndarray
    ) -> np.ndarray:  # fmt: skip
        """The rates of those entries of y; of a velocity where one lies on its level."""
        n = self._n
        if not (distances[rows >= n] == 0).any():
            return y[np.where(rows < n, rows + n, rows)]
        if self.equation.sampled and (held is None or np.isnan(held).any()):  # before the first tick
            y, held = self.equation.tick(t, y)
        return self.equation.rate(t, y, held)[0][rows]

    def on(self, sides: np.ndarray) -> StateEquation:
        """The state equation with each threshold on its side, in the mode that is known; smooth there."""
        mode, sides = None if self.modes is None else self.modes.mode, self.of_thresholds(sides)
        key = sides.tobytes() + (b"" if mode is None else np.concatenate([x for x in mode if x is not None]).tobytes())
        if key not in self._known:
            of: dict[tuple[int | None, Threshold], int] = {
                (part, each): int(side) for part, each, side in zip(self._parts, self.thresholds, sides, strict=False)
            }
            at = {k: {each: of[k if each.own else None, each] for each in mine} for k, mine in self._of.items()}
            equation, n = self.equation, self._n
            effects: list[Effect] = [
                effect.on_side(n, at[k]) if at[k] else effect for k, effect in enumerate(equation.plant.effects)
            ]
            plant, controller = Plant(equation.plant.dynamics, effects), equation.controller
            if controller is not None and at.get(CONTROLLER):
                controller = controller.on_side(at[CONTROLLER])
            plant = plant if mode is None else in_mode(plant, mode)
            on_sides = replace(equation, plant=plant, controller=controller)
            if len(self._known) >= _MOST:
                return on_sides
            self._known[key] = on_sides
        return self._known[key]

    def number(self, index: int) -> int:
        """The number of a switching function among thresholds and user-defined events."""
        return index - (self.guards if index >= self.coordinates else 0)

    def of_thresholds(self, sides: np.ndarray) -> np.ndarray:
        """The sides of the thresholds, (T,), of those of all switching functions."""
        E = self.coordinates
        return np.concatenate([sides[:E], sides[E + self.guards :][: len(self.thresholds) - E]])

    def occurrence(self, index: int, t: float, y: np.ndarray, side: float) -> Occurrence:
        """The event of the threshold, or of the user-defined event, of this number; its sign is now `side`."""
        q, v, joint = *self.equation.state(y)[:2], ""
        if index < len(self.thresholds):
            each = self.thresholds[index]
            joint = self.equation.plant.dynamics.joint_names[each.joint]
            name = f"{each.name} of {joint} {each.rising if side > 0 else each.falling}"
        else:
            name = self.events[index - len(self.thresholds)].name
        return Occurrence(t, name, int(side), tuple(q.tolist()), tuple(v.tolist()), joint)
