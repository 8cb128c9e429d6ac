"""A generator of random scenes: smooth motion, dry friction, impacts, sampled control, windows of force."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

import robot_dyn as rd

FAMILIES = ("smooth", "smooth", "friction", "impact", "sampled", "window")  # smooth twice: a third of all scenes
METHODS = (
    "Euler", "SemiImplicitEuler", "Midpoint", "RK4", "RK4", "DP8", "GaussLegendre2", "GaussLegendre4", "GaussLegendre6",
    "Rodas5PFixed", "Rodas5PFixed",
)  # fmt: skip
RAIL = """<robot name="rail"><link name="base"/><link name="block"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="block"/><axis xyz="0 0 1"/>
<limit lower="-100" upper="100" effort="1000" velocity="100"/></joint></robot>"""


@dataclass(frozen=True)
class Scene:
    """A setup with what the truth needs to know of it in plain numbers."""

    family: str
    setup: rd.Setup
    label: str


@cache
def arms() -> dict[str, rd.Robot]:
    """The robots, in gravity."""
    return {
        "rail": rd.Robot.from_text(RAIL),
        "pendulum": rd.load("pendulum"),
        "planar_2r": rd.load("planar_2r"),
        "cart_pole": rd.load("cart_pole"),
        "ur5": rd.load("ur5"),
        "panda": _panda(),
    }


def _panda() -> rd.Robot:
    """Without its fingers."""
    whole = rd.load("panda")
    return whole.with_(lock=dict.fromkeys(whole.joint_names[7:], 0.0))


def scene(seed: int, index: int, of: str = "") -> Scene:
    """Scene number `index` of a seed, of one of the arms or of that one."""
    rng = np.random.default_rng([seed, index])
    family = FAMILIES[index % len(FAMILIES)]
    names = ["pendulum", "planar_2r", "cart_pole"] + (["rail"] if family in ("impact", "window") else ["ur5"])
    name = of or str(rng.choice(names))
    arm = arms()[name]
    n, duration = arm.n, float(np.round(rng.uniform(0.2, 1.2), 3))
    q, v = rng.uniform(-1, 1, n), rng.uniform(-1, 1, n)
    scale = np.diag(arm.M(q))  # so that forces fit the arm
    effects: list[rd.Effect] = []
    if family != "impact" and rng.random() < 0.5:
        effects.append(rd.effects.ViscousFriction(scale * rng.uniform(0.1, 2.0, n)))
    if rng.random() < 0.3:
        effects.append(rd.effects.Spring(scale * rng.uniform(1, 30, n), rng.uniform(-1, 1, n)))
    if family == "friction":
        effects.append(rd.effects.RegularisedCoulombFriction(scale * rng.uniform(0.3, 8, n), 10 ** rng.uniform(-3, -1)))
    if family == "impact":
        effects += _stops(rng, arm, name, q, v, scale)
    if family == "window":
        effects += _windows(rng, arm, float(scale.max()), duration)
    controller = _controller(rng, arm, family, q, scale, duration)
    if rng.random() < 0.35:
        method = rd.integrate.Adaptive(rtol=10 ** rng.uniform(-11, -5), atol=10 ** rng.uniform(-13, -8))
        text = f"DOP853 {method.rtol:.0e}"
    else:
        method = rd.integrate.method("RK4" if arm.n > 2 else str(rng.choice(METHODS)))
        text = method.name
    step = float(np.round(10 ** rng.uniform(-3.4, -1.9), 6))
    fixed = {} if isinstance(method, rd.integrate.Adaptive) else {"step_s": step}
    setup = rd.Setup(rd.Plant(arm, effects), q, v, duration, controller, method, engine="interpreted", **fixed)
    return Scene(family, setup, f"{seed}/{index} {family} {name} {text} h={step:g} T={duration:g}")


def _stops(rng: np.random.Generator, arm: rd.Robot, name: str, q, v, scale) -> list[rd.Effect]:
    """Stops within reach; on the rail half of them a little below the apex of a toss."""
    stiffness = scale * 10 ** rng.uniform(2, 7)
    lower, upper = q - rng.uniform(0.05, 1.0, arm.n), q + rng.uniform(0.05, 1.0, arm.n)
    if name == "rail":
        v[:] = rng.uniform(1, 10)
        upper = q + v**2 / (2 * 9.80665) - 10 ** rng.uniform(-6, -2)
        lower = q - 50.0
    damping = stiffness * rng.choice([0.0, 0.1])
    return list(rd.effects.joint_stops(lower, upper, stiffness, damping))


def _windows(rng: np.random.Generator, arm: rd.Robot, scale: float, duration: float) -> list[rd.Effect]:
    made = []
    for _ in range(int(rng.integers(1, 4))):
        start = rng.uniform(0, duration)
        length = duration * 10 ** rng.uniform(-5, -0.3)
        force = scale * rng.normal(size=6) * min(10.0, 1.0 / length)
        made.append(rd.effects.ExternalWrench(arm.frame_names[-1], force, start_s=start, end_s=start + length))
    return made


def _controller(rng: np.random.Generator, arm: rd.Robot, family: str, q, scale, duration: float):
    period = float(rng.choice([0.002, 0.005, 0.01, 0.02])) if family == "sampled" else 0.0
    if family != "sampled" and rng.random() < 0.6:
        return None
    plan = rd.control.quintic(q, q + rng.uniform(-0.5, 0.5, arm.n), duration * rng.uniform(0.4, 1.2))
    omega = rng.uniform(3, 12)
    if rng.random() < 0.3:
        return rd.control.ComputedTorque(arm.with_(mass_scale=1.1), plan, bandwidth_rad_s=omega, period_s=period)
    kp, kd = rd.control.gains_from(scale, omega, 0.7)
    return rd.control.PD(plan, kp=kp, kd=kd, period_s=period)
