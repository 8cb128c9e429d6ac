"""Cost of effects and algorithms on one arm: exact instruction counts, and times of runs that take turns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.accuracy.costs import step_cost
from robot_dyn.accuracy.costs.ab_comparison import ABComparison, Version, take_turns
from robot_dyn.accuracy.costs.query_cost import QueryCost
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Block, Table, number_or_dash
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.validate import JointValues, choice, function, integer, number
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import format_duration
from robot_dyn.report.environment import processor_and_versions
from robot_dyn.report.result import INTERRUPTED, Result
from robot_dyn.report.time_budget import Budget
from robot_dyn.simulation.results.acting import acting
from robot_dyn.simulation.setup.options import setup_of, starts
from robot_dyn.simulation.setup.setup import Setup

_MAX_REPEATS = 1000
_PAIR_COLUMNS = ("group", "name", "per", "instructions_ratio", "time_ratio", "time_ratio_spread", "time_between_s")
_VERSION_COLUMNS = ("name", "instructions", "time_s", "repeats", "repeatable")


@final
@dataclass(frozen=True, eq=False, repr=False)
class Cost(Result):
    """The cost of the parts of a setup, and of algorithms for its equations.

    Attributes:
        robot: Name of the robot.
        acting: Descriptions of gravity, effects and control.
        alternatives: The comparisons of two versions.
        left_out: Omitted comparisons, with reasons.
        environment: Software versions and processor.
        budget_s: Time budget, in [s].
        spent_s: Time spent, without compiling, in [s].
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.costs.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        *_PAIR_COLUMNS[:3],
        *(f"{version}_{column}" for version in ("first", "second") for column in _VERSION_COLUMNS),
        *_PAIR_COLUMNS[3:],
    )
    robot: str
    acting: tuple[str, ...]
    alternatives: tuple[ABComparison, ...]
    left_out: tuple[str, ...]
    environment: dict[str, str]
    budget_s: float
    spent_s: float

    def tables(self) -> Iterator[Block]:
        """One line per comparison, grouped by unit of work, and notes."""
        yield f"{self.robot}: {', '.join(self.acting) or 'no effects'}"
        headings = ("per", "difference", "first / second", "instructions", "ratio", "time", "ratio")
        yield Table(headings, tuple(map(tuple, cost_rows(self))), right=headings[3:])
        yield "instructions are exact; times are the shortest processor times over turns, machine code on one thread;"
        yield "± half the interquartile range of the ratios within a turn; ~ a time that varied by over 5 %"

    def comparison(self, name: str) -> ABComparison:
        """Return the comparison with a name, for example "gravity" or "forward dynamics".

        Raises:
            QueryError: If there is no such comparison.
        """
        pairs = {pair.name: pair for pair in self.alternatives}
        return pairs[choice("cost of", name, pairs)]

    @property
    def rows(self) -> Iterator[Mapping[str, object]]:
        for pair in self.alternatives:
            row = {name: getattr(pair, name) for name in _PAIR_COLUMNS}
            for place, version in (("first", pair.first), ("second", pair.second)):
                row |= {f"{place}_{name}": getattr(version, name) for name in _VERSION_COLUMNS}
                row |= {} if version.times else {f"{place}_time_s": None}
            yield row

    @reported
    def parts(self) -> dict[str, int]:
        """Instructions that each part of the setup adds to a step with all others, by name."""
        pairs = (pair for pair in self.alternatives if pair.group == "parts" and pair.name != step_cost.EVERYTHING)
        return {pair.name: pair.added for pair in pairs}

    @property
    def _everything(self) -> ABComparison | None:
        return next((pair for pair in self.alternatives if pair.name == step_cost.EVERYTHING), None)

    @reported
    def shared(self) -> int:
        """Instructions of all parts in a step, minus the sum of `parts`; negative if parts share instructions."""
        return (self._everything.added if self._everything else 0) - sum(self.parts.values())

    @reported
    def sentence(self) -> str:
        """Instructions and time of a step, with the share of each part, in one sentence."""
        if self._everything is None:
            return "no step was counted"
        on, off = self._everything.first, self._everything.second
        time = f", {format_duration(on.time_s)}" if on.times else ""
        counts = {"rigid bodies": off.instructions, **self.parts}
        terms = [f"{name} {count}".replace(" -", " −") for name, count in counts.items()]
        terms += [f"interactions of these parts {self.shared}"] * (self.shared > 0)
        terms += [f"minus {-self.shared} that several parts share"] * (self.shared < 0)
        return f"a step of RK4 takes {on.instructions} instructions{time}: {', '.join(terms)}"


