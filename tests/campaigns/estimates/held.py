"""Random scenes with dry friction and rigid stops, and an accuracy that is asked for; how it is met."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import robot_dyn as rd
from tests.campaigns.estimates.asked import Answer
from tests.campaigns.estimates.nonsmooth import nonsmooth_truth, time_of_event
from tests.campaigns.estimates.scenes import Scene, arms

FAMILIES = ("rigid", "dry")
EVENTS = 150  # of a scene, at most


def held_scene(seed: int, index: int, of: str = "") -> tuple[Scene, float]:
    """Scene number `index` of a seed, of one of four arms or of that one, its method to be chosen, and what is asked.

    That is 1e-10 to 1e-3.
    """
    rng, family = np.random.default_rng([seed, index, 14]), FAMILIES[index % 2]
    name = of or str(rng.choice(["rail", "pendulum", "planar_2r", "cart_pole"]))
    arm = arms()[name]
    n, q, v = arm.n, *rng.uniform(-1, 1, (2, arm.n))
    scale, duration = np.diag(arm.M(q)), float(np.round(rng.uniform(0.3, 1.2), 3))
    effects: list[rd.Effect] = [rd.effects.ViscousFriction(scale * rng.uniform(0.1, 1, n))]
    if rng.random() < 0.5:
        effects.append(rd.effects.Spring(scale * rng.uniform(1, 30, n), rng.uniform(-1, 1, n)))
    if family == "dry" or rng.random() < 0.4:
        effects.append(_friction(rng, scale * rng.uniform(0.3, 8, n)))
    if family == "rigid":
        lower, upper = q - rng.uniform(0.05, 0.6, n), q + rng.uniform(0.05, 0.6, n)
        effects.append(rd.effects.RigidStops(lower, upper, rng.uniform(0, 0.9, n) * (rng.random(n) < 0.7)))
    drive = None
    if rng.random() < 0.5:
        gains = scale * rng.uniform(5, 60, n), scale * rng.uniform(0.3, 3, n)
        drive = rd.control.PD(rd.control.hold(q + rng.uniform(-0.5, 0.5, n)), kp=gains[0], kd=gains[1])
    setup = rd.Setup(rd.Plant(arm, effects), q, v, duration, drive, record_every_s=duration / 20)
    return Scene(family, setup, f"{seed}/{index} {family} {name} T={duration:g}"), float(10 ** rng.uniform(-10, -3))


def _friction(rng: np.random.Generator, level: np.ndarray) -> rd.Effect:
    """Of one level, of two, or by Stribeck's curve."""
    kind = rng.random()
    if kind < 0.5:
        return rd.effects.DryFriction(level)
    if kind < 0.8:
        return rd.effects.DryFriction(level, level * rng.uniform(1, 1.5, len(level)))
    return rd.effects.DryFriction(level, level * 1.3, 0.2)


def cut(made: Scene) -> Scene:
    """The scene, of so many events at most, and as long as its motion is the only one."""
    end = time_of_event(made.setup, EVENTS)
    return replace(made, setup=replace(made.setup, duration_s=end, record_every_s=end / 20))


def meet(seed: int, index: int) -> Answer:
    """Ask for the accuracy of a scene; AccuracyError if it is refused. The truth, and its witness, are `nonsmooth`."""
    whole, asked = held_scene(seed, index)
    scene = cut(whole)
    run = rd.simulate(scene.setup, accuracy=asked)
    assert run.accuracy is not None
    exact, other = nonsmooth_truth(scene.setup, run.t), nonsmooth_truth(scene.setup, run.t, 1e-12, 3e-3)
    true, unsure = (float(np.abs(exact - q).max()) for q in (run.q, other))
    return Answer(scene.label, asked, run.accuracy.estimated, true, unsure)
