"""The largest point mass with which motors suffice: torque is affine in it, so the masses that fit are an interval.

    τ(t, m) = τ₀(t) + m τ₁(t)

    |τ₀ + m τ₁| ≤ τ_max at each time,     ⟨τ₀²⟩ + 2 m ⟨τ₀ τ₁⟩ + m² ⟨τ₁²⟩ ≤ τ_continuous²

Each inequality allows an interval of m, and so do all together: every mass between two that fit also fits. Speed does
not depend on m. Peaks between the times are computed with the current mass and added until no limit is exceeded.

A gear with losses is affine on either side of τ = J a, and increases: the limits of the motor have limits of τ at each
time. The mean square is then quadratic in m between masses at which a sign changes; its root is found with the signs
there.

Loads on bearings and holding torques of brakes are convex in m: the masses within these limits are an interval as well,
whose ends are found by Brent's method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from math import inf, nan
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn import Payload, Plant
from robot_dyn.description import LARGEST
from robot_dyn.foundations import Answer, Block, QueryError
from robot_dyn.tools.motors.gear import Gear
from robot_dyn.tools.motors.limits import Limits, used_fraction
from robot_dyn.tools.motors.motor_budget.bearing_loads import of_plan
from robot_dyn.tools.motors.motor_budget.breakaway import breakaway
from robot_dyn.tools.motors.motor_budget.demand import Demand, of_motion, torques
from robot_dyn.tools.motors.motor_budget.holding import holdings
from robot_dyn.tools.motors.motor_budget.joint_budget import TOLERANCE
from robot_dyn.tools.motors.motor_budget.result import MotorBudget, case_of

_ROUNDS = 12
_INSTEAD = "compute budgets with payload= instead"
_CLOSE = 1e-9  # relative to a limit, by which a peak between the times may exceed it
_AFFINE = 1e-9  # relative to the torque, its largest deviation from an affine function
_NEAR, _ROOT = 1e-6, 1e-9  # distance of a share from 1 that counts as reached; [kg], error of a mass
_NONE = 1e-12  # relative to the largest torque of a unit mass: smaller torques are rounding


@final
@dataclass(frozen=True, repr=False)
class LargestPayload(Answer):
    """The largest point mass on a link with which the motors suffice, and the limit that determines it.

    Attributes:
        link: Name of the link.
        com: Place of the mass in the axes of the link, in [m].
        mass: The mass, in [kg], in addition to the arm's payloads; None if no mass fits, inf if no known limit bounds
            it.
        least: The smallest mass that fits, in [kg]: 0, unless the arm needs a counterweight.
        joint: The limiting joint; empty if no known limit bounds the mass.
        limit: The limit: "peak torque", "continuous torque", "break-away torque", "speed", "brake", or a load on the
            bearing, such as "tilting load".
        at_s: Time at which the limit is reached, in [s]; nan for continuous torque, a mean over the motion, and for
            brakes.
        largest_share: Largest share of a limit with this mass, by inverse dynamics.
        resolution: Times of the check with this mass, in words.
        carried: Mass of the arm's payloads, in [kg].
    """

    link: str
    com: tuple[float, float, float]
    mass: float | None
    least: float
    joint: str
    limit: str
    at_s: float
    largest_share: float
    resolution: str
    carried: float

    def blocks(self) -> Iterator[Block]:
        x, y, z = self.com
        where = f"on {self.link} at ({x:g}, {y:g}, {z:g}) m"
        at = "" if np.isnan(self.at_s) else f" at {round(self.at_s, 9):.4g} s"
        if self.mass is None:
            yield f"no payload {where} fits: the {self.limit} of {self.joint} is exceeded{at}"
        elif self.mass == inf:
            yield f"payload {where}: no known limit bounds it"
        else:
            limit = f"the {self.limit} of {self.joint}{at}"
            more = f" more, {self.carried + self.mass:.5g} kg in all" if self.carried else ""
            yield f"largest payload {where}: {self.mass:.5g} kg{more}; limited by {limit}"
            least = "all smaller masses fit" if not self.least else f"at least {self.least:.5g} kg are needed"
            yield f"{least}: torque is affine in a point mass, and loads on bearings and brakes are convex in it"
            yield (f"with this mass the largest share of a limit is {self.largest_share:.6f}; {self.resolution}")


class _Bound(NamedTuple):
    """Masses that a limit allows, from `least` to `most`, with joint, limit and time."""

    least: float
    most: float
    joint: int = 0
    limit: str = ""
    at_s: float = nan


def max_payload(motor_budget: MotorBudget, link: str, com: Any = (0.0, 0.0, 0.0)) -> LargestPayload:
    """Compute the largest point mass on a link with which the motors suffice, in addition to the arm's payloads.

    Torque is affine in the mass, so the masses that fit are an interval, in closed form at each time. The peaks of the
    torque between times are computed again with this mass, until no limit is exceeded. Limits of brakes and bearings
    may narrow the interval; as in the budget, the torque on a brake is the largest one found.

    Args:
        motor_budget: The budget of a plan.
        link: Name of the link that carries the mass.
        com: Place of the mass in the axes of the link, (3,), in [m].

    Raises:
        QueryError: If the budget is of a run: its control would change as well.
        EditError: If the link is unknown.
    """
    plant, motion, limits = case_of(motor_budget, "the largest payload")
    robot: Any = plant.dynamics
    unit, bare = Payload(link, 1.0, com), of_motion(motion, plant, limits)
    limits = limits.at_mean_speed(bare.mean_speed)
    carried = float(sum(payload.mass for payload in robot.edits.payloads))

    def carrying(mass: float) -> Plant:
        return replace(plant, dynamics=robot.with_(payload=replace(unit, mass=mass)))

    @cache
    def demand(mass: float) -> Demand:
        return of_motion(motion, carrying(mass), limits)

    @cache
    def worst(mass: float) -> _Bound:
        return _worst_load(demand(mass), carrying(mass), limits)

    def result(mass: float | None, least: float, bound: _Bound, share: float, there: Demand = bare) -> LargestPayload:
        joint = robot.joint_names[bound.joint] if bound.limit else ""
        limit = joint, bound.limit, bound.at_s
        return LargestPayload(unit.frame, unit.com, mass, least, *limit, share, there.resolution, carried)

    loaded, none = carrying(1.0), _Bound(-inf, inf)
    if (fast := bare.speed[0] > limits.velocity * (1 + TOLERANCE)).any():
        i = int(np.argmax(fast))
        return result(None, 0.0, _Bound(nan, nan, i, "speed", float(bare.speed[1][i])), inf)
    bounds = [none, *_of_means(bare, plant, loaded, limits), *_of_starts(bare, plant, loaded, limits)]
    bounds += _of_times(bare, plant, loaded, limits, 0.0)
    turn = 0
    while True:
        turn += 1
        low, high = max(bounds, key=lambda x: x.least), min(bounds, key=lambda x: x.most)
        least, most = max(0.0, low.least), high.most
        if most < least:
            return result(None, 0.0, high if most < 0 else low, inf)
        if most > LARGEST:
            most = LARGEST
            break
        if _share(demand(most), limits) <= 1 + _CLOSE or turn == _ROUNDS:
            break
        bounds += _of_times(demand(most), plant, loaded, limits, most)
    share = 0.0
    if limits.brake or limits.bearing:
        least, inside, most = _interval(lambda mass: worst(mass).least, least, most)
        if worst(inside).least > 1 + _CLOSE:
            return result(None, 0.0, worst(inside), inf)
        share = worst(most).least
        high = worst(most) if share > 1 - _NEAR else high
    if most == LARGEST:
        return result(inf, least, none, 0.0)
    return result(most, least, high, max(share, _share(demand(most), limits)), demand(most))


def _worst_load(demand: Demand, plant: Plant, limits: Limits) -> _Bound:
    """Return the largest share of a brake or bearing, as `least`, with joint, limit and time."""
    robot: Any = plant.dynamics
    assert demand.cells is not None
    index = robot.joint_names.index
    shares = [
        _Bound(x.gravity / x.brake, nan, index(name), "brake") for name, x in holdings(robot, limits.brake).items()
    ]
    if limits.bearing:
        loads = of_plan(demand.cells, plant, limits.bearing).by_joint
        shares += [
            _Bound(x.used, nan, index(name), f"{x.worst} load", getattr(x, f"{x.worst}_at_s"))
            for name, x in loads.items()
        ]
    return max(shares, key=lambda x: x.least)


def _interval(share: Callable[[float], float], least: float, most: float) -> tuple[float, float, float]:
    """Return the masses at which a convex share is at most 1: both ends and a mass between."""
    optimize: Any = import_module("scipy.optimize")
    inside = min((least, most), key=share)
    if share(inside) > 1:
        inside = float(optimize.minimize_scalar(share, bounds=(least, most), method="bounded").x)
    if share(inside) > 1:
        return least, inside, most
    ends = (
        x if share(x) <= 1 else optimize.brentq(lambda x: share(x) - 1, inside, x, xtol=_ROOT) for x in (least, most)
    )
    least, most = (float(x) for x in ends)
    return least, inside, most


def _of_times(there: Demand, plant: Plant, loaded: Plant, limits: Limits, mass: float) -> Iterator[_Bound]:
    """Yield the bounds of peak torque at the times of a demand with a mass.

    Raises:
        QueryError: If the torque at that mass is not affine.
    """
    assert there.cells is not None
    bare, one = (torques(there.cells, x, there.cell, there.x)[0] for x in (plant, loaded))
    per_mass, a = one - bare, there.cells.states(there.cell, there.x)[3]
    tau = bare + mass * per_mass
    size = np.abs(bare).max() + mass * np.abs(per_mass).max()
    loss = 0.0 if limits.gear is None else limits.gear.loss(tau, there.v, a)
    if np.abs(tau + loss - there.split.tau).max() > _AFFINE * size:
        raise QueryError(
            "the torque is not affine in the mass of the payload: an effect depends on the dynamics of the arm; "
            + _INSTEAD
        )
    m, n = bare.shape
    joints, t = np.tile(np.arange(n), m), np.repeat(there.split.t, n)
    bounds = (_at_joint(limits.gear, x, there.v, a).ravel() for x in limits.bounds(there.v))
    yield from _of_torques("peak torque", joints, t, bare.ravel(), per_mass.ravel(), *bounds)


def _of_starts(bare: Demand, plant: Plant, loaded: Plant, limits: Limits) -> Iterator[_Bound]:
    """Yield the bounds of the torque at which joints break away."""
    assert bare.cells is not None
    joints, t, tau, direction, a = breakaway(bare.cells, plant)
    per_mass = breakaway(bare.cells, loaded).torque - tau
    gear, effort = limits.gear and limits.gear.of(joints), limits.effort[joints]
    bounds = (_at_joint(gear, x, direction, a) for x in (-effort, effort))
    yield from _of_torques("break-away torque", joints, t, tau, per_mass, *bounds)


def _at_joint(gear: Gear | None, tau: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the torques of joints for torques of their motors."""
    return tau if gear is None else gear.at_joint(tau, v, a)


