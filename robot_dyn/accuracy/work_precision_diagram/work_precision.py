"""Work-precision study: error against time and evaluations, of every suitable method and of other programs.

error = max over joints and records of |q − q_ref|
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, isfinite, log10
from typing import ClassVar, final

import numpy as np
from numpy.typing import ArrayLike

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
from robot_dyn.accuracy.work_precision_diagram.peers import methods_of_peers
from robot_dyn.accuracy.work_precision_diagram.reference_run import PastHorizon, Reference, past_horizon, reference
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Block, Table, number_or_dash
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.validate import JointValues, function, instance, integer, number, truth
from robot_dyn.integrate.adaptive import AUTO, EXPLICIT, STIFF, Adaptive
from robot_dyn.integrate.integrator import Integrator
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

# Measured in this order, in case the budget ends: the most used and the fastest methods first.
_FIRST = ("DOP853", "RK4", "DP8", "Euler", "Rodas5P", "GaussLegendre6", "GaussLegendre4", "Midpoint")
_MAX_REPEATS, _MAX_DIGITS = 1000, 20
_DIGITS = (3, 6, 9)  # columns of the table
_OWN = "robot_dyn"  # this program
_USUAL_DIGITS = 6  # in the sentence
_ENOUGH = 5  # with this number of measured methods, the sentence names no extrapolated one
_ALWAYS_NAMED = ("RK4", "RK4 (without events)", "Euler")


@final
@dataclass(frozen=True, eq=False, repr=False)
class WorkPrecision(Result):
    """Error against work of the methods for one motion.

    Attributes:
        robot: Name of the robot.
        acting: Descriptions of gravity, effects and control.
        unit: Unit of errors, "rad", "m" or both.
        duration_s: The requested duration, in [s].
        reference: The reference solution up to the horizon.
        ladders: The runs of each method in each engine, and of each program.
        left_out: Omitted methods, with reasons.
        environment: Software versions and processor.
        budget_s: Time budget, in [s].
        spent_s: Time spent, without compiling, in [s].
        past_horizon: For chaotic motion, energy and return error over the whole duration, by method; otherwise empty.
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.work_precision_diagram.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        "method", "engine", "events", "by", "setting", "steps", "evaluations", "error", "energy", "time_s", "repeats",
        "resolved", "repeatable", "on_front",
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
        """Lines with the setup, the definition of errors with the reference, and the horizon if it is cut."""
        reference = self.reference
        first, second = reference.methods
        yield f"{self.robot}: {', '.join(self.acting) or 'no effects'}"
        yield (
            f"error: largest |q − q_ref| over joints and {reference.records} records in {reference.horizon_s:g} s, in"
            f" {self.unit}; reference: {first}, {reference.error:.1e} from {second}: smaller errors are not resolved"
        )
        if reference.parted_s is not None:
            lost = "" if reference.lost_s is None else f", and differ by 0.1 at {reference.lost_s:.3g} s"
            yield (
                f"horizon: {reference.horizon_s:g} s of {self.duration_s:g} s: beyond it, runs at tight tolerances"
                f" diverge from each other{lost}"
            )

    def tables(self) -> Iterator[Block]:
        """The basis, one line per method, and the runs past the horizon."""
        yield from self.basis
        yield self._table_of_ladders([digits for digits in _DIGITS if 10.0**-digits >= self.reference.error])
        yield "times: least time of prepared runs that take turns; * the least; ( ) extrapolated by the order"
        if self.past_horizon:
            yield from self._beyond_horizon()

    def _table_of_ladders(self, columns: list[int]) -> Table:
        """Return a row for each method: orders, time for a number of digits, and the finest run."""
        headings = (
            "method",
            "order",
            "measured",
            *(f"{digits} digits" for digits in columns),
            "least error",
            "steps",
            "in",
        )
        best = {digits: min((p.value for _, p in self.digits(10.0**-digits)), default=0.0) for digits in columns}
        rows = []
        for ladder in self.ladders:
            cells = []
            for digits in columns:
                price = ladder.price(10.0**-digits)
                shown = "—" if price is None else f"({price})" if price.extrapolated else str(price)
                cells.append(shown + " *" * (price is not None and price.value == best[digits]))
            finest = min(ladder.points, key=lambda point: point.error)
            is_resolved = finest.error > self.reference.error
            error = number_or_dash(finest.error, 2) if is_resolved else f"< {self.reference.error:.0e}"
            orders = ["—" if order is None else f"{order:.2g}" for order in (ladder.order, ladder.measured_order)]
            steps = "—" if finest.steps is None else str(finest.steps)
            rows.append((ladder.name, *orders, *cells, error, steps, format_duration(finest.time_s)))
        return Table(headings, tuple(rows), right=headings[1:])

    def _beyond_horizon(self) -> Iterator[Block]:
        """Energy and return error past the horizon, one line per method."""
        yield ""
        yield f"over the whole {self.duration_s:g} s, where no error can be measured, the finest runs:"
        headings, rows = ("method", "setting", "energy", "there and back"), []
        for run in self.past_horizon:
            back = "—" if run.returned is None else f"{run.returned:.1e}"
            rows.append((run.name, f"{run.setting:.3g}", f"{run.energy:.1e}", back))
        yield Table(headings, tuple(rows), right=headings[1:])
        yield "energy: largest residual, as a fraction of the energy exchanged; there and back: |q − q₀|"
        yield f"in {self.unit} after a run that is reversed at the end, for motion without drive or dissipation"

    @property
    def front(self) -> tuple[tuple[ToleranceLadder, Point], ...]:
        """The Pareto front: runs that no other run beats in both error and time, from coarse to fine.

        Runs below the error of the reference are excluded.
        """
        resolved = [(ladder, p) for ladder in self.ladders for p in ladder.points if p.resolved and isfinite(p.error)]
        front: list[tuple[ToleranceLadder, Point]] = []
        for ladder, point in sorted(resolved, key=lambda run: (run[1].time_s, run[1].error)):
            if not front or point.error < front[-1][1].error:
                front.append((ladder, point))
        return tuple(front)

    @reported
    def rows(self) -> list[Mapping[str, object]]:
        """The runs in sequence: their ladder, the measured values, and whether they are on the Pareto front."""
        front = [point for _, point in self.front]
        return [
            {name: getattr(ladder, name) for name in self.columns[:4]}
            | {name: getattr(point, name) for name in self.columns[4:-1]}
            | {"on_front": any(point is best for best in front)}
            for ladder in self.ladders
            for point in ladder.points
        ]

    def digits(self, error: float) -> list[tuple[ToleranceLadder, Price]]:
        """Return the time to reach an error by each method for which it can be estimated, the fastest first.

        Args:
            error: The error, in [rad] or [m].

        Raises:
            QueryError: If the error is not positive.
        """
        error = number("error", error, above=0)
        prices = [(ladder, price) for ladder in self.ladders if (price := ladder.price(error)) is not None]
        return sorted(prices, key=lambda pair: pair[1].value)

    @property
    def usual_digits(self) -> int:
        """6, or the number of digits reached if it is smaller."""
        best = min((p.error for ladder in self.ladders for p in ladder.points if p.resolved), default=1.0)
        return min(_USUAL_DIGITS, floor(-log10(max(best, self.reference.error))))

    @reported
    def sentence(self) -> str:
        """The time that 6 digits take, or the digits reached if fewer, in one sentence."""
        return self.sentence_of(self.usual_digits)

    def sentence_of(self, digits: int) -> str:
        """Return a sentence with the time that a number of digits takes.

        Args:
            digits: Number of digits, for errors of at most 10^−digits.

        Raises:
            QueryError: If it is not a whole number from 0 to 20.
        """
        digits = integer("digits", digits, most=_MAX_DIGITS)
        if not self.ladders:
            return "no method was measured; see left_out"
        parts = [
            f"{ladder.name} would take {price} (extrapolated)" if price.extrapolated else f"{ladder.name} {price}"
            for ladder, price in named(self, digits)
        ]
        if not parts:
            return f"no run reached {digits} digits of q"
        return f"{digits} digits of q over {self.reference.horizon_s:g} s: {'; '.join(parts)}"


