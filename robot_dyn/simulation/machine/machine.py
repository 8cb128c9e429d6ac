"""The machine code of a setup: its motion traced, its march compiled, and held to the interpreted engine before use.

|y⁺ − y⁺_interpreted| ≤ 1e-13 · scale   after one step from random states, or it is refused
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.integrator import Integrator, System
from robot_dyn.simulation.machine.places import Ended, Lane, Now
from robot_dyn.simulation.machine.program import Program
from robot_dyn.simulation.machine.timetable import Timetable, at_times, pieces, timetable
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.schedule import Stretch
from robot_dyn.simulation.setup import Setup

_STATES = 4
_AGREES = 1e-13


class MarchError(RobotDynError):
    """A compiled march that does not agree with the interpreted engine; nothing of it is used."""


@final
@dataclass(frozen=True, eq=False)
class Machine:
    """A motion as machine code.

    Attributes:
        motion: The interpreted motion whose equations it has: that of the setup, with right angles written out in full.
        program: Its text and machine code.
        whole: Whether steps run in machine code too, not the rate alone.
        free: Values of what differs from run to run, as the setup has them.
    """

    motion: Motion
    program: Program
    whole: bool
    free: np.ndarray

    @property
    def ready(self) -> bool:
        """Whether there is nothing left to compile."""
        return self.program.known if self.whole else "rate" in vars(self.program)

    def work(self, y: np.ndarray) -> np.ndarray:
        """The array of work at a state (m,), or at those of all lanes (W, m)."""
        places = self.program.places
        made, x = np.zeros(places.size), places.x + (places.state + places.held) * places.lanes
        made[: places.x] = y.T.ravel()
        made[x : places.k] = np.repeat(self.free, places.lanes)
        return made

    def hold(self, work: np.ndarray, held: np.ndarray | None) -> None:
        """Put what a sampled controller holds, (n,) or (W, n), in its place."""
        places = self.program.places
        if held is not None:
            at = places.x + places.x
            work[at : at + places.held * places.lanes] = held.T.ravel()

    def run(self, work: np.ndarray, table: Timetable, **arrays: Any) -> Ended:
        """March; `arrays` are those of the program that matter, the others are empty."""
        m, lanes, empty = self.program.places.state, self.program.lanes, np.empty
        given: dict[str, Any] = {
            "lanes": np.zeros((len(Lane), lanes)), "alive": np.ones(lanes, np.int64), "given": empty((0, 0)),
            "which": empty(0, np.int64), "out_step": empty((0, 2), np.int64), "out_y": empty((0, 0, lanes)),
            "out_u": empty((0, 0, 0)), "out_e": empty((0, 2, lanes)), "out_shared": empty((0, m + 2)),
            "columns": empty((0, 0)), "clock": np.array([np.inf, 0.0, 0.0]), "stop": np.zeros(1, np.int64),
        } | arrays  # fmt: skip
        order = (
            "given",
            "which",
            "out_step",
            "out_y",
            "out_u",
            "out_e",
            "out_shared",
            "columns",
            "now",
            "clock",
            "stop",
        )
        return Ended(
            self.program.march(work, given["lanes"], given["alive"], *table.arrays, *(given[name] for name in order))
        )

    def look(self, t: np.ndarray, y: np.ndarray, held: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Rate with actuation (k, m + n), and energies (k, 2), of states y (k, m) at times t."""
        there = at_times(getattr(self.motion.controller, "reference", None), t)
        made, energies = np.empty((len(t), self.program.places.made)), np.empty((len(t), 2))
        work = self.work(np.zeros(self.program.places.state))
        if not self.whole:
            for i in range(len(t)):
                work = self.work(y[i])
                self.hold(work, None if held is None else held[i])
                work[len(y[i]) : 2 * len(y[i])] = y[i]
                self.program.rate(t[i], work, there[i], made[i])
                self.program.energy(t[i], work, there[i], energies[i])
            return made, energies
        rest, ones = np.zeros(len(t)), np.ones(len(t), dtype=np.int64)
        table = Timetable(t, rest, np.full(len(t), np.inf), ones, 0 * ones, there, there)
        now = np.zeros(len(Now), dtype=np.int64)
        now[Now.SAMPLING], now[Now.BUDGET], now[Now.EVERY], now[Now.THIN] = 1, len(t) + 1, 1, 1
        given = y if held is None else np.column_stack([y, held])
        self.run(
            work, table, given=np.ascontiguousarray(given), now=now,
            out_u=made[:, None], out_e=energies[:, :, None],
        )  # fmt: skip
        return made, energies

    def system(self, held: np.ndarray | None, stretch: Stretch, setup: Setup, seen: np.ndarray | None = None) -> System:
        """The equation on one stretch, as `Motion.system`, its rate in machine code."""
        part = pieces(setup.controller, np.array([stretch.start]), np.array([stretch.end]))[0]
        work, rate, m = self.work(np.zeros(self.program.places.state)), self.program.rate, self.program.places.state
        self.hold(work, held)
        made, last, n = np.empty(self.program.places.made), np.nextafter(stretch.end, -np.inf), self.program.n

        def one(t: float, y: np.ndarray) -> np.ndarray:
            if y.ndim > 1:
                return np.array([one(t, row) for row in y.reshape(-1, m)]).reshape(y.shape)
            work[m : 2 * m] = y
            rate(min(float(t), last), work, part, made)
            if seen is not None:
                seen[:n], seen[n:] = made[:n], made[m : m + n]
            return made[:m].copy()

        return System(one, n, self.motion.widths)

    def check(self, setup: Setup) -> None:
        """Hold one step from random states to the interpreted engine.

        Raises:
            MarchError: If they differ by more than rounding.
        """
        rng, n = np.random.default_rng(20), self.program.n
        table, stretches, lanes = timetable(setup), setup.stretches, self.program.lanes
        for i in range(_STATES if lanes == 1 else 1):
            s = int(rng.integers(len(table.starts)))
            y = rng.normal(size=(lanes, self.program.places.state))
            held = rng.normal(size=(lanes, n)) if self.motion.sampled else None
            t, method, first = stretches[s].start, setup.integrator, None if held is None else held[0]
            with np.errstate(all="ignore"):
                f = self.motion.system(first, stretches[s]).rate(t, y[0])
            # so that neither engine's rounding is multiplied, as by gains of an unstable control
            h = min(1e-3, setup.step_s, 0.01 / max(1.0, float(np.nan_to_num(np.abs(f[: 2 * n]).max()))))
            stretch = Stretch(t, max(stretches[s].end, t + 2 * h), False)
            ours = self._one_step(table, s, h, y, held) if self.whole else None
            for lane in range(min(lanes, _STATES)):
                own = None if held is None else held[lane]
                system = self.motion.system(own, stretch)
                if ours is None:
                    one, theirs = self.system(own, stretch, setup).rate(t, y[lane]), system.rate(t, y[lane])
                    allowed = _AGREES * max(1.0, float(np.linalg.cond(self.motion.plant.M(y[lane, :n]))))
                else:
                    assert isinstance(method, Integrator)
                    one, theirs, allowed = ours[lane], method.step(system, t, y[lane], h), _AGREES
                error = _difference(one, theirs, y[lane], n)
                if not error <= allowed:
                    raise MarchError(
                        f"a compiled step of {self.program.name} differs from the interpreted one by {error:.1e} of "
                        f"its size, {allowed:.1e} allowed: take engine='interpreted', and report it (random state {i})"
                    )

    def _one_step(self, table: Timetable, s: int, h: float, y: np.ndarray, held: np.ndarray | None) -> np.ndarray:
        one = slice(s, s + 1)
        part = Timetable(
            table.starts[one], np.array([h]), table.lasts[one], np.ones(1, np.int64), np.zeros(1, np.int64),
            table.pieces[one], table.at_ticks[one],
        )  # fmt: skip
        work, now = self.work(y), np.zeros(len(Now), dtype=np.int64)
        self.hold(work, held)
        now[Now.BUDGET], now[Now.EVERY], now[Now.THIN] = 2, 2, 2
        self.run(work, part, now=now, out_shared=np.empty((1, self.program.places.state + 2)))
        places = self.program.places
        return work[places.x : 2 * places.x].reshape(places.state, places.lanes).T


def _difference(x: np.ndarray, y: np.ndarray, start: np.ndarray, n: int) -> float:
    """Largest difference of two states, of positions, velocities and the rest each by its own size."""
    size = np.maximum(np.abs(y), np.abs(start))
    parts = [part for part in (slice(0, n), slice(n, 2 * n), slice(2 * n, None)) if len(size[part])]
    worst = [np.abs(x[part] - y[part]).max() / size[part].max() for part in parts]
    return float(max(worst)) if np.isfinite(worst).all() else np.inf
