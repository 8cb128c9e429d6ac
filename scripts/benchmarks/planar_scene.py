"""The scene that benchmarks of sweeps share: two bars in a plane, with friction."""

from __future__ import annotations

_SCENE = """
robot = "planar_2r"
duration_s = {duration_s}
method = "rk4"
step_s = 0.001
record_period_s = 0.001

[start]
q = [0.4, 0.9]

[[effect]]
kind = "gravity"

[[effect]]
kind = "viscous_friction"
damping_N_m_s_per_rad = 0.5
"""


def planar_scene(duration_s: float) -> str:
    """Its text, recorded at each of its steps of 1 ms."""
    return _SCENE.format(duration_s=duration_s)
