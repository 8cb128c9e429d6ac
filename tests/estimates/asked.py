"""Random scenes with an accuracy that is asked for: smooth, stops, dry friction, sampled control, stiff dampers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import robot_dyn as rd
from tests.estimates.scenes import Scene, scene

FAMILIES = ("smooth", "impact", "friction", "sampled", "stiff")
_OF = {"smooth": 0, "friction": 2, "impact": 3, "sampled": 4, "stiff": 0}  # places among the families of `scene`


def asked_scene(seed: int, index: int) -> tuple[Scene, float]:
    """Scene number `index` of a seed, its method to be chosen, and what is asked: 1e-10 to 1e-3."""
    rng = np.random.default_rng([seed, index, 5])
    family = FAMILIES[index % len(FAMILIES)]
    made = scene(seed, 6 * (index // len(FAMILIES)) + _OF[family])
    plant = made.setup.plant
    if family == "stiff":
        n, scale = plant.dynamics.n, np.diag(plant.dynamics.M(made.setup.q0))
        plant = rd.Plant(plant.dynamics, [*plant.effects, rd.ViscousFriction(scale * 10 ** rng.uniform(2, 4.3, n))])
    setup = replace(made.setup, plant=plant, integrator="auto", step_s=None)
    return Scene(family, setup, made.label), float(10 ** rng.uniform(-10, -3))
