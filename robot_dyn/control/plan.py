"""A planned motion for a controller, with the limits that it respects and findings about doubtful parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn.control.extremes import extreme_values
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.queries.units import of_joint, without_rounding

_ORDERS = {"velocity": 1, "acceleration": 2, "jerk": 3}
_PER = {"velocity": "[/s]", "acceleration": "[/s²]", "jerk": "[/s³]"}


@final
@dataclass(frozen=True, eq=False, repr=False)
class Plan(Answer, ReadOnly):
    """A motion of the joints of an arm; pass `plan.reference` to a controller.

    Attributes:
        arm: Name of the arm.
        joint_names: Names of the n joints, in the order of q.
        joint_types: Types of the joints, such as "revolute".
        reference: The motion q(t).
        method: Description of the method, in one line.
        limits: Limits that the motion was planned for or compared with, (n,), inf for none, by "velocity",
            "acceleration", "jerk" or "torque".
        findings: Doubtful parts of the motion, in words, with remedies.
    """

    arm: str
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    reference: PiecewisePolynomial
    method: str
    limits: Mapping[str, np.ndarray]
    findings: tuple[str, ...] = ()

    @reported
    def duration_s(self) -> float:
        """Time from the first to the last break, in [s]."""
        return self.reference.end_s - self.reference.start_s

    @cached_property
    def peaks(self) -> dict[str, np.ndarray]:
        """Largest absolute velocity, acceleration and jerk of each joint, all (n,), exact up to rounding."""
        return {name: extreme_values(self.reference, order).largest for name, order in _ORDERS.items()}

    def blocks(self) -> Iterator[Block]:
        yield f"{self.arm}: {self.method}"
        after = f" from {self.reference.start_s:g} s" if self.reference.start_s else ""
        yield f"{self.duration_s:.6g} s{after}, {len(self.reference.coefficients)} polynomials"
        start, end = without_rounding(self.reference.at(np.array([self.reference.start_s, self.reference.end_s]))[0])
        shown = [name for name in _ORDERS if name in self.limits or name != "jerk"]
        columns = [self._cells(name) for name in shown]
        units = [of_joint("rad", kind) for kind in self.joint_types]
        heading = "joint", "unit", "from", "to", *(f"{name} {_PER[name]}, of its limit" for name in shown)
        yield Table(heading, tuple(zip(self.joint_names, units, start, end, *columns, strict=True)), right=heading[4:])
        yield from (f"finding: {finding}" for finding in self.findings)

    def _cells(self, name: str) -> list[str]:
        """Return the largest value of each joint, with its limit if there is one."""
        limits = self.limits.get(name, np.full(len(self.joint_names), np.inf))
        pairs = zip(self.peaks[name], limits, strict=True)
        return [f"{x:.4g} of {limit:.4g}" if limit < np.inf else f"{x:.4g}" for x, limit in pairs]
