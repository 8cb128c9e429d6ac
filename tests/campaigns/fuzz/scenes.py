"""Scenes: the starters with keys, values and tables changed, and with damaged text. What is accepted is not run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import robot_dyn as rd
from robot_dyn.scene import starter, starter_names
from tests.campaigns.fuzz.bytes import damage, damage_text

# Parts that no starter has; `double_pendulum` is left out of none, so that every kind meets a small robot too.
MORE = """robot = "cart_pole"
duration_s = 0.1
method = "RK4"
start = {q = {hinge = 0.3}, v = [0.1, 0.2]}
[[effect]]
kind = "lock"
joints = {slide = 0.1}
[[effect]]
kind = "armature"
inertia_kg_m2 = 0.1
[[effect]]
kind = "joint_stops"
lower_rad = -1.0
upper_rad = 1.0
[[effect]]
kind = "lugre_friction"
bristle_stiffness_N_m_per_rad = 100.0
bristle_damping_N_m_s_per_rad = {hinge = 0.1}
viscous_N_m_s_per_rad = 0.2
coulomb_N_m = 0.5
static_N_m = 0.7
stribeck_velocity_rad_s = 0.1
[[effect]]
kind = "line_spring_damper"
frame = "pole"
other_point_m = [0.3, 0.2, 0.9]
stiffness_N_per_m = 30.0
damping_N_s_per_m = 2.0
length_m = 0.7
[[effect]]
kind = "actuator_lag"
time_constant_s = 0.05
[control]
kind = "pid"
bandwidth_rad_s = 10.0
[control.model]
mass_scale = 1.1
[[control.model.effects]]
kind = "gravity"
[reference]
kind = "via_points"
times_s = [0.05, 0.1]
points = [[0.1], [0.2]]
"""


def seeds(folder: Path) -> list[str]:
    """The starters, on small robots, and one with the parts that they lack."""
    return [*(starter(name) for name in starter_names()), MORE, MORE]


def mutate(rng: np.random.Generator, seed: str) -> bytes:
    return damage(rng, seed.encode()) if rng.random() < 0.2 else damage_text(rng, seed).encode("utf-8", "surrogatepass")


def attempt(mutant: bytes, folder: Path) -> str:
    path = folder / "mutant.toml"
    path.write_bytes(mutant)
    rd.read_scene(path)
    return "accepted"