def work_precision(
    system: Setup | Plant | Dynamics,
    q0: JointValues | None = None,
    v0: JointValues | None = None,
    *,
    duration_s: float | None = None,
    controller: Controller | Callable[[float, np.ndarray, np.ndarray], ArrayLike] | None = None,
    methods: Sequence[str | Integrator | Adaptive] | None = None,
    peers: bool = True,
    budget_s: float = 30.0,
    repeats: int = 25,
    on_progress: Callable[[float, str], object] | None = None,
) -> WorkPrecision:
    """Measure error against time and evaluations of all methods for one motion.

    Method, step, tolerances, record period, error estimate and events of a setup are not used. The engine of a setup is
    used; "auto" means both engines.

    Args:
        system: A setup, or a plant or robot with a start.
        q0: Initial position, (n,), in [rad] or [m]; required unless `system` is a setup.
        v0: Initial velocity, (n,), in [rad/s] or [m/s]; by default that of the setup, or 0.
        duration_s: Duration, in [s]; by default that of the setup, or 1. Chaotic motion is cut earlier.
        controller: Controller, see `Setup`; by default that of the setup, or none.
        methods: Methods, or names for `rd.integrate.method`; by default all of these.
        peers: True to run other installed programs too, if they can simulate the motion.
        budget_s: Time budget, compiling not included, in [s].
        repeats: Largest number of timings of a run, while the budget lasts; fewer if its time repeats (`Point`).
        on_progress: Called with the time spent, in [s], and the name of the current run.

    Raises:
        QueryError: If an argument is invalid.
        HorizonError: If the motion has no reference solution.
    """
    options = {"duration_s": duration_s, "controller": controller}
    setup = setup_of("work_precision", system, starts(q0, v0) | {k: x for k, x in options.items() if x is not None})
    if methods is None:
        methods = [*_FIRST, *(name for name in METHODS if name not in (*_FIRST, AUTO))]
    instance("methods", methods, tuple | list, "give a list of names or methods, such as ['DOP853', 'RK4']")
    integrators = [as_method(method) for k, method in enumerate(methods) if method not in methods[:k]]
    if any(method.name == AUTO for method in integrators):
        raise QueryError(f"methods: {AUTO!r} uses {EXPLICIT!r} or {STIFF!r}; name these instead")
    truth("peers", peers)
    integer("repeats", repeats, least=1, most=_MAX_REPEATS)
    budget = Budget(number("budget_s", budget_s, above=0), function("on_progress", on_progress, "(spent, task)"))
    setup, engines, left_out = _engines(whole(setup))
    whole_setup = setup
    setup, exact = reference(setup, budget)
    integrators, unable = _able(setup, integrators)
    variants = [(engines[0], True)] + [(engines[0], False)] * switches(setup) + [(name, True) for name in engines[1:]]
    candidates = [own(setup, method, engine, events) for engine, events in variants for method in integrators]
    with budget.apart():  # other programs are loaded, and build their models
        others, refused = methods_of_peers(setup) if peers else ([], [])
    place = len(integrators)  # programs in machine code precede interpreted runs, which take longest
    candidates[place:place] = others
    ladders, ended = measure(candidates, exact, budget, repeats)
    left_out += unable + refused + ended
    later = ()
    if exact.parted_s is not None and INTERRUPTED not in ended:
        by_name = {method.name: method for method in integrators}
        later = past_horizon(whole_setup, exact.horizon_s, ladders, by_name, budget)
    dynamics = setup.plant.dynamics
    types = getattr(dynamics, "joint_types", (None,))
    return WorkPrecision(
        robot=getattr(dynamics, "name", type(dynamics).__name__),
        acting=acting(setup),
        unit=joint_units("q", types),
        duration_s=whole_setup.duration_s,
        reference=exact,
        ladders=ladders,
        left_out=tuple(left_out),
        environment=processor_and_versions(),
        budget_s=budget.seconds,
        spent_s=budget.spent,
        past_horizon=later,
    )


