"""A stress test of an arm: its worst configurations, what breaks first, and runs that are judged."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from robot_dyn.accuracy.budget import Budget
from robot_dyn.accuracy.environment import environment
from robot_dyn.accuracy.worst_state import random_states
from robot_dyn.errors import RobotDynError
from robot_dyn.model.robot import Robot
from robot_dyn.stress_test.finding import Judged, Limit, Worst
from robot_dyn.stress_test.gains import gain_limit
from robot_dyn.stress_test.lines import Loading
from robot_dyn.stress_test.loads import payload_limit, speed_limit
from robot_dyn.stress_test.lost_digits import lost_digits
from robot_dyn.stress_test.result import Stress
from robot_dyn.stress_test.runs import judged_runs
from robot_dyn.stress_test.steps import held, step_limits
from robot_dyn.stress_test.worst import FASTEST, pd_gains, worst_configurations
from robot_dyn.validate import function, instance, integer, number

_LEAST_SAMPLES, _MOST_SAMPLES, _MOST_RUNS = 100, 10**6, 10**5

Found = Worst | Limit | Judged | str  # words are of what was left out


def stress(
    robot: Robot,
    *,
    samples: int = 10_000,
    runs: int = 7,
    seed: int = 0,
    budget_s: float = 100.0,
    on_progress: Callable[[float, str], object] | None = None,
) -> Stress:
    """The worst configurations of an arm, the step, gain, speed and payload at which it breaks, and runs judged.

    Worst configurations are searched for from random states on: κ of M, the fastest motion, gravity torque over effort
    limit, and digits lost by each road. Limits are confirmed at 0.98 and 1.02 of them. Estimated errors of random runs
    are held against better runs; one that is too small, and says nothing, misleads.

    Args:
        robot: The robot.
        samples: Number of random states.
        runs: Number of random runs.
        seed: Of the random generator.
        budget_s: Time to spend, in [s]; what is to come when it ends is left out.
        on_progress: Called with the time spent, in [s], and with what is being done.

    Raises:
        QueryError: If an argument is wrong.
    """
    robot = instance("robot", robot, Robot, "give one of rd.load")
    return stressed(robot, Loading.of(robot), samples, runs, seed, budget_s, on_progress)


def stressed(
    robot: Robot, loading: Loading, samples: int, runs: int, seed: int, budget_s: float,
    on_progress: Callable[[float, str], object] | None,
) -> Stress:  # fmt: skip
    """The same of a robot that is loaded so."""
    samples = integer("samples", samples, least=_LEAST_SAMPLES, most=_MOST_SAMPLES)
    runs, seed = integer("runs", runs, most=_MOST_RUNS), integer("seed", seed, most=2**128 - 1)
    seconds = number("budget_s", budget_s, above=0)
    budget = Budget(seconds, function("on_progress", on_progress, "(spent, what)"))
    robot, found, interrupted = robot.warn_below(None), list[Found](_unlimited(robot)), False
    try:
        for name, part in _parts(robot, loading, samples, runs, seed, budget.tell):
            try:
                for each in part:
                    found.append(each)
                    if budget.left <= 0:
                        found.append(f"{name}: the rest, as the budget of {seconds:g} s ended")
                        break
            except RobotDynError as error:
                found.append(f"{name}: {error}")
            except np.linalg.LinAlgError as error:
                found.append(f"{name}: {error}; M is near a singular one")
    except KeyboardInterrupt:
        interrupted = True
        found.append("what was to come when it was interrupted")

    def of(kind: type) -> tuple[Any, ...]:
        return tuple(each for each in found if isinstance(each, kind))

    return Stress(
        robot.name, robot.joint_names, of(Worst), of(Limit), of(Judged), of(str), loading, environment(), samples,
        seed, budget.spent, interrupted,
    )  # fmt: skip


def _parts(
    robot: Robot, loading: Loading, samples: int, runs: int, seed: int, tell: Callable[[str], object]
) -> Iterator[tuple[str, Iterable[Found]]]:
    """The parts of the test; each begins when it is asked for, with a generator of its own."""
    streams = [np.random.default_rng(each) for each in np.random.SeedSequence(seed).spawn(6)]
    tell("random states")
    states = random_states(robot, samples, streams[0])
    found: list[Worst] = []
    yield "worst configurations", _kept(found, worst_configurations(robot, states, streams[1], loading.words, tell))
    moves = robot.joint_without_inertia is None
    gains = pd_gains(robot, states) if moves else None
    yield "speed", (speed_limit(robot, states, streams[2], tell) for _ in range(1))
    yield "payload", (payload_limit(robot, states, streams[3], gains, tell) for _ in range(1))
    fastest = [each for each in found if each.what == FASTEST]
    if gains is not None and fastest:
        setup = held(robot, np.array(fastest[-1].state["q"]), gains, fastest[-1].minimal)
        yield "steps", step_limits(setup, seed, tell)
        yield "gains", (gain_limit(setup, seed, tell) for _ in range(1))
    yield "digits", lost_digits(robot, states, streams[4], loading.words, tell)
    if moves:
        yield "runs", judged_runs(robot, states, runs, streams[5], tell)
    else:
        why = f"joint {robot.joint_without_inertia!r} carries no inertia"
        yield (
            "without forward dynamics",
            (f"{what}: {why}" for what in ("κ of M", "fastest motion, steps and gains", "runs")),
        )


def _kept(into: list[Worst], those: Iterable[Worst]) -> Iterator[Worst]:
    """The same, kept as they come."""
    for each in those:
        into.append(each)
        yield each


def _unlimited(robot: Robot) -> Iterator[str]:
    """What the file does not limit."""
    for what, limit in (("effort", robot.effort_limit), ("velocity", robot.velocity_limit)):
        without = [name for name, x in zip(robot.joint_names, limit, strict=True) if not (np.isfinite(x) and x > 0)]
        if without:
            instead = "" if what == "effort" else "; 1 rad/s or 1 m/s is taken"
            yield f"joints without an {what} limit: {', '.join(without)}{instead}".replace("an velocity", "a velocity")
