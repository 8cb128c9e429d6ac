"""A stress test of an arm: worst configurations, first limits, and judged runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from robot_dyn import Robot
from robot_dyn.accuracy import random_states, warn_below
from robot_dyn.foundations import function, instance, integer, number
from robot_dyn.report import INTERRUPTED, Budget, processor_and_versions
from robot_dyn.tools.stress.limits import gain_limit, holding_setup, payload_limit, speed_limit, step_limits
from robot_dyn.tools.stress.result import Finding, JudgedRun, Limit, Stress, WorstCase
from robot_dyn.tools.stress.runs import judged_runs
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import BY_PD, FASTEST, HELD, lost_digits, pd_gains, worst_configurations

_LEAST_SAMPLES, _MOST_SAMPLES, _MOST_RUNS = 100, 10**6, 10**5
_PIECES = 8  # one piece of work may take at most this part of the budget


def stress(
    robot: Robot,
    *,
    samples: int = 10_000,
    runs: int = 7,
    seed: int = 0,
    budget_s: float = 90.0,
    on_progress: Callable[[float, str], object] | None = None,
) -> Stress:
    """Find the worst configurations of an arm, its limits of step, gain, speed and payload, and misleading runs.

    The search for worst configurations begins at random states: κ of M, the fastest motion, gravity torque over effort
    limit, and digits lost by each implementation. Limits are checked at 0.98 and 1.02 of their values. Estimated errors
    of random runs are compared with better runs; a run misleads if its estimate is too small and there is no warning.

    Args:
        robot: The robot.
        samples: Number of random states.
        runs: Number of random runs.
        seed: Seed of the random generator.
        budget_s: Time to spend, in [s]. Parts that remain at its end, or take more than an eighth of it, are listed in
            `out_of_time`; with enough time for all parts, the result depends only on the seed.
        on_progress: Function of the elapsed time, in [s], and the name of the current part.

    Raises:
        QueryError: If an argument is invalid.
    """
    robot = warn_below(instance("robot", robot, Robot, "give a robot, such as rd.load('ur5')"), None)
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

    def of_kind(kind: type) -> tuple[Any, ...]:
        return tuple(finding for finding in findings if isinstance(finding, kind))

    return Stress(
        robot=robot.name,
        joints=robot.joint_names,
        worst=of_kind(WorstCase),
        limits=of_kind(Limit),
        runs=of_kind(JudgedRun),
        left_out=(*_unlimited(robot), *work.left_out),
        out_of_time=tuple(work.out_of_time),
        environment=processor_and_versions(),
        samples=samples,
        seed=seed,
        spent_s=budget.spent,
    )


def _findings(robot: Robot, samples: int, runs: int, seed: int, work: Work) -> Iterator[Finding | None]:
    """Yield the findings of all parts, None for skipped ones; the parts have independent random generators."""
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
        setup = work.do("start of steps and gain", lambda _: holding_setup(robot, at, gains, rate), HELD)
    if setup is not None:
        yield from step_limits(setup, seed, work)
        yield work.do("largest gain", lambda budget: gain_limit(setup, seed, budget))
    yield from lost_digits(robot, states, streams[4], work)
    if massless is None:
        yield from judged_runs(robot, states, runs, streams[5], work)


def _unlimited(robot: Robot) -> Iterator[str]:
    """Yield a message about joints without limits in the file."""
    default = "; 1 rad/s or 1 m/s is assumed"
    for kind, limit, note in (("an effort", robot.effort_limit, ""), ("a velocity", robot.velocity_limit, default)):
        without = [name for name, x in zip(robot.joint_names, limit, strict=True) if not (np.isfinite(x) and x > 0)]
        if without:
            yield f"joints without {kind} limit: {', '.join(without)}{note}"
