"""Random scenes whose steps or control periods have a limit of stability, and where runs of them blow up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import robot_dyn as rd
from robot_dyn.foundations import with_values
from tests.campaigns.estimates.scenes import arms

METHODS = ("Euler", "SemiImplicitEuler", "Midpoint", "RK4", "DP8")
_FAR, _LEAST = 30.0, 1e-4  # times as far from the motion as with half the length, and [rad] or [m] more: blown up
_NEAR = 1.02  # of a limit that is bisected


@dataclass(frozen=True)
class Limited:
    """A setup, and a run of it with a step, or a period, of another length."""

    setup: rd.Setup
    sampled: bool
    label: str

    def of(self, length: float) -> rd.Setup:
        """The setup with that step, or that period and ten steps in each."""
        if self.sampled:
            controller = with_values(self.setup.controller, {"period_s": length})
            return replace(self.setup, controller=controller, step_s=length / 10)
        return replace(self.setup, step_s=length)


def limited(seed: int, index: int) -> Limited:
    """Scene number `index` of a seed: every third one is a sampled loop."""
    rng = np.random.default_rng([seed, index, 9])
    name = str(rng.choice(["pendulum", "planar_2r", "cart_pole", "ur5"]))
    arm, sampled = arms()[name], index % 3 == 0
    n, scale = arm.n, np.diag(arm.M(np.full(arm.n, 0.4)))
    q, fast = rng.uniform(-0.5, 0.5, n), 10 ** rng.uniform(2.0, 3.0)
    method = str(rng.choice(METHODS))
    effects: list[rd.Effect] = [] if sampled else [rd.effects.ViscousFriction(scale * fast * rng.uniform(0.3, 1.0, n))]
    controller = None
    if sampled or rng.random() < 0.5:
        gains = rd.control.gains_from(scale, fast * rng.uniform(0.1, 0.5), rng.uniform(0.7, 1.5))
        controller = rd.control.PD(
            rd.control.hold(q + rng.uniform(-0.05, 0.05, n)),
            kp=gains[0],
            kd=gains[1],
            period_s=1e-4 if sampled else 0.0,
        )
    setup = rd.Setup(
        rd.Plant(arm, effects), q, np.zeros(n), 0.5, controller, method, 1e-4, estimate_error=False
    )  # fmt: skip
    return Limited(setup, sampled, f"{seed}/{index} {name} {method} {'sampled' if sampled else 'continuous'}")


def blow_up(scene: Limited, near: float) -> float:
    """The length at which runs begin to blow up, bisected between a third and three times a length."""
    exact = rd.simulate(scene.of(near / 20), method="RK4" if scene.sampled else "Rodas5PFixed")
    usual = _off(rd.simulate(scene.of(near / 2)), exact)
    return _bisected(
        lambda length: _off(rd.simulate(scene.of(length)), exact) > _FAR * usual + _LEAST, near / 3, near * 3
    )


def _off(run: rd.Trajectory, exact: rd.Trajectory) -> float:
    """How far a run is from the motion in its second half; inf if it ended before its time."""
    if run.outcome.ending != "finished":
        return np.inf
    late = run.t > run.t[-1] / 2
    motion = [np.interp(run.t[late], exact.t, q) for q in exact.q.T]
    return float(np.abs(run.q[late].T - motion).max())


def _bisected(blows: Callable[[float], bool], low: float, high: float) -> float:
    if blows(low):
        return low
    if not blows(high):
        return high
    while high / low > _NEAR:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if blows(middle) else (middle, high)
    return high
