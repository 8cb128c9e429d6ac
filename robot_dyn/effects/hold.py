"""Joints held at rest by dry friction and rigid stops: the load on each, and the loads at which it breaks away.

    M a + C v + ∂V/∂q = τ + Σ τ_effect + λ,    load = −λ

λ solves one convex problem for all joints, so the load on each joint depends on the state of all joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.effects.equation_of_motion import EquationOfMotion
from robot_dyn.foundations.result import reported


@final
@dataclass(frozen=True)
class HeldJoint:
    """A joint held at rest.

    Attributes:
        joint: Name of the joint.
        by: Names of the effects that can hold the joint.
        load: Torque or force that these effects balance, in [N m] or [N].
        lower_breakaway, upper_breakaway: Loads below and above which the joint breaks away, in [N m] or [N]; −inf or
            inf towards a stop.
    """

    joint: str
    by: tuple[str, ...]
    load: float
    lower_breakaway: float
    upper_breakaway: float

    @reported
    def margin(self) -> float:
        """Smallest change of load, in either direction, at which the joint breaks away; at least 0."""
        return max(min(self.load - self.lower_breakaway, self.upper_breakaway - self.load), 0.0)


def held_joints(equation: EquationOfMotion, q: np.ndarray, v: np.ndarray, total: np.ndarray) -> tuple[HeldJoint, ...]:
    """Return the joints held at rest under a total torque; arguments are not checked.

    Args:
        equation: Equation of motion whose effects have no mode.
        q: Position, (n,).
        v: Velocity, (n,).
        total: τ + Σ τ_effect, (n,).
    """
    if not equation.set_valued:
        return ()
    a, reaction = equation.with_reaction(q, v, total)
    intervals = [(effect.name, effect.at_rest(q)) for effect in equation.set_valued]
    least, most = (sum(interval[k] for _, interval in intervals) for k in (0, 1))
    holds = []
    for i in np.flatnonzero((v == 0) & (a == 0) & (np.less(least, 0) | np.greater(most, 0))):
        by = tuple(name for name, interval in intervals if interval.least[i] < 0 or interval.most[i] > 0)
        ends = -float(most[i]), -float(least[i])  # pyright: ignore[reportIndexIssue]
        holds.append(
            HeldJoint(equation.dynamics.joint_names[i], by, -float(reaction[i]) + 0.0, *(x + 0.0 for x in ends))
        )
    return tuple(holds)
