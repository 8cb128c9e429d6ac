"""Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = τ, by Pinocchio and a Lagrangian.

An arm              load, list_robots, Robot, Payload; `arm.M(q)`, `arm.C(q, v)`, `arm.N(q)`, …
Other formulations  Lagrangian, compiled, euler_lagrange
Inspection          info (an arm), why (a torque by cause), explain (the equations of a run), parameters (that can vary)
Trust               compare
A simulation        Plant, Setup, Event, read_scene, simulate, rollouts, linearise, advise
Display             replay, show, plot, diff_runs
Files               `.save(path)` of a run, a batch, a page, a figure or a result; read (a run, a batch)
Results             Trajectory, Rollouts; RobotDynError, ModelWarning, PrecisionWarning; STANDARD_GRAVITY in [m/s²]

Subpackages, whose docstrings list their contents: effects (friction, springs, stops, limits, …), control (controllers,
references, recorded motions, inverse kinematics), integrate (methods), accuracy (work-precision diagrams, certificates,
costs) and tools (doctor of files, motors, sweeps, proofs, stress tests, steps, exports).
"""

from __future__ import annotations

from robot_dyn.foundations import missing_packages
from robot_dyn.foundations.public import public_names

missing_packages.install()
_public, _, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("robot-dyn")
    return _public(name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
