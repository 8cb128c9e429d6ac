"""The thresholds of the runs of a batch, where coefficients may differ from run to run, and levels with them."""

from __future__ import annotations

from collections.abc import Mapping
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
from robot_dyn.simulation.events.detection import LockStep, lock_step
from robot_dyn.simulation.events.switching import Switching
from robot_dyn.simulation.setup.schedule import MOST_CUT
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class Thresholds:
    """The thresholds of B runs, K of each.

    Attributes:
        rows, coordinates: As of `LockStep`.
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

    def lanes(self, runs: np.ndarray, rows: int, positions: int) -> LockStep:
        """The switching functions of some of the runs at their start: of rates of so many rows, and `positions`."""
        switches = lock_step(self.rows, self.coordinates, self.levels[:, runs], rows, self.functions, positions)
        switches.until[self.others[runs]] = 0.0
        switches.left[0] -= self.others[runs].sum()
        return switches


def thresholds(setup: Setup, sweep: Mapping[str, np.ndarray], count: int) -> Thresholds | None:
    """Return the thresholds at which `simulate` cuts steps, of B runs of a setup; None where it cuts none.

    Args:
        setup: Of all runs.
        sweep: Values that differ from run to run, (B, size) by name.
        count: B.
    """
    if setup.steps > MOST_CUT or setup.integrator.nonsmooth:
        return None
    equation = setup.equation
    of_runs = _of_runs(equation, sweep, count)
    others = np.array([each.equation.limited != equation.limited for each, _ in of_runs])
    known = [(each, runs) for (each, runs), other in zip(of_runs, others, strict=True) if not other]
    names = tuple(dict.fromkeys(threshold.name for each, _ in of_runs for threshold in each.thresholds))
    if not names:
        return None
    places = [_places(each) for each, _ in known]
    union = sorted({place for each in places for place in each})
    levels = np.full((len(union), count), np.inf)
    for (each, runs), places_of_runs in zip(known, places, strict=True):
        for place, level in zip(places_of_runs, each.levels, strict=True):
            levels[union.index(place), runs] = level
    unknown = np.zeros(count, bool)
    for (_, runs), other in zip(of_runs, others, strict=True):
        unknown[runs] = other
    rows = np.array([row for _, row, _ in union], np.int64)
    coordinates = sum(not function for function, _, _ in union)
    return Thresholds(rows, coordinates, levels, len(equation.limited) * equation.plant.dynamics.n, unknown, names)


def _places(switching: Switching) -> list[tuple[bool, int, int]]:
    """Where each threshold is: whether of a function, its row, and which one of that row."""
    places: list[tuple[bool, int, int]] = []
    for k, row in enumerate(switching.rows.tolist()):
        function = k >= switching.coordinates
        places.append((function, row, sum(each[:2] == (function, row) for each in places)))
    return places


def _of_runs(
    equation: StateEquation, sweep: Mapping[str, np.ndarray], count: int
) -> list[tuple[Switching, np.ndarray]]:
    """The thresholds of the runs, with the numbers of those that have them, (k,)."""
    plant, controller = equation.plant, equation.controller
    known = parameters(plant.dynamics, plant.effects, controller, sweep)
    parts = {each.part for each in known if each.name in sweep and each.part[0] in ("effect", *CONTROLLER)}
    parts = {part for part in parts if not _always_smooth(controller if part == CONTROLLER else plant.effects[part[1]])}
    known = [each for each in known if each.part in parts]
    of = {part: controller if part == CONTROLLER else plant.effects[part[1]] for part in parts}
    values, places = joined(known), {each.name: rows(known, each.name) for each in known if each.name in sweep}
    groups: dict[Any, tuple[dict[Part, Any], list[int]]] = {}
    for run in range(count if parts else 1):
        for name, place in places.items():
            values[place] = sweep[name][run]
        swept = {part: with_values(of[part], given) for part, given in split(known, values).items()}
        declared = tuple(
            each.thresholds() if part == CONTROLLER else each.thresholds(plant.dynamics.n)
            for part, each in swept.items()
        )
        groups.setdefault(declared, (swept, []))[1].append(run)
    found = []
    for swept, runs in groups.values():
        effects = [swept.get(("effect", i), each) for i, each in enumerate(plant.effects)]
        state = StateEquation(Plant(plant.dynamics, effects), swept.get(CONTROLLER, controller), equation.canonical)
        found.append((Switching(state), np.array(runs if parts else range(count))))
    return found


def _always_smooth(part: Any) -> bool:
    """Whether a part has no threshold, whatever its coefficients are."""
    return type(part).thresholds in (smooth, Effect.thresholds, Controller.thresholds)
