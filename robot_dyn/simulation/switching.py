"""Where a state equation switches: thresholds of the effects, events asked for, and what holds on either side."""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.threshold import Threshold
from robot_dyn.integrate.bernstein import room
from robot_dyn.simulation.crossings import Switches
from robot_dyn.simulation.event import Occurrence
from robot_dyn.simulation.state_equation import StateEquation


@final
class Switching:
    """The switching functions of a run.

    Args:
        equation: The state equation, of effects that switch by themselves, and with events asked for.
        dropped: Thresholds that are not looked for: there the effects switch by themselves.

    Attributes:
        thresholds: Of the effects, each once, E of them; the switching function is the coordinate less the level.
    """

    def __init__(self, equation: StateEquation, dropped: frozenset[Threshold] = frozenset()) -> None:
        self.equation, self.events, self.dropped = equation, equation.events, dropped
        n = equation.plant.dynamics.n
        joints = {each.joint for each in dropped}  # the formulas of a joint hang together
        self._of = [
            tuple(
                each
                for each in effect.thresholds(n)
                if each.joint not in joints and not (each.of_velocity and equation.canonical)
            )
            for effect in equation.plant.effects
        ]
        self.thresholds: tuple[Threshold, ...] = tuple(dict.fromkeys(each for of in self._of for each in of))
        self._known: dict[bytes, StateEquation] = {}

    def at(self, t: float, y: np.ndarray, degree: int, functions: object) -> Switches:
        """The switching functions, their sides those of a state y at t, for dense output of a degree."""
        n, G = self.equation.plant.dynamics.n, len(self.events)
        rows = np.array([each.joint + n * each.of_velocity for each in self.thresholds], np.int64)
        levels = np.array([each.level for each in self.thresholds])
        gaps = y[rows] - levels
        moving = y[np.where(rows < n, rows + n, rows)]  # on the level itself, where it is going
        sides = np.where(gaps + (gaps == 0) * moving > 0, 1.0, -1.0)
        for i in np.flatnonzero((gaps == 0) & (moving == 0)):  # a stop is touched, and not passed
            sides[i] = 1.0 if self.thresholds[i].falling == "touched" else -1.0
        values = self.values(t, y)
        sides = np.append(sides, np.sign(values))  # 0 where y is a root: the next step tells
        size = np.maximum(1.0, np.abs(levels))
        return Switches(
            rows, levels, sides, functions, np.zeros((G, 1)), size, np.zeros(degree + 1),
            room(degree),
        )  # fmt: skip

    def values(self, t: float, y: np.ndarray) -> np.ndarray:
        """The user's switching functions, (G,)."""
        q, v, _, _ = self.equation.state(y)
        return np.array(self.equation.switching(t, q, v), dtype=float)

    def function(self, t: float, y: Array, p: Array, own: Array, out: Array) -> None:
        """The same, as of `evaluate`."""
        x = y[:, 0].copy()
        x.setflags(write=False)
        out[:, 0] = self.values(t, x)

    def on(self, sides: np.ndarray) -> StateEquation:
        """The state equation with each threshold on its side; smooth there."""
        key = sides[: len(self.thresholds)].tobytes()
        if key not in self._known:
            of = {each: int(side) for each, side in zip(self.thresholds, sides, strict=False)}
            plant, n = self.equation.plant, self.equation.plant.dynamics.n
            effects = [
                effect.beyond(n, {each: of[each] for each in mine}) if mine else effect
                for effect, mine in zip(plant.effects, self._of, strict=True)
            ]
            self._known[key] = replace(self.equation, plant=Plant(plant.dynamics, effects))
        return self._known[key]

    def occurrence(self, index: int, t: float, y: np.ndarray, side: float) -> Occurrence:
        """The event of a switching function whose sign is now `side`."""
        q, v, joint = *self.equation.state(y)[:2], ""
        if index < len(self.thresholds):
            each = self.thresholds[index]
            joint = self.equation.plant.dynamics.joint_names[each.joint]
            name = f"{each.name} of {joint} {each.rising if side > 0 else each.falling}"
        else:
            name = self.events[index - len(self.thresholds)].name
        return Occurrence(t, name, int(side), tuple(q.tolist()), tuple(v.tolist()), joint)
