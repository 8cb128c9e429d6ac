"""What a digit costs: error against time and evaluations of every method that can take a motion, and of other programs.

error = max over joints and records of |q − q_ref|
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, isfinite, log10
from typing import Any, ClassVar, final

from robot_dyn.accuracy.work_precision_diagram.measurement import measure
from robot_dyn.accuracy.work_precision_diagram.method_under_test import (
    COMPILED,
    INTERPRETED,
    Point,
    Price,
    ToleranceLadder,
    own,
    recorded,
    switches,
    whole,
)
from robot_dyn.accuracy.work_precision_diagram.peers import found
from robot_dyn.accuracy.work_precision_diagram.reference_run import PastHorizon, Reference, past_horizon, reference
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Block, Table, number_or_dash
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.validate import function, instance, integer, number, truth
from robot_dyn.integrate.adaptive import AUTO, EXPLICIT, STIFF
from robot_dyn.integrate.methods import METHODS, as_method
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import format_duration, joint_units
from robot_dyn.report.environment import processor_and_versions
from robot_dyn.report.result import INTERRUPTED, Result
from robot_dyn.report.time_budget import Budget
from robot_dyn.simulation.engine.choice import choose
from robot_dyn.simulation.results.acting import acting
from robot_dyn.simulation.setup.options import setup_of, starts
from robot_dyn.simulation.setup.setup import Setup

# In this order, should the budget end: first what is most used and what costs least.
_FIRST = ("DOP853", "RK4", "DP8", "Euler", "Rodas5P", "GaussLegendre6", "GaussLegendre4", "Midpoint")
_MOST_REPEATS, _MOST_DIGITS = 1000, 20
_DIGITS = (3, 6, 9)  # of the columns
_OWN = "robot_dyn"  # this program
_USUAL_DIGITS = 6  # digits, of the sentence
_ENOUGH = 5  # methods of a sentence: with so many, none that is extrapolated is named
_ALWAYS_NAMED = ("RK4", "RK4 (without events)", "Euler")


@final
@dataclass(frozen=True, eq=False, repr=False)
class WorkPrecision(Result):
    """Error against work of the methods for one motion.

    Attributes:
        robot: Its name.
        acting: Descriptions of what acts.
        unit: Of errors, "rad", "m" or both.
        duration_s: The requested duration, in [s].
        reference: What errors are measured against, and up to when.
        ladders: The runs of each method in each engine, and of each program.
        left_out: What was left out, and why.
        environment: Versions and processor.
        budget_s: That was allowed, in [s].
        spent_s: That was spent, without compiling, in [s].
        past_horizon: Of chaotic motion, energy and the way back over all of the duration, by method; else nothing.
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.work_precision_diagram.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        "method", "engine", "events", "by", "setting", "steps", "evaluations", "error", "energy", "time_s", "repeats",
        "believed", "repeatable", "on_front",
    )  # fmt: skip
    robot: str
    acting: tuple[str, ...]
    unit: str
    duration_s: float
    reference: Reference
    ladders: tuple[ToleranceLadder, ...]
    left_out: tuple[str, ...]
    environment: dict[str, str]
    budget_s: float
    spent_s: float
    past_horizon: tuple[PastHorizon, ...] = ()

    @property
    def basis(self) -> Iterator[str]:
        """What acts, what errors are measured against, and where the horizon is cut, a line each."""
        of = self.reference
        yield f"{self.robot}: {', '.join(self.acting) or 'no effects'}"
        yield (
            f"error: largest |q − q_ref| over joints and {of.records} records in {of.horizon_s:g} s, in {self.unit};"
            f" reference: {of.methods[0]}, {of.error:.1e} from {of.methods[1]}: no error below that is believed"
        )
        if of.parted_s is not None:
            lost = "" if of.lost_s is None else f", and differ by 0.1 at {of.lost_s:.3g} s"
            yield (
                f"horizon: {of.horizon_s:g} s of {self.duration_s:g} s: beyond it runs at tight tolerances part from"
                f" each other{lost}"
            )

    def tables(self) -> Iterator[Block]:
        """What it rests on, and a line for each method."""
        yield from self.basis
        yield self._table_of_ladders([digits for digits in _DIGITS if 10.0**-digits >= self.reference.error])
        yield "times of prepared runs, the least of runs that take turns; * the least; ( ) extrapolated by the order"
        if self.past_horizon:
            yield from self._beyond_horizon()

    def _table_of_ladders(self, columns: list[int]) -> Table:
        """A row for each method: orders, what so many digits cost, and the finest run."""
        headings = ("method", "order", "measured", *(f"{digits} digits" for digits in columns), "least error", "in")
        best = {digits: min((p.value for _, p in self.digits(10.0**-digits)), default=0.0) for digits in columns}
        rows = []
        for ladder in self.ladders:
            cells = []
            for digits in columns:
                price = ladder.price(10.0**-digits)
                shown = "—" if price is None else f"({price})" if price.extrapolated else str(price)
                cells.append(shown + " *" * (price is not None and price.value == best[digits]))
            finest = min(ladder.points, key=lambda point: point.error)
            known = finest.error > self.reference.error
            error = number_or_dash(finest.error, 2) if known else f"< {self.reference.error:.0e}"
            orders = ["—" if order is None else f"{order:.2g}" for order in (ladder.order, ladder.measured_order)]
            rows.append((ladder.name, *orders, *cells, error, format_duration(finest.time_s)))
        return Table(headings, tuple(rows), right=headings[1:])

    def _beyond_horizon(self) -> Iterator[Block]:
        """Energy and the way back where no error can be measured, a line for each method."""
        yield ""
        yield f"over all of {self.duration_s:g} s, where no error can be measured, the finest runs:"
        headings, rows = ("method", "setting", "energy", "there and back"), []
        for run in self.past_horizon:
            back = "—" if run.returned is None else f"{run.returned:.1e}"
            rows.append((run.name, f"{run.setting:.3g}", f"{run.energy:.1e}", back))
        yield Table(headings, tuple(rows), right=headings[1:])
        yield "energy: largest residual, as a part of the energy exchanged; there and back: |q − q₀|"
        yield f"in {self.unit} of a run that turns round at the end, where nothing drives it or takes energy"

    @property
    def front(self) -> tuple[tuple[ToleranceLadder, Point], ...]:
        """The runs that no other one beats in error and time, from coarse to fine (Pareto front).

        Those below the error of the reference do not take part.
        """
        believed = [(ladder, p) for ladder in self.ladders for p in ladder.points if p.believed and isfinite(p.error)]
        front: list[tuple[ToleranceLadder, Point]] = []
        for ladder, point in sorted(believed, key=lambda run: (run[1].time_s, run[1].error)):
            if not front or point.error < front[-1][1].error:
                front.append((ladder, point))
        return tuple(front)

    @reported
    def rows(self) -> list[Mapping[str, Any]]:
        """The runs, one after the other: what their ladder is, what was measured, and whether no other one beats it."""
        front = [point for _, point in self.front]
        return [
            {name: getattr(ladder, name) for name in self.columns[:4]}
            | {name: getattr(point, name) for name in self.columns[4:-1]}
            | {"on_front": any(point is best for best in front)}
            for ladder in self.ladders
            for point in ladder.points
        ]

    def digits(self, error: float) -> list[tuple[ToleranceLadder, Price]]:
        """Return what an error costs in time by each method whose runs show it, the cheapest first.

        Args:
            error: In [rad] or [m].

        Raises:
            QueryError: If it is not positive.
        """
        error = number("error", error, above=0)
        prices = [(ladder, price) for ladder in self.ladders if (price := ladder.price(error)) is not None]
        return sorted(prices, key=lambda each: each[1].value)

    @property
    def usual_digits(self) -> int:
        """6, or as many digits as were reached."""
        best = min((p.error for ladder in self.ladders for p in ladder.points if p.believed), default=1.0)
        return min(_USUAL_DIGITS, floor(-log10(max(best, self.reference.error))))

    @reported
    def sentence(self) -> str:
        """What 6 digits cost, or as many as were reached, in a sentence."""
        return self.sentence_of(self.usual_digits)

    def sentence_of(self, digits: int) -> str:
        """Return what so many digits cost, in a sentence.

        Args:
            digits: Errors of at most 10^−digits.

        Raises:
            QueryError: If it is not a whole number from 0 to 20.
        """
        digits = integer("digits", digits, most=_MOST_DIGITS)
        if not self.ladders:
            return "no method was measured: see what was left out"
        parts = [
            f"{ladder.name} would take {price} (extrapolated)" if price.extrapolated else f"{ladder.name} {price}"
            for ladder, price in named(self, digits)
        ]
        if not parts:
            return f"{digits} digits of q were reached by no run"
        return f"{digits} digits of q over {self.reference.horizon_s:g} s: {'; '.join(parts)}"


