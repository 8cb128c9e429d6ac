"""Agreement of two values of one quantity: their difference relative to its scale, at the worst entry and state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.lagrange.scale import floored, scaled
from robot_dyn.queries.units import numbers_row


@final
@dataclass(frozen=True)
class Agreement:
    """Agreement of Pinocchio and the library's Lagrangian on one quantity, at the worst of all states and entries.

    Attributes:
        quantity: Name of a query of `Dynamics`, or the identity that was checked.
        error: Difference relative to its scale.
        tolerance: Allowed error.
        entry: Joints or frame of the entry.
        pinocchio, own: The two values; for numbers of the file, the value both implementations use, and yourdfpy's.
        state: q, v, a, tau, by name; empty for numbers of the file.
    """

    quantity: str
    error: float
    tolerance: float
    entry: str
    pinocchio: float
    own: float
    state: dict[str, list[float]] = field(hash=False, repr=False)

    @reported
    def ok(self) -> bool:
        """True if the error is within the tolerance."""
        return bool(self.error <= self.tolerance)

    @property
    def tolerance_fraction(self) -> float:
        """Error as a fraction of the tolerance."""
        return self.error / self.tolerance


@final
@dataclass(frozen=True, repr=False)
class Comparison(Answer):
    """Result of `compare`.

    Attributes:
        robot: Name of the robot.
        n: Number of its degrees of freedom.
        samples: Number of random states.
        agreements: Agreements, one for each quantity.
        notes: Quantities that could not be compared, with reasons, and findings on the robot.
    """

    robot: str
    n: int
    samples: int
    agreements: tuple[Agreement, ...] = field(metadata=UNREPORTED)
    notes: tuple[str, ...]

    @reported
    def ok(self) -> bool:
        """True if both agree on every quantity."""
        return all(agreement.ok for agreement in self.agreements)

    @reported
    def quantities(self) -> dict[str, Agreement]:
        """Agreements by the names of their quantities."""
        return {agreement.quantity: agreement for agreement in self.agreements}

    @property
    def worst(self) -> Agreement:
        """Agreement with the largest error as a fraction of its tolerance."""
        return max(self.agreements, key=lambda agreement: agreement.tolerance_fraction)

    def blocks(self) -> Iterator[Block]:
        agreed = f"{sum(x.ok for x in self.agreements)} of {len(self.agreements)} quantities agree"
        yield f"{self.robot}: Pinocchio and the independent Lagrangian at {self.samples} random states: {agreed}"
        headings = ("quantity", "worst error", "allowed", "where", "Pinocchio", "Lagrangian")
        yield Table(headings, tuple(map(_row, self.agreements)), right=(*headings[1:3], *headings[4:]))
        yield from self.notes
        worst = self.worst
        yield f"worst: {worst.quantity}, {worst.error:.2e} of {worst.tolerance:.1e} allowed, at {worst.entry}"
        if not self.ok:
            yield from (f"  {name} = {numbers_row(values)}" for name, values in worst.state.items())

    @property
    def drawing(self) -> str:
        from robot_dyn.foundations.display import levels

        shares = {agreement.quantity: agreement.tolerance_fraction for agreement in self.agreements}
        return levels("worst error / allowed; exact agreement is omitted", shares, 1.0)


def _row(x: Agreement) -> tuple[str, ...]:
    numbers = (f"{value:.16g}" if abs(value) < float(UNBOUNDED) else "none" for value in (x.pinocchio, x.own))
    return x.quantity, marked(x.ok, x.error), f"{x.tolerance:.1e}", x.entry, *numbers


def marked(ok: bool, error: float) -> str:
    """Format an error, marked if it is too large."""
    return f"{error:.1e}" if ok else f"{error:.1e}  DISAGREE"


@final
@dataclass(frozen=True)
class Pair:
    """Two values of one quantity at one state; `scale` has the shape of the values."""

    quantity: str
    pinocchio: Any
    own: Any
    scale: Any
    tolerance: float
    axes: tuple[tuple[str, ...], ...] = ()
    frame: str = ""

    def worst(self, state: dict[str, np.ndarray]) -> Agreement:
        """Return the agreement at the entry with the largest difference relative to its scale."""
        errors = scaled(np.asarray(self.pinocchio) - self.own, floored(np.asarray(self.scale)))
        errors = np.where(np.isnan(errors), np.inf, errors)
        index = np.unravel_index(np.argmax(errors), errors.shape)
        names = [axis[i] for axis, i in zip(self.axes, index, strict=False)]
        return Agreement(
            self.quantity,
            float(errors[index]),
            self.tolerance,
            ", ".join([self.frame] * bool(self.frame) + names),
            float(np.broadcast_to(self.pinocchio, errors.shape)[index]),
            float(np.broadcast_to(self.own, errors.shape)[index]),
            {name: x.tolist() for name, x in state.items()},
        )


def worst_by_quantity(agreements: Iterable[Agreement]) -> tuple[Agreement, ...]:
    """Return for each quantity the agreement with the largest error relative to its tolerance."""
    worst: dict[str, Agreement] = {}
    for agreement in agreements:
        current = worst.get(agreement.quantity)
        if current is None or agreement.tolerance_fraction > current.tolerance_fraction:
            worst[agreement.quantity] = agreement
    return tuple(worst.values())
