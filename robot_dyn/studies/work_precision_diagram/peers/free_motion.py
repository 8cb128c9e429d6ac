"""The free motion of an arm under gravity, in the form given to other programs."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.model.robot import Robot
from robot_dyn.simulation.results.ledger import Ledger
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.studies.work_precision_diagram.method_under_test import Run

_SAME = 1e-9  # of the largest entry of M and N: two programs with the same arm agree to rounding
_STATES = 3


class PeerError(Exception):
    """Internal: why a program cannot do a motion."""


@final
@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion without effects or control.

    Attributes:
        setup: The setup returned by `recorded`.
        robot: The robot that moves.
    """

    setup: Setup
    robot: Robot

    @cached_property
    def times(self) -> np.ndarray:
        """Times of the records, including the start, (k,), in [s]."""
        period, end = self.setup.record_period_s, self.setup.duration_s
        return np.append(period * np.arange(round(end / period)), end)

    def run(self, q: np.ndarray, v: np.ndarray, steps: int | None, evaluations: int | None, time_s: float) -> Run:
        """The result of a run of another program from its q and v, (k, n) each."""
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            return Run(self.times, None, np.nan, steps, evaluations, time_s)
        kinetic, potential = self.robot.kinetic_energy(q, v), self.robot.potential_energy(q)
        return Run(self.times, q, Ledger(kinetic, potential, {}).closure, steps, evaluations, time_s)

    def check(self, mass_matrix: Any, bias: Any) -> None:
        """Check that another program has the same M(q) and C v + N at random states.

        Raises:
            PeerError: If they differ.
        """
        rng = np.random.default_rng(3)
        for _ in range(_STATES):
            q, v = rng.normal(size=(2, self.robot.n))
            zero = np.zeros(self.robot.n)
            pairs = (self.robot.M(q), mass_matrix(q)), (self.robot.inverse_dynamics(q, v, zero), bias(q, v))
            for ours, theirs in pairs:
                differ = float(np.abs(ours - theirs).max() / np.abs(ours).max())
                if not differ <= _SAME:
                    raise PeerError(f"its own reading of the file gives another arm: M or N differ by {differ:.0e}")


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
