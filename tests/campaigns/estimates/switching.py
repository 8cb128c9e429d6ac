"""Random scenes in which steps are cut: joints with bristles, and soft stops, by methods of every order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import robot_dyn as rd
from tests.campaigns.estimates.scenes import METHODS, Scene, arms, scene

FAMILIES = ("bristles", "stops")
_OF_ALL = 8  # scenes, the last two of which are of these families


def scene_of_all(seed: int, index: int) -> Scene:
    """Scene number `index` of a seed, of the families of `scene` and of these."""
    block, place = divmod(index, _OF_ALL)
    usual = _OF_ALL - len(FAMILIES)
    made = scene(seed, usual * block + place) if place < usual else switching_scene(seed, index)
    return replace(made, label=f"{seed}/{index} {made.label.partition(' ')[2]}")


def switching_scene(seed: int, index: int) -> Scene:
    """Scene number `index` of a seed: bristles where it is even, else stops."""
    rng, family = np.random.default_rng([seed, index, 17]), FAMILIES[index % 2]
    name = str(rng.choice(["rail", "pendulum", "planar_2r", "cart_pole"]))
    arm = arms()[name]
    n, q, v = arm.n, *rng.uniform(-1, 1, (2, arm.n))
    scale, duration = np.diag(arm.M(q)), float(np.round(rng.uniform(0.2, 0.6), 3))
    effects: list[rd.Effect] = [rd.effects.ViscousFriction(scale * rng.uniform(0.1, 1, n))] * int(rng.integers(2))
    if rng.random() < 0.5:
        effects.append(rd.effects.Spring(scale * rng.uniform(1, 30, n), rng.uniform(-1, 1, n)))
    if family == "bristles":
        effects.append(_bristles(rng, scale))
    if family == "stops" or rng.random() < 0.2:
        stiffness = scale * 10 ** rng.uniform(2, 6)
        lower, upper = q - rng.uniform(0.02, 0.5, n), q + rng.uniform(0.02, 0.5, n)
        effects += rd.effects.joint_stops(lower, upper, stiffness, stiffness * rng.choice([0.0, 0.1]))
    drive = None
    if rng.random() < 0.4:
        plan = rd.control.quintic(q, q + rng.uniform(-0.5, 0.5, n), duration * rng.uniform(0.4, 1.2))
        kp, kd = rd.control.gains_from(scale, rng.uniform(3, 12), 0.7)
        drive = rd.control.PD(plan, kp=kp, kd=kd)
    text = str(rng.choice([*METHODS, "DP8", "DP8", "RK4", "GaussLegendre6"]))
    step = float(np.round(10 ** rng.uniform(-3.3, -2.1), 6))
    setup = rd.Setup(rd.Plant(arm, effects), q, v, duration, drive, text, step, engine="interpreted")
    return Scene(family, setup, f"{seed}/{index} {family} {name} {text} h={step:g} T={duration:g}")


def _bristles(rng: np.random.Generator, scale: np.ndarray) -> rd.Effect:
    """LuGre's or Dahl's, of oscillations of some 10 to 300 rad/s."""
    level = scale * rng.uniform(0.3, 8, len(scale))
    stiffness = scale * 10 ** rng.uniform(2, 5)
    if rng.random() < 0.3:
        return rd.effects.DahlFriction(stiffness, level)
    damping = scale * np.sqrt(stiffness / scale) * rng.uniform(0, 2)
    viscous, more = scale * rng.uniform(0, 1), rng.uniform(1, 1.5)
    return rd.effects.LuGreFriction(stiffness, damping, viscous, level, level * more, 10 ** rng.uniform(-2, -0.7))
