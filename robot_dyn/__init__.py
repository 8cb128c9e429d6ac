"""Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = Υ, by two independent roads."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robot_dyn.accuracy.compare import Comparison as Comparison
    from robot_dyn.accuracy.compare import compare as compare
    from robot_dyn.arithmetic import Ball as Ball
    from robot_dyn.arithmetic import midpoint as midpoint
    from robot_dyn.arithmetic import radius as radius
    from robot_dyn.effects.friction import RegularisedCoulombFriction as RegularisedCoulombFriction
    from robot_dyn.effects.friction import ViscousFriction as ViscousFriction
    from robot_dyn.effects.plant import Plant as Plant
    from robot_dyn.errors import ModelWarning as ModelWarning
    from robot_dyn.errors import RobotDynError as RobotDynError
    from robot_dyn.lagrange.manipulator import Lagrangian as Lagrangian
    from robot_dyn.model.catalog import list_robots as list_robots
    from robot_dyn.model.dynamics import Dynamics as Dynamics
    from robot_dyn.model.edits import STANDARD_GRAVITY as STANDARD_GRAVITY
    from robot_dyn.model.edits import Payload as Payload
    from robot_dyn.model.loading import load as load
    from robot_dyn.model.robot import Robot as Robot

# Public names and where they live; imported when first used, so that `import robot_dyn` stays light (PEP 562).
_HOME = {
    "Ball": "arithmetic",
    "Comparison": "accuracy.compare",
    "Dynamics": "model.dynamics",
    "Lagrangian": "lagrange.manipulator",
    "ModelWarning": "errors",
    "Payload": "model.edits",
    "Plant": "effects.plant",
    "RegularisedCoulombFriction": "effects.friction",
    "Robot": "model.robot",
    "RobotDynError": "errors",
    "STANDARD_GRAVITY": "model.edits",
    "ViscousFriction": "effects.friction",
    "compare": "accuracy.compare",
    "list_robots": "model.catalog",
    "load": "model.loading",
    "midpoint": "arithmetic",
    "radius": "arithmetic",
}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'robot_dyn' has no attribute {name!r}")
    return getattr(import_module(f"robot_dyn.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
