"""What effects and algorithms cost on one arm: instructions, counted exactly, and times of runs that take turns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, final

from robot_dyn.accuracy.costs import step_cost
from robot_dyn.accuracy.costs.ab_comparison import ABComparison, Version, take_turns
from robot_dyn.accuracy.costs.query_cost import QueryCost
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Block, Table, number_or_dash
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.validate import choice, function, integer, number
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import format_duration
from robot_dyn.report.environment import processor_and_versions
from robot_dyn.report.result import INTERRUPTED, Result
from robot_dyn.report.time_budget import Budget
from robot_dyn.simulation.results.acting import acting
from robot_dyn.simulation.setup.options import setup_of, starts
from robot_dyn.simulation.setup.setup import Setup

_MOST_REPEATS = 1000
# Columns of a table: of two versions, and of each of them.
_OF_BOTH = ("group", "what", "per", "instructions_ratio", "time_ratio", "time_ratio_spread", "time_between_s")
_OF_ONE = ("name", "instructions", "time_s", "repeats", "repeatable")


@final
@dataclass(frozen=True, eq=False, repr=False)
class Cost(Result):
    """The cost of the parts of a setup, and of algorithms for its equations.

    Attributes:
        robot: Its name.
        acting: Descriptions of what acts.
        alternatives: Two of each kind beside each other.
        left_out: What was left out, and why.
        environment: Versions and processor.
        budget_s: That was allowed, in [s].
        spent_s: That was spent, without compiling, in [s].
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.costs.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        *_OF_BOTH[:3], *(f"{of}_{key}" for of in ("first", "second") for key in _OF_ONE), *_OF_BOTH[3:],
    )  # fmt: skip
    robot: str
    acting: tuple[str, ...]
    alternatives: tuple[ABComparison, ...]
    left_out: tuple[str, ...]
    environment: dict[str, str]
    budget_s: float
    spent_s: float

    def tables(self) -> Iterator[Block]:
        """A line for each alternative, by what they are of."""
        yield f"{self.robot}: {', '.join(self.acting) or 'no effects'}"
        headings = ("per", "what", "first / second", "instructions", "ratio", "time", "ratio")
        yield Table(headings, tuple(map(tuple, cost_rows(self))), right=headings[3:])
        yield "instructions are exact; times of the processor, in machine code on one thread, are the least over turns;"
        yield "± half of the interquartile range of the ratios in a turn; ~ a time that did not repeat to 5 %"

    def of(self, what: str) -> ABComparison:
        """The two versions of what differs, such as "gravity" or "forward dynamics".

        Raises:
            QueryError: If it is not among them.
        """
        known = {each.what: each for each in self.alternatives}
        return known[choice("cost of", what, known)]

    @property
    def rows(self) -> Iterator[Mapping[str, Any]]:
        for pair in self.alternatives:
            row = {name: getattr(pair, name) for name in _OF_BOTH}
            for of, version in (("first", pair.first), ("second", pair.second)):
                row |= {f"{of}_{name}": getattr(version, name) for name in _OF_ONE}
                row |= {} if version.times else {f"{of}_time_s": None}
            yield row

    @reported
    def parts(self) -> dict[str, int]:
        """Instructions in a step that each part of the setup adds to the others, by name."""
        pairs = (pair for pair in self.alternatives if pair.group == "parts" and pair.what != step_cost.EVERYTHING)
        return {pair.what: pair.added for pair in pairs}

    @property
    def _everything(self) -> ABComparison | None:
        return next((pair for pair in self.alternatives if pair.what == step_cost.EVERYTHING), None)

    @reported
    def shared(self) -> int:
        """Instructions in a step of all parts, less the sum of `parts`: negative where several count the same ones."""
        return (self._everything.added if self._everything else 0) - sum(self.parts.values())

    @reported
    def sentence(self) -> str:
        """What a step costs and what of it the parts are, in a sentence."""
        if self._everything is None:
            return "no step was counted"
        on, off = self._everything.first, self._everything.second
        time = f", {format_duration(on.time_s)}" if on.times else ""
        counts = {"rigid bodies": off.instructions, **self.parts}
        terms = [f"{name} {count}".replace(" -", " −") for name, count in counts.items()]
        terms += [f"several of these together {self.shared}"] * (self.shared > 0)
        terms += [f"less {-self.shared} that several of these count"] * (self.shared < 0)
        return f"a step of RK4 takes {on.instructions} instructions{time}: {', '.join(terms)}"


def cost(
    what: Setup | Plant | Dynamics,
    q0: Any = None,
    v0: Any = None,
    *,
    controller: Any = None,
    budget_s: float = 10.0,
    repeats: int = 25,
    on_progress: Callable[[float, str], object] | None = None,
) -> Cost:
    """Instructions and time of each effect, controller and term, on and off, and of algorithms beside each other.

    Parts are compared in a step of RK4 in machine code, whatever the method of a setup. Times are those of the
    processor, so that other programs on the machine matter little.

    Args:
        what: A setup, or a plant or robot with a start.
        q0: Position at the start, (n,), in [rad] or [m]; required unless `what` is a setup.
        v0: Velocity at the start, (n,), in [rad/s] or [m/s]; 0, or that of the setup, unless given.
        controller: As of a setup.
        budget_s: Time to spend, compiling not counted, in [s].
        repeats: How often each is timed at most, while the budget lasts.
        on_progress: Called with the time spent, in [s], and with what is being done.

    Raises:
        QueryError: If an argument is wrong.
    """
    given = starts(q0, v0) | ({} if controller is None else {"controller": controller})
    setup = setup_of("cost", what, given)
    integer("repeats", repeats, least=1, most=_MOST_REPEATS)
    budget = Budget(number("budget_s", budget_s, above=0), function("on_progress", on_progress, "(spent, what)"))
    pairs, left_out = list[ABComparison](), list[str]()
    try:
        with budget.apart():
            for name, make in _questions(setup):
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


def _questions(setup: Setup) -> Iterator[tuple[str, Callable[[], list[ABComparison]]]]:
    """What is compared, by name."""
    yield "parts", lambda: list(step_cost.pairs_of_parts(setup))
    yield step_cost.NUMBERS, lambda: [step_cost.numbers(setup)]
    yield step_cost.SIDE_BY_SIDE, lambda: [step_cost.side_by_side(setup)]
    robot = getattr(setup.plant.dynamics, "robot", setup.plant.dynamics)
    if isinstance(robot, Robot):
        yield from ((name, lambda make=make: [make()]) for name, make in QueryCost(robot).pairs())


def cost_rows(result: Cost) -> Iterator[list[str]]:
    """A row for each alternative: per, what, versions, instructions and their ratio, times and theirs."""
    for k, pair in enumerate(result.alternatives):
        again = k > 0 and result.alternatives[k - 1].per == pair.per
        first, second, ratio = pair.first, pair.second, "—"
        if pair.time_ratio is not None:
            ratio = f"{pair.time_ratio:.2f} ± {pair.time_ratio_spread:.2f}{', within noise' * pair.within_noise}"
        names, counts = f"{first.name} / {second.name}", f"{first.instructions} / {second.instructions}"
        fewer, times = number_or_dash(pair.instructions_ratio, 3), f"{_time(first)} / {_time(second)}"
        yield ["" if again else pair.per, pair.what, names, counts, fewer, times, ratio]


def _time(of: Version) -> str:
    return f"{'~' * (not of.repeatable)}{format_duration(of.time_s)}" if of.times else "—"
