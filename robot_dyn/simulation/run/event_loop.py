"""The time loop of a run whose steps are chosen by error control, or end at events; samples lie between their ends.

    for each segment:
        begin_segment                         tick of the controller, sample
        while t < end of the segment:
            restart                           at its start, and after each event: rate, first step
            take_step                         y⁺ = step(t, y, h), ‖e‖ ≤ 1
            locate_event                      does the dense output bracket a root of a switching function g?
            step_to_event                     if so, the step again, with g(step(t, y, θ h)) = 0
            record_step, finish_step          samples within the step; t, y = t + h, y⁺
            handle_event                      change of the mode, or of the formulas; else check_step

Repeating the step, instead of the dense output, keeps the order of the method. Plain functions of arrays, see
`time_loop`. [Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.6; Shampine,
Thompson 2000]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.bernstein import NONE
from robot_dyn.integrate.primitives import between, copy, inlined
from robot_dyn.integrate.step_control import StepControl, chosen_step, controls_error, first_step, is_finite, shortened
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Phase
from robot_dyn.simulation.events.contact_mode import ContactMode
from robot_dyn.simulation.events.detection import FASTEST
from robot_dyn.simulation.events.event_table import (
    EventTable,
    coordinate_approaches,
    coordinates,
    function_approaches,
    newton_shift,
    settle_sides,
    start_table,
)
from robot_dyn.simulation.events.first_event import first_event
from robot_dyn.simulation.events.regions import Regions, pass_level
from robot_dyn.simulation.run.recording import Loop, log_step, observe_step, sample, share
from robot_dyn.simulation.run.time_loop import apply_tick, changes_torque, conserves_energy, count_step

_EARLY = 1e-9  # fraction of a period: a sample at the end of a segment belongs to the next one
_ROOTS = 6  # repetitions of a step for an event
_FARTHEST = 2.0  # steps: the root is within the step, except for the error of its dense output
_SHORT = 1e-8  # fraction of a step: over such a part of it y is a straight line, to rounding
_WATCHED = 8  # steps between energy checks


class Events(NamedTuple):
    """The events of a run: switching functions, parameters between thresholds, and the contact mode."""

    table: EventTable
    regions: Regions
    mode: ContactMode


def event_loop(
    begin: Callable[..., int],
    step: Callable[..., int],
    error: Callable[..., float],
    rate_at_end: Callable[..., int],
    dense: Callable[..., int],
    end_mode: Callable[..., int],
) -> Callable[..., int]:
    """Return the time loop of the functions of a method, see `ControlledStepper`, and of an `end_mode`.

    advance(functions, coefficients, work, loop, events, control, stop) → Ended; `stop[0]` other than 0 ends it after
    its current step.
    """
    choose = chosen_step(step, error)

    def advance(f: Functions, c: Any, work: Any, loop: Loop, events: Events, control: StepControl, stop: Array) -> int:
        table, lanes, position = loop.table, loop.lanes, loop.position
        last = len(table.counts) - 1
        while position.segment[0] <= last:
            s: int = position.segment[0]
            if table.payload_events[s] == 1:
                return Ended.PAYLOAD
            copy(lanes.p, table.parameters[s])
            if position.phase[0] == Phase.TICK and not begin_segment(f, loop):
                return Ended.TICK
            if s == last:
                position.segment[0] += 1
                continue
            end = table.starts[s + 1]
            if position.phase[0] == Phase.RESTART and not restart(f, c, work, loop, events.table, control, end):
                return Ended.NOT_FINITE
            while position.time[0] < end and position.phase[0] == Phase.STEPS:
                if not take_step(f, c, work, loop, control, end):
                    return Ended.TOO_SMALL
                event, theta, has_dense = locate_event(f, c, work, loop, events.table, control)
                h, rest = control.h[0], 0.0
                if event >= 0:
                    h, rest, e = step_to_event(f, c, work, loop, events.table, control, event, theta)
                    if lanes.failed[0] != 0 or not is_finite(lanes.after):
                        return Ended.TOO_SMALL
                    if e > 1.0:
                        reject(loop, events.table, control, h, e)
                        continue
                    control.end[0] = position.time[0] + (h + rest)
                    # the event, not the error, shortened the step
                    control.next_h[0] = max(control.next_h[0], abs(control.h[0]))
                    events.table.sides[event] = -events.table.sides[event]
                record_step(f, c, work, loop, control, h, end, has_dense and event < 0)
                finish_step(f, work, loop, events.table, control, event, rest)
                ended = handle_event(f, loop, events, control, event) if event >= 0 else check_step(f, loop, events)
                if ended != Ended.DONE:
                    return ended
                if position.budget[0] <= 0 or stop[0] != 0:
                    return Ended.PAUSED
            if position.phase[0] == Phase.STEPS:
                position.segment[0] += 1
                position.phase[0] = Phase.TICK
        return Ended.DONE

    def restart(
        f: Functions, c: Any, work: Any, loop: Loop, table: EventTable, control: StepControl, end: float
    ) -> bool:
        """Evaluate the rate and the switching functions at t, and choose a first step. Return False without a rate."""
        position, lanes, t = loop.position, loop.lanes, loop.position.time[0]
        position.evaluations[0] += begin(f, c, work, t, lanes)
        if not is_finite(work.K[0]):
            return False
        start_table(table, lanes, t)
        if control.next_h[0] == 0.0 and controls_error(control):
            position.evaluations[0] += first_step(f, work, control, t, end, lanes)
        position.phase[0] = Phase.STEPS
        return True

    @inlined
    def take_step(f: Functions, c: Any, work: Any, loop: Loop, control: StepControl, end: float) -> bool:
        """Choose and take a step, and evaluate the rate at its end. Return False if no step is small enough."""
        position, lanes, t = loop.position, loop.lanes, loop.position.time[0]
        evaluations, taken = choose(f, c, work, control, t, end, lanes)
        position.evaluations[0] += evaluations
        if taken:
            position.evaluations[0] += rate_at_end(f, c, work, t, control.h[0], lanes)
        return taken

    @inlined
    def locate_event(
        f: Functions, c: Any, work: Any, loop: Loop, table: EventTable, control: StepControl
    ) -> tuple[int, float, bool]:
        """Return the switching function that changes sign first in the step, or −1; θ; True with dense output."""
        lanes, t, h = loop.lanes, loop.position.time[0], control.h[0]
        if len(table.sides) == 0:
            return -1, NONE, False
        approaches = function_approaches(table, lanes, control.end[0])
        if not approaches and not coordinate_approaches(table, lanes, loop.config, work, h):
            return -1, NONE, False
        loop.position.evaluations[0] += dense(f, c, work, t, h, lanes)
        event, theta = first_event(table, lanes, work.F, t, h)
        return event, theta, True

    def step_to_event(
        f: Functions, c: Any, work: Any, loop: Loop, table: EventTable, control: StepControl, event: int, theta: float
    ) -> tuple[float, float, float]:
        """Shorten the step by Newton's iteration until it ends at the root of a switching function, minus a rest.

        Returns:
            The length of the step; the length of the rest, over which y is linear and which the caller adds; and the
            error of the step. The error may exceed 1 if the whole step jumped over a range, such as friction near 0.
        """
        lanes, position, t, whole = loop.lanes, loop.position, loop.position.time[0], control.h[0]
        h, e = theta * whole, 0.0
        for k in range(_ROOTS):
            if abs(h) <= np.spacing(abs(t)):  # immediately, for example right after another event
                copy(lanes.after, lanes.y)
                copy(work.last, work.K[0])
                return 0.0, 0.0, 0.0
            position.evaluations[0] += step(f, c, work, t, h, lanes)
            if controls_error(control):
                e = error(c, work, h, lanes, control.rtol, control.atol)
            position.evaluations[0] += rate_at_end(f, c, work, t, h, lanes)
            shift = newton_shift(table, lanes, work, event, t, h, whole)
            if not abs(shift) > _SHORT * h:
                return h, shift, e
            if k == _ROOTS - 1 or (abs(shift) > h and event >= coordinates(table)):
                break  # a function that jumps: where it is bracketed
            h = min(max(h + shift, 0.0), _FARTHEST * whole)
        return h, 0.0, e

    def record_step(
        f: Functions, c: Any, work: Any, loop: Loop, control: StepControl, h: float, end: float, has_dense: bool
    ) -> None:
        """Store the samples and shared states within the step."""
        lanes, config, position, t, t1 = loop.lanes, loop.config, loop.position, loop.position.time[0], control.end[0]
        samples = is_due(position.sample[0], config.sample_period, t1, end)
        shares = is_due(position.share[0], config.share_period, t1, end)
        if not (h > 0.0 and (samples or shares)):
            return
        if not has_dense:
            position.evaluations[0] += dense(f, c, work, t, h, lanes)
        while is_due(position.sample[0], config.sample_period, t1, end):
            at = position.sample[0] * config.sample_period
            between(lanes.y, work.F, (at - t) / h, lanes.inner)
            sample(f, loop, at, lanes.inner, lanes.p)
            position.sample[0] += 1
        while is_due(position.share[0], config.share_period, t1, end):
            at = position.share[0] * config.share_period
            between(lanes.y, work.F, (at - t) / h, lanes.inner)
            share(loop, at, lanes.inner)
            position.share[0] += 1

    def handle_event(f: Functions, loop: Loop, events: Events, control: StepControl, event: int) -> int:
        """Change the mode, or the formulas, after an event; return `DONE`, or the reason for which the loop returns."""
        table, lanes, position, guard = events.table, loop.lanes, loop.position, event - events.table.thresholds
        t = position.time[0]
        position.event[0], position.phase[0] = event, Phase.RESTART
        if loop.config.restarts and event < len(table.rows) - table.user_defined:
            control.next_h[0] = 0.0
        if 0 <= guard < table.guards:
            return end_mode(f, t, lanes, table, events.mode, guard)
        if pass_level(events.regions, table, events.mode, lanes, loop.config.held, event, t):
            return Ended.DONE
        return Ended.EVENT

    return advance


def begin_segment(f: Functions, loop: Loop) -> bool:
    """Apply the tick at the start of a segment, and store the samples due. Return False if the torque is not finite."""
    table, lanes, config, position = loop.table, loop.lanes, loop.config, loop.position
    s: int = position.segment[0]
    t, period, share_period = table.starts[s], config.sample_period, config.share_period
    if table.ticks[s] > 0 and not apply_tick(f, loop, t, table.at_ticks[s], table.ticks[s]):
        return False
    is_end = t == config.duration and period < np.inf
    if position.sample[0] * period <= t + _EARLY * period or config.samples_nodes or is_end:
        sample(f, loop, t, lanes.y, lanes.p)
    while position.sample[0] * period <= t + _EARLY * period and period < np.inf:
        position.sample[0] += 1
    if share_period < np.inf:
        share(loop, t, lanes.y)
        while position.share[0] * share_period <= t + _EARLY * share_period:
            position.share[0] += 1
    position.time[0], position.phase[0] = t, Phase.RESTART
    return True


def is_due(k: int, period: float, t: float, end: float) -> bool:
    """Return True if period k ends at t or before, and before the end of the segment."""
    return k * period <= t and k * period < end - _EARLY * period


def reject(loop: Loop, table: EventTable, control: StepControl, h: float, e: float) -> None:
    """Reject a step of length h to an event, with the error e; the next is shorter than the whole step."""
    control.next_h[0] = shortened(control, min(h, control.h[0]), e)
    start_table(table, loop.lanes, loop.position.time[0])


@inlined
def finish_step(
    f: Functions, work: Any, loop: Loop, table: EventTable, control: StepControl, event: int, rest: float
) -> None:
    """Take y⁺ at the end of a step, and record it; `rest` is the length that is left to an event."""
    lanes, config, position = loop.lanes, loop.config, loop.position
    s: int = position.segment[0]
    y, t, t1, start = lanes.y, position.time[0], control.end[0], loop.table.starts[s]
    copy(y, lanes.after)
    if event >= 0:
        arrive(table, y, work.last, event, rest)
    for row in table.zeroed:
        y[row, 0] = 0.0
    position.time[0] = t1
    copy(work.K[0], work.last)
    if config.samples_steps and event < 0 and t1 < loop.table.starts[s + 1]:
        sample(f, loop, t1, y, lanes.p)
    count_step(loop)
    log_step(loop, t1, y)
    observe_step(loop, work.last, t, t1, t == start and changes_torque(config, loop.table.ticks[s]))


def arrive(table: EventTable, y: Array, rate: Array, event: int, rest: float) -> None:
    """Advance y by the last bit of a step to an event; a coordinate then lies on its level, except for rounding."""
    for e in range(len(y)):
        y[e, 0] += rest * rate[e, 0]
    if event < coordinates(table) and not table.is_rate[event]:
        row, level = table.rows[event], table.levels[event]
        if abs(y[row, 0] - level) <= table.rounding[event]:
            y[row, 0] = level


@inlined
def check_step(f: Functions, loop: Loop, events: Events) -> int:
    """Check a step without an event for divergence; return `DONE`, or the reason for which the loop returns."""
    config, position, y, fastest = loop.config, loop.position, loop.lanes.y, 0.0
    settle_sides(events.table)
    if not config.canonical:
        for e in range(config.n, 2 * config.n):
            fastest = max(fastest, abs(y[e, 0]))
        if not fastest < FASTEST:
            return Ended.FAST
    if position.steps[0] % _WATCHED == 0 and not conserves_energy(f, loop, position.time[0]):
        return Ended.ENERGY_GROWS
    return Ended.DONE