def cost(
    system: Setup | Plant | Dynamics,
    q0: JointValues | None = None,
    v0: JointValues | None = None,
    *,
    controller: Controller | Callable[[float, np.ndarray, np.ndarray], ArrayLike] | None = None,
    budget_s: float = 10.0,
    repeats: int = 25,
    on_progress: Callable[[float, str], object] | None = None,
) -> Cost:
    """Measure instructions and time of gravity, effects and control, each on and off, and of alternative algorithms.

    Parts are compared in a step of RK4 in machine code; the method of a setup is not used. Times are processor times,
    which depend little on other programs.

    Args:
        system: A setup, or a plant or robot with a start.
        q0: Initial position, (n,), in [rad] or [m]; required unless `system` is a setup.
        v0: Initial velocity, (n,), in [rad/s] or [m/s]; by default that of the setup, or 0.
        controller: Controller, see `Setup`; by default that of the setup, or none.
        budget_s: Time budget without compiling, in [s].
        repeats: Largest number of timings of each version, while the budget lasts.
        on_progress: Called with the time spent, in [s], and the name of the current task.

    Raises:
        QueryError: If an argument is invalid.
    """
    options = starts(q0, v0) | ({} if controller is None else {"controller": controller})
    setup = setup_of("cost", system, options)
    integer("repeats", repeats, least=1, most=_MAX_REPEATS)
    budget = Budget(number("budget_s", budget_s, above=0), function("on_progress", on_progress, "(spent, task)"))
    pairs, left_out = list[ABComparison](), list[str]()
    try:
        with budget.apart():
            for name, make in _comparisons(setup):
                budget.report(f"counting: {name}")
                try:
                    pairs += make()
                except (ImportError, RobotDynError) as error:
                    left_out.append(f"{name}: {error}")
        alternatives, untimed = take_turns(pairs, budget, repeats)
    except KeyboardInterrupt:
        left_out.append(INTERRUPTED)
        alternatives, untimed = take_turns(pairs, budget, 0)
    name = getattr(setup.plant.dynamics, "name", type(setup.plant.dynamics).__name__)
    return Cost(
        name, acting(setup), alternatives, (*left_out, *untimed), processor_and_versions(), budget.seconds, budget.spent
    )


def _comparisons(setup: Setup) -> Iterator[tuple[str, Callable[[], list[ABComparison]]]]:
    """Yield the names of all comparisons, with functions that compute them."""
    yield "parts", lambda: list(step_cost.pairs_of_parts(setup))
    yield step_cost.NUMBERS, lambda: [step_cost.numbers(setup)]
    yield step_cost.SIDE_BY_SIDE, lambda: [step_cost.side_by_side(setup)]
    robot = getattr(setup.plant.dynamics, "robot", setup.plant.dynamics)
    if isinstance(robot, Robot):
        yield from ((name, lambda make=make: [make()]) for name, make in QueryCost(robot).pairs())


def cost_rows(result: Cost) -> Iterator[list[str]]:
    """Return a row for each comparison: unit, name, versions, instructions and their ratio, times and their ratio."""
    for k, pair in enumerate(result.alternatives):
        is_repeated = k > 0 and result.alternatives[k - 1].per == pair.per
        first, second, ratio = pair.first, pair.second, "—"
        if pair.time_ratio is not None:
            ratio = f"{pair.time_ratio:.2f} ± {pair.time_ratio_spread:.2f}{', within noise' * pair.within_noise}"
        names, counts = f"{first.name} / {second.name}", f"{first.instructions} / {second.instructions}"
        count_ratio, times = number_or_dash(pair.instructions_ratio, 3), f"{_time(first)} / {_time(second)}"
        yield ["" if is_repeated else pair.per, pair.name, names, counts, count_ratio, times, ratio]


def _time(version: Version) -> str:
    return f"{'~' * (not version.repeatable)}{format_duration(version.time_s)}" if version.times else "—"
