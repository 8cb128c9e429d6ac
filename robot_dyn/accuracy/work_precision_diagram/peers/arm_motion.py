"""The motion of an arm in the form given to other programs: gravity, and torques of the joints.

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

_SAME = 1e-9  # of the largest entry of M, N and τ: two programs with the same arm agree to rounding
_STATES = 3
# Of each joint alone: their torque takes as long from here as written by hand in NumPy.
_OF_A_JOINT = ViscousFriction, RegularisedCoulombFriction, JointStopSpring, JointStopDamper


class PeerError(Exception):
    """Internal: why a program cannot do a motion."""


@final
@dataclass(frozen=True, eq=False)
class ArmMotion:
    """A motion of an arm under gravity and effects that other programs know or can be given.

    Attributes:
        setup: The setup returned by `recorded`.

    Raises:
        PeerError: If anything else acts.
    """

    setup: Setup

    def __post_init__(self) -> None:
        if not isinstance(self.setup.plant.dynamics, Robot):
            raise PeerError("only robots with a file are the same there")
        for each in self.setup.plant.effects:
            if not isinstance(each, (*_OF_A_JOINT, LineSpring, LineDamper)):
                raise PeerError(f"{each.name} is not given to them")
        if (law := self.setup.controller) is not None and not (isinstance(law, PD) and law.period_s == 0):
            raise PeerError(f"the controller, {law.name}, is not given to them: a continuous PD is")

    @property
    def robot(self) -> Robot:
        """The robot that moves."""
        robot: Any = self.setup.plant.dynamics
        return robot

    @property
    def servo(self) -> PD | None:
        """The controller."""
        law: Any = self.setup.controller
        return law

    @property
    def free(self) -> bool:
        """Whether gravity alone acts."""
        return not self.setup.plant.effects and self.servo is None

    @property
    def events(self) -> bool:
        """Whether steps end wherever the torque has a kink: false where it has some, which other programs pass."""
        return not switches(self.setup)

    @cached_property
    def times(self) -> np.ndarray:
        """Times of the records, including the start, (k,), in [s]."""
        period, end = self.setup.record_every_s, self.setup.duration_s
        return np.append(period * np.arange(round(end / period)), end)

    @property
    def lines(self) -> tuple[LineSpring | LineDamper, ...]:
        """Springs and dampers between two points."""
        return tuple(each for each in self.setup.plant.effects if isinstance(each, LineSpring | LineDamper))

    @cached_property
    def torque(self) -> Callable[[float, np.ndarray, np.ndarray], np.ndarray]:
        """τ(t, q, v) without lines, (n,), in NumPy."""
        effects: Any = [each for each in self.setup.plant.effects if isinstance(each, _OF_A_JOINT)]
        servo, zero = self.servo, np.zeros(self.robot.n)
        desired = None if servo is None else desired_motion(servo.reference)

        def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            total = zero
            for each in effects:
                total = total + each.torque(None, t, q, v)
            if servo is not None and desired is not None:
                q_d, v_d = desired(t)
                total = total + servo.kp * (q_d - q) + servo.kd * (v_d - v)
            return total

        return torque

    def recorded(
        self, advance: Callable[[float], tuple[np.ndarray, np.ndarray]], limit: Limit
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return q and v at the records, (k, n) each, of a program that `advance` takes to a time, and its time."""
        q, v = (np.empty((len(self.times), self.robot.n)) for _ in range(2))
        q[0], v[0] = self.setup.q0, self.setup.v0
        limit(0.0)
        began = perf_counter()
        for k, t in enumerate(self.times[1:], start=1):
            q[k], v[k] = advance(t)
            limit(t)
        return q, v, perf_counter() - began

    def run(self, q: np.ndarray, v: np.ndarray, steps: int | None, evaluations: int | None, time_s: float) -> Run:
        """The result of a run of another program from its q and v, (k, n) each; its energy is known if it is free."""
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            return Run(self.times, None, np.nan, steps, evaluations, time_s)
        closure = np.nan
        if self.free:
            closure = Ledger(self.robot.kinetic_energy(q, v), self.robot.potential_energy(q), {}).closure
        return Run(self.times, q, closure, steps, evaluations, time_s)

    def check(self, mass_matrix: Any, bias: Any, torque: Any) -> None:
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
                "the torques of control and effects": (plant.torque(q, v, t=t) + control, torque(t, q, v)),
            }
            for what, (ours, theirs) in pairs.items():
                differ = float(np.abs(ours - theirs).max() / (np.abs(ours).max() or 1.0))
                if not differ <= _SAME:
                    raise PeerError(f"its own reading of the file gives another arm: {what} differ by {differ:.0e}")


def desired_motion(of: PiecewisePolynomial) -> Callable[[float], np.ndarray]:
    """q_d and v_d at a time, (2, n), by powers of s = t − tᵢ: in less than half the time of `of.at`, which checks t."""
    powers = np.arange(of.coefficients.shape[1])
    lower = np.maximum(powers - 1, 0)
    ends = of.breaks[1:-1]

    def at(t: float) -> np.ndarray:
        inside = min(max(t, of.start_s), of.end_s)
        piece = int(np.searchsorted(ends, inside, side="right")) if len(ends) else 0
        s = inside - of.breaks[piece]
        rate = powers * s**lower if of.start_s <= t <= of.end_s else 0.0 * powers
        return np.array([s**powers, rate]) @ of.coefficients[piece]

    return at


def bare_urdf(robot: Robot) -> Any:
    """The file of a robot with dynamics alone: no shapes, limits, friction; joints not in the robot are fixed."""
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
