"""Logs with one planted fault, and what the verdict says of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

import robot_dyn as rd
from robot_dyn.foundations import rotation
from robot_dyn.tools.identify import FourierSeries, Verdict, links_of

ARMS = {"ur5": None, "panda": "panda_finger_joint1", "ur10": None, "xarm7": None, "ur3": None}
FAULTS = (
    "mass", "centre of mass", "torque offset", "mounting", "friction", "gain", "time offset", "load",
)  # fmt: skip
DURATION_S, STEP_S, HARMONICS = 20.0, 0.005, 16
SPEED = 0.8  # of the velocity limit
TORQUE_NOISE = 0.005, 0.05  # of the rms torque of the joint, from log to log
TRACKING = 0.01  # coefficients of the motion that the desired one lacks
ENCODER_NOISE = 1e-5  # [rad]


@cache
def arm_named(name: str) -> rd.Robot:
    """An arm of the catalog, without its fingers."""
    arm = rd.load(name)
    return arm.with_(lock={ARMS[name]: 0.0}) if ARMS[name] else arm


@dataclass(frozen=True)
class Planted:
    """A log with one fault, or a clean one.

    Attributes:
        arm: Name of the arm.
        fault: Kind of the fault, as in a verdict; "" for a clean log.
        where: Link or joint; "" for the whole arm.
        log: The log.
        effects: The friction that the arm is said to have.
    """

    arm: str
    fault: str
    where: str
    log: dict[str, np.ndarray]
    effects: tuple[rd.effects.Effect, ...]


@dataclass(frozen=True)
class Judged:
    """What a verdict says of a planted fault.

    Attributes:
        planted: The fault.
        ratio: Largest residual of the file, in units of the noise.
        rank: Place of the true cause among all causes, from 0; −1 for a clean log.
        together: Number of causes that the verdict names together as the first.
        is_among: True if the true cause is one of them.
        first: The first cause, in words; "" if no cause is seen.
    """

    arm: str
    fault: str
    where: str
    ratio: float
    rank: int
    together: int
    is_among: bool
    first: str


def planted(seed: int, fault: str) -> Planted:
    """Plant a fault, of random place and sign, in a log of a random arm that follows the desired motion to 1 %."""
    rng = np.random.default_rng([seed, len(fault), *map(ord, fault[:1])])
    name = str(rng.choice(sorted(ARMS)))
    arm = arm_named(name)
    n, sign, joint = arm.n, rng.choice([-1.0, 1.0]), int(rng.integers(arm.n))
    series, t = FourierSeries(DURATION_S, HARMONICS), np.arange(0.0, DURATION_S, STEP_S)
    x = rng.normal(size=(series.size, n))
    x[0] = 0.0
    speed = np.where(np.isfinite(arm.velocity_limit), arm.velocity_limit, 2.0)
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    q, v, _ = (np.abs(B @ x).max(axis=0) for B in series.basis(t))
    x *= np.minimum(SPEED * speed / v, 0.4 * (upper - lower) / q)
    x[0] = (lower + upper) / 2
    desired, x = x, x + TRACKING * np.abs(x).mean(axis=0) * rng.normal(size=x.shape)
    late = 0.005 * sign if fault == "time offset" else 0.0
    q, v, a = (B @ x for B in series.basis(t - late))
    theta, gravity, where = arm.inertial_parameters.reshape(-1, 10).copy(), np.array(arm.gravity), ""
    if fault in ("mass", "centre of mass"):
        links = links_of(arm)
        heavy = [k for k, m in enumerate(links.theta[:, 0]) if m > 0 and arm.body_names[k] != arm.joint_names[0]]
        k = int(rng.choice(heavy))
        where, link = links.names[k], links.theta[k]
        moved = 1.5 * link if fault == "mass" else shifted(link, rng)
        theta[k] += links.X[k] @ (moved - link)
    if fault == "load":  # 0.5 to 2 kg up to 10 cm from the last link
        links, unit = links_of(arm), np.array([1.0, *rng.uniform(-0.1, 0.1, 3), 0.04, 0.0, 0.04, 0.0, 0.0, 0.04])
        where, theta[-1] = links.names[-1], theta[-1] + links.X[-1] @ (rng.uniform(0.5, 2.0) * unit)
    if fault == "mounting":
        angle = rng.uniform(0, 2 * np.pi)
        gravity = rotation(np.array([np.cos(angle), np.sin(angle), 0.0]), np.deg2rad(3.0)) @ gravity
    tau = arm.with_(gravity=gravity).regressor(q, v, a) @ theta.ravel() + arm.armature * a
    size = np.sqrt((tau**2).mean(axis=0))
    size = np.maximum(size, 0.1 * size.max())
    viscous, coulomb = rng.uniform(0.05, 0.15, (2, n)) * size
    viscous = viscous / v.std(axis=0)
    factor = np.ones(n)
    if fault == "friction":
        factor[joint] = 2.0
        where = arm.joint_names[joint]
    tau = tau + factor * (viscous * v + coulomb * np.sign(v))
    if fault == "torque offset":
        tau[:, joint] += 0.1 * sign * size[joint]
        where = arm.joint_names[joint]
    if fault == "gain":
        tau[:, joint] *= 1.0 + 0.1 * sign
        where = arm.joint_names[joint]
    noise = np.exp(rng.uniform(*np.log(TORQUE_NOISE)))
    tau = tau + noise * size * rng.normal(size=tau.shape)
    measured = series.basis(t)[0] @ x + ENCODER_NOISE * rng.normal(size=q.shape)
    log = {"t": t, "q": measured, "tau": tau, "desired": series.basis(t)[0] @ desired}
    return Planted(name, fault, where, log, (rd.effects.ViscousFriction(viscous), rd.effects.DryFriction(coulomb)))


def shifted(theta: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the parameters of a link whose centre of mass is 5 cm off, in a random direction."""
    direction = rng.normal(size=3)
    m, c = theta[0], theta[1:4] / theta[0]
    d = c + 0.05 * direction / np.linalg.norm(direction)
    more = m * ((d @ d) * np.eye(3) - np.outer(d, d) - (c @ c) * np.eye(3) + np.outer(c, c))
    return theta + np.array([0.0, *(m * (d - c)), *more[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]])


def judged(case: Planted, verdict: Verdict) -> Judged:
    """Compare a verdict with the planted fault."""
    is_true = [x.kind == case.fault and x.where in (case.where, "") for x in verdict.causes]
    rank = is_true.index(True) if any(is_true) else (len(is_true) if case.fault else -1)
    first = verdict.first
    return Judged(
        *(case.arm, case.fault, case.where, float(np.nanmax(verdict.ratios)), rank, len(first), 0 <= rank < len(first)),
        first[0].text if first else "",
    )


def judge(seed: int, fault: str) -> Judged:
    """Plant a fault, identify the arm and compare."""
    case = planted(seed, fault)
    result = rd.tools.identify.identify(arm_named(case.arm), case.log, effects=case.effects)
    return judged(case, result.verdict)