def work_precision(
    what: Setup | Plant | Dynamics,
    q0: Any = None,
    v0: Any = None,
    *,
    duration_s: float | None = None,
    controller: Any = None,
    methods: Sequence[Any] | None = None,
    peers: bool = True,
    budget_s: float = 30.0,
    repeats: int = 25,
    on_progress: Callable[[float, str], object] | None = None,
) -> WorkPrecision:
    """Error against time and evaluations of all methods for one motion.

    Method, step, tolerances, record period, error estimate and events of a setup are not used. Its engine is:
    "auto" stands for both.

    Args:
        what: What moves: a setup, or a plant or robot with a start.
        q0: Position at the start, (n,), in [rad] or [m]; required unless `what` is a setup.
        v0: Velocity at the start, (n,), in [rad/s] or [m/s]; 0, or that of the setup, unless given.
        duration_s: In [s]; that of the setup, or 1, unless given. Chaotic motion is cut earlier.
        controller: As of a setup.
        methods: Names of `rd.integrate.method`, or methods; all of these unless given.
        peers: Whether other programs that are installed and can do the motion run too.
        budget_s: Time to spend, compiling not counted, in [s].
        repeats: How often a run is timed at most, while the budget lasts: less often if its time repeats (`Point`).
        on_progress: Called with the time spent, in [s], and with what is being run.

    Raises:
        QueryError: If an argument is wrong.
        HorizonError: If the motion has no reference.
    """
    given = {"duration_s": duration_s, "controller": controller}
    setup = setup_of("work_precision", what, starts(q0, v0) | {k: x for k, x in given.items() if x is not None})
    if methods is None:
        methods = [*_FIRST, *(name for name in METHODS if name not in (*_FIRST, AUTO))]
    instance("methods", methods, tuple | list, "give a list of names or methods, such as ['DOP853', 'RK4']")
    integrators = [as_method(each) for k, each in enumerate(methods) if each not in methods[:k]]
    if any(each.name == AUTO for each in integrators):
        raise QueryError(f"methods: {AUTO!r} is one of {EXPLICIT!r} and {STIFF!r}; name these")
    truth("peers", peers)
    integer("repeats", repeats, least=1, most=_MOST_REPEATS)
    budget = Budget(number("budget_s", budget_s, above=0), function("on_progress", on_progress, "(spent, what)"))
    setup, engines, left_out = _engines(whole(setup))
    requested, everything = setup.duration_s, setup
    setup, exact = reference(setup, budget)
    integrators, unable = _able(setup, integrators)
    variants = [(engines[0], True)] + [(engines[0], False)] * switches(setup) + [(each, True) for each in engines[1:]]
    candidates = [own(setup, each, engine, events) for engine, events in variants for each in integrators]
    with budget.apart():  # other programs are loaded, and build their models
        others, refused = found(setup) if peers else ([], [])
    place = len(integrators)  # programs in machine code come before what is interpreted, which takes longest
    candidates[place:place] = others
    ladders, ended = measure(candidates, exact, budget, repeats)
    left_out += unable + refused + ended
    cut = exact.parted_s is not None and INTERRUPTED not in ended
    later = past_horizon(everything, exact.horizon_s, ladders, {x.name: x for x in integrators}, budget) if cut else ()
    dynamics: Any = setup.plant.dynamics
    types = getattr(dynamics, "joint_types", (None,))
    return WorkPrecision(
        robot=getattr(dynamics, "name", type(dynamics).__name__),
        acting=acting(setup),
        unit=joint_units("q", types),
        duration_s=requested,
        reference=exact,
        ladders=ladders,
        left_out=tuple(left_out),
        environment=processor_and_versions(),
        budget_s=budget.seconds,
        spent_s=budget.spent,
        past_horizon=later,
    )