def _of_torques(
    name: str, joints: np.ndarray, t: np.ndarray, tau: np.ndarray, slope: np.ndarray, lower: np.ndarray,
    upper: np.ndarray,
) -> Iterator[_Bound]:  # fmt: skip
    """Yield, for each joint, the narrowest bounds of lower ≤ τ + m slope ≤ upper; all arrays are (k,)."""
    flat = np.abs(slope) <= _NONE * np.abs(slope).max(initial=0.0)
    steep = np.where(flat, 1.0, slope)
    none = np.where((tau < lower) | (tau > upper), inf, -inf)
    ends = (lower - tau) / steep, (upper - tau) / steep
    least, most = np.where(flat, none, np.minimum(*ends)), np.where(flat, -none, np.maximum(*ends))
    for i in np.unique(joints):
        of_joint = np.flatnonzero(joints == i)
        low, high = of_joint[np.argmax(least[of_joint])], of_joint[np.argmin(most[of_joint])]
        yield _Bound(float(least[low]), inf, int(i), name, float(t[low]))
        yield _Bound(-inf, float(most[high]), int(i), name, float(t[high]))


def _of_means(bare: Demand, plant: Plant, loaded: Plant, limits: Limits) -> Iterator[_Bound]:
    """Yield the bounds of continuous torque, a quadratic inequality in the mass for each joint."""
    assert bare.cells is not None
    tau, one = (torques(bare.cells, x, bare.cell, bare.x)[0] for x in (plant, loaded))
    per_mass, a = one - tau, bare.cells.states(bare.cell, bare.x)[3]
    nothing = _NONE**2 * bare.mean(per_mass**2).max()
    for i in np.flatnonzero(np.isfinite(limits.continuous)):
        gear = limits.gear and limits.gear.of(i)
        least, most = (
            _end_of_mean(bare, gear, side, limits.continuous[i], nothing, [x[:, i] for x in (tau, per_mass, bare.v, a)])
            for side in (-1, 1)
        )
        yield _Bound(least, most, int(i), "continuous torque")


