"""A tick of a loop: what acts from now on, and the next states, of the states z where a loop has its delays and blocks.

Before the first tick z = 0; then q and v have been measured at all times, and no torque was asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.control.digital_loop.delay import shifted

if TYPE_CHECKING:
    from robot_dyn.control.digital_loop.loop import Loop


def tick(loop: Loop, t: float, q: Array, v: Array, z: Array) -> tuple[Array, Array]:
    """The torque that acts from a tick on, and z⁺."""
    i, begun = _coming(loop, z), z[loop.places["begun"]]
    if len(begun) and begun[0] < 0.5:
        z = _at_rest(loop, q, v, z)
    at, fresh = loop.ticks[i], q if loop.differs else np.concatenate([q, v])
    made = {name: z[place] for name, place in loop.places.items()}
    made["begun"] = np.ones(len(begun))
    u = made["acting"]
    if at.computes:
        u = _computed(loop, t, fresh, made)
        if loop.actuation_delay % 1.0:
            u, made["computed"] = made["acting"], u
    elif at.acts:
        u = made["computed"]
    if at.measures and not at.computes:
        made["sample"] = fresh
    if len(loop.ticks) > 1:
        made["acting"], made["instant"] = u, np.array([(i + 1.0) % len(loop.ticks)])
    return u, np.concatenate([*made.values()])


def _coming(loop: Loop, z: Array) -> int:
    """Number of the instant of this tick, which z counts where there are several."""
    i = 0
    while i < len(loop.ticks) - 1 and z[loop.places["instant"]][0] > i + 0.5:
        i += 1
    return i


def _computed(loop: Loop, t: float, fresh: Array, made: dict[str, Array]) -> Array:
    """What the torque is to be that the whole periods of its delay let through; the states in `made` go on."""
    newest = made["sample"] if len(made["sample"]) else fresh
    measured, made["past"] = shifted(newest, made["past"])
    q = _through(loop, "position", measured[: loop.n], made)
    v = _through(loop, "velocity", q if loop.differs else measured[loop.n :], made)
    z = made["controller"]
    u = _through(loop, "actuation", loop.controller.torque(t, q, v, z), made)
    made["controller"] = loop.controller.next_state(t, q, v, z)
    u, made["coming"] = shifted(u, made["coming"])
    return u


def _through(loop: Loop, line: str, x: Array, made: dict[str, Array]) -> Array:
    """The signal behind the blocks of a line, whose states go on."""
    for i, block in enumerate(getattr(loop, line)):
        s, name = made[f"{line}.{i}"], f"{line}.{i}"
        if not block.random:
            made[name] = block.next_state(x, s, loop.period_s)
        x = block.output(x, s, loop.period_s)
    return x


def _at_rest(loop: Loop, q: Array, v: Array, z: Array) -> Array:
    """The states of a loop in which q and v have been measured at all times, and no torque was asked for."""
    made = {name: z[place] for name, place in loop.places.items()}
    fresh = q if loop.differs else np.concatenate([q, v])
    for name in ("sample", "past"):
        made[name] = np.concatenate([fresh] * (len(made[name]) // len(fresh)) or [fresh[:0]])
    signals = {"position": q, "velocity": v, "actuation": 0 * q}
    for line, i, block in loop.blocks:
        if line == "velocity" and i == 0 and loop.differs:
            signals[line] = signals["position"]
        x, name = signals[line], f"{line}.{i}"
        if not block.random:
            made[name] = block.start(x, loop.period_s)
        elif line == "actuation":
            continue  # no torque, no noise
        signals[line] = block.output(x, made[name], loop.period_s)
    return np.concatenate([*made.values()])
