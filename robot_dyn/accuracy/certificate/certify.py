"""What a digit costs in M, C, N, inverse and forward dynamics: true digits of each implementation beside its time.

    digits = −log₁₀(error),   error against balls of radius 1e-20

Errors of M_ij are relative to √(M_ii M_jj); of accelerations, in the norm of M, to Σ ‖M⁻¹ τ_k‖ of τ, C v and N; of C, N
and inverse dynamics to the largest entry in the units √M_ii of the joints, or its root mean square over the random
states if that is more: an answer that vanishes at a state does not count as lost digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf, isfinite, log10
from typing import Any, ClassVar, final

import numpy as np

from robot_dyn.accuracy.certificate.digit_count import DigitCount, Held, Implementation, evaluate, implementations
from robot_dyn.accuracy.certificate.worst_case_search import Batch, random_states, row, worst_state
from robot_dyn.accuracy.correct_digits import QUANTITIES, warn_below
from robot_dyn.foundations.answer import Block, Table
from robot_dyn.foundations.arithmetic import Ball
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.validate import choice, function, integer, joint_values
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.scale import unit_diagonal_conditions
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import M
from robot_dyn.queries.quantity import MOST_DIGITS, Quantity
from robot_dyn.queries.units import format_duration
from robot_dyn.report.environment import processor_and_versions
from robot_dyn.report.result import INTERRUPTED, Result
from robot_dyn.report.timing import in_turns

_AT_LEAST_S = 1e-3  # of a loop that is timed
_MOST_REPEATS, _LEAST_SAMPLES, _MOST_SAMPLES = 1000, 100, 10**6
DECIMALS = "decimals of the file as float64"  # name of the implementation that computes exactly with these decimals


@final
@dataclass(frozen=True)
class Condition:
    """κ of M scaled to a unit diagonal; inf where M is singular.

    Attributes:
        given: κ at the given state; None if none was given.
        typical: Median over the random states.
        random: Largest κ over the random states.
        searched: Largest κ found.
        q: Configuration of the largest κ found.
    """

    given: float | None
    typical: float
    random: float
    searched: float
    q: tuple[float, ...] = field(repr=False)

    @property
    def digits(self) -> float:
        """log₁₀ of the largest κ: the digits that solving M a = τ may lose."""
        return log10(self.searched)


@final
@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Result):
    """True digits of a robot's dynamics.

    Attributes:
        robot: Name of the robot.
        joints: Names of the joints.
        digits: Digits of each quantity by each implementation.
        decimals: By quantity, digits left after rounding the decimals of the file to float64, at the worst state.
        right_angles: By quantity, digits left after machine code completes the rounded right angles of the file.
        condition: Condition number of M.
        bits: Highest precision of the balls used for the true values.
        left_out: What was left out, and why.
        environment: Versions and processor.
        seed: Seed of the random states.
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.certificate.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        "quantity", "implementation", "given", "typical", "samples", "random", "searched", "time_s", "repeats",
        "repeatable",
    )  # fmt: skip
    robot: str
    joints: tuple[str, ...]
    digits: tuple[Held, ...]
    decimals: dict[str, float]
    right_angles: dict[str, float]
    condition: Condition
    bits: int
    left_out: tuple[str, ...]
    environment: dict[str, str]
    seed: int

    def tables(self) -> Iterator[Block]:
        """A line for each quantity and implementation, and what it rests on."""
        yield (
            f"{self.robot}: decimal digits that hold, against balls of {self.bits} bits: error of M_ij relative to"
            " √(M_ii M_jj); of C, N and inverse"
        )
        own = "or its rms at random states if that is more"
        yield f"dynamics to the largest entry in the units √M_ii of the joints, {own};"
        yield "of forward dynamics to M⁻¹τ, M⁻¹C v and M⁻¹N, in the norm of M"
        given = any(each.given is not None for each in self.digits)
        counts = ("typical", "worst of", "random", "searched", "time")
        headings = ("quantity", "implementation", *["given"] * given, *counts)
        yield Table(headings, tuple(self._digit_rows(given)), right=headings[2:])
        of = self.condition
        lose = f": up to {of.digits:.1f} digits for forward dynamics to lose" if isfinite(of.digits) else ""
        yield (
            f"κ of M scaled to a unit diagonal: typical {of.typical:.3g}, largest at random {of.random:.3g}, searched"
            f" {of.searched:.3g}{lose}"
        )
        if lost := [f"{implementation} {digits:+.1f}" for implementation, digits in self.lost.items()]:
            yield f"digits of inverse less those of forward dynamics, at the worst states: {', '.join(lost)}"
        if self.right_angles:
            yield (
                "machine code writes right angles out in full, and is judged by these; of the file as it stands that"
                f" leaves {min(self.right_angles.values()):.1f} digits"
            )
        yield "times of one query from Python, the least of calls that take turns; no more than 20 digits are counted"

    def of(self, quantity: str, implementation: str) -> Held:
        """The digits of one quantity by one implementation.

        Raises:
            QueryError: If they were not counted.
        """
        choice("quantity", quantity, self.quantities)
        choice("implementation", implementation, self.implementations)
        for each in self._of(quantity):
            if each.implementation == implementation:
                return each
        raise QueryError(
            f"{implementation!r} does not answer {quantity}; look at the quantities of each implementation in digits"
        )

    @property
    def rows(self) -> Iterator[Mapping[str, Any]]:
        yield from ({name: getattr(held, name) for name in self.columns} for held in self.digits)
        for quantity, digits in self.decimals.items():
            yield {"quantity": quantity, "implementation": DECIMALS, "searched": digits}

    @reported
    def lost(self) -> dict[str, float]:
        """By implementation, digits of inverse dynamics minus those of forward dynamics, at the worst states."""
        inverse, forward = (
            {each.implementation: each.searched for each in self._of(quantity) if each.samples > 1}
            for quantity in ("inverse_dynamics", "forward_dynamics")
        )
        return {
            name: inverse[name] - forward[name] for name in self.implementations if name in inverse.keys() & forward
        }

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities examined."""
        return tuple(dict.fromkeys(each.quantity for each in self.digits))

    @property
    def implementations(self) -> tuple[str, ...]:
        """Names of the implementations examined."""
        return tuple(dict.fromkeys(each.implementation for each in self.digits))

    @reported
    def sentence(self) -> str:
        """The digits of forward dynamics, or of the last quantity counted, in a sentence."""
        if not self.digits:
            return "no digits were counted"
        quantity = "forward_dynamics" if "forward_dynamics" in self.quantities else self.quantities[-1]
        parts = [
            f"{each.implementation} {each.searched:.1f} in {format_duration(each.time_s)}"
            for each in sorted(self._of(quantity), key=lambda each: each.time_s)
        ]
        return f"digits of {quantity} at the worst state found: {'; '.join(parts)}"

    def _of(self, quantity: str) -> Iterator[Held]:
        return (each for each in self.digits if each.quantity == quantity)

    def _digit_rows(self, given: bool) -> Iterator[tuple[str, ...]]:
        """A row for each implementation, and one for the decimals of the file, by quantity."""
        for quantity in self.quantities:
            for held in self._of(quantity):
                own = ["—" if held.given is None else f"{held.given:.1f}"] * given
                worst, time = (f"{held.random:.1f}", f"{held.searched:.1f}"), format_duration(held.time_s)
                yield quantity, held.implementation, *own, f"{held.typical:.1f}", str(held.samples), *worst, time
            yield quantity, DECIMALS, *[""] * (3 + given), f"{self.decimals[quantity]:.1f}", ""


def certify(
    robot: Robot,
    *,
    q: Any = None,
    v: Any = None,
    a: Any = None,
    tau: Any = None,
    samples: int = 10_000,
    seed: int = 0,
    repeats: int = 11,
    on_progress: Callable[[float, str], object] | None = None,
) -> Certificate:
    """Count the true digits of M, C, N, inverse and forward dynamics by each implementation, and time its queries.

    Implementations are Pinocchio, the Lagrangian in float32, float64 and longdouble, articulated bodies, machine code
    (judged by its own right angles) and balls. Random states are those of `compare`, in numbers of float32, so that no
    implementation rounds them. Errors at these states, and in the search that begins at the worst of them, are taken
    against longdouble; balls judge the worst of each. Errors of longdouble are taken against balls, at 1/250 of the
    states.

    Args:
        robot: The robot.
        q: Positions of a state to look at too, (n,), in [rad] or [m].
        v: Its velocities, (n,), in [rad/s] or [m/s]; 0 unless given.
        a: Its accelerations, (n,), in [rad/s²] or [m/s²]; 0 unless given.
        tau: Its torques, (n,), in [N m] or [N]; 0 unless given.
        samples: Number of random states.
        seed: Of the random generator.
        repeats: How often each query is timed; they take turns, and the least time counts.
        on_progress: Called with the part that is done, from 0 to 1, and with what is being done.

    Raises:
        QueryError: If an argument is wrong.
    """
    robot = warn_below(robot, None)
    samples = integer("samples", samples, least=_LEAST_SAMPLES, most=_MOST_SAMPLES)
    seed, repeats = integer("seed", seed, most=2**128 - 1), integer("repeats", repeats, least=1, most=_MOST_REPEATS)
    report = function("on_progress", on_progress, "(part, what)") or (lambda part, what: None)
    given = _given(robot, q, v, a, tau)
    rng = np.random.default_rng(seed)
    states = random_states(robot, samples, rng)
    report(0.0, "machine code")
    found, left_out = implementations(robot)
    digit_count, held = DigitCount(robot, states, given, rng), list[Held]()
    quantities = [each for each in QUANTITIES.values() if each in found[0].quantities]
    try:
        for k, quantity in enumerate(quantities):
            held += _quantity(
                digit_count, quantity, [each for each in found if quantity in each.quantities], repeats, left_out,
                lambda part, what, k=k: report((k + part) / len(quantities), what),
            )  # fmt: skip
    except KeyboardInterrupt:
        left_out.append(INTERRUPTED)
    return Certificate(
        robot=robot.name,
        joints=robot.joint_names,
        digits=tuple(held),
        decimals=digit_count.decimals,
        right_angles=digit_count.right_angles,
        condition=_condition(robot, states, given, rng),
        bits=digit_count.bits,
        left_out=tuple(left_out),
        environment=processor_and_versions(),
        seed=seed,
    )


def _given(robot: Robot, q: Any, v: Any, a: Any, tau: Any) -> dict[str, np.ndarray] | None:
    """The state to look at, or None."""
    more = {name: x for name, x in {"v": v, "a": a, "tau": tau}.items() if x is not None}
    if q is None:
        if more:
            raise QueryError(f"{next(iter(more))} is given without q; give q, or leave it out")
        return None
    state = {name: np.zeros(robot.n) for name in ("v", "a", "tau")}
    for name, x in ({"q": q} | more).items():
        state[name] = np.array(joint_values(name, x, robot.joint_names))
        if state[name].ndim != 1:
            raise QueryError(f"{name} must have shape ({robot.n},), got {state[name].shape}")
    return state


def _quantity(
    digit_count: DigitCount, quantity: Quantity, found: list[Implementation], repeats: int, left_out: list[str],
    report: Callable[[float, str], object],
) -> list[Held]:  # fmt: skip
    """Return digits and times of one quantity by each implementation; `left_out` takes those without an answer."""
    held, calls, state = list[Held](), {}, digit_count.given or row(digit_count.states, 0)
    for k, implementation in enumerate(found):
        report(k / len(found), f"{quantity.name}: {implementation.name}")
        try:
            held.append(digit_count.count(implementation, quantity))
            calls[implementation.name] = _call(implementation.engine, quantity, state)
        except QueryError as error:
            left_out.append(str(error))
    bits = digit_count.truth(digit_count.robot, quantity, state).bits
    name, most = f"balls, {bits} bits", float(MOST_DIGITS)
    calls[name] = _call(Lagrangian(digit_count.robot, Ball(bits)), quantity, state)
    given = None if digit_count.given is None else most
    at = {key: state[key].tolist() for key in quantity.arguments}
    held.append(Held(quantity.name, name, given, most, most, most, 1, state=at))
    report(1.0, f"{quantity.name}: times")
    times = in_turns(calls, repeats, _AT_LEAST_S)
    return [replace(count, times=tuple(times[count.implementation])) for count in held]


def _call(engine: Any, quantity: Quantity, state: dict[str, np.ndarray]) -> Callable[[], object]:
    """A query of one state, ready to be timed."""
    return partial(getattr(engine, quantity.name), *(state[name] for name in quantity.arguments))


def _condition(robot: Robot, states: Batch, given: dict[str, np.ndarray] | None, rng: np.random.Generator) -> Condition:
    """κ of M, and its largest."""

    def conditions(states: Batch) -> np.ndarray:
        return unit_diagonal_conditions(evaluate(robot, M, states))

    if robot.joint_without_inertia is not None:
        return Condition(None if given is None else inf, inf, inf, inf, ())
    known = conditions(states)
    worst, most = worst_state(states, rng, conditions, known, ("q",))
    own = None if given is None else float(conditions({"q": given["q"][None]})[0])
    return Condition(own, float(np.median(known)), float(known.max()), most, tuple(worst["q"][0].tolist()))
