"""Benchmarks, both sides in one run: time per call, medians over repeats that alternate between the sides.

overhead = t(Robot) − t(bare Pinocchio)
"""

from __future__ import annotations

import argparse
import platform
import re
import subprocess
import sys
import timeit
from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from statistics import median

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

import robot_dyn as rd

BATCH = 4096


def seconds(call: Callable[[], object], at_least: float) -> float:
    """Time of one call, over a loop of about `at_least` seconds."""
    timer, number = timeit.Timer(call), 1
    while (taken := timer.timeit(number)) < at_least:
        number = max(2 * number, int(1.2 * number * at_least / max(taken, 1e-9)))
    return taken / number


def alternate(calls: Mapping[str, Callable[[], object]], repeats: int, at_least: float) -> dict[str, float]:
    """Median time of each call in µs; the calls take turns, so that the machine's moods meet all of them."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            times[name].append(seconds(call, at_least))
    return {name: 1e6 * median(samples) for name, samples in times.items()}


def arms() -> dict[str, rd.Robot]:
    """The arms of every table."""
    return {"UR5": rd.load("ur5"), "Panda-7": rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})}


def both_sides(robot: rd.Robot, state: np.ndarray) -> dict[str, tuple[Callable[[], object], Callable[[], object]]]:
    """Each query as the bare call of Pinocchio and as the call of a Robot."""
    q, v, a = state
    model = robot.model
    data = model.createData()
    return {
        "M": (lambda: pin.crba(model, data, q), lambda: robot.M(q)),
        "C": (lambda: pin.computeCoriolisMatrix(model, data, q, v), lambda: robot.C(q, v)),
        "N": (lambda: pin.computeGeneralizedGravity(model, data, q), lambda: robot.N(q)),
        "inverse_dynamics": (lambda: pin.rnea(model, data, q, v, a), lambda: robot.inverse_dynamics(q, v, a)),
        "forward_dynamics": (lambda: pin.aba(model, data, q, v, a), lambda: robot.forward_dynamics(q, v, a)),
    }


def queries(repeats: int, at_least: float) -> None:
    """Robot against the bare call of Pinocchio, and the own Lagrangian beside it."""
    print("| arm | query | pin, µs | Robot, µs | over it, µs | Lagrangian, µs | Lagrangian, µs per state of 4096 |")
    print("|---|---|--:|--:|--:|--:|--:|")
    for arm, robot in arms().items():
        rng = np.random.default_rng(1)
        state, batch = rng.normal(size=(3, robot.n)), rng.normal(size=(3, BATCH, robot.n))
        own = rd.Lagrangian(robot)
        for name, (bare, ours) in both_sides(robot, state).items():
            arguments = {"M": 1, "N": 1, "C": 2}.get(name, 3)
            t = alternate({"pin": bare, "Robot": ours}, repeats, at_least)
            t |= alternate({"one": partial(getattr(own, name), *state[:arguments])}, repeats, at_least)
            t |= alternate({"batch": partial(getattr(own, name), *batch[:arguments])}, repeats // 2 + 1, at_least)
            print(
                f"| {arm} | {name} | {t['pin']:.2f} | {t['Robot']:.2f} | {t['Robot'] - t['pin']:.2f}"
                f" | {t['one']:.0f} | {t['batch'] / BATCH:.2f} |"
            )
    startup(repeats)


def startup(repeats: int) -> None:
    """Whole processes: an empty one, the import, the help."""
    code = {
        "python -c pass": "pass",
        "import robot_dyn": "import robot_dyn",
        "robot-dyn --help": "import sys; sys.argv[1:] = ['--help']; from robot_dyn.cli import main; main()",
    }
    calls = {
        name: partial(subprocess.run, [sys.executable, "-c", text], check=True, stdout=subprocess.DEVNULL)
        for name, text in code.items()
    }
    print("\n| process | s |\n|---|--:|")
    for name, microseconds in alternate(calls, repeats, 0.0).items():
        print(f"| `{name}` | {microseconds / 1e6:.2f} |")


def environment() -> str:
    """Versions and processor, without which a time says nothing."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("pin", "numpy"))
    info = Path("/proc/cpuinfo")  # Linux; elsewhere the name of the architecture must do
    names = re.findall(r"model name\s*: (.*)", info.read_text() if info.exists() else "")
    return f"Python {platform.python_version()}, {packages}, {(names or [platform.processor()])[0]}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="?", choices=["queries"], default="queries")
    parser.add_argument("--quick", action="store_true", help="short loops: to see that it runs, not for figures")
    options = parser.parse_args()
    print(environment(), end="\n\n")
    queries(*((3, 0.002) if options.quick else (11, 0.1)))
