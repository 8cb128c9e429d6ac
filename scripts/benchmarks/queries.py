"""Queries of a Robot against bare Pinocchio: overhead = t(Robot) − t(bare call); and whole processes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

import robot_dyn as rd
from benchmarks.measure import BATCH, Effort, alternate, arms, lowest, row, table
from robot_dyn.queries.dynamics import QUANTITIES

Sides = dict[str, tuple[str, Callable[[], object], Callable[[], object]]]  # what is called bare, and both calls


def both_sides(robot: rd.Robot, state: np.ndarray) -> Sides:
    """Each query as the bare calls that answer it for all joints of the model, and as the call of a Robot."""
    q, v, a = state
    Q, V, A = robot.couplings.position(q), robot.couplings.velocity(v), robot.couplings.velocity(a)
    model, data = robot.model, robot.model.createData()
    weightless = model.copy()
    weightless.gravity = pin.Motion.Zero()
    frame = robot.frame_names[-1]
    index = model.getFrameId(frame, pin.FrameType.BODY)

    def placement() -> Any:
        pin.forwardKinematics(model, data, Q)
        return pin.updateFramePlacement(model, data, index)

    def jacobian(axes: Any = pin.LOCAL) -> Any:
        return pin.computeFrameJacobian(model, data, Q, index, axes)

    def turned() -> Any:
        return placement().rotation @ jacobian().reshape(2, 3, -1)

    def rate(axes: Any) -> Any:
        pin.computeJointJacobiansTimeVariation(model, data, Q, V)
        return pin.getFrameJacobianTimeVariation(model, data, index, axes)

    def M() -> Any:
        return pin.crba(model, data, Q)

    def C() -> Any:
        return pin.computeCoriolisMatrix(model, data, Q, V)

    def ours(name: str, **options: str) -> Callable[[], object]:
        given = [dict(zip("qva", state, strict=True)).get(x, a) for x in QUANTITIES[name].arguments]
        return partial(getattr(robot, name), *given, *[frame] * QUANTITIES[name].framed, **options)

    bare: dict[str, tuple[str, Callable[[], object]]] = {
        "M": ("crba", M),
        "C": ("computeCoriolisMatrix", C),
        "N": ("computeGeneralizedGravity", lambda: pin.computeGeneralizedGravity(model, data, Q)),
        "coriolis_torque": ("nonLinearEffects", lambda: pin.nonLinearEffects(weightless, data, Q, V)),
        "coriolis_transpose": ("v · computeCoriolisMatrix", lambda: V.dot(C())),
        "inverse_dynamics": ("rnea", lambda: pin.rnea(model, data, Q, V, A)),
        "forward_dynamics": ("aba", lambda: pin.aba(model, data, Q, V, A)),
        "kinetic_energy": ("v · crba · v / 2", lambda: V.dot(M().dot(V)) / 2),
        "potential_energy": ("computePotentialEnergy", lambda: pin.computePotentialEnergy(model, data, Q)),
        "momentum": ("crba · v", lambda: M().dot(V)),
        "regressor": ("computeJointTorqueRegressor", lambda: pin.computeJointTorqueRegressor(model, data, Q, V, A)),
        "placement": ("forwardKinematics, updateFramePlacement", lambda: placement().homogeneous),
    }
    sides = {name: (text, call, ours(name)) for name, (text, call) in bare.items()}
    for axes, text, call in (
        ("body", "computeFrameJacobian", jacobian),
        ("world", "computeFrameJacobian", partial(jacobian, pin.WORLD)),
        ("world_aligned", "the same in body axes, and turned", turned),
    ):
        sides[f"jacobian, {axes}"] = text, call, ours("jacobian", expressed_in=axes)
    for axes, reference in (("world", pin.WORLD), ("world_aligned", pin.LOCAL_WORLD_ALIGNED)):
        text = "computeJointJacobiansTimeVariation, getFrameJacobianTimeVariation"
        sides[f"jacobian_rate, {axes}"] = text, partial(rate, reference), ours("jacobian_rate", expressed_in=axes)
    return sides


def queries(effort: Effort) -> None:
    """Every query of a Robot against the bare calls of Pinocchio."""
    subjects = arms() | {arm: rd.load(arm.lower()) for arm in ("Panda", "Z1", "Kinova")}
    sides = {}
    for arm, robot in subjects.items():
        q, v, a = np.random.default_rng(1).normal(size=(3, robot.n))
        sides[arm] = both_sides(robot, np.array([np.clip(q, robot.lower, robot.upper), v, a]))
    table("query", "bare calls", *(heading for arm in subjects for heading in (f"{arm}, µs", "over it")))
    for name, (text, *_) in sides["UR5"].items():
        cells = []
        for arm in subjects:
            _, bare, ours = sides[arm][name]
            t = lowest({"bare": bare, "Robot": ours}, effort)
            cells += [f"{t['bare']:.2f}", f"{t['Robot'] - t['bare']:.2f}"]
        row(name, text, *cells)
    table("arm", "C by", "bound of Pinocchio's rounding")
    for arm, robot in subjects.items():
        way = "body axes" if robot.coriolis.regrouped is None else "Pinocchio"
        row(arm, way, f"{robot.coriolis.rounding:.1e}")


def lagrangian(effort: Effort) -> None:
    """The own Lagrangian, one state and a batch."""
    table("arm", "query", "Lagrangian, µs", f"µs per state of {BATCH}")
    for arm, robot in arms().items():
        rng = np.random.default_rng(1)
        state, batch = rng.normal(size=(3, robot.n)), rng.normal(size=(3, BATCH, robot.n))
        own = rd.Lagrangian(robot)
        for name in ("M", "C", "N", "inverse_dynamics", "forward_dynamics"):
            arguments = len(QUANTITIES[name].arguments)
            t = alternate({"one": partial(getattr(own, name), *state[:arguments])}, effort)
            fewer = replace(effort, repeats=effort.repeats // 2 + 1)
            t |= alternate({"batch": partial(getattr(own, name), *batch[:arguments])}, fewer)
            row(arm, name, f"{t['one']:.0f}", f"{t['batch'] / BATCH:.2f}")


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