def _end_of_mean(
    bare: Demand, gear: Gear | None, side: int, limit: float, nothing: float, columns: list[np.ndarray]
) -> float:
    """Return the smallest or largest mass, by side, with which the mean square is within a limit; −side inf if none."""
    tau, per_mass, v, a = columns
    mass = root = 0.0
    for _ in range(_ROUNDS):
        start, slope = tau, per_mass
        if gear is not None:  # with the signs at the last mass
            factor = gear.factor(tau + mass * per_mass, v, a)
            start, slope = gear.rotor * a + factor * (tau - gear.rotor * a), factor * per_mass
        A, B, C = (float(bare.mean(x * y)) for x, y in ((start, start), (start, slope), (slope, slope)))
        over = A - limit**2
        if nothing >= C:
            return -side * inf if over > 0 else side * inf
        root, last = B**2 - C * over, mass
        mass = (-B + side * max(root, 0.0) ** 0.5) / C
        if mass == last:
            break
    return mass if root >= 0 else -side * inf


def _share(demand: Demand, limits: Limits) -> float:
    """Return the largest share of a torque limit."""
    rms = np.sqrt(demand.mean(demand.split.tau**2))
    broken = used_fraction(np.abs(demand.starts.torque), limits.effort[demand.starts.joint])
    peak = np.maximum(used_fraction(demand.peak, limits.effort), limits.used(demand.split.tau, demand.v).max(axis=0))
    return float(max(peak.max(), (rms / limits.continuous).max(), broken.max(initial=0.0)))