def _engines(setup: Setup) -> tuple[Setup, tuple[str, ...], list[str]]:
    """Return the setup in the first engine it may use, the names of all of these, and notes on those left out."""
    if setup.engine != "auto":
        return setup, (setup.engine,), []
    compiled = replace(recorded(setup, setup.duration_s), engine=COMPILED)
    try:
        choose(compiled)
    except (ImportError, RobotDynError) as error:
        return replace(setup, engine=INTERPRETED), (INTERPRETED,), [f"machine code: {error}"]
    return replace(setup, engine=COMPILED), (COMPILED, INTERPRETED), []


def _able(setup: Setup, integrators: list[Integrator | Adaptive]) -> tuple[list[Integrator | Adaptive], list[str]]:
    """Return the methods that can run the setup, and notes on the others."""
    able, left_out = [], []
    for method in integrators:
        try:
            able.append(replace(setup, method=method).method)
        except QueryError as error:
            left_out.append(f"{method.name}: {error}")
    return able, left_out


def programs(result: WorkPrecision, error: float) -> Iterator[str]:
    """Return lines with the time to reach an error by the fastest method of each program, this library first.

    Methods that were left out follow.
    """
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
            yield f"  {program}: not reached ({'; '.join(ended)})"
    yield "  times: shortest time of prepared runs that take turns"
    yield from (f"  left out: {note}" for note in result.left_out)


def named(result: WorkPrecision, digits: int) -> list[tuple[ToleranceLadder, Price]]:
    """Return the ladders in the sentence of a result, with the time that the digits take; [] if none can be timed."""
    prices = result.digits(10.0**-digits)
    measured = [ladder for ladder, price in prices if not price.extrapolated]
    if not measured:
        return []
    ours = [ladder for ladder in measured if not ladder.peer]
    best = [measured[0], *ours[:1], *[ladder for ladder in ours if ladder.events][:1]]
    chosen: dict[str, tuple[ToleranceLadder, Price]] = {}  # the best method of each program
    for ladder, price in prices:
        if ladder.peer or ladder.name in _ALWAYS_NAMED or ladder in best:
            chosen.setdefault(program_of(ladder) if ladder.peer else ladder.name, (ladder, price))
    has_enough = sum(not price.extrapolated for _, price in chosen.values()) >= _ENOUGH
    return [(ladder, price) for ladder, price in chosen.values() if not (has_enough and price.extrapolated)]


def program_of(ladder: ToleranceLadder) -> str:
    """Return the name of the program of a ladder."""
    return ladder.method.split(" ")[0] if ladder.peer else _OWN
