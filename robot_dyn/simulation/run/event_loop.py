"""The time loop of a run whose steps are chosen, or cut at events: samples lie between the ends of steps.

Plain functions of arrays, for one run, as of `time_loop`. The dense output of a step brackets a root of a switching
function g; the step is then repeated, up to where g vanishes after it, which keeps the order of the method:

    g(step(t, y, θ h)) = 0

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.6; Shampine, Thompson 2000]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.bernstein import NONE
from robot_dyn.integrate.primitives import between, copy
from robot_dyn.integrate.step_control import At, chosen_step, finite, first_step, shortened
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Now, Rules, Runs
from robot_dyn.simulation.events.crossings import (
    Switches,
    approaches,
    correction,
    nears,
    remember,
    settle_sides,
)
from robot_dyn.simulation.events.detection import FASTEST
from robot_dyn.simulation.events.first_event import first_event
from robot_dyn.simulation.events.holding import Holding
from robot_dyn.simulation.events.sides import Sides, goes_on
from robot_dyn.simulation.run.recording import Records, log_step, sample, share, show
from robot_dyn.simulation.run.time_loop import act, acts, conserve
from robot_dyn.simulation.setup.segment_table import SegmentTable

_EARLY = 1e-9  # of a period: a sample at the end of a segment belongs to the next one
_ROOTS = 6  # repetitions of a step for an event, at most
_SHORT = 1e-8  # of a step: over so little of it y is a straight line, to rounding
_WATCHED = 8  # steps between looks at the energy


class Times(NamedTuple):
    """Times as numbers.

    Attributes:
        reached: The time reached, (1,), in [s].
        period, compared: Periods of samples and of shared states, in [s]; inf for none.
        nodes, every: Whether there is a sample at the start of every segment, and at the end of every step, too.
        end: Of the run.
        mesh: Where steps end, (k,), if they are to do so at given times; error control makes more of them.
    """

    reached: Array
    period: float
    compared: float
    nodes: bool
    every: bool
    end: float
    mesh: Array


def event_loop(
    begin: Callable[..., int], step: Callable[..., int], error: Callable[..., float], accept: Callable[..., int],
    dense: Callable[..., int], end_mode: Callable[..., int],
) -> Callable[..., int]:  # fmt: skip
    """The time loop of the functions of a method, see `ControlledStepper`, and of the end of a mode, as of `end_mode`.

    advance(functions, plan, runs, records, times, rules, coefficients, work, switches, sides, holding, now, control,
    stop) → Ended, with `control` as of `control_of`; `stop[0]` other than 0 ends it.
    """
    choose = chosen_step(step, error)

    def cut(
        f: Functions, c: Any, t: float, whole: float, theta: float, p: Array, runs: Runs, work: Any,
        switches: Switches, event: int, control: Array,
    ) -> tuple[int, float, float, float]:  # fmt: skip
        """The step repeated, up to where a switching function vanishes after it, but for the last bit of its length.

        Its evaluations, its length, that bit, over which y is a straight line, and its error as of `error`: it may pass
        slowly through what the whole step leapt over, as friction near v = 0.
        """
        h, evaluations, y, after, e = theta * whole, 0, runs.y, runs.after, 0.0
        for k in range(_ROOTS):
            if abs(h) <= np.spacing(abs(t)):  # immediately, as right behind another event
                copy(after, y)
                copy(work.last, work.K[0])
                return evaluations, 0.0, 0.0, 0.0
            evaluations += step(f, c, t, h, y, p, runs.run_parameters, after, work, runs.lost)
            if control[At.RTOL] + control[At.ATOL] > 0.0:  # 0 for steps of a fixed length
                e = error(c, h, y, after, work, control[At.RTOL], control[At.ATOL])
            evaluations += accept(f, c, t, h, y, p, runs.run_parameters, after, work)
            shift = correction(f, t, h, whole, y, p, runs, work, switches, event)
            if not abs(shift) > _SHORT * h:
                return evaluations, h, shift, e
            if k == _ROOTS - 1 or (abs(shift) > h and event >= len(switches.exact)):
                break  # a function that jumps, say: where it is bracketed
            h = max(h + shift, 0.0)
        return evaluations, h, 0.0, e

    def advance(
        f: Functions, table: SegmentTable, runs: Runs, records: Records, times: Times, rules: Rules, c: Any, work: Any,
        switches: Switches, sides: Sides, holding: Holding, now: Array, control: Array, stop: Array,
    ) -> int:  # fmt: skip
        last = len(table.counts) - 1
        run_parameters, y, after = runs.run_parameters, runs.y, runs.after
        while now[Now.SEGMENT] <= last:
            s: int = now[Now.SEGMENT]
            start, p = table.starts[s], table.parameters[s]
            if table.payload_events[s] == 1:
                return Ended.PAYLOAD
            if now[Now.STEP] == 0:
                if table.ticks[s] > 0 and not act(f, runs, rules, start, table.at_ticks[s], table.ticks[s]):
                    return Ended.TICK
                node(f, runs, records, times, now, start, p)
                times.reached[0] = start
                now[Now.STEP] = 1
            if s == last:
                now[Now.SEGMENT] += 1
                continue
            end = table.starts[s + 1]
            if now[Now.STEP] == 1:  # at the start of a segment, and behind an event
                now[Now.EVALUATIONS] += begin(f, c, times.reached[0], y, p, run_parameters, work)
                if not finite(work.K[0]):
                    return Ended.NOT_FINITE
                remember(times.reached[0], y, p, run_parameters, switches)
                if control[At.NEXT] == 0.0 and control[At.RTOL] + control[At.ATOL] > 0.0:
                    now[Now.EVALUATIONS] += first_step(
                        f, times.reached[0], end, y, p, run_parameters, after, work, control
                    )
                now[Now.STEP] = 2
            while times.reached[0] < end:
                t = times.reached[0]
                made, found = choose(f, c, t, end, y, p, run_parameters, after, work, runs.lost, control, times.mesh)
                now[Now.EVALUATIONS] += made
                if found != 0:
                    return Ended.TOO_SMALL
                h, t1 = control[At.TAKEN], control[At.END]
                now[Now.EVALUATIONS] += accept(f, c, t, h, y, p, run_parameters, after, work)
                has_dense, event, theta, rest = False, -1, NONE, 0.0
                if len(switches.sides) > 0:
                    near = nears(t1, after, p, run_parameters, switches)
                    if near or approaches(y, after, h, work.K[0], work.last, rules, switches):
                        now[Now.EVALUATIONS] += dense(f, c, t, h, y, p, run_parameters, after, work)
                        event, theta = first_event(f, t, h, y, p, runs, work.F, switches)
                        has_dense = event < 0
                    if event >= 0:
                        made, h, rest, e = cut(f, c, t, h, theta, p, runs, work, switches, event, control)
                        now[Now.EVALUATIONS] += made
                        if runs.lost[0] != 0 or not finite(after):
                            return Ended.TOO_SMALL
                        if e > 1.0:
                            control[At.NEXT] = shortened(h, e, control)
                            remember(t, y, p, run_parameters, switches)
                            continue
                        t1 = t + (h + rest)
                        control[At.NEXT] = max(control[At.NEXT], abs(control[At.TAKEN]))  # the cut is no error
                        switches.sides[event] = -switches.sides[event]
                if h > 0.0 and is_due(times, now, t1, end):
                    if not has_dense:
                        now[Now.EVALUATIONS] += dense(f, c, t, h, y, p, run_parameters, after, work)
                    inside(f, runs, records, times, now, t, h, t1, end, p, work.F)
                copy(y, after)
                if event >= 0:
                    arrive(y, work.last, rest, switches, event)
                for row in switches.zeroed:
                    y[row, 0] = 0.0
                times.reached[0] = t1
                copy(work.K[0], work.last)
                if times.every and event < 0 and t1 < end:
                    sample(f, runs, records, 0, now, t1, y, p)
                now[Now.STEPS] += 1
                now[Now.BUDGET] -= 1
                log_step(records, now, t1, y)
                show(runs, records, rules, work.last, now, t, t1, t == start and acts(rules, table.ticks[s]))
                if event >= 0:
                    now[Now.EVENT] = event
                    now[Now.STEP] = 1
                    guard = event - switches.thresholds
                    if sides.restarts and event < len(switches.rows) - switches.user_defined:
                        control[At.NEXT] = 0.0
                    if 0 <= guard < switches.guards:
                        ended = end_mode(f, t1, runs, p, switches, holding, guard)
                        if ended != Ended.DONE:
                            return ended
                    elif not goes_on(t1, runs, switches, sides, holding, event, rules.held):
                        return Ended.EVENT
                    if now[Now.BUDGET] <= 0 or stop[0] != 0:
                        return Ended.PAUSED
                    break
                settle_sides(switches)
                if not rules.canonical and fast(y, rules.n):
                    return Ended.FAST
                if now[Now.STEPS] % _WATCHED == 0 and not conserve(f, runs, rules, t1, p):
                    return Ended.GAINS
                if now[Now.BUDGET] <= 0 or stop[0] != 0:
                    return Ended.PAUSED
            if now[Now.STEP] == 1:  # behind an event
                continue
            now[Now.SEGMENT] += 1
            now[Now.STEP] = 0
        return Ended.DONE

    return advance


def arrive(y: Array, rate: Array, rest: float, switches: Switches, event: int) -> None:
    """The last bit of a step up to an event; what passes its level there lies on it, but for rounding."""
    for e in range(len(y)):
        y[e, 0] += rest * rate[e, 0]
    if event < len(switches.exact) and not switches.rates[event]:
        row, level = switches.rows[event], switches.levels[event]
        if abs(y[row, 0] - level) <= switches.exact[event]:
            y[row, 0] = level


def node(f: Functions, runs: Runs, records: Records, times: Times, now: Array, t: float, p: Array) -> None:
    """A sample, if there is to be one, and a shared state, at the start of a segment or at the end of the run."""
    due = now[Now.DUE] * times.period <= t + _EARLY * times.period
    if due or times.nodes or (t == times.end and times.period < np.inf):
        sample(f, runs, records, 0, now, t, runs.y, p)
    while now[Now.DUE] * times.period <= t + _EARLY * times.period and times.period < np.inf:
        now[Now.DUE] += 1
    if times.compared < np.inf:
        share(records, now, t, runs.y)
        while now[Now.MET] * times.compared <= t + _EARLY * times.compared:
            now[Now.MET] += 1


def is_due(times: Times, now: Array, t: float, end: float) -> bool:
    """Whether a sample or a shared state is due before t."""
    return due(now[Now.DUE], times.period, t, end) or due(now[Now.MET], times.compared, t, end)


def due(k: int, period: float, t: float, end: float) -> bool:
    """Whether the k-th period ends at t at the latest, and before the end of the segment."""
    return k * period <= t and k * period < end - _EARLY * period


def inside(
    f: Functions, runs: Runs, records: Records, times: Times, now: Array, t: float, h: float, t1: float, end: float,
    p: Array, F: Array,
) -> None:  # fmt: skip
    """The samples and shared states within a step."""
    x = runs.last
    while due(now[Now.DUE], times.period, t1, end):
        at = now[Now.DUE] * times.period
        between(runs.y, F, (at - t) / h, x)
        sample(f, runs, records, 0, now, at, x, p)
        now[Now.DUE] += 1
    while due(now[Now.MET], times.compared, t1, end):
        at = now[Now.MET] * times.compared
        between(runs.y, F, (at - t) / h, x)
        share(records, now, at, x)
        now[Now.MET] += 1


def fast(y: Array, n: int) -> bool:
    """Whether a joint moves without bound."""
    most = 0.0
    for e in range(n, 2 * n):
        most = max(most, abs(y[e, 0]))
    return not most < FASTEST
