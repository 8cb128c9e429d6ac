"""Thresholds that are passed within the loop: each region between them has its own run parameters.

Parameters of a region that is entered for the first time are computed in Python, and cached. Plain functions of arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.simulation.dynamics.loop_state import Lanes
from robot_dyn.simulation.events.contact_mode import ContactMode, write_mode
from robot_dyn.simulation.events.event_log import EventKind, EventLog, log_event, may_chatter
from robot_dyn.simulation.events.event_table import EventTable

_MOST = 64  # regions that are cached


class Regions(NamedTuple):
    """The parameters of a run in each region between its thresholds, and the rules of user-defined events.

    Attributes:
        sides: Sides of the thresholds in each region, see `EventTable`, (T, K).
        run_parameters: Parameters there, without the actuation in zero-order hold, (P, K).
        filled: Number of regions in use, (1,); 0 where Python functions change with the sides.
        directions: Direction of each user-defined event, (G,).
        terminal: True if the event ends the run, (G,).
        log: Log of events.
    """

    sides: Array
    run_parameters: Array
    filled: Array
    directions: Array
    terminal: Array
    log: EventLog


def empty_regions(
    threshold_count: int, parameter_count: int, directions: Array, terminal: Array, log: EventLog
) -> Regions:
    """Return a table without regions."""
    return Regions(
        sides=np.zeros((threshold_count, _MOST)),
        run_parameters=np.zeros((parameter_count, _MOST)),
        filled=np.zeros(1, np.int64),
        directions=directions,
        terminal=terminal,
        log=log,
    )


def pass_level(
    regions: Regions, table: EventTable, mode: ContactMode, lanes: Lanes, held: int, event: int, t: float
) -> bool:
    """Handle a threshold or user-defined event in the loop. Return False if Python must take over.

    Python takes over for a terminal event, a new region, thresholds that may chatter, and a full log. A user-defined
    event in the other direction is ignored.

    Args:
        regions: The regions.
        table: The switching functions, on their sides after the event.
        mode: The contact mode.
        lanes: The run.
        held: Number of torques in zero-order hold.
        event: Index of the switching function, which is not a guard.
        t: Time, in [s].
    """
    number = event if event < table.thresholds else event - table.guards
    side, log = table.sides[event], regions.log
    if log.filled[0] >= log.limit:
        return False
    g = number - len(regions.sides)  # among the user-defined events
    if g >= 0:
        is_wanted = regions.directions[g] * side >= 0.0
        if regions.terminal[g] and is_wanted:
            return False
        if not is_wanted:
            return True
    elif may_chatter(log, t) or not enter_region(regions, table, mode, lanes, held):
        return False
    log_event(log, t, lanes.y, number, EventKind.PASSES, side, side)
    return True


def enter_region(regions: Regions, table: EventTable, mode: ContactMode, lanes: Lanes, held: int) -> bool:
    """Write the run parameters of the region that the sides determine. Return False if they are not cached."""
    for k in range(regions.filled[0]):
        same = True
        for i in range(len(regions.sides)):
            e = i if i < table.thresholds else i + table.guards
            same = same and regions.sides[i, k] == table.sides[e]
        if same:
            for i in range(len(regions.run_parameters)):
                lanes.run_parameters[held + i, 0] = regions.run_parameters[i, k]
            write_mode(mode, lanes.run_parameters)
            return True
    return False


def add_region(regions: Regions, sides: np.ndarray, parameters: np.ndarray) -> None:
    """Cache the parameters of a new region; if the table is full, the loop returns to Python each time."""
    k = int(regions.filled[0])
    if k < _MOST and not (sides == regions.sides[:, :k].T).all(axis=1).any():
        regions.sides[:, k], regions.run_parameters[:, k] = sides, parameters
        regions.filled[0] += 1
