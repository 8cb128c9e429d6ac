"""A certificate: correct digits of each quantity in each implementation, and their computing time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite, log10
from typing import Any, ClassVar, final

from robot_dyn.foundations.answer import Block, Table
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.validate import choice
from robot_dyn.queries.units import format_duration
from robot_dyn.report.result import Result
from robot_dyn.report.timing import Repeated

DECIMALS = "decimals of the file as float64"  # name of the implementation that computes exactly with these decimals


@final
@dataclass(frozen=True)
class Held(Repeated):
    """The digits of one quantity by one implementation, from 0 to 20, and times of one query from Python.

    Attributes:
        quantity: Its name.
        implementation: Program or formulation, and numbers.
        given: Digits at the given state; None if none was given.
        typical: Median over the random states.
        random: Digits at the worst random state.
        searched: Digits at the worst state found.
        samples: Number of random states; 1 for balls, whose digits are proven.
        state: The worst state, q, v, a, tau by name.
    """

    quantity: str
    implementation: str
    given: float | None
    typical: float
    random: float
    searched: float
    samples: int
    state: dict[str, list[float]] = field(default_factory=dict, hash=False, repr=False)


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
