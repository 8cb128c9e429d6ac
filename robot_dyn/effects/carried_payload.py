"""A payload that the arm picks up and drops: M, C and N include its body for start_s ≤ t < end_s.

    picked up at rest            (M + ΔM) v⁺ = M v⁻
    picked up at the hand's speed, or dropped     v⁺ = v⁻

Grasping a body at rest is an inelastic impact: it conserves the momentum of each joint and loses kinetic energy.
[Moreau 1988; Featherstone, Rigid Body Dynamics Algorithms, 2008, §11.7]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, final

from robot_dyn.description.edits import Payload
from robot_dyn.effects.effect import Timed
from robot_dyn.foundations.coefficients import coefficient
from robot_dyn.foundations.errors import EditError, EffectError
from robot_dyn.foundations.validate import instance, truth
from robot_dyn.queries.dynamics import Dynamics

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot


_START = coefficient("s", shapes=((),), can_vary=False)
_END = coefficient("s", shapes=((),), infinite=True, can_vary=False)


@final
@dataclass(frozen=True, eq=False)
class CarriedPayload(Timed):
    """A payload carried for start_s ≤ t < end_s; from the start of a run if start_s ≤ 0.

    In the energy ledger its work is the energy that the body brings minus the energy it takes away. The kinetic energy
    lost when a body at rest is picked up is the work of `pick_up`.

    Attributes:
        payload: The body and its link.
        start_s: Time at which it is picked up, in [s].
        end_s: Time at which it is dropped, in [s].
        at_rest: True if the body is at rest before it is picked up; False if it moves with the link.

    Example:
        >>> rd.effects.CarriedPayload(payload=rd.Payload("tip", 0.5), start_s=0.004, end_s=0.5, at_rest=True)
    """

    payload: Payload
    start_s: float = field(default=0.0, metadata=_START)
    end_s: float = field(default=inf, metadata=_END)
    at_rest: bool = True

    carried: bool | None = field(default=None, init=False, repr=False)

    term = "a rigid body on a link, in M, C and N while it is carried"

    def __post_init__(self) -> None:
        remedy = "give a payload, for example rd.Payload('tool0', 1.5)"
        instance("payload", self.payload, Payload, remedy, error=EffectError)
        truth("at_rest", self.at_rest, error=EffectError)
        super().__post_init__()

    def on(self, dynamics: Dynamics) -> CarriedPayload:
        if self.carried is None:
            robot_with(dynamics, [self], [True])  # reports an unknown link now, not during a run
        return self


def robot_with(dynamics: Dynamics, effects: Sequence[CarriedPayload], carried: Sequence[bool]) -> Robot:
    """Return the robot with all these payloads; those that are not carried have no mass.

    Raises:
        EffectError: If the dynamics are not a robot, or the link is unknown.
    """
    with_ = getattr(dynamics, "with_", None)
    if with_ is None:
        raise EffectError(f"carried_payload needs a Robot, got {type(dynamics).__name__}; use rd.Plant(robot, …)")
    massless = ((0.0, 0.0, 0.0),) * 3
    bodies = [
        effect.payload if is_carried else replace(effect.payload, mass=0.0, inertia=massless)
        for effect, is_carried in zip(effects, carried, strict=True)
    ]
    try:
        return with_(payload=bodies)
    except EditError as error:
        raise EffectError(f"carried_payload: {error}") from None
