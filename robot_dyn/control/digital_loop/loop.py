"""The loop of a real controller: measurements are delayed and rounded, commands are delayed and limited.

    q, v at t_k − τ_m ─ blocks ─► q̂, v̂ ─ controller at t_k ─► blocks ─► u from t_k + τ_u onwards

The loop is itself a sampled controller: its states z contain the delayed signals and the states of blocks. Whole
periods of a delay are a queue of signals; the rest of a period is a second instant in each period:

    measured at t_k − τ_m: x_{k−d} of the instants t_k − (τ_m mod T);   acts from t_k + τ_u: at t_{k+d} + (τ_u mod T)

[Åström, Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, sec. 2.3 and ch. 9]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil
from typing import Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.control.controller import Controller, Enclosing, Nested, check_joints, check_sampled
from robot_dyn.control.digital_loop.block import Block
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.errors import ControlError, shown
from robot_dyn.foundations.validate import integer, number

SIGNALS = {"position": "rad", "velocity": "rad/s", "actuation": "N m"}  # unit of the signal on each line
LINES = tuple(SIGNALS)
_MIN = 1e-6  # smallest distance of two instants, in periods
_MAX = 1000  # largest delay, in periods: each period adds a state to every joint
_ROUNDED = 1e-9  # largest change when a delay is rounded, in periods


class Instant(NamedTuple):
    """A point of each period, as a fraction, at which the loop measures, computes, or applies a torque."""

    part: float
    measures: bool
    computes: bool
    acts: bool


@final
@dataclass(frozen=True, eq=False)
class Loop(Enclosing):
    """A sampled controller with delays, and blocks between it and the arm.

    Delays are in periods T. The controller computes at t_k = k T, from the reference at that time and the measurement
    at t_k − τ_m T; its torque acts from t_k + τ_u T, with τ_m = measurement_delay_periods and τ_u =
    actuation_delay_periods. Measurements before the start are the initial position and velocity, and the torque is 0
    until the first command acts. The actuation of a run is the acting torque.

    Attributes:
        controller: A sampled controller; its period is the period of the loop.
        position: Blocks of the measured position, in the order from the joints to the controller.
        velocity: Blocks of the measured velocity; if the first is `Differences`, its input is the output of `position`.
        actuation: Blocks of the torque, in the order from the controller to the joints.
        measurement_delay_periods: Delay of position and velocity, in periods, not negative.
        actuation_delay_periods: Delay of the torque, from the start of its computation, in periods, not negative.
        noise_seed: Seed of the noise, an integer.
        run: Number of the run, which selects its noise; `rollouts` counts up from it.

    Raises:
        ControlError: If the controller is continuous or a loop itself, or a block or a delay is invalid.
    """

    outermost: ClassVar[bool] = True

    controller: Controller
    position: tuple[Block, ...] = ()
    velocity: tuple[Block, ...] = ()
    actuation: tuple[Block, ...] = ()
    measurement_delay_periods: float = 0.0
    actuation_delay_periods: float = 0.0
    noise_seed: int = 0
    run: int = 0
    period_s: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        check_sampled("controller", self.controller)
        object.__setattr__(self, "period_s", self.controller.period_s)
        for line in LINES:
            object.__setattr__(self, line, _blocks(line, getattr(self, line)))
        for name in ("measurement_delay_periods", "actuation_delay_periods"):
            object.__setattr__(self, name, delay(name, getattr(self, name)))
        for name in ("noise_seed", "run"):
            object.__setattr__(self, name, integer(name, getattr(self, name), most=2**63 - 1, error=ControlError))
        super().__post_init__()
        self._check_blocks(self.period_s)
        self.places  # noqa: B018  # cached now, while the controller has numbers: tracing replaces them by symbols

    def _check_blocks(self, period_s: float) -> None:
        for line, i, block in self.blocks:
            if block.differentiates and (line, i) != ("velocity", 0):
                kind = type(block).__name__
                raise ControlError(f"{line}: {kind} must be the first block of velocity; move it there")
            check_joints(block, self.n, f"{line}: ")
            block.check(period_s)

    @property
    def blocks(self) -> Iterator[tuple[str, int, Block]]:
        """The blocks, each with its line and number."""
        return ((line, i, block) for line in LINES for i, block in enumerate(getattr(self, line)))

    @cached_property
    def n(self) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Number of driven joints."""
        return self.controller.n

    @property
    def parts(self) -> tuple[Nested, ...]:
        parts = [*super().parts]
        for line in LINES:
            names = [block.name for block in getattr(self, line)]
            for i, (name, block) in enumerate(zip(names, getattr(self, line), strict=True)):
                number = f" {names[: i + 1].count(name)}" if names.count(name) > 1 else ""
                parts.append(Nested(f"{line}.{i}", f"{line}.{name}{number}.", block))
        return tuple(parts)

    @property
    def instants(self) -> tuple[float, ...]:
        return tuple(instant.part for instant in self.ticks)

    @property
    def acting_instant(self) -> int:
        return next(i for i, instant in enumerate(self.ticks) if instant.acts)

    @property
    def deviates(self) -> int:
        return sum(block.state_size(self.n) for _, _, block in self.blocks if block.random)

    @property
    def noise_key(self) -> tuple[int, int]:
        return self.noise_seed, self.run

    def of_run(self, run: int) -> Loop:
        return with_values(self, {"run": self.run + run})

    @property
    def state_size(self) -> int:
        return max((place.stop for place in self.places.values()), default=0)

    @cached_property
    def ticks(self) -> tuple[Instant, ...]:
        """The instants of each period, the first at its start."""
        return instants(self.measurement_delay_periods, self.actuation_delay_periods)

    @property
    def derives_velocity(self) -> bool:
        """True if the velocity is derived from the measured position."""
        return bool(self.velocity) and self.velocity[0].differentiates

    @cached_property
    def places(self) -> dict[str, slice]:
        """Slices of the states in z, by name."""
        n, several = self.n, len(self.ticks) > 1
        measured = n if self.derives_velocity else 2 * n
        whole = int(self.measurement_delay_periods), int(self.actuation_delay_periods)
        named = {f"{line}.{i}": block for line, i, block in self.blocks}
        sizes = {"controller": self.controller.state_size, "instant": several, "begun": 0}
        sizes["sample"] = measured * (self.measurement_delay_periods % 1.0 > 0)
        sizes["past"] = measured * whole[0]
        sizes |= {name: block.state_size(n) for name, block in named.items() if not block.random}
        sizes["begun"] = any(sizes[name] for name in sizes if name not in ("controller", "instant"))
        sizes["coming"] = n * whole[1]
        sizes["computed"] = n * (self.actuation_delay_periods % 1.0 > 0)
        sizes["acting"] = n * several
        sizes |= {name: block.state_size(n) for name, block in named.items() if block.random}
        ends = np.cumsum([0, *sizes.values()]).tolist()
        return {name: slice(a, b) for name, a, b in zip(sizes, ends, ends[1:], strict=False)}

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return _tick(self, t, q, v, z)[0]

    def state_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return 0 * z

    def next_state(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return _tick(self, t, q, v, z)[1]

    def at_period(self, period_s: float) -> Controller:
        inside = self.controller.at_period(period_s)
        if not period_s:
            return inside
        self._check_blocks(period_s)
        return with_values(self, {"controller": inside, "period_s": period_s})

    def small_signal(self) -> Loop:
        lines: Any = {line: tuple(block for block in getattr(self, line) if block.linear) for line in LINES}
        return replace(self, controller=self.controller.small_signal(), **lines)

    def settled(self, t: float, q: Array, v: Array, z: Array) -> Array:
        inside = self.controller.settled(t, q, v, z)
        z = np.concatenate([inside, np.zeros(self.state_size - len(inside))])
        late = ceil(self.measurement_delay_periods) + ceil(self.actuation_delay_periods) + 2
        for k in range(-self.cycle * ceil(late / self.cycle), 0):
            for part in self.instants:
                s = (k + part) * self.period_s
                z = self.next_state(t + s, q + s * v, v, z)
        return z


def _blocks(line: str, value: Any) -> tuple[Block, ...]:
    """Return the blocks of a line, from one block or a sequence."""
    blocks = (value,) if isinstance(value, Block) else value
    if not isinstance(blocks, tuple | list) or not all(isinstance(block, Block) for block in blocks):
        raise ControlError(f"{line} must be blocks, such as [rd.control.Quantisation(1e-4)], got {shown(value)}")
    return tuple(blocks)


# --- a tick: the next acting torque, and the next states of controller, delays and blocks


def _tick(loop: Loop, t: float, q: Array, v: Array, z: Array) -> tuple[Array, Array]:
    """Return the torque that acts from a tick onwards, and z⁺.

    z = 0 means that no tick has happened: all earlier measurements were q and v, and the torque is 0.
    """
    i, begun = _instant_of(loop, z), z[loop.places["begun"]]
    if len(begun) and begun[0] < 0.5:
        z = _at_rest(loop, q, v, z)
    at, fresh = loop.ticks[i], q if loop.derives_velocity else np.concatenate([q, v])
    states = {name: z[place] for name, place in loop.places.items()}
    states["begun"] = np.ones(len(begun))
    u = states["acting"]
    if at.computes:
        u = _computed(loop, t, fresh, states)
        if loop.actuation_delay_periods % 1.0:
            u, states["computed"] = states["acting"], u
    elif at.acts:
        u = states["computed"]
    if at.measures and not at.computes:
        states["sample"] = fresh
    if len(loop.ticks) > 1:
        states["acting"], states["instant"] = u, np.array([(i + 1.0) % len(loop.ticks)])
    return u, np.concatenate([*states.values()])


def _instant_of(loop: Loop, z: Array) -> int:
    """Return the index of this tick's instant, which z counts if there are several."""
    i = 0
    while i < len(loop.ticks) - 1 and z[loop.places["instant"]][0] > i + 0.5:
        i += 1
    return i


def _computed(loop: Loop, t: float, fresh: Array, states: dict[str, Array]) -> Array:
    """Return the torque delayed by the whole periods of its delay, and advance `states`."""
    newest = states["sample"] if len(states["sample"]) else fresh
    measured, states["past"] = shifted(newest, states["past"])
    q = _through(loop, "position", measured[: loop.n], states)
    v = _through(loop, "velocity", q if loop.derives_velocity else measured[loop.n :], states)
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
    """Return the states of a loop that has always measured q and v, with zero torque."""
    states = {name: z[place] for name, place in loop.places.items()}
    fresh = q if loop.derives_velocity else np.concatenate([q, v])
    for name in ("sample", "past"):
        states[name] = np.concatenate([fresh] * (len(states[name]) // len(fresh)) or [fresh[:0]])
    signals = {"position": q, "velocity": v, "actuation": 0 * q}
    for line, i, block in loop.blocks:
        if line == "velocity" and i == 0 and loop.derives_velocity:
            signals[line] = signals["position"]
        x, name = signals[line], f"{line}.{i}"
        if not block.random:
            states[name] = block.start(x, loop.period_s)
        elif line == "actuation":
            continue  # zero torque has no noise
        signals[line] = block.output(x, states[name], loop.period_s)
    return np.concatenate([*states.values()])


def instants(measurement_delay: float, actuation_delay: float) -> tuple[Instant, ...]:
    """Return the instants of each period, the computation first, for delays in periods.

    Raises:
        ControlError: If two instants lie too close together.
    """
    measured, acted = -measurement_delay % 1.0, actuation_delay % 1.0
    parts = sorted({0.0, measured, acted})
    if (np.diff([*parts, 1.0]) < _MIN).any():
        raise ControlError(
            f"measurement_delay_periods = {measurement_delay!r} and actuation_delay_periods = {actuation_delay!r} give"
            f" two instants less than {_MIN:g} periods apart; make them equal, or move them further apart"
        )
    return tuple(Instant(part, part == measured, part == 0.0, part == acted) for part in parts)


def delay(name: str, value: object) -> float:
    """Return a delay in periods, as a whole number if it differs from one only by rounding."""
    periods = number(name, value, error=ControlError)
    if not 0 <= periods <= _MAX:
        raise ControlError(f"{name} must be from 0 to {_MAX} periods, got {periods:g}; choose another period")
    return float(round(periods)) if abs(periods - round(periods)) < _ROUNDED else periods


def shifted(x: Array, past: Array) -> tuple[Array, Array]:
    """Return the output of a queue when x enters it, and its new content, newest first."""
    if not len(past):
        return x, past
    return past[-len(x) :], np.concatenate([x, past[: -len(x)]])
