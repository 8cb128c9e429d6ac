"""Queries of a Robot against bare Pinocchio: overhead = t(Robot) − t(bare call); and whole processes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

import robot_dyn as rd
from benchmarks.measure import BATCH, Effort, alternate, arms, row, table


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


def queries(effort: Effort) -> None:
    """Robot against the bare call of Pinocchio, and the own Lagrangian beside it."""
    table(
        "arm", "query", "pin, µs", "Robot, µs", "over it, µs", "Lagrangian, µs", f"Lagrangian, µs per state of {BATCH}"
    )
    for arm, robot in arms().items():
        rng = np.random.default_rng(1)
        state, batch = rng.normal(size=(3, robot.n)), rng.normal(size=(3, BATCH, robot.n))
        own = rd.Lagrangian(robot)
        for name, (bare, ours) in both_sides(robot, state).items():
            arguments = {"M": 1, "N": 1, "C": 2}.get(name, 3)
            t = alternate({"pin": bare, "Robot": ours}, effort)
            t |= alternate({"one": partial(getattr(own, name), *state[:arguments])}, effort)
            fewer = replace(effort, repeats=effort.repeats // 2 + 1)
            t |= alternate({"batch": partial(getattr(own, name), *batch[:arguments])}, fewer)
            over = t["Robot"] - t["pin"]
            numbers = (f"{t['pin']:.2f}", f"{t['Robot']:.2f}", f"{over:.2f}", f"{t['one']:.0f}")
            row(arm, name, *numbers, f"{t['batch'] / BATCH:.2f}")


def right_angles(effort: Effort) -> None:
    """Machine code with right angles written out in full, and with those of the file: the same literals, longer."""
    table("arm", "query", "instructions, off", "on", f"µs per state of {BATCH}, off", "on", "off/on")
    robot = arms()["UR5"]
    batch = np.random.default_rng(1).normal(size=(3, BATCH, robot.n))
    sides = {"off": rd.Compiled(as_stated(robot)), "on": rd.Compiled(robot)}
    for name, arguments in (("forward_dynamics", 3), ("inverse_dynamics", 3), ("M", 1)):
        t = alternate({side: partial(getattr(each, name), *batch[:arguments]) for side, each in sides.items()}, effort)
        counts = [min(each.instructions[name].values()) for each in sides.values()]
        off, on = (t[side] / BATCH for side in sides)
        row("UR5", name, *counts, f"{off:.4f}", f"{on:.4f}", f"{off / on:.2f}")


def as_stated(robot: rd.Robot) -> rd.Robot:
    """The robot with all decimals of its angles, zeros at the end, so that none is taken as a right angle."""
    root = etree.fromstring(robot.description.xml)
    for origin in root.iterfind("joint/origin"):
        origin.set("rpy", " ".join(f"{float(x):.15f}" for x in origin.get("rpy", "0 0 0").split()))
    return rd.Robot(replace(robot.description, xml=etree.tostring(root)), robot.edits)


def startup(effort: Effort) -> None:
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
    table("process", "s")
    for name, microseconds in alternate(calls, replace(effort, at_least=0.0)).items():
        row(f"`{name}`", f"{microseconds / 1e6:.2f}")
