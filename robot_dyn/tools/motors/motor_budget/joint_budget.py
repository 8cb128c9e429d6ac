"""The demand of a motion on the motor of each joint, with limits and causes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan, nan
from operator import itemgetter
from typing import final

import numpy as np

from robot_dyn.foundations import reported
from robot_dyn.queries import of_joint
from robot_dyn.tools.motors.limits import Limits, used_fraction
from robot_dyn.tools.motors.motor_budget.bearing_loads import BearingLoads, Bearings
from robot_dyn.tools.motors.motor_budget.demand import Demand
from robot_dyn.tools.motors.motor_budget.holding import Holding

TOLERANCE = 1e-3  # relative to a limit, by which plans at their limits may exceed it
_DIGITS = 12  # decimals of times in [s]: places at the ends of cells lie slightly inside
KINDS: Mapping[str, str] = {
    "peak": "peak torque", "continuous": "continuous torque", "speed": "speed", "line": "torque–speed line",
    "brake": "brake", "bearing": "bearing",
}  # fmt: skip


@final
@dataclass(frozen=True)
class JointBudget:
    """The demand of a motion on the motor of a joint; for a prismatic joint read [N] for [N m] and [m] for [rad].

    Attributes:
        joint, type: Name of the joint, and its type, such as "revolute".
        peak, peak_at_s: Largest |τ|, in [N m], and its time, in [s]; for a run, the time of the largest sample.
        rms: √(1/T ∫ τ² dt), in [N m].
        speed, speed_at_s: Largest |v|, in [rad/s], and its time, in [s].
        power, power_at_s: Largest |τ v|, in [W], and its time, in [s].
        mean_power: 1/T ∫ τ v dt, in [W].
        energy: ∫ max(τ v, 0) dt, delivered by the motor, in [J].
        regenerated: ∫ max(−τ v, 0) dt, returned to the motor, in [J].
        static_friction: f_s of dry friction, in [N m]; 0 without dry friction, nan for a run.
        breakaway, breakaway_at_s: Largest |τ| at which the joint leaves rest against f_s, and its time; nan if it never
            leaves rest.
        peak_limit, continuous_limit, speed_limit: The limits; inf for none, a peak limit of 0 for a passive joint.
        of_peak: Parts of τ at `peak_at_s` by cause.
        of_rms: Parts of `rms` by cause, 1/(T rms) ∫ τ_cause τ dt; negative for a cause that relieves the motor.
        line: Largest use of the torque–speed line: "torque" in [N m], "speed" in [rad/s], "limit" at that speed,
            "used", the factor λ for which (torque, speed)/λ is on the line, and "at_s" in [s]; empty without a line.
        holding: The brake, and the torque of gravity that it holds; None without a brake.
        bearing: Largest loads on its bearing; None if they are unknown.
        cut: True if an effort limit or a torque–speed line cut the actuation of a run, so that the demand was higher.
    """

    joint: str
    type: str | None
    peak: float
    peak_at_s: float
    rms: float
    speed: float
    speed_at_s: float
    power: float
    power_at_s: float
    mean_power: float
    energy: float
    regenerated: float
    static_friction: float
    breakaway: float
    breakaway_at_s: float
    peak_limit: float
    continuous_limit: float
    speed_limit: float
    of_peak: dict[str, float]
    of_rms: dict[str, float]
    line: dict[str, float] = field(default_factory=dict)
    holding: Holding | None = None
    bearing: BearingLoads | None = None
    cut: bool = False

    @property
    def shares(self) -> dict[str, float]:
        """Used fractions of limits: "peak", "continuous", "speed", 0 if unknown, and "line", "brake" and "bearing"."""
        peak = max(self.peak, 0.0 if isnan(self.breakaway) else self.breakaway)
        demand = np.array([peak, self.rms, self.speed])
        limit = np.array([self.peak_limit, self.continuous_limit, self.speed_limit])
        used = dict(zip(KINDS, used_fraction(demand, limit).tolist(), strict=False))
        used |= {"line": self.line["used"]} if self.line else {}
        used |= {"brake": self.holding.gravity / self.holding.brake} if self.holding else {}
        return used | ({"bearing": self.bearing.used} if self.bearing and self.bearing.used else {})

    @reported
    def headroom(self) -> dict[str, float]:
        """Unused fraction of each limit; 1 for unknown limits, negative for exceeded ones."""
        return {kind: 1 - used for kind, used in self.shares.items()}

    @reported
    def too_small(self) -> tuple[str, ...]:
        """Exceeded limits, by more than a thousandth: "peak", "continuous", "speed", "line", "brake" or "bearing".

        A limit at which the actuation was cut is included.
        """
        most = {"peak": 1 - TOLERANCE, "line": 1 - TOLERANCE} if self.cut else {}
        return tuple(kind for kind, used in self.shares.items() if used > most.get(kind, 1 + TOLERANCE))

    def says(self, kind: str) -> str:
        """Return demand and limit of a kind in words, with the largest cause."""
        unit = of_joint("rad/s" if kind == "speed" else "N m", self.type)
        if kind == "continuous":
            return f"{self.rms:.4g} {unit} rms (limit {self.continuous_limit:.4g}){_most(self.of_rms)}"
        if kind == "speed":
            return f"{self.speed:.4g} {unit} (limit {self.speed_limit:.4g}) at {self.speed_at_s:.4g} s"
        if kind == "line":
            speed = f"{self.line['speed']:.4g} {of_joint('rad/s', self.type)}"
            needs = f"{self.line['torque']:.4g} {unit} at {speed}"
            return f"{needs} (limit {self.line['limit']:.4g} there) at {self.line['at_s']:.4g} s"
        if kind == "brake" and self.holding:
            return f"{self.holding.gravity:.4g} {unit} to hold against gravity (limit {self.holding.brake:.4g})"
        if kind == "bearing" and self.bearing:
            return self.bearing.says
        starts = self.breakaway > self.peak
        need, at = (self.breakaway, self.breakaway_at_s) if starts else (self.peak, self.peak_at_s)
        more = " to break away" if starts else ", where it was cut" if self.cut else ""
        return f"{need:.4g} {unit} (limit {self.peak_limit:.4g}) at {at:.4g} s{more or _most(self.of_peak)}"


def joint_budgets(
    demand: Demand, limits: Limits, holding: Mapping[str, Holding], bearings: Bearings,
    cut: frozenset[str] = frozenset(),
) -> Iterator[JointBudget]:  # fmt: skip
    """Yield the budget of each joint; `cut` names joints whose actuation was cut at an effort limit."""
    split, power, row = demand.split, demand.power, np.arange(len(demand.peak))
    limits = limits.at_mean_speed(demand.mean_speed)
    lines = list(_lines(demand, limits))
    rms = np.sqrt(demand.mean(split.tau**2))
    delivered, regenerated = (demand.duration_s * demand.mean(x.clip(0.0)) for x in (power, -power))
    at_peak, strongest = (np.abs(x).argmax(axis=0) for x in (split.tau, power))
    parts = {cause: demand.mean(torque * split.tau) for cause, torque in split.torques.items()}
    by_joint = [[(abs(tau), t) for joint, t, tau, *_ in zip(*demand.starts, strict=True) if joint == i] for i in row]
    starts = [max(torques, key=itemgetter(0), default=(nan, nan)) for torques in by_joint]
    values: dict[str, Sequence[float] | np.ndarray] = {
        "peak": demand.peak,
        "peak_at_s": split.t[at_peak],
        "rms": rms,
        "speed": demand.speed[0],
        "speed_at_s": demand.speed[1],
        "power": np.abs(power[strongest, row]),
        "power_at_s": split.t[strongest],
        "mean_power": demand.mean(power),
        "energy": delivered,
        "regenerated": regenerated,
        "static_friction": demand.friction,
        "breakaway": [torque for torque, _ in starts],
        "breakaway_at_s": [t for _, t in starts],
        "peak_limit": limits.effort,
        "continuous_limit": limits.continuous,
        "speed_limit": limits.velocity,
    }
    for i, (name, kind) in enumerate(zip(split.joints, split.types, strict=True)):
        numbers = {key: float(x[i]) for key, x in values.items()}
        yield JointBudget(
            joint=name,
            type=kind,
            **{key: round(x, _DIGITS) if key.endswith("_at_s") else x for key, x in numbers.items()},
            of_peak={cause: float(torque[at_peak[i], i]) for cause, torque in split.torques.items()},
            of_rms={cause: float(part[i] / rms[i]) if rms[i] else 0.0 for cause, part in parts.items()},
            line=lines[i],
            holding=holding.get(name),
            bearing=bearings.by_joint.get(name),
            cut=name in cut,
        )


def _lines(demand: Demand, limits: Limits) -> Iterator[dict[str, float]]:
    """Yield the demand of each joint that uses the largest fraction of its torque–speed line; {} without a line."""
    tau, v, line = demand.split.tau, demand.v, limits.line
    if line is None:
        yield from [{}] * tau.shape[1]
        return
    used, given = limits.used(tau, v), limits.bounds(v)
    for i, k in enumerate(used.argmax(axis=0)):
        values = {
            "torque": abs(tau[k, i]), "speed": abs(v[k, i]), "limit": abs(given[int(tau[k, i] > 0)][k, i]),
            "used": used[k, i], "at_s": round(float(demand.split.t[k]), _DIGITS),
        }  # fmt: skip
        yield {key: float(x) for key, x in values.items()} if line.exists[i] else {}


def _most(parts: Mapping[str, float]) -> str:
    """Return the cause with the largest part of a sum, in words."""
    sign = 1.0 if sum(parts.values()) >= 0 else -1.0
    cause = max(parts, key=lambda name: sign * parts[name])
    return f", {sign * parts[cause]:.4g} for {cause}"
