"""Other programs that can simulate a motion, if installed: SciPy with Pinocchio, MuJoCo, Drake, heyoka.

SciPy and MuJoCo support gravity, PD control, friction, soft stops and springs between points; Drake and heyoka support
free motion. All start from the same URDF; MuJoCo and Drake use their own parsers.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from robot_dyn.accuracy.work_precision_diagram.method_under_test import MethodUnderTest
from robot_dyn.accuracy.work_precision_diagram.peers import drake, heyoka, mujoco, scipy
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import ArmMotion, PeerError
from robot_dyn.foundations.errors import shorten
from robot_dyn.simulation.setup.setup import Setup

# By the name of the required module.
PEERS: dict[str, Callable[[ArmMotion], list[MethodUnderTest]]] = {
    "scipy": scipy.methods_under_test, "mujoco": mujoco.methods_under_test,
    "pydrake": drake.methods_under_test, "heyoka": heyoka.methods_under_test,
}  # fmt: skip
_FREE_MOTION_ONLY = ("pydrake", "heyoka")


def methods_of_peers(setup: Setup) -> tuple[list[MethodUnderTest], list[str]]:
    """Return the methods of other programs for a setup, and notes on omitted programs, with reasons."""
    installed = [name for name in PEERS if find_spec(name)]
    try:
        motion = ArmMotion(setup)
    except PeerError as error:
        return [], [f"other programs ({', '.join(installed)}): {error}"]
    methods: list[MethodUnderTest] = []
    left_out = [f"{name}: not installed" for name in PEERS if name not in installed]
    for name in installed:
        try:
            if name in _FREE_MOTION_ONLY and not motion.free:
                raise PeerError("it is used for free motion only")
            methods += PEERS[name](motion)
        except PeerError as error:
            left_out.append(f"{name}: {error}")
        except ImportError as error:
            left_out.append(f"{name}: cannot be imported ({shorten(error, 200)})")
    return methods, left_out
