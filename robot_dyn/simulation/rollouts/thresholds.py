"""The thresholds of the runs of a batch, whose coefficients, and therefore levels, may differ from run to run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from robot_dyn.codegen.parameters import CONTROLLER, Part, joined, parameters, rows, split
from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.threshold import smooth
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.detection import LaneEvents
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.setup.schedule import MOST_CUT
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class Thresholds:
    """K thresholds of each of B runs.

    Attributes:
        rows, coordinates: See `LaneEvents`.
        levels: Levels of each run, inf for none, (K, B).
        functions: Number of functions of the actuation.
        others: True for runs in which other parts have thresholds than in the compiled equation, (B,).
        names: Distinct names of the thresholds.
    """

    rows: np.ndarray
    coordinates: int
    levels: np.ndarray
    functions: int
    others: np.ndarray
    names: tuple[str, ...]

    @property
    def some(self) -> np.ndarray:
        """True for runs that have a threshold, (B,)."""
        return np.isfinite(self.levels).any(axis=0) | self.others

    def for_runs(self, runs: np.ndarray) -> Thresholds:
        """Return the thresholds of some of the runs."""
        return replace(self, levels=self.levels[:, runs], others=self.others[runs])

    def lanes(self, runs: np.ndarray, rows: int, positions: int) -> LaneEvents:
        """Return the switching functions of some of the runs, whose sides, rates and values are not yet evaluated.

        Args:
            runs: Numbers of the runs.
            rows: Number of rows of a rate.
            positions: Number of rows that are positions.
        """
        W, others = len(runs), self.others[runs]
        rate, next_rate = np.zeros((2, rows if self.coordinates else 0, W))
        values, next_values, change = np.zeros((3, self.functions, W))
        return LaneEvents(
            rows=self.rows,
            coordinates=self.coordinates,
            positions=positions,
            levels=np.array(self.levels[:, runs], order="C"),
            sides=np.zeros((len(self.rows), W)),
            rate=rate,
            next_rate=next_rate,
            values=values,
            next_values=next_values,
            change=change,
            until=np.where(others, 0.0, np.inf),
            left=np.array([W - others.sum()]),
        )


def thresholds(setup: Setup, sweep: Mapping[str, np.ndarray], count: int) -> Thresholds | None:
    """Return the thresholds at which `simulate` cuts steps, for B runs of a setup; None if it cuts no steps.

    Args:
        setup: Setup of all runs.
        sweep: Values that differ from run to run, (B, size) by name.
        count: Number of runs, B.
    """
    if setup.steps > MOST_CUT or setup.method.nonsmooth:
        return None
    equation, names = setup.equation, dict[str, None]()
    levels, others = dict[tuple[bool, int, int], np.ndarray](), np.zeros(count, bool)
    for switching, runs in _of_runs(equation, sweep, count):
        names |= dict.fromkeys(threshold.name for threshold in switching.thresholds)
        if switching.equation.limited != equation.limited:
            others[runs] = True
            continue
        for place, level in zip(_places(switching), switching.levels, strict=True):
            levels.setdefault(place, np.full(count, np.inf))[runs] = level
    if not names:
        return None
    places = sorted(levels)
    rows, coordinates = (
        np.array([row for _, row, _ in places], np.int64),
        sum(not is_function for is_function, _, _ in places),
    )
    functions, stacked = len(equation.limited) * equation.plant.dynamics.n, [levels[place] for place in places]
    return Thresholds(rows, coordinates, np.reshape(stacked, (-1, count)), functions, others, tuple(names))


def _places(switching: Switching) -> list[tuple[bool, int, int]]:
    """Return the place of each threshold: True if it is of a function, its row, and its number in that row."""
    places: list[tuple[bool, int, int]] = []
    for k, row in enumerate(switching.rows.tolist()):
        is_function = k >= switching.coordinates
        places.append((is_function, row, sum(place[:2] == (is_function, row) for place in places)))
    return places


def _of_runs(
    equation: StateEquation, sweep: Mapping[str, np.ndarray], count: int
) -> Iterator[tuple[Switching, np.ndarray]]:
    """Yield the distinct thresholds of the runs, with the numbers of the runs that have them, (k,)."""
    plant, controller = equation.plant, equation.controller
    varied = parameters(plant.dynamics, plant.effects, controller, sweep)
    part_of: dict[Part, Any] = {("effect", i): effect for i, effect in enumerate(plant.effects)}
    part_of[CONTROLLER] = controller
    parts = {x.part for x in varied if x.name in sweep and x.part in part_of and not _always_smooth(part_of[x.part])}
    varied = [x for x in varied if x.part in parts]
    values, places = joined(varied), {x.name: rows(varied, x.name) for x in varied if x.name in sweep}
    groups: dict[Any, tuple[dict[Part, Any], list[int]]] = {}
    for run in range(count if parts else 1):
        for name, place in places.items():
            values[place] = sweep[name][run]
        swept = {part: with_values(part_of[part], new) for part, new in split(varied, values).items()}
        n = plant.dynamics.n
        declared = tuple(x.thresholds() if part == CONTROLLER else x.thresholds(n) for part, x in swept.items())
        groups.setdefault(declared, (swept, []))[1].append(run)
    for swept, runs in groups.values():
        effects = [swept.get(("effect", i), effect) for i, effect in enumerate(plant.effects)]
        state = StateEquation(Plant(plant.dynamics, effects), swept.get(CONTROLLER, controller), equation.canonical)
        yield Switching(state), np.array(runs if parts else range(count))


def _always_smooth(part: Any) -> bool:
    """Return True if a part has no threshold for any coefficients."""
    return type(part).thresholds in (smooth, Effect.thresholds, Controller.thresholds)
