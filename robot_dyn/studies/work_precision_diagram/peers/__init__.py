"""Other programs that can do a motion, where they are installed: SciPy around Pinocchio, MuJoCo, Drake, heyoka.

They take part where an arm moves freely under gravity; all start from the same file, and each from its own parser.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from robot_dyn.errors import shorten
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.studies.work_precision_diagram.method_under_test import MethodUnderTest
from robot_dyn.studies.work_precision_diagram.peers import drake, heyoka, mujoco, scipy
from robot_dyn.studies.work_precision_diagram.peers.free_motion import FreeMotion, PeerError

# By the module that each needs.
PEERS: dict[str, Callable[[FreeMotion], list[MethodUnderTest]]] = {
    "scipy": scipy.methods_under_test, "mujoco": mujoco.methods_under_test,
    "pydrake": drake.methods_under_test, "heyoka": heyoka.methods_under_test,
}  # fmt: skip


def found(setup: Setup) -> tuple[list[MethodUnderTest], list[str]]:
    """The candidates of other programs for a setup, and which are left out, with the reason."""
    robot: Any = setup.plant.dynamics
    installed = [name for name in PEERS if find_spec(name)]
    if setup.plant.effects or setup.controller is not None or not isinstance(robot, Robot):
        why = "only the free motion of an arm under gravity is the same there"
        return [], [f"other programs ({', '.join(installed)}): {why}"]
    methods: list[MethodUnderTest] = []
    left_out = [f"{name}: is not installed" for name in PEERS if name not in installed]
    motion = FreeMotion(setup, robot)
    for name in installed:
        try:
            methods += PEERS[name](motion)
        except PeerError as error:
            left_out.append(f"{name}: {error}")
        except ImportError as error:
            left_out.append(f"{name}: cannot be imported ({shorten(error, 200)})")
    return methods, left_out
