"""Certificates: true digits and time of M, C, N, inverse and forward dynamics by each implementation.

    digits = −log₁₀(error),   error against balls of radius 1e-20

Errors of M_ij are relative to √(M_ii M_jj). Errors of accelerations, in the norm of M, are relative to Σ ‖M⁻¹ τ_k‖ of
τ, C v and N. Errors of C, N and inverse dynamics are relative to the largest entry in the units √M_ii of the joints, or
to its root mean square over the random states if that is larger: an answer that vanishes at a state loses no digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf, isfinite, log10
from typing import ClassVar, final

import numpy as np

from robot_dyn.accuracy.certificate.digit_count import (
    CountedDigits,
    DigitCount,
    Engine,
    Implementation,
    evaluate,
    implementations,
)
from robot_dyn.accuracy.certificate.worst_case_search import Batch, random_states, row, worst_state
from robot_dyn.accuracy.correct_digits import QUANTITIES, warn_below
from robot_dyn.foundations.answer import Block, Table
from robot_dyn.foundations.arithmetic import Ball
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.validate import JointValues, choice, function, integer, joint_values
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.scale import unit_diagonal_conditions
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import M
from robot_dyn.queries.quantity import MAX_DIGITS, Quantity
from robot_dyn.queries.units import format_duration
from robot_dyn.report.environment import processor_and_versions
from robot_dyn.report.result import INTERRUPTED, Result
from robot_dyn.report.timing import in_turns

_MIN_LOOP_S = 1e-3  # duration of a timed loop
_MAX_REPEATS, _MIN_SAMPLES, _MAX_SAMPLES = 1000, 100, 10**6
DECIMALS = "decimals of the file as float64"  # name of the implementation that computes exactly with these decimals


@final
@dataclass(frozen=True)
class Condition:
    """κ of M scaled to a unit diagonal; inf where M is singular.

    Attributes:
        at_state: κ at the additional state of the user; None without one.
        typical: Median over the random states.
        random: Largest κ over the random states.
        searched: Largest κ found.
        q: Configuration of the largest κ found.
    """

    at_state: float | None
    typical: float
    random: float
    searched: float
    q: tuple[float, ...] = field(repr=False)

    @property
    def digits(self) -> float:
        """log₁₀ of the largest κ: the number of digits that solving M a = τ may lose."""
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
        left_out: Omitted implementations and quantities, with reasons.
        environment: Software versions and processor.
        seed: Seed of the random states.
    """

    diagram: ClassVar[str] = "robot_dyn.accuracy.certificate.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        "quantity", "implementation", "at_state", "typical", "samples", "random", "searched", "time_s", "repeats",
        "repeatable",
    )  # fmt: skip
    robot: str
    joints: tuple[str, ...]
    digits: tuple[CountedDigits, ...]
    decimals: dict[str, float]
    right_angles: dict[str, float]
    condition: Condition
    bits: int
    left_out: tuple[str, ...]
    environment: dict[str, str]
    seed: int

    def tables(self) -> Iterator[Block]:
        """The definition of errors, a line for each quantity and implementation, and notes."""
        yield (
            f"{self.robot}: correct decimal digits, against balls of {self.bits} bits: error of M_ij relative to"
            " √(M_ii M_jj); of C, N and inverse"
        )
        yield "dynamics to the largest entry in the units √M_ii of the joints, or its rms at random states if larger;"
        yield "of forward dynamics to M⁻¹τ, M⁻¹C v and M⁻¹N, in the norm of M"
        has_state = any(count.at_state is not None for count in self.digits)
        counts = ("typical", "samples", "random", "searched", "time")
        headings = ("quantity", "implementation", *["at state"] * has_state, *counts)
        yield Table(headings, tuple(self._digit_rows(has_state)), right=headings[2:])
        condition = self.condition
        loss = f": up to {condition.digits:.1f} digits lost in forward dynamics" if isfinite(condition.digits) else ""
        yield (
            f"κ of M scaled to a unit diagonal: typical {condition.typical:.3g}, largest at random"
            f" {condition.random:.3g}, searched {condition.searched:.3g}{loss}"
        )
        if lost := [f"{implementation} {digits:+.1f}" for implementation, digits in self.lost.items()]:
            yield f"digits of inverse minus those of forward dynamics, at the worst states: {', '.join(lost)}"
        if self.right_angles:
            yield (
                "machine code uses exact right angles and is judged by them; against the angles of the file it has"
                f" {min(self.right_angles.values()):.1f} digits"
            )
        yield "times of one query from Python: the shortest of calls that take turns; at most 20 digits are counted"

    def digits_of(self, quantity: str, implementation: str) -> CountedDigits:
        """Return the digits of one quantity by one implementation.

        Raises:
            QueryError: If they were not counted.
        """
        choice("quantity", quantity, self.quantities)
        choice("implementation", implementation, self.implementations)
        for count in self._of(quantity):
            if count.implementation == implementation:
                return count
        raise QueryError(
            f"{implementation!r} does not compute {quantity}; see certificate.digits for the quantities of every"
            " implementation"
        )

    @property
    def rows(self) -> Iterator[Mapping[str, object]]:
        yield from ({name: getattr(count, name) for name in self.columns} for count in self.digits)
        for quantity, digits in self.decimals.items():
            yield {"quantity": quantity, "implementation": DECIMALS, "searched": digits}

    @reported
    def lost(self) -> dict[str, float]:
        """By implementation, digits of inverse dynamics minus those of forward dynamics, at the worst states."""
        inverse, forward = (
            {count.implementation: count.searched for count in self._of(quantity) if count.samples > 1}
            for quantity in ("inverse_dynamics", "forward_dynamics")
        )
        return {
            name: inverse[name] - forward[name] for name in self.implementations if name in inverse.keys() & forward
        }

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities examined."""
        return tuple(dict.fromkeys(count.quantity for count in self.digits))

    @property
    def implementations(self) -> tuple[str, ...]:
        """Names of the implementations examined."""
        return tuple(dict.fromkeys(count.implementation for count in self.digits))

    @reported
    def sentence(self) -> str:
        """The digits of forward dynamics, or of the last quantity counted, in a sentence."""
        if not self.digits:
            return "no digits were counted"
        quantity = "forward_dynamics" if "forward_dynamics" in self.quantities else self.quantities[-1]
        parts = [
            f"{count.implementation} {count.searched:.1f} in {format_duration(count.time_s)}"
            for count in sorted(self._of(quantity), key=lambda count: count.time_s)
        ]
        return f"digits of {quantity} at the worst state found: {'; '.join(parts)}"

    def _of(self, quantity: str) -> Iterator[CountedDigits]:
        return (count for count in self.digits if count.quantity == quantity)

    def _digit_rows(self, has_state: bool) -> Iterator[tuple[str, ...]]:
        """Return a row for each implementation, and one for the decimals of the file, by quantity."""
        for quantity in self.quantities:
            for count in self._of(quantity):
                at_state = ["—" if count.at_state is None else f"{count.at_state:.1f}"] * has_state
                worst, time = (f"{count.random:.1f}", f"{count.searched:.1f}"), format_duration(count.time_s)
                yield (
                    quantity,
                    count.implementation,
                    *at_state,
                    f"{count.typical:.1f}",
                    str(count.samples),
                    *worst,
                    time,
                )
            yield quantity, DECIMALS, *[""] * (3 + has_state), f"{self.decimals[quantity]:.1f}", ""


def certify(
    robot: Robot,
    *,
    q: JointValues | None = None,
    v: JointValues | None = None,
    a: JointValues | None = None,
    tau: JointValues | None = None,
    samples: int = 10_000,
    seed: int = 0,
    repeats: int = 11,
    on_progress: Callable[[float, str], object] | None = None,
) -> Certificate:
    """Count the true digits of M, C, N, inverse and forward dynamics by each implementation, and time its queries.

    Implementations are Pinocchio, the Lagrangian in float32, float64 and longdouble, articulated bodies, machine code
    (judged by exact right angles) and balls. Random states are sampled as in `compare` and rounded to float32, so that
    no implementation rounds them. A search for larger errors begins at the worst of these states. Errors are computed
    against longdouble, and at the worst states against balls. Errors of longdouble are computed against balls, at
    1/250 of the states.

    Args:
        robot: The robot.
        q: Positions of an additional state, (n,), in [rad] or [m].
        v: Velocities at this state, (n,), in [rad/s] or [m/s]; 0 by default.
        a: Accelerations at this state, (n,), in [rad/s²] or [m/s²]; 0 by default.
        tau: Torques at this state, (n,), in [N m] or [N]; 0 by default.
        samples: Number of random states.
        seed: Seed of the random states.
        repeats: Number of timings of each query; queries take turns, and the shortest time counts.
        on_progress: Called with the completed fraction, from 0 to 1, and the name of the current task.

    Raises:
        QueryError: If an argument is invalid.
    """
    robot = warn_below(robot, None)
    samples = integer("samples", samples, least=_MIN_SAMPLES, most=_MAX_SAMPLES)
    seed, repeats = integer("seed", seed, most=2**128 - 1), integer("repeats", repeats, least=1, most=_MAX_REPEATS)
    report = function("on_progress", on_progress, "(fraction, task)") or (lambda fraction, task: None)
    state = _state(robot, q, v, a, tau)
    rng = np.random.default_rng(seed)
    states = random_states(robot, samples, rng)
    report(0.0, "machine code")
    options, left_out = implementations(robot)
    digit_count, counts = DigitCount(robot, states, state, rng), list[CountedDigits]()
    quantities = [quantity for quantity in QUANTITIES.values() if quantity in options[0].quantities]
    try:
        for k, quantity in enumerate(quantities):
            able = [option for option in options if quantity in option.quantities]

            def report_part(fraction: float, task: str, k: int = k) -> None:
                report((k + fraction) / len(quantities), task)

            counts += _count_and_time(digit_count, quantity, able, repeats, left_out, report_part)
    except KeyboardInterrupt:
        left_out.append(INTERRUPTED)
    return Certificate(
        robot=robot.name,
        joints=robot.joint_names,
        digits=tuple(counts),
        decimals=digit_count.decimals,
        right_angles=digit_count.right_angles,
        condition=_condition(robot, states, state, rng),
        bits=digit_count.bits,
        left_out=tuple(left_out),
        environment=processor_and_versions(),
        seed=seed,
    )


def _state(
    robot: Robot, q: JointValues | None, v: JointValues | None, a: JointValues | None, tau: JointValues | None
) -> dict[str, np.ndarray] | None:
    """Return the additional state of the user, or None."""
    others = {name: x for name, x in {"v": v, "a": a, "tau": tau}.items() if x is not None}
    if q is None:
        if others:
            name = next(iter(others))
            raise QueryError(f"{name} needs q; pass q too, or omit {name}")
        return None
    state = {name: np.zeros(robot.n) for name in ("v", "a", "tau")}
    for name, x in ({"q": q} | others).items():
        state[name] = np.array(joint_values(name, x, robot.joint_names))
        if state[name].ndim != 1:
            raise QueryError(f"{name} must have shape ({robot.n},), got {state[name].shape}")
    return state


def _count_and_time(
    digit_count: DigitCount,
    quantity: Quantity,
    options: list[Implementation],
    repeats: int,
    left_out: list[str],
    report: Callable[[float, str], object],
) -> list[CountedDigits]:
    """Return digits and times of one quantity by each implementation; append failures to `left_out`."""
    counts, calls, state = list[CountedDigits](), {}, digit_count.state or row(digit_count.states, 0)
    for k, implementation in enumerate(options):
        report(k / len(options), f"{quantity.name}: {implementation.name}")
        try:
            counts.append(digit_count.count(implementation, quantity))
            calls[implementation.name] = _call(implementation.engine, quantity, state)
        except QueryError as error:
            left_out.append(str(error))
    bits = digit_count.truth(digit_count.robot, quantity, state).bits
    name, most = f"balls, {bits} bits", float(MAX_DIGITS)
    calls[name] = _call(Lagrangian(digit_count.robot, Ball(bits)), quantity, state)
    at_state = None if digit_count.state is None else most
    at = {key: state[key].tolist() for key in quantity.arguments}
    counts.append(CountedDigits(quantity.name, name, at_state, most, most, most, 1, state=at))
    report(1.0, f"{quantity.name}: times")
    times = in_turns(calls, repeats, _MIN_LOOP_S)
    return [replace(count, times=tuple(times[count.implementation])) for count in counts]


def _call(engine: Engine, quantity: Quantity, state: dict[str, np.ndarray]) -> Callable[[], object]:
    """Return a query at one state as a function without arguments, to be timed."""
    return partial(getattr(engine, quantity.name), *(state[name] for name in quantity.arguments))


def _condition(robot: Robot, states: Batch, state: dict[str, np.ndarray] | None, rng: np.random.Generator) -> Condition:
    """Return κ of M at the states, and its largest value from a search."""

    def conditions(states: Batch) -> np.ndarray:
        return unit_diagonal_conditions(evaluate(robot, M, states))

    if robot.joint_without_inertia is not None:
        return Condition(None if state is None else inf, inf, inf, inf, ())
    sampled = conditions(states)
    worst, largest = worst_state(states, rng, conditions, sampled, ("q",))
    at_state = None if state is None else float(conditions({"q": state["q"][None]})[0])
    return Condition(at_state, float(np.median(sampled)), float(sampled.max()), largest, tuple(worst["q"][0].tolist()))
