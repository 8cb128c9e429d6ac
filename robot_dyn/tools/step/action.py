"""The action of a stepper: a torque that each lane holds for a period, or the set-point of a controller.

Both are one coefficient of the controller of a setup, which is an input of its machine code. At a set-point, the
desired velocity and acceleration are 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, final

import numpy as np

from robot_dyn.control import CartesianReference, Controller, PiecewisePolynomial, Reference, Stateless
from robot_dyn.foundations import Array, QueryError, coefficient, shown, with_values

REMEDY = "give a controller with one reference, such as rd.control.PD(rd.control.hold(q), kp=…, kd=…, period_s=…)"


class Action(NamedTuple):
    """An action of k numbers.

    Attributes:
        controller: Controller that applies it.
        parameter: Name of the parameter of the controller that it sets.
        labels: Names of its entries, (k,): joints, or coordinates of a frame.
    """

    controller: Controller
    parameter: str
    labels: tuple[str, ...]


@final
@dataclass(frozen=True, eq=False)
class HeldTorque(Stateless):
    """A torque τ_a in zero-order hold.

    Attributes:
        torque_of_lane: τ_a, (n,), in [N m] or [N].
        period_s: Time for which it is held, in [s].
    """

    torque_of_lane: np.ndarray = field(metadata=coefficient("N m", symbol="τ_a"))
    period_s: float

    term = "τ_a"

    @property
    def n(self) -> int:
        return len(self.torque_of_lane)

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return self.torque_of_lane + 0 * q

    def thresholds(self) -> tuple[()]:
        return ()


@final
@dataclass(frozen=True, eq=False)
class SetPoint(PiecewisePolynomial):
    """Joints at rest at a commanded position; machine code has no polynomial of it.

    Attributes:
        set_point: q_d, (n,), in [rad] or [m].
    """

    set_point: np.ndarray = field(metadata=coefficient("rad", symbol="q_d"))

    @property
    def polynomials(self) -> dict[str, PiecewisePolynomial]:
        return {}

    def at(self, t: object) -> tuple[Array, Array, Array]:
        still = 0 * self.set_point
        return self.set_point, still, still


@final
@dataclass(frozen=True, eq=False)
class FrameSetPoint(Reference):
    """A frame at rest at a commanded position.

    Attributes:
        set_point: p_d of the frame's origin in the base, (3,), in [m].
        rotation: Orientation, (3, 3); None leaves it free.
    """

    set_point: np.ndarray = field(metadata=coefficient("m", symbol="p_d", shapes=((3,),)))
    rotation: np.ndarray | None = None

    knots = np.zeros(0)  # pyright: ignore[reportAssignmentType, reportIncompatibleMethodOverride]

    def at(self, t: float) -> tuple[Array, np.ndarray | None, Array, Array]:
        """Return position, orientation, twist and rate of the twist; see `CartesianReference.at`."""
        still = 0 * np.concatenate([self.set_point, self.set_point])
        return self.set_point, self.rotation, still, still


def action_of(controller: Controller | None, joints: tuple[str, ...], period_s: float) -> Action:
    """Return the action of lanes with a controller: its set-point, or a torque without one.

    Args:
        controller: A controller with one reference; or None.
        joints: Names of the joints.
        period_s: Time between actions, in [s].

    Raises:
        QueryError: If the controller has no set-point, or its period does not divide the period of the actions.
    """
    if controller is None:
        return Action(HeldTorque(np.zeros(len(joints)), period_s), "torque_of_lane", joints)
    if not isinstance(controller, Controller):
        raise QueryError(f"controller: {REMEDY}, got {shown(controller)}")
    references: Mapping[str, Reference] = controller.references
    path, reference = next(iter(references.items()), ("", None))
    if isinstance(reference, PiecewisePolynomial):
        still = np.zeros(reference.n)
        point, labels = SetPoint([0.0, 1.0], still[None, None], still), joints
    elif isinstance(reference, CartesianReference):
        point, labels = FrameSetPoint(np.zeros(3), reference.at(0.0)[1]), ("x", "y", "z")
    else:
        point, labels = None, ()
    if point is None or len(references) > 1:
        kinds = ", ".join(type(x).__name__ for x in references.values()) or "no reference"
        raise QueryError(f"controller: {controller.name} has {kinds}, so that no set-point can be the action; {REMEDY}")
    cycle_s = controller.period_s * controller.cycle
    cycles = max(1, round(min(period_s / cycle_s, 1e9))) if cycle_s else 0
    if cycle_s and abs(period_s / cycle_s - cycles) > 1e-9 * cycles:
        raise QueryError(
            f"controller: its period of {cycle_s:g} s does not divide the {period_s:g} s between actions; give"
            f" period_s={cycles * cycle_s:g}"
        )
    commanded = with_values(controller, {path: point})
    return Action(commanded, f"{path.removeprefix('controller.')}.set_point", labels)
