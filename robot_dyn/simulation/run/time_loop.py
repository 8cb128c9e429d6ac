"""The time loop of fixed steps: segments, ticks, samples, steps and checks for divergence; one run, or W in lock step.

    for each segment:  tick;  for each step:  share, sample, y⁺ = step(t, y), observe, check the energy

Plain functions of arrays: they run in Python with Python functions of the state equation, or as machine code with
addresses of these. Python reviews a doubtful step of a single run; in lock step, the state of an ended run is nan.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import below, copy, evaluate, sizes
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, LaneEnd, Lanes, LoopConfig, erase_ended
from robot_dyn.simulation.observation.observation import observe, observe_actuation, observe_motion
from robot_dyn.simulation.run.philox import draw
from robot_dyn.simulation.run.recording import Loop, observe_step, sample, share

WATCHED = 64  # steps between energy checks
RUNAWAY = 1e3  # limit of the ledger's residual, relative to the energy at the start plus the work


def time_loop(step: Callable[..., int]) -> Callable[..., int]:
    """Return the time loop of a step function; see `FixedStepper`.

    advance(functions, coefficients, work, loop, stop) → Ended. It returns early where Python must act, or after the
    current step if `stop[0]` is not 0; the next call continues at `loop.position`. The last segment is the end of the
    run: its state is recorded, and no step is taken.
    """

    def advance(functions: Functions, coefficients: Any, work: Any, loop: Loop, stop: Array) -> int:
        table, lanes, config, position = loop.table, loop.lanes, loop.config, loop.position
        last = len(table.counts) - 1
        if not config.alone:
            begin_lanes(functions, loop)
        while position.segment[0] <= last:
            s: int = position.segment[0]
            start, h, tick = table.starts[s], table.lengths[s], table.ticks[s]
            if table.payload_events[s] == 1:
                return Ended.PAYLOAD
            copy(lanes.p, table.parameters[s])
            if position.step[0] == 0 and tick > 0 and not apply_tick(functions, loop, start, table.at_ticks[s], tick):
                return Ended.TICK
            while position.step[0] < table.counts[s]:
                acted = position.step[0] == 0 and changes_torque(config, tick)
                t = start + position.step[0] * h
                record(functions, loop, t, s == last)
                if s == last:
                    position.step[0] += 1
                    continue
                position.evaluations[0] += step(functions, coefficients, work, t, h, lanes)
                if not accept(lanes, config, t):
                    return Ended.NEEDS_REVIEW
                count_step(loop)
                position.step[0] += 1
                observe_lanes(functions, loop, work.K[len(work.K) - 1], t, t + h, acted)
                if position.steps[0] % WATCHED == 0 and not conserves_energy(functions, loop, t + h):
                    return Ended.ENERGY_GROWS
                if position.budget[0] <= 0 or stop[0] != 0:
                    return Ended.PAUSED
            position.segment[0] += 1
            position.step[0] = 0
        return Ended.DONE

    return advance


def begin_lanes(functions: Functions, loop: Loop) -> None:
    """Compute the energy at the start of runs in lock step, and observe the actuation there if it is continuous."""
    lanes, config = loop.lanes, loop.config
    copy(lanes.p, loop.table.parameters[0])
    evaluate(functions.energy, 0.0, lanes.y, lanes.p, lanes.run_parameters, lanes.energies)
    for b in range(len(lanes.size)):
        K, V = lanes.energies[0, b], lanes.energies[1, b]
        lanes.energy[b], lanes.scale[b] = K + V, 1.0 + abs(K) + abs(V)
    if config.apart > 0 and config.held == 0:
        observe_torque(functions, loop, 0.0, False)


def apply_tick(functions: Functions, loop: Loop, t: float, p: Array, number: int) -> bool:
    """Apply a tick: write the torque for the zero-order hold and the next states of the controller.

    Noise depends on the number of the period: it is the same at all ticks of a period.

    Args:
        functions: Functions of the state equation.
        loop: The loop.
        t: Time of the tick, in [s].
        p: Parameters of the segment at the time of the tick.
        number: Number of the tick, from 1.

    Returns:
        False if the torque of a single run is not finite; then nothing is applied.
    """
    lanes, config = loop.lanes, loop.config
    n, held, z = config.n, config.held, config.states
    if config.deviates > 0:
        draw(lanes.y, 2 * n + z - config.deviates, config.deviates, lanes.keys, (number - 1) // config.instants)
    evaluate(functions.tick, t, lanes.y, p, lanes.run_parameters, lanes.command)
    sizes(lanes.command, lanes.size)
    if config.alone and not lanes.size[0] < np.inf:
        return False
    copy(lanes.run_parameters[:held], lanes.command[:held])
    copy(lanes.y[2 * n : 2 * n + z], lanes.command[held:])
    erase_ended(lanes.run_parameters[:held], lanes)
    return True


def changes_torque(config: LoopConfig, tick: int) -> bool:
    """Return True if the torque of a sampled controller changes at this tick; the number 0 means no tick."""
    return tick > 0 and (tick - 1) % config.instants == config.acting


def record(functions: Functions, loop: Loop, t: float, at_end: bool) -> None:
    """Store the state before a step: for companions every `every` steps, and as a sample where one is due."""
    config, position, lanes = loop.config, loop.position, loop.lanes
    if config.every > 0 and position.step[0] % config.every == 0:
        if position.shareable[0] % config.thin == 0 or at_end:
            share(loop, t, lanes.y)
        position.shareable[0] += 1
    due = position.sample_time[0]
    if t >= due - config.sample_slack or (at_end and due < np.inf):
        sample(functions, loop, t, lanes.y, lanes.p)
        position.sample_time[0] += config.sample_period
        if config.apart > 0 and t > loop.records.observation.latest[0]:
            observe_torque(functions, loop, t, False)


def accept(lanes: Lanes, config: LoopConfig, t: float) -> bool:
    """Replace y by y⁺ unless y⁺ is doubtful: too large, not finite, or of a step whose stages did not converge.

    Return False for a doubtful step of a single run; y is then unchanged. In lock step, the runs concerned end at t.
    """
    sizes(lanes.after, lanes.size)
    doubtful = not (below(lanes.size, config.largest) and below(lanes.failed, 1))
    if doubtful and config.alone:
        return False
    if doubtful:
        for b in range(len(lanes.size)):
            if lanes.reason[b] == 0 and (lanes.failed[b] != 0 or not lanes.size[b] < config.largest):
                end_lane(lanes, b, t, LaneEnd.NO_STAGES if lanes.failed[b] != 0 else LaneEnd.OVERFLOW)
    copy(lanes.y, lanes.after)
    if doubtful:
        erase_lanes(lanes, config)
    return True


def count_step(loop: Loop) -> None:
    """Count a step, and take it off the budget."""
    loop.position.steps[0] += 1
    loop.position.budget[0] -= 1


def conserves_energy(functions: Functions, loop: Loop, t: float) -> bool:
    """Return False if energy grows without a source in a single run; in lock step, end the runs where it does.

    Steps are unstable if E − E(0) − Σ W exceeds 1000 (1 J + |K(0)| + |V(0)| + Σ |W|).
    """
    lanes, config, ended = loop.lanes, loop.config, False
    evaluate(functions.energy, t, lanes.y, lanes.p, lanes.run_parameters, lanes.energies)
    for b in range(len(lanes.size)):
        lanes.peak[b] = max(lanes.peak[b], lanes.energies[0, b])
        gained, moved = lanes.energies[0, b] + lanes.energies[1, b] - lanes.energy[b], lanes.scale[b]
        for w in range(len(lanes.y) - config.works, len(lanes.y)):
            gained -= lanes.y[w, b]
            moved += abs(lanes.y[w, b])
        if lanes.reason[b] == 0 and gained > RUNAWAY * moved:
            if config.alone:
                return False
            end_lane(lanes, b, t, LaneEnd.ENERGY_GAIN)
            ended = True
    if ended:
        erase_lanes(lanes, config)
    return True


def end_lane(lanes: Lanes, b: int, t: float, reason: int) -> None:
    """End a run in lock step."""
    lanes.reason[b], lanes.end_time[b] = reason, t
    copy(lanes.end_state[:, b], lanes.y[:, b])


def erase_lanes(lanes: Lanes, config: LoopConfig) -> None:
    """Write nan over the states and torques of the runs that have ended."""
    erase_ended(lanes.y, lanes)
    erase_ended(lanes.run_parameters[: config.held], lanes)


def observe_lanes(functions: Functions, loop: Loop, latest: Array, start: float, t: float, acted: bool) -> None:
    """Observe q, v and the torque of a step; in lock step, observe a continuous torque only every `apart` steps.

    Args:
        functions: Functions of the state equation.
        loop: The loop.
        latest: Rate at the end of the step, followed by u for a single run.
        start: Time at the start of the step, in [s].
        t: Time at its end, in [s].
        acted: True if the controller acted at the start.
    """
    lanes, config, observation = loop.lanes, loop.config, loop.records.observation
    if config.alone:
        observe_step(loop, latest, start, t, acted)
        return
    if observation.low.shape[1] == 0:
        return
    n = config.n
    q, v = lanes.y[:n], lanes.y[n : 2 * n]
    if config.canonical:
        v = latest[:n]
        erase_ended(v, lanes)
    if config.apart == 0:
        observe(observation, start, t, q, v, lanes.run_parameters[:n], acted)
        return
    observe_motion(observation, start, t, q, v)
    if loop.position.steps[0] % config.apart == 0:
        observe_torque(functions, loop, t, acted)


def observe_torque(functions: Functions, loop: Loop, t: float, acted: bool) -> None:
    """Observe the actuation of runs in lock step at their current state."""
    lanes, observation = loop.lanes, loop.records.observation
    if observation.low.shape[1] == 0:
        return
    evaluate(functions.actuation, t, lanes.y, lanes.p, lanes.run_parameters, lanes.u)
    erase_ended(lanes.u, lanes)
    observe_actuation(observation, t, lanes.u, acted)
