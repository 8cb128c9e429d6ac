"""The watch over divergence as lines of machine code: E − E(0) − Σ W beyond a thousand times all energy there was.

The rules are those of `Watch`. One run leaves the judgement to Python; in a tile a lane that has ended is nan after.
"""

from __future__ import annotations

from collections.abc import Callable

from robot_dyn.simulation.machine.places import DOUBTFUL, LARGEST, RUNAWAY, WATCHED, Ended, Places
from robot_dyn.simulation.machine.stages import indented


def watch_lines(places: Places, n: int, memory: int, show: list[str], leave: Callable[[Ended], list[str]]) -> list[str]:
    """Lines that take y⁺ from x, unless it is no number, and look at the energy now and then.

    Args:
        places: Where rows stand.
        n: Number of joints.
        memory: Number of states of the controller.
        show: Lines that show the step to an observer, of a single run.
        leave: Gives the lines that go back to Python.
    """
    W, works = places.lanes, range(2 * n + memory, places.state)
    take = [f"for e in range({places.x}):", f"    work[e] = work[{places.x} + e]", "steps, left = steps + 1, left - 1"]
    gained = [
        "energy(t + h, work, p, energies)",
        f"for b in range({W}):",
        f"    came, moved = energies[b] + energies[{W} + b] - lanes[2, b], lanes[3, b]",
        *(f"    came, moved = came - work[{w * W} + b], moved + abs(work[{w * W} + b])" for w in works),
    ]
    return _one(places, [*take, *show], gained, leave) if W == 1 else _tile(places, n, take, gained)


def _one(places: Places, take: list[str], gained: list[str], leave: Callable[[Ended], list[str]]) -> list[str]:
    return [
        "size = zero",
        f"for e in range({places.state}):",
        f"    size += abs(work[{places.x} + e])",
        f"if failed[0] != 0 or not size < {DOUBTFUL!r}:",
        *indented(leave(Ended.DOUBTFUL)),
        *take,
        f"if steps % {WATCHED} == 0:",
        *indented(gained),
        f"        if came > {RUNAWAY!r} * moved:",
        "            k += 1",
        *indented(leave(Ended.GAINS), 3),
    ]


def _tile(places: Places, n: int, take: list[str], gained: list[str]) -> list[str]:
    W, size = places.lanes, f"abs(work[{places.x} + e * {places.lanes} + b])"
    v, most = f"abs(work[({n} + e) * {W} + b])", f"abs(work[({n} + int(lanes[5, b])) * {W} + b])"
    fastest = [f"for e in range({n}):", f"    lanes[5, b] = e if {v} > {most} else lanes[5, b]"]
    return [
        f"for b in range({W}):",
        "    sizes[b] = zero",
        f"for e in range({n}):",
        f"    for b in range({W}):",
        f"        sizes[b] = {size} if {size} > sizes[b] else sizes[b]",
        f"for b in range({W}):",
        "    lanes[4, b] = sizes[b] if sizes[b] > lanes[4, b] else lanes[4, b]",
        f"for e in range({places.state}):",
        f"    for b in range({W}):",
        f"        sizes[b] += {size}",
        "ill = 0",
        f"for b in range({W}):",
        f"    ill += 0 if sizes[b] < {LARGEST!r} else 1",
        "    ill += failed[b]",
        "if ill != 0:",
        f"    for b in range({W}):",
        f"        if alive[b] == 1 and (failed[b] != 0 or not sizes[b] < {LARGEST!r}):",
        "            alive[b], lanes[0, b], lanes[1, b] = 0, t, 3.0 if failed[b] == 1 else 1.0",
        *indented(fastest, 3),
        *take,
        f"if ill != 0 or steps % {WATCHED} == 0:",
        f"    if steps % {WATCHED} == 0:",
        *indented(gained, 2),
        f"            if alive[b] == 1 and came > {RUNAWAY!r} * moved:",
        "                alive[b], lanes[0, b], lanes[1, b] = 0, t + h, 2.0",
        *indented(fastest, 4),
        f"    for b in range({W}):",
        "        if alive[b] == 0:",
        f"            for e in range({places.state}):",
        f"                work[e * {W} + b] = np.nan",
    ]