def _engines(setup: Setup) -> tuple[Setup, tuple[str, ...], list[str]]:
    """The setup in the first of the engines that it asks for and that can run it, all of these, and why not others."""
    if setup.engine != "auto":
        return setup, (setup.engine,), []
    compiled = replace(recorded(setup, setup.duration_s), engine=COMPILED)
    try:
        choose(compiled)
    except (ImportError, RobotDynError) as error:
        return replace(setup, engine=INTERPRETED), (INTERPRETED,), [f"machine code: {error}"]
    return replace(setup, engine=COMPILED), (COMPILED, INTERPRETED), []


def _able(setup: Setup, integrators: list[Any]) -> tuple[list[Any], list[str]]:
    """The methods that take the setup, and why not the others."""
    able, why = [], []
    for each in integrators:
        try:
            able.append(replace(setup, method=each).method)
        except QueryError as error:
            why.append(f"{each.name}: {error}")
    return able, why


def programs(result: WorkPrecision, error: float) -> Iterator[str]:
    """What an error takes by the cheapest method of each program, this library first; and what was left out."""
    best: dict[str, tuple[ToleranceLadder, Price]] = {}
    for ladder, price in result.digits(error):
        best.setdefault(program_of(ladder), (ladder, price))
    for program in dict.fromkeys([_OWN, *best, *map(program_of, result.ladders)]):
        if program in best:
            ladder, price = best[program]
            name = f"{_OWN} {ladder.name}" if program == _OWN else ladder.name
            times = ""
            if _OWN in best and program != _OWN:
                times = f", {float(f'{price.value / best[_OWN][1].value:.2g}'):g} times as long"
            yield f"  {name}: {price}{times}{' (extrapolated)' * price.extrapolated}"
        else:
            ended = dict.fromkeys(ladder.ended for ladder in result.ladders if program_of(ladder) == program)
            yield f"  {program}: reached by no run ({'; '.join(ended)})"
    yield "  times of prepared runs, the least of runs that take turns"
    yield from (f"  left out: {what}" for what in result.left_out)


def named(result: WorkPrecision, digits: int) -> list[tuple[ToleranceLadder, Price]]:
    """Return the ladders that the sentence of a result names, with what the digits cost; none if none was reached."""
    prices = result.digits(10.0**-digits)
    measured = [ladder for ladder, price in prices if not price.extrapolated]
    if not measured:
        return []
    ours = [ladder for ladder in measured if not ladder.peer]
    best = [measured[0], *ours[:1], *[ladder for ladder in ours if ladder.events][:1]]
    chosen: dict[str, tuple[ToleranceLadder, Price]] = {}  # of each program its best method
    for ladder, price in prices:
        if ladder.peer or ladder.name in _ALWAYS_NAMED or ladder in best:
            chosen.setdefault(program_of(ladder) if ladder.peer else ladder.name, (ladder, price))
    enough = sum(not price.extrapolated for _, price in chosen.values()) >= _ENOUGH
    return [(ladder, price) for ladder, price in chosen.values() if not (enough and price.extrapolated)]


def program_of(ladder: ToleranceLadder) -> str:
    """The program that a ladder is of."""
    return ladder.method.split(" ")[0] if ladder.peer else _OWN
