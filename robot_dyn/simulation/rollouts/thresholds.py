"""The thresholds of the runs of a batch, where coefficients may differ from run to run, and levels with them."""

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
from robot_dyn.simulation.events.detection import LaneEvents, lane_events
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.setup.schedule import MOST_CUT
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class Thresholds:
    """The thresholds of B runs, K of each.

    Attributes:
        rows, coordinates: See `LaneEvents`.
        levels: Of each run, inf where it has none, (K, B).
        functions: Number of the functions of the actuation.
        others: Runs in which other parts have thresholds than in the compiled equation, (B,).
        names: What the thresholds are, each once.
    """

    rows: np.ndarray
    coordinates: int
    levels: np.ndarray
    functions: int
    others: np.ndarray
    names: tuple[str, ...]

    @property
    def some(self) -> np.ndarray:
        """Whether each run has a threshold, (B,)."""
        return np.isfinite(self.levels).any(axis=0) | self.others

    def of(self, runs: np.ndarray) -> Thresholds:
        """The thresholds of some of the runs."""
        return replace(self, levels=self.levels[:, runs], others=self.others[runs])

    def lanes(self, runs: np.ndarray, rows: int, positions: int) -> LaneEvents:
        """The switching functions of some of the runs at their start: of rates of so many rows, and `positions`."""
        events = lane_events(self.rows, self.coordinates, self.levels[:, runs], rows, self.functions, positions)
        events.until[self.others[runs]] = 0.0
        events.left[0] -= self.others[runs].sum()
        return events


def thresholds(setup: Setup, sweep: Mapping[str, np.ndarray], count: int) -> Thresholds | None:
    """Return the thresholds at which `simulate` cuts steps, of B runs of a setup; None where it cuts none.

    Args:
        setup: Of all runs.
        sweep: Values that differ from run to run, (B, size) by name.
        count: B.
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
    rows, coordinates = np.array([row for _, row, _ in places], np.int64), sum(not of for of, _, _ in places)
    functions, stacked = len(equation.limited) * equation.plant.dynamics.n, [levels[place] for place in places]
    return Thresholds(rows, coordinates, np.reshape(stacked, (-1, count)), functions, others, tuple(names))


def _places(switching: Switching) -> list[tuple[bool, int, int]]:
    """Where each threshold is: whether of a function, its row, and which one of that row."""
    places: list[tuple[bool, int, int]] = []
    for k, row in enumerate(switching.rows.tolist()):
        function = k >= switching.coordinates
        places.append((function, row, sum(each[:2] == (function, row) for each in places)))
    return places


def _of_runs(
    equation: StateEquation, sweep: Mapping[str, np.ndarray], count: int
) -> Iterator[tuple[Switching, np.ndarray]]:
    """Yield the thresholds of the runs, with the numbers of those that have them, (k,)."""
    plant, controller = equation.plant, equation.controller
    known = parameters(plant.dynamics, plant.effects, controller, sweep)
    of: dict[Part, Any] = {("effect", i): effect for i, effect in enumerate(plant.effects)}
    of[CONTROLLER] = controller
    parts = {x.part for x in known if x.name in sweep and x.part in of and not _always_smooth(of[x.part])}
    known = [x for x in known if x.part in parts]
    values, places = joined(known), {x.name: rows(known, x.name) for x in known if x.name in sweep}
    groups: dict[Any, tuple[dict[Part, Any], list[int]]] = {}
    for run in range(count if parts else 1):
        for name, place in places.items():
            values[place] = sweep[name][run]
        swept = {part: with_values(of[part], given) for part, given in split(known, values).items()}
        n = plant.dynamics.n
        declared = tuple(x.thresholds() if part == CONTROLLER else x.thresholds(n) for part, x in swept.items())
        groups.setdefault(declared, (swept, []))[1].append(run)
    for swept, runs in groups.values():
        effects = [swept.get(("effect", i), effect) for i, effect in enumerate(plant.effects)]
        state = StateEquation(Plant(plant.dynamics, effects), swept.get(CONTROLLER, controller), equation.canonical)
        yield Switching(state), np.array(runs if parts else range(count))


def _always_smooth(part: Any) -> bool:
    """Whether a part has no threshold, whatever its coefficients are."""
    return type(part).thresholds in (smooth, Effect.thresholds, Controller.thresholds)
