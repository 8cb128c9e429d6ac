"""A tick of a loop: the torque that acts next, and the next states of the controller, delays and blocks.

Before the first tick z = 0, which stands for q and v measured at all times before, and for no torque.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.control.digital_loop.delay import shifted
from robot_dyn.foundations.arithmetic import Array

if TYPE_CHECKING:
    from robot_dyn.control.digital_loop.loop import Loop


def tick(loop: Loop, t: float, q: Array, v: Array, z: Array) -> tuple[Array, Array]:
    """The torque that acts from a tick on, and z⁺."""
    i, begun = _coming(loop, z), z[loop.places["begun"]]
    if len(begun) and begun[0] < 0.5:
        z = _at_rest(loop, q, v, z)
    at, fresh = loop.ticks[i], q if loop.differs else np.concatenate([q, v])
    states = {name: z[place] for name, place in loop.places.items()}
    states["begun"] = np.ones(len(begun))
    u = states["acting"]
    if at.computes:
        u = _computed(loop, t, fresh, states)
        if loop.actuation_delay % 1.0:
            u, states["computed"] = states["acting"], u
    elif at.acts:
        u = states["computed"]
    if at.measures and not at.computes:
        states["sample"] = fresh
    if len(loop.ticks) > 1:
        states["acting"], states["instant"] = u, np.array([(i + 1.0) % len(loop.ticks)])
    return u, np.concatenate([*states.values()])


def _coming(loop: Loop, z: Array) -> int:
    """Number of the instant of this tick, which z counts if there are several."""
    i = 0
    while i < len(loop.ticks) - 1 and z[loop.places["instant"]][0] > i + 0.5:
        i += 1
    return i


def _computed(loop: Loop, t: float, fresh: Array, states: dict[str, Array]) -> Array:
    """Return the torque that leaves the whole periods of its delay, and advance `states`."""
    newest = states["sample"] if len(states["sample"]) else fresh
    measured, states["past"] = shifted(newest, states["past"])
    q = _through(loop, "position", measured[: loop.n], states)
    v = _through(loop, "velocity", q if loop.differs else measured[loop.n :], states)
    z = states["controller"]
    u = _through(loop, "actuation", loop.controller.torque(t, q, v, z), states)
    states["controller"] = loop.controller.next_state(t, q, v, z)
    u, states["coming"] = shifted(u, states["coming"])
    return u


def _through(loop: Loop, line: str, x: Array, states: dict[str, Array]) -> Array:
    """Return the signal after the blocks of a line, and advance their states."""
    for i, block in enumerate(getattr(loop, line)):
        s, name = states[f"{line}.{i}"], f"{line}.{i}"
        if not block.random:
            states[name] = block.next_state(x, s, loop.period_s)
        x = block.output(x, s, loop.period_s)
    return x


def _at_rest(loop: Loop, q: Array, v: Array, z: Array) -> Array:
    """Return the states of a loop in which q and v have been measured at all times, without torque."""
    states = {name: z[place] for name, place in loop.places.items()}
    fresh = q if loop.differs else np.concatenate([q, v])
    for name in ("sample", "past"):
        states[name] = np.concatenate([fresh] * (len(states[name]) // len(fresh)) or [fresh[:0]])
    signals = {"position": q, "velocity": v, "actuation": 0 * q}
    for line, i, block in loop.blocks:
        if line == "velocity" and i == 0 and loop.differs:
            signals[line] = signals["position"]
        x, name = signals[line], f"{line}.{i}"
        if not block.random:
            states[name] = block.start(x, loop.period_s)
        elif line == "actuation":
            continue  # no torque, no noise
        signals[line] = block.output(x, states[name], loop.period_s)
    return np.concatenate([*states.values()])
