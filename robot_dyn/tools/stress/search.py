"""A stress test of an arm: its worst configurations, what breaks first, and runs that are judged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from robot_dyn import Robot
from robot_dyn.accuracy import random_states, warn_below
from robot_dyn.foundations import function, instance, integer, number
from robot_dyn.report import INTERRUPTED, Budget, processor_and_versions
from robot_dyn.tools.stress.limits import gain_limit, held, payload_limit, speed_limit, step_limits
from robot_dyn.tools.stress.result import Finding, JudgedRun, Limit, Stress, WorstCase
from robot_dyn.tools.stress.runs import judged_runs
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import BY_PD, FASTEST, HELD, lost_digits, pd_gains, worst_configurations

_LEAST_SAMPLES, _MOST_SAMPLES, _MOST_RUNS = 100, 10**6, 10**5
_PIECES = 8  # of the budget; one piece of work may take this part of it


def stress(
    robot: Robot,
    *,
    samples: int = 10_000,
    runs: int = 7,
    seed: int = 0,
    budget_s: float = 90.0,
    on_progress: Callable[[float, str], object] | None = None,
) -> Stress:
    """The worst configurations of an arm, the step, gain, speed and payload at which it breaks, and runs judged.

    Worst configurations are searched for from random states on: κ of M, the fastest motion, gravity torque over effort
    limit, and digits lost by each implementation. Limits are confirmed at 0.98 and 1.02 of them. Estimated errors of
    random runs are compared with better runs; a run misleads if its estimate is too small and nothing warns.

    Args:
        robot: The robot.
        samples: Number of random states.
        runs: Number of random runs.
        seed: Of the random generator.
        budget_s: Time to spend, in [s]. What is to come when it ends, or takes more than an eighth of it, is named in
            `out_of_time`; with time enough for all, what is found depends on the seed alone.
        on_progress: Called with the time spent, in [s], and with what is being done.

    Raises:
        QueryError: If an argument is wrong.
    """
    robot = warn_below(instance("robot", robot, Robot, "give one of rd.load"), None)
    samples = integer("samples", samples, least=_LEAST_SAMPLES, most=_MOST_SAMPLES)
    runs, seed = integer("runs", runs, most=_MOST_RUNS), integer("seed", seed, most=2**128 - 1)
    seconds = number("budget_s", budget_s, above=0)
    budget = Budget(seconds, function("on_progress", on_progress, "(spent, what)"))
    work, findings = Work(budget, seconds / _PIECES), list[Finding | None]()
    try:
        for finding in _findings(robot, samples, runs, seed, work):
            findings.append(finding)
    except KeyboardInterrupt:
        work.left_out.append(INTERRUPTED)

    def of(kind: type) -> tuple[Any, ...]:
        return tuple(finding for finding in findings if isinstance(finding, kind))

    return Stress(
        robot.name, robot.joint_names, of(WorstCase), of(Limit), of(JudgedRun), (*_unlimited(robot), *work.left_out),
        tuple(work.out_of_time), processor_and_versions(), samples, seed, budget.spent,
    )  # fmt: skip


def _findings(robot: Robot, samples: int, runs: int, seed: int, work: Work) -> Iterator[Finding | None]:
    """The findings of all parts, None for what was skipped; each part has a random generator of its own."""
    streams = [np.random.default_rng(stream) for stream in np.random.SeedSequence(seed).spawn(6)]
    states = work.do("random states", lambda _: random_states(robot, samples, streams[0]), ("all at these",))
    if states is None:
        return
    gains = fastest = setup = None
    if (massless := robot.joint_without_inertia) is None:
        gains = work.do("gains of a PD", lambda _: pd_gains(robot, states), (f"worst {FASTEST} under it", *HELD))
    else:
        parts = ("κ of M", "fastest motion, steps and gains", "runs")
        work.left_out += [f"{part}: joint {massless!r} carries no inertia" for part in parts]
    for case in worst_configurations(robot, states, streams[1], gains, work):
        fastest = case if case.note == BY_PD else fastest
        yield case
    yield work.do("speed", lambda budget: speed_limit(robot, states, streams[2], budget))
    yield work.do("payload", lambda budget: payload_limit(robot, states, streams[3], gains, budget))
    if gains is not None and fastest is not None:
        at, rate = np.array(fastest.state["q"]), fastest.minimal
        setup = work.do("start of steps and gain", lambda _: held(robot, at, gains, rate), HELD)
    if setup is not None:
        yield from step_limits(setup, seed, work)
        yield work.do("largest gain", lambda budget: gain_limit(setup, seed, budget))
    yield from lost_digits(robot, states, streams[4], work)
    if massless is None:
        yield from judged_runs(robot, states, runs, streams[5], work)


def _unlimited(robot: Robot) -> Iterator[str]:
    """What the file does not limit."""
    taken = "; 1 rad/s or 1 m/s is taken"
    for what, limit, instead in (("an effort", robot.effort_limit, ""), ("a velocity", robot.velocity_limit, taken)):
        without = [name for name, x in zip(robot.joint_names, limit, strict=True) if not (np.isfinite(x) and x > 0)]
        if without:
            yield f"joints without {what} limit: {', '.join(without)}{instead}"
