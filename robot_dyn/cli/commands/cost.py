"""Commands for the cost of digits, effects and algorithms, and for the choice of steps."""

from __future__ import annotations

from math import isfinite
from typing import Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.application import DYNAMICS, SIMULATION, VERIFICATION, bar, command
from robot_dyn.cli.options import AS_STATED, PRINTED, Budget, Json, Name, Repeats, Results, RobotOptions, Scene
from robot_dyn.cli.terminal import show
from robot_dyn.foundations.errors import QueryError

_DURATION_S = 1.0


@command(VERIFICATION)
def work_precision(
    source: Annotated[str, typer.Argument(autocompletion=completion.robots)],
    /,
    budget: Budget = 30.0,
    repeats: Repeats = 25,
    method: list[str] | None = None,
    peers: bool = True,
    q: str | None = None,
    v: str | None = None,
    duration: float | None = None,
    options: RobotOptions = AS_STATED,
    results: Results = PRINTED,
) -> None:
    """Measure computing time against accuracy, by method and peer.

    The table lists the time for a number of correct digits. Ctrl-C ends the measurement and keeps finished runs.

    Options:
        source (SCENE.toml|ROBOT): A scene file, or a robot for a free swing.
        method (METHOD): Only this method; may be repeated; all by default.
        peers: Also run other installed programs that can simulate the motion.
        q: Start of a robot, in the form of `query --q`; random by default.
        v: Velocities at the start; 0 by default.
        duration (SECONDS): Duration of the robot's motion; 1 by default.
    """
    paths = results.files(rd.accuracy.WorkPrecision, source)
    setup = _setup(source, q, v, duration, options)
    with bar(budget, "starting") as spent:
        result = rd.accuracy.work_precision(
            setup, methods=method, peers=peers, budget_s=budget, repeats=repeats, on_progress=spent
        )
    results.give(result, paths)


@command(DYNAMICS)
def cost(scene: Scene, /, budget: Budget = 10.0, repeats: Repeats = 25, results: Results = PRINTED) -> None:
    """Count instructions and time of effects, control and terms.

    Each part of a time step is switched on and off, and alternative algorithms are compared.
    """
    paths = results.files(rd.accuracy.Cost, scene)
    setup = rd.read_scene(scene)
    with bar(budget, "starting") as spent:
        result = rd.accuracy.cost(setup, budget_s=budget, repeats=repeats, on_progress=spent)
    results.give(result, paths)


@command(VERIFICATION)
def certify(
    robot: Name,
    /,
    samples: int = 10000,
    seed: int = 0,
    repeats: Annotated[int, typer.Option(min=1)] = 7,
    q: str | None = None,
    v: str | None = None,
    a: str | None = None,
    tau: str | None = None,
    options: RobotOptions = AS_STATED,
    results: Results = PRINTED,
) -> None:
    """Count the correct digits of M, C, N and the dynamics.

    Digits and times are listed by program and type of number.

    Options:
        samples: Number of random states.
        seed: Seed of the random states.
        repeats: Number of timings of each query.
        q: Positions of a state to certify as well, in the form of `query --q`.
        v: Velocities of this state; 0 by default.
        a: Accelerations of this state, for inverse dynamics; 0 by default.
        tau: Torques of this state, for forward dynamics; 0 by default.
    """
    paths = results.files(rd.accuracy.Certificate, robot)
    arm = options.load(robot)
    given = {"q": q, "v": v, "a": a, "tau": tau}
    state = {key: arguments.vector(f"--{key}", x, arm.joint_names) for key, x in given.items() if x is not None}
    with bar(1.0, "starting") as done:
        result = rd.accuracy.certify(arm, **state, samples=samples, seed=seed, repeats=repeats, on_progress=done)
    results.give(result, paths)


@command(SIMULATION)
def advise(scene: Scene, /, as_json: Json = False) -> None:
    """Check whether step and control period are short enough.

    It also estimates the error. The exit code is 1 if they are not short enough.
    """
    setup = rd.read_scene(scene)
    with bar(description="analysing the loop"):
        advice = rd.advise(setup)
    show(advice, as_json=as_json)
    if not advice.stable:
        raise typer.Exit(1)


def _setup(source: str, q: str | None, v: str | None, duration: float | None, options: RobotOptions) -> rd.Setup:
    """Return the setup of a scene file, or of the free swing of a robot."""
    if setup := arguments.scene(source, {"--q": q, "--v": v, "--duration": duration} | options.stated):
        return setup
    import numpy as np

    robot = options.load(source)
    names = robot.joint_names
    start: Any = (
        robot.random_configuration(np.random.default_rng(0)) if q is None else arguments.vector("--q", q, names)
    )
    seconds = _DURATION_S if duration is None else duration
    if not (isfinite(seconds) and seconds > 0):
        raise QueryError(f"--duration must be positive, got {seconds:g}")
    return rd.Setup(rd.Plant(robot), start, arguments.vector("--v", v, names), duration_s=seconds)
