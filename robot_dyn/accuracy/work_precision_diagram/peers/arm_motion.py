"""The motion of an arm in the form passed to other programs: gravity, and torques of the joints.

M(q) a + C(q, v) v + N(q) = τ(t, q, v),   τ = PD control + friction + soft stops + springs and dampers of lines
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any, final

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.accuracy.work_precision_diagram.method_under_test import Limit, Run, switches
from robot_dyn.control.independent_joint import PD
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.effects.joint_limit import JointStopDamper, JointStopSpring
from robot_dyn.effects.line_spring_damper import LineDamper, LineSpring
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.results.ledger import Ledger
from robot_dyn.simulation.setup.setup import Setup

_SAME = 1e-9  # fraction of the largest entry of M, N and τ: two programs with the same arm agree to rounding
_STATES = 3  # number of states at which two programs are compared
# Effects on single joints; their `torque` takes as long as code written by hand in NumPy.
_JOINT_EFFECTS = ViscousFriction, RegularisedCoulombFriction, JointStopSpring, JointStopDamper


class PeerError(Exception):
    """Internal: a program cannot simulate a motion, with the reason."""


@final
@dataclass(frozen=True, eq=False)
class ArmMotion:
    """A motion of an arm under gravity and effects that other programs support or accept as torques.

    Attributes:
        setup: The setup returned by `recorded`.

    Raises:
        PeerError: If the setup has other effects or control.
    """

    setup: Setup

    def __post_init__(self) -> None:
        if not isinstance(self.setup.plant.dynamics, Robot):
            raise PeerError("the dynamics are not those of a robot file")
        for effect in self.setup.plant.effects:
            if not isinstance(effect, (*_JOINT_EFFECTS, LineSpring, LineDamper)):
                raise PeerError(f"the effect {effect.name} is not supported")
        if (law := self.setup.controller) is not None and not (isinstance(law, PD) and law.period_s == 0):
            raise PeerError(f"the controller {law.name} is not supported, only a continuous PD")

    @property
    def robot(self) -> Robot:
        """The robot of the setup."""
        robot: Any = self.setup.plant.dynamics
        return robot

    @property
    def servo(self) -> PD | None:
        """The controller; None without one."""
        law: Any = self.setup.controller
        return law

    @property
    def free(self) -> bool:
        """True if only gravity acts."""
        return not self.setup.plant.effects and self.servo is None

    @property
    def events(self) -> bool:
        """True if the torque has no kinks, at which other programs would not end their steps."""
        return not switches(self.setup)

    @cached_property
    def times(self) -> np.ndarray:
        """Times of the records, including the start, (k,), in [s]."""
        period, end = self.setup.record_every_s, self.setup.duration_s
        return np.append(period * np.arange(round(end / period)), end)

    @property
    def lines(self) -> tuple[LineSpring | LineDamper, ...]:
        """Springs and dampers between two points."""
        return tuple(effect for effect in self.setup.plant.effects if isinstance(effect, LineSpring | LineDamper))

    @cached_property
    def torque(self) -> Callable[[float, np.ndarray, np.ndarray], np.ndarray]:
        """τ(t, q, v) without lines, (n,), in NumPy."""
        effects: Any = [effect for effect in self.setup.plant.effects if isinstance(effect, _JOINT_EFFECTS)]
        servo, zero = self.servo, np.zeros(self.robot.n)
        desired = None if servo is None else desired_motion(servo.reference)

        def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            total = zero
            for effect in effects:
                total = total + effect.torque(None, t, q, v)
            if servo is not None and desired is not None:
                q_d, v_d = desired(t)
                total = total + servo.kp * (q_d - q) + servo.kd * (v_d - v)
            return total

        return torque

    def recorded(
        self, advance: Callable[[float], tuple[np.ndarray, np.ndarray]], limit: Limit
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Run another program: return q and v at the records, (k, n) each, and the time of the run, in [s].

        Args:
            advance: Function that advances the program to a time, and returns q and v.
            limit: Limit of the run.
        """
        q, v = (np.empty((len(self.times), self.robot.n)) for _ in range(2))
        q[0], v[0] = self.setup.q0, self.setup.v0
        limit(0.0)
        began = perf_counter()
        for k, t in enumerate(self.times[1:], start=1):
            q[k], v[k] = advance(t)
            limit(t)
        return q, v, perf_counter() - began

    def run(self, q: np.ndarray, v: np.ndarray, steps: int | None, evaluations: int | None, time_s: float) -> Run:
        """Return the result of a run of another program from q and v, (k, n) each; energy is nan unless it is free."""
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            return Run(self.times, None, np.nan, steps, evaluations, time_s)
        closure = np.nan
        if self.free:
            closure = Ledger(self.robot.kinetic_energy(q, v), self.robot.potential_energy(q), {}).closure
        return Run(self.times, q, closure, steps, evaluations, time_s)

    def check(
        self,
        mass_matrix: Callable[[np.ndarray], np.ndarray],
        bias: Callable[[np.ndarray, np.ndarray], np.ndarray],
        torque: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
    ) -> None:
        """Check that another program has the same M(q), C v + N and τ at random states.

        Raises:
            PeerError: If they differ.
        """
        rng, plant, zero = np.random.default_rng(3), self.setup.plant, np.zeros(self.robot.n)
        for _ in range(_STATES):
            t, (q, v) = rng.uniform(0, self.setup.duration_s), rng.normal(size=(2, self.robot.n))
            control = zero if self.servo is None else self.servo.torque(t, q, v, zero[:0])
            pairs = {
                "M": (self.robot.M(q), mass_matrix(q)),
                "N": (self.robot.inverse_dynamics(q, v, zero), bias(q, v)),
                "the torque of control and effects": (plant.torque(q, v, t=t) + control, torque(t, q, v)),
            }
            for quantity, (ours, theirs) in pairs.items():
                difference = float(np.abs(ours - theirs).max() / (np.abs(ours).max() or 1.0))
                if not difference <= _SAME:
                    raise PeerError(f"its parser reads a different arm: {quantity} differs by {difference:.0e}")


def desired_motion(reference: PiecewisePolynomial) -> Callable[[float], np.ndarray]:
    """Return a function of time that returns q_d and v_d, (2, n), from powers of s = t − tᵢ.

    It takes less than half the time of `reference.at`, which checks t.
    """
    powers = np.arange(reference.coefficients.shape[1])
    lower = np.maximum(powers - 1, 0)
    ends = reference.breaks[1:-1]

    def at(t: float) -> np.ndarray:
        inside = min(max(t, reference.start_s), reference.end_s)
        piece = int(np.searchsorted(ends, inside, side="right")) if len(ends) else 0
        s = inside - reference.breaks[piece]
        rate = powers * s**lower if reference.start_s <= t <= reference.end_s else 0.0 * powers
        return np.array([s**powers, rate]) @ reference.coefficients[piece]

    return at


def bare_urdf(robot: Robot) -> etree._Element:
    """Return the URDF of a robot without shapes, limits and friction; joints that are not in the robot are fixed."""
    urdf = deepcopy(robot.description.element)
    etree.strip_elements(urdf, "visual", "collision", "limit", "dynamics", "mimic", "safety_controller")
    for joint in urdf.iter("joint"):
        if joint.get("type") == "fixed":
            continue
        if joint.get("name") not in robot.joint_names:
            joint.set("type", "fixed")
        elif joint.get("type") == "revolute":
            joint.set("type", "continuous")
    return urdf
