"""External wrench on a link, constant or during an interval of time: τ = J(q)ᵀ F."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import final

import numpy as np

from robot_dyn.effects.effect import Active, Timed, check_frame
from robot_dyn.foundations.arithmetic import Array, transpose
from robot_dyn.foundations.arithmetic import apply as times
from robot_dyn.foundations.coefficients import CoefficientField, coefficient
from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.validate import instance, rows
from robot_dyn.queries.dynamics import Axes, Dynamics

_TIME = coefficient("s", shapes=((),), infinite=True, can_vary=False)


@final
@dataclass(frozen=True, eq=False)
class ExternalWrench(Timed, Active):
    """A force and a torque on a link: τ = Jᵀ F, with F and J in the same axes.

    Attributes:
        frame: The link.
        wrench: F = (force, torque), (6,), in [N] and [N m].
        expressed_in: "world_aligned": at the frame's origin, in base axes; "body": at the frame's origin, in frame
            axes; "world": at the origin of the base, in base axes.
        start_s: Time at which it starts, in [s].
        end_s: Time at which it ends, in [s]; it acts for start_s ≤ t < end_s.

    Example:
        >>> rd.effects.ExternalWrench(frame="tip", wrench=[1.0, 0.0, 2.0, 0.0, 0.5, 0.0], expressed_in="body",
        ...     start_s=0.0, end_s=0.2)
    """

    frame: str
    wrench: CoefficientField = field(metadata=coefficient("N", symbol="F", shapes=((6,),)))
    expressed_in: str = Axes.WORLD_ALIGNED
    start_s: float = field(default=0.0, metadata=_TIME)
    end_s: float = field(default=inf, metadata=_TIME)

    term = "Jᵀ F"

    def __post_init__(self) -> None:
        instance("frame", self.frame, str, "give the name of a link", error=EffectError)
        super().__post_init__()
        object.__setattr__(self, "expressed_in", Axes.from_name(self.expressed_in))

    def on(self, dynamics: Dynamics) -> ExternalWrench:
        check_frame(self, dynamics, self.frame)
        return self

    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        if not self.start_s <= t < self.end_s:
            return 0 * v
        J = dynamics.jacobian(q, self.frame, expressed_in=self.expressed_in)
        return times(transpose(J), self.wrench)

    def at(self, placement: Array) -> Array:
        """Return the wrench in base axes at the frame's origin, (..., 6), for placements of the frame, (..., 4, 4)."""
        placement = rows("placement", placement, 4, 4)
        R, p = placement[..., :3, :3], placement[..., :3, 3]
        force, torque = self.wrench[:3], self.wrench[3:]
        if self.expressed_in is Axes.BODY:
            force, torque = R @ force, R @ torque
        elif self.expressed_in is Axes.WORLD:  # moved from the base to the frame
            torque = torque - np.cross(p, force)
        return np.concatenate(np.broadcast_arrays(force + 0 * p, torque + 0 * p), axis=-1)
