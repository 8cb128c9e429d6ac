"""The motion of a theorem, M(q) a + C(q, v) v + N(q) = Σ τ_effect + u(t, q, v), with analytic terms only.

A part that switches has no Taylor series across the switch, and user-defined code cannot be inspected: both are
refused with their names. Coefficients and gains are the exact values of the stored floats, without float arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn import Robot, Setup
from robot_dyn.codegen.trace.base_parameters import regrouped
from robot_dyn.codegen.trace.origins import slid
from robot_dyn.control import PD, ComputedTorque, Controller, FeedForward, PDGravity, PiecewisePolynomial, polynomial
from robot_dyn.effects import CarriedPayload, Effect, RegularisedCoulombFriction, Spring, ViscousFriction
from robot_dyn.foundations import Array, ProofError, with_values
from robot_dyn.lagrange import Linkage, linkage_of, newton_euler, tree_of
from robot_dyn.tools.proof.term import Literals

_EFFECTS = (ViscousFriction, RegularisedCoulombFriction, Spring)
_CONTROLLERS = (PD, ComputedTorque, PDGravity, FeedForward)


@final
@dataclass(frozen=True)
class Motion:
    """A plant and its controller, all of whose parts are analytic.

    Attributes:
        robot: Robot with its permanent payloads.
        effects: Effects other than gravity and payloads.
        controller: A continuous controller, or None.
    """

    robot: Robot
    effects: tuple[Effect, ...]
    controller: Controller | None

    @property
    def knots(self) -> tuple[float, ...]:
        """Times in [s] at which a reference changes from one polynomial to the next."""
        return self.controller.knots if self.controller is not None else ()

    def torque(self, model: Bodies, t: Array, q: Array, v: Array, piece: float) -> Array:
        """Return Σ τ_effect + u in the arithmetic of a trace, (n,).

        Args:
            model: The bodies.
            t: Time, (1,).
            q: Position, (n,).
            v: Velocity, (n,).
            piece: A time in [s] within the piece of the reference to use.
        """
        total = model.arithmetic.array(np.zeros(len(q)))
        for effect in self.effects:
            total = total + effect.torque(model, t[0], q, v)  # pyright: ignore[reportAttributeAccessIssue]
        if self.controller is None:
            return total
        own: dict[str, Any] = {name: _Piece(x, piece) for name, x in self.controller.references.items()}
        own |= {name: Bodies(_robot(x, self.controller.name), model.arithmetic) for name, x in self._models}
        law: Any = with_values(self.controller, own)  # on numbers of the trace, which its types exclude
        return total + law.torque(t, q, v, total[:0])

    @property
    def _models(self) -> Iterable[tuple[str, object]]:
        return self.controller.models.items() if self.controller is not None else ()


@final
class Bodies:
    """Rigid bodies of a robot under gravity, evaluated recursively in the arithmetic of a trace.

    Args:
        robot: Robot whose file and edits are used.
        arithmetic: Arithmetic of the trace; methods must be called within its scope.
    """

    def __init__(self, robot: Robot, arithmetic: Literals) -> None:
        self.robot, self.arithmetic, self.n = robot, arithmetic, robot.n

    @cached_property
    def linkage(self) -> Linkage:
        """Equivalent linkage with other frames and fewer parameters, but the same M, C and N."""
        tree = tree_of(self.robot.description, self.robot.edits)
        return regrouped(slid(linkage_of(tree, self.robot.joint_names, self.arithmetic)))

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Return M a + C v + N, (n,)."""
        return newton_euler(self.linkage, q, v, a)

    def N(self, q: Array) -> Array:
        """Return ∂V/∂q, (n,)."""
        zero = self.arithmetic.array(np.zeros(self.n))
        return newton_euler(self.linkage, q, zero, zero)


@final
class _Piece:
    """One polynomial of a reference, with the stored floats as exact coefficients."""

    def __init__(self, reference: Any, t: float) -> None:
        breaks, table = reference.breaks, reference.coefficients
        k = int(np.searchsorted(breaks[1:-1], min(max(t, breaks[0]), breaks[-1]), side="right"))
        self._start, self._coefficients, self._rests = float(breaks[k]), table[k], None
        if not breaks[0] <= t <= breaks[-1]:
            self._rests = float(breaks[0] if t < breaks[0] else breaks[-1])

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration at t (1,); at rest outside the breaks."""
        if self._rests is None:
            return polynomial(self._coefficients, t - self._start)
        q, _, _ = polynomial(self._coefficients, 0 * t + self._rests - self._start)
        return q, 0 * q, 0 * q


def motion(setup: Setup, until_s: float) -> Motion:
    """Return the motion of a setup up to a time.

    Raises:
        ProofError: If a part is not analytic or user-defined; the message names the part.
    """
    plant, controller = setup.plant, setup.controller
    for effect in plant.effects:
        if isinstance(effect, CarriedPayload):
            if any(0 < t < until_s for t in effect.switches):
                raise ProofError(
                    f"{effect.name} is attached or dropped within {until_s:g} s; end the proof at that time"
                )
        elif type(effect) not in _EFFECTS:
            raise ProofError(
                f"effect {effect.name} switches or is user-defined: theorems support gravity, payloads, viscous"
                " friction, springs and tanh friction; remove it"
            )
    if controller is not None:
        _check(controller)
    whole = plant.at(0.0)
    robot = _robot(whole.dynamics, "plant")
    return Motion(robot, tuple(x for x in whole.effects if not isinstance(x, CarriedPayload)), controller)


def _check(controller: Controller) -> None:
    if type(controller) not in _CONTROLLERS:
        raise ProofError(
            f"controller {controller.name} switches, has states or is user-defined: theorems support PD, PDGravity,"
            " FeedForward and ComputedTorque; use one of them"
        )
    if controller.period_s > 0:
        raise ProofError(
            f"controller {controller.name} is sampled every {controller.period_s:g} s: theorems support continuous"
            " control; set period_s=0"
        )
    for name, reference in controller.references.items():
        if not isinstance(reference, PiecewisePolynomial):
            raise ProofError(
                f"{name} of {controller.name} is not a piecewise polynomial; use rd.control.PiecewisePolynomial"
            )


def _robot(dynamics: Any, part: str) -> Robot:
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(robot, Robot):
        raise ProofError(
            f"{part}: {type(dynamics).__name__} has no robot with a file, whose decimals a theorem needs; use a Robot"
        )
    return robot
