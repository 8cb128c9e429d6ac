"""The largest point mass with which motors suffice: torque is affine in it, so the masses that fit are an interval.

    τ(t, m) = τ₀(t) + m τ₁(t)

    |τ₀ + m τ₁| ≤ τ_max at each time,     ⟨τ₀²⟩ + 2 m ⟨τ₀ τ₁⟩ + m² ⟨τ₁²⟩ ≤ τ_continuous²

Each of these leaves an interval of m, and so do all of them: no mass between two that fit is missed. Speed does not
depend on it. Peaks between the times are found with the mass at hand, and added, until no limit is passed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, nan
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn import Payload, Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.description import LARGEST
from robot_dyn.foundations import Answer, Block, QueryError
from robot_dyn.tools.motors.limits import Limits
from robot_dyn.tools.motors.motor_budget.breakaway import breakaway
from robot_dyn.tools.motors.motor_budget.demand import Demand, of_motion, torques
from robot_dyn.tools.motors.motor_budget.joint_budget import TOLERANCE

_ROUNDS = 12
_CLOSE = 1e-9  # of a limit, by which a peak between the times may pass it
_AFFINE = 1e-9  # of the torque, by which effects may depart from it
_NONE = 1e-12  # of the largest torque of a unit mass: rounding of none


@final
@dataclass(frozen=True, repr=False)
class LargestPayload(Answer):
    """The largest point mass on a link with which the motors suffice, and what says no to more.

    Attributes:
        link: The link.
        com: Where on it, in its axes, in [m].
        mass: In [kg], beside what the arm carries; None if no mass fits, inf if no limit that is known holds it back.
        least: The smallest mass that fits, in [kg]: 0, unless the arm is too heavy without a counterweight.
        joint: The joint that says no to more.
        limit: Which limit of it: "peak torque", "continuous torque", "break-away torque" or "speed".
        at: When, in [s]; nan of continuous torque, which is of the whole motion.
        largest_share: Largest share of a limit of torque with that mass, by the inverse dynamics.
        resolution: At which times it was looked at with that mass, in words.
        carried: What the arm carries already, in [kg].
    """

    link: str
    com: tuple[float, float, float]
    mass: float | None
    least: float
    joint: str
    limit: str
    at: float
    largest_share: float
    resolution: str
    carried: float

    def blocks(self) -> Iterator[Block]:
        x, y, z = self.com
        where = f"on {self.link} at ({x:g}, {y:g}, {z:g}) m"
        at = "" if np.isnan(self.at) else f" at {round(self.at, 9):.4g} s"
        if self.mass is None:
            yield f"no payload {where} fits: the {self.limit} of {self.joint} is passed{at}"
        elif self.mass == inf:
            yield f"payload {where}: no limit that is known holds it back"
        else:
            says_no = f"the {self.limit} of {self.joint}"
            more = f" more, {self.carried + self.mass:.5g} kg in all" if self.carried else ""
            yield f"largest payload {where}: {self.mass:.5g} kg{more}; {says_no}{at} says no to more"
            least = "every mass up to it fits" if not self.least else f"at least {self.least:.5g} kg are needed"
            yield f"{least}: torque is affine in a point mass, so each time bounds it in closed form"
            yield (f"with it the largest share of a limit is {self.largest_share:.6f}; {self.resolution}")


class _Bound(NamedTuple):
    """Masses that a limit allows, from `least` to `most`, and whose limit it is."""

    least: float
    most: float
    joint: int
    limit: str
    at: float


def largest_payload(
    plant: Plant, motion: PiecewisePolynomial, limits: Limits, continuous: np.ndarray, *, link: Any, com: Any
) -> LargestPayload:
    """As of `MotorBudget.max_payload`."""
    robot: Any = plant.dynamics
    carried = float(sum(each.mass for each in robot.edits.payloads))
    unit, bare = Payload(link, 1.0, com), of_motion(motion, plant)
    names, loaded, where = plant.dynamics.joint_names, _carrying(plant, unit), (unit.frame, unit.com)
    if (fast := bare.speed[0] > limits.velocity * (1 + TOLERANCE)).any():
        i = int(np.argmax(fast))
        return LargestPayload(
            *where, None, 0.0, names[i], "speed", float(bare.speed[1][i]), inf, bare.resolution, carried
        )
    bounds = [_Bound(-inf, inf, 0, "", nan), *_of_means(bare, loaded, continuous)]
    bounds += [*_of_starts(bare, plant, loaded, limits), *_of_times(bare, plant, loaded, limits, 0.0)]
    turn = 0
    while True:
        turn += 1
        low, high = max(bounds, key=lambda x: x.least), min(bounds, key=lambda x: x.most)
        least, most = max(0.0, low.least), high.most
        if most > LARGEST:
            return LargestPayload(*where, inf, least, "", "", nan, 0.0, bare.resolution, carried)
        if most < least:
            holds = high if most < 0 else low
            held = names[holds.joint], holds.limit, holds.at
            return LargestPayload(*where, None, 0.0, *held, inf, bare.resolution, carried)
        heavy = _carrying(plant, replace(unit, mass=most))
        there = of_motion(motion, heavy)
        share = _share(there, heavy, limits, continuous)
        if share <= 1 + _CLOSE or turn == _ROUNDS:
            held = names[high.joint], high.limit, high.at
            return LargestPayload(*where, most, least, *held, share, there.resolution, carried)
        bounds += _of_times(there, plant, loaded, limits, most)


def _carrying(plant: Plant, payload: Payload) -> Plant:
    robot: Any = plant.dynamics
    return replace(plant, dynamics=robot.with_(payload=payload))


def _of_times(there: Demand, plant: Plant, loaded: Plant, limits: Limits, mass: float) -> Iterator[_Bound]:
    """Of peak torque at the times that were looked at with a mass: for each joint the narrowest ones.

    Raises:
        QueryError: If the torque at that mass is not the affine one.
    """
    assert there.cells is not None
    bare, one = (torques(there.cells, each, there.cell, there.x)[0] for each in (plant, loaded))
    per_mass = one - bare
    size = np.abs(bare).max() + mass * np.abs(per_mass).max()
    if np.abs(bare + mass * per_mass - there.split.tau).max() > _AFFINE * size:
        raise QueryError(
            "the torque is not affine in the mass of the payload: an effect depends on the dynamics of the arm; give"
            " budgets with payload= instead"
        )
    for i in np.flatnonzero(np.isfinite(limits.effort)):
        least, most = _interval(bare[:, i], per_mass[:, i], float(limits.effort[i]), float(np.abs(per_mass).max()))
        low, high = int(np.argmax(least)), int(np.argmin(most))
        yield _Bound(float(least[low]), inf, int(i), "peak torque", float(there.split.t[low]))
        yield _Bound(-inf, float(most[high]), int(i), "peak torque", float(there.split.t[high]))


def _of_starts(there: Demand, plant: Plant, loaded: Plant, limits: Limits) -> Iterator[_Bound]:
    """Of the torque at which joints break away, at each time at which one does."""
    assert there.cells is not None
    bare, one = (breakaway(there.cells, each) for each in (plant, loaded))
    per_mass = one.torque - bare.torque
    for i, t, tau, slope in zip(bare.joint, bare.t, bare.torque, per_mass, strict=True):
        limit, size = float(limits.effort[i]), float(np.abs(per_mass).max())
        if limit < inf:
            least, most = _interval(np.array([tau]), np.array([slope]), limit, size)
            yield _Bound(float(least[0]), float(most[0]), int(i), "break-away torque", float(t))


def _of_means(there: Demand, loaded: Plant, continuous: np.ndarray) -> Iterator[_Bound]:
    """Of continuous torque, a quadratic inequality in the mass for each joint."""
    assert there.cells is not None
    bare = there.split.tau
    per_mass = torques(there.cells, loaded, there.cell, there.x)[0] - bare
    A, B, C = (there.mean(x * y) for x, y in ((bare, bare), (bare, per_mass), (per_mass, per_mass)))
    for i in np.flatnonzero(np.isfinite(continuous)):
        over, root = A[i] - continuous[i] ** 2, B[i] ** 2 - C[i] * (A[i] - continuous[i] ** 2)
        if C[i] <= _NONE**2 * C.max():
            least, most = (inf, -inf) if over > 0 else (-inf, inf)
        else:
            ends = (-B[i] + np.array([-1, 1]) * np.sqrt(root)) / C[i] if root >= 0 else (inf, -inf)
            least, most = float(ends[0]), float(ends[1])
        yield _Bound(least, most, int(i), "continuous torque", nan)


def _interval(tau: np.ndarray, slope: np.ndarray, limit: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """The masses at which |τ + m slope| ≤ limit, from the least to the most, (k,) each; (inf, −inf) for none."""
    flat = np.abs(slope) <= _NONE * size
    steep = np.where(flat, 1.0, slope)
    ends = (-limit - tau) / steep, (limit - tau) / steep
    none = np.where(np.abs(tau) > limit, inf, -inf)
    return np.where(flat, none, np.minimum(*ends)), np.where(flat, -none, np.maximum(*ends))


def _share(demand: Demand, plant: Plant, limits: Limits, continuous: np.ndarray) -> float:
    """Largest share of a limit of torque."""
    assert demand.cells is not None
    rms, starts = np.sqrt(demand.mean(demand.split.tau**2)), breakaway(demand.cells, plant)
    broken = np.abs(starts.torque) / limits.effort[starts.joint]
    return float(max((demand.peak / limits.effort).max(), (rms / continuous).max(), broken.max(initial=0.0)))
