"""The time loop: segments, ticks, samples, steps and the watch over divergence, for one run or W in lock step.

It is plain functions of arrays, called as they stand with Python functions of the state equation, or as machine code
with addresses of them. What ends a single run is looked at by its driver, which knows the words; in lock step a run
that has ended is nan from there on.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.integrate.primitives import below, copy, evaluate, sizes
from robot_dyn.simulation.dynamics.loop_state import Ended, Functions, Now, Rules, Runs, Why, erase_ended
from robot_dyn.simulation.observation.observation import Observation, observe, observe_actuation, observe_motion
from robot_dyn.simulation.run.philox import draw
from robot_dyn.simulation.run.recording import Records, sample, share, show
from robot_dyn.simulation.setup.segment_table import SegmentTable

WATCHED = 64  # steps between looks at the energy
RUNAWAY = 1e3  # times all the energy there was, that may come from nowhere


def time_loop(step: Callable[..., int]) -> Callable[..., int]:
    """The time loop of a step function; see `Stepper`.

    advance(functions, plan, runs, records, rules, coefficients, work, now, clock, stop) → Ended, with `clock` the time
    of the next sample, the record period, and what a sample may be early by; `stop[0]` other than 0 ends it.
    """

    def advance(
        functions: Functions, table: SegmentTable, runs: Runs, records: Records, rules: Rules, coefficients: Any,
        work: Any, now: Array, clock: Array, stop: Array,
    ) -> int:  # fmt: skip
        last = len(table.counts) - 1
        if not rules.alone:
            own_energy(functions, runs, table.parameters[0])
            if rules.apart > 0 and rules.held == 0:
                show_actuation(functions, runs, records.observation, 0.0, table.parameters[0], False)
        while now[Now.SEGMENT] <= last:
            s: int = now[Now.SEGMENT]
            start, h, p = table.starts[s], table.lengths[s], table.parameters[s]
            if table.payload_events[s] == 1:
                return Ended.PAYLOAD
            tick, at_tick = table.ticks[s], table.at_ticks[s]
            if now[Now.STEP] == 0 and tick > 0 and not act(functions, runs, rules, start, at_tick, tick):
                return Ended.TICK
            while now[Now.STEP] < table.counts[s]:
                k = now[Now.STEP]
                t = start + k * h
                share_at_step(runs, records, rules, now, t, s == last)
                if t >= clock[0] - clock[2] or (s == last and clock[0] < np.inf):
                    sample(functions, runs, records, rules.base, now, t, runs.y, p)
                    clock[0] += clock[1]
                    if rules.apart > 0 and t > records.observation.latest[0]:
                        show_actuation(functions, runs, records.observation, t, p, False)
                if s == last:
                    now[Now.STEP] += 1
                    continue
                y, run_parameters, after, lost = runs.y, runs.run_parameters, runs.after, runs.lost
                now[Now.EVALUATIONS] += step(functions, coefficients, t, h, y, p, run_parameters, after, work, lost)
                if not take(runs, rules, t):
                    return Ended.NEEDS_REVIEW
                now[Now.STEP] += 1
                now[Now.STEPS] += 1
                now[Now.BUDGET] -= 1
                latest, acted = work.K[len(work.K) - 1], k == 0 and acts(rules, tick)
                if rules.alone:
                    show(runs, records, rules, latest, now, t, t + h, acted)
                else:
                    show_lanes(functions, runs, records.observation, rules, latest, now, t, t + h, p, acted)
                if now[Now.STEPS] % WATCHED == 0 and not conserve(functions, runs, rules, t + h, p):
                    return Ended.GAINS
                if now[Now.BUDGET] <= 0 or stop[0] != 0:
                    return Ended.PAUSED
            now[Now.SEGMENT] += 1
            now[Now.STEP] = 0
        return Ended.DONE

    return advance


def act(functions: Functions, runs: Runs, rules: Rules, t: float, p: Array, number: int) -> bool:
    """A tick: what the controller holds from now on, and its next states; whether a single run may go on."""
    n, held, z = rules.n, rules.held, rules.states
    if rules.deviates > 0:
        draw(runs.y, 2 * n + z - rules.deviates, rules.deviates, runs.keys, (number - 1) // rules.instants)
    evaluate(functions.tick, t, runs.y, p, runs.run_parameters, runs.command)
    sizes(runs.command, runs.size)
    if rules.alone and not runs.size[0] < np.inf:
        return False
    copy(runs.run_parameters[:held], runs.command[:held])
    copy(runs.y[2 * n : 2 * n + z], runs.command[held:])
    erase_ended(runs.run_parameters[:held], runs)
    return True


def acts(rules: Rules, tick: int) -> bool:
    """Whether the torque of a sampled controller changes at the tick of a number; 0 is none."""
    return tick > 0 and (tick - 1) % rules.instants == rules.acting


def share_at_step(runs: Runs, records: Records, rules: Rules, now: Array, t: float, last: bool) -> None:
    """Store the state for companion runs, at each `every`-th step of a segment, and at the end."""
    if rules.every == 0 or now[Now.STEP] % rules.every != 0:
        return
    if now[Now.SEEN] % rules.thin == 0 or last:
        share(records, now, t, runs.y)
    now[Now.SEEN] += 1


def take(runs: Runs, rules: Rules, t: float) -> bool:
    """Take y⁺; whether a single run may go on. In lock step, end the runs whose y⁺ is not finite, or not found."""
    sizes(runs.after, runs.size)
    ill = not (below(runs.size, rules.largest) and below(runs.lost, 1))
    if ill and rules.alone:
        return False
    if ill:
        for b in range(len(runs.size)):
            if runs.alive[b] == 1 and (runs.lost[b] != 0 or not runs.size[b] < rules.largest):
                end(runs, b, t, Why.NOT_FOUND if runs.lost[b] != 0 else Why.OVERFLOWED)
    copy(runs.y, runs.after)
    if ill:
        erase_ended(runs.y, runs)
        erase_ended(runs.run_parameters[: rules.held], runs)
    return True


def conserve(functions: Functions, runs: Runs, rules: Rules, t: float, p: Array) -> bool:
    """Whether no energy came from nowhere in a single run; in lock step, end the runs where it did.

    E − E(0) − Σ W beyond a thousand times all energy there was is not an error of a step: the steps are unstable.
    """
    evaluate(functions.energy, t, runs.y, p, runs.run_parameters, runs.energies)
    ended = False
    for b in range(len(runs.size)):
        runs.peak[b] = max(runs.peak[b], runs.energies[0, b])
        came, moved = runs.energies[0, b] + runs.energies[1, b] - runs.energy[b], runs.scale[b]
        for w in range(len(runs.y) - rules.works, len(runs.y)):
            came -= runs.y[w, b]
            moved += abs(runs.y[w, b])
        if runs.alive[b] == 1 and came > RUNAWAY * moved:
            if rules.alone:
                return False
            end(runs, b, t, Why.GAINED)
            ended = True
    if ended:
        erase_ended(runs.y, runs)
        erase_ended(runs.run_parameters[: rules.held], runs)
    return True


def own_energy(functions: Functions, runs: Runs, p: Array) -> None:
    """E(0) of each run in lock step, and its scale."""
    evaluate(functions.energy, 0.0, runs.y, p, runs.run_parameters, runs.energies)
    for b in range(len(runs.size)):
        K, V = runs.energies[0, b], runs.energies[1, b]
        runs.energy[b], runs.scale[b] = K + V, 1.0 + abs(K) + abs(V)


def end(runs: Runs, b: int, t: float, why: int) -> None:
    """End a run in lock step."""
    runs.alive[b], runs.why[b], runs.ended[b] = 0, why, t
    copy(runs.last[:, b], runs.y[:, b])


def show_lanes(
    functions: Functions, runs: Runs, of: Observation, rules: Rules, latest: Array, now: Array, began: float, t: float,
    p: Array, acted: bool,
) -> None:  # fmt: skip
    """Observe a step of runs in lock step: q, v and what is held; or at instants the actuation, where it changes."""
    if of.low.shape[1] == 0:
        return
    n = rules.n
    q, v = runs.y[:n], runs.y[n : 2 * n]
    if rules.canonical:
        v = latest[:n]
        erase_ended(v, runs)
    if rules.apart == 0:
        observe(of, began, t, q, v, runs.run_parameters[:n], acted)
        return
    observe_motion(of, began, t, q, v)
    if now[Now.STEPS] % rules.apart == 0:
        show_actuation(functions, runs, of, t, p, acted)


def show_actuation(functions: Functions, runs: Runs, of: Observation, t: float, p: Array, acted: bool) -> None:
    """Observe the actuation in the state reached."""
    if of.low.shape[1] == 0:
        return
    evaluate(functions.actuation, t, runs.y, p, runs.run_parameters, runs.u)
    erase_ended(runs.u, runs)
    observe_actuation(of, t, runs.u, acted)
