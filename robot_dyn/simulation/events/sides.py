"""Thresholds that are passed within the loop: parts are other formulas on each side, by other numbers of the run.

Parameters of sides that have not been met before are computed in Python, and cached. Plain functions of arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.simulation.dynamics.loop_state import Runs
from robot_dyn.simulation.events.crossings import Switches
from robot_dyn.simulation.events.event_log import EventLog, What, may_chatter, note
from robot_dyn.simulation.events.holding import Holding, write_mode

_KNOWN = 64  # sides for which there is room


class Sides(NamedTuple):
    """What runs on each side of the thresholds.

    Attributes:
        sides: Those that are known, as of `Switches` without guards and user-defined events, (T, K).
        run_parameters: Those of the run on them, behind the actuation in zero-order hold, (P, K).
        known: How many are filled, (1,); 0 where functions of Python change with the sides.
        directions: Of the user-defined events, (G,).
        terminal: Whether they end the run, (G,).
        restarts: Whether the first step behind an event of the equation is to be chosen again.
        log: What happened.
    """

    sides: Array
    run_parameters: Array
    known: Array
    directions: Array
    terminal: Array
    restarts: bool
    log: EventLog


def sides_of(
    thresholds: int, parameters: int, directions: Array, terminal: Array, restarts: bool, log: EventLog
) -> Sides:  # fmt: skip
    """None known yet."""
    return Sides(
        np.zeros((thresholds, _KNOWN)), np.zeros((parameters, _KNOWN)), np.zeros(1, np.int64), directions, terminal,
        restarts, log,
    )  # fmt: skip


def goes_on(t: float, runs: Runs, switches: Switches, of: Sides, holding: Holding, event: int, held: int) -> bool:
    """Go on behind a threshold or a user-defined event, not a guard; whether the loop need not return to Python."""
    number = event if event < switches.thresholds else event - switches.guards
    side, log = switches.sides[event], of.log
    if log.filled[0] >= log.room:
        return False
    place = number - len(of.sides)  # among the user-defined events
    if place >= 0:
        counts = of.directions[place] * side >= 0.0
        if of.terminal[place] and counts:
            return False
        if counts:
            note(log, t, runs.y, number, What.PASSES, side, side)
        return True
    if may_chatter(log, t) or not take_numbers(runs, switches, of, holding, held):
        return False
    note(log, t, runs.y, number, What.PASSES, side, side)
    return True


def take_numbers(runs: Runs, switches: Switches, of: Sides, holding: Holding, held: int) -> bool:
    """Take the numbers of the sides that the thresholds are on; whether they are known."""
    for k in range(of.known[0]):
        same = True
        for e in range(len(of.sides)):
            at = e if e < switches.thresholds else e + switches.guards
            same = same and of.sides[e, k] == switches.sides[at]
        if same:
            for i in range(len(of.run_parameters)):
                runs.run_parameters[held + i, 0] = of.run_parameters[i, k]
            write_mode(holding, runs.run_parameters)
            return True
    return False


def keep_numbers(of: Sides, sides: np.ndarray, parameters: np.ndarray) -> None:
    """Cache the parameters on sides that were not known; without room, the loop returns to Python each time."""
    k = int(of.known[0])
    if k < _KNOWN and not (sides == of.sides[:, :k].T).all(axis=1).any():
        of.sides[:, k], of.run_parameters[:, k] = sides, parameters
        of.known[0] += 1
