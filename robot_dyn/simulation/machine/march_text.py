"""The text of a march: steps, ticks, samples and the watch over divergence, as one Numba function.

    march(work, lanes, timetable…, records…, now, clock, stop) → Ended

The same text serves one run (one lane, which Python follows closely) and a tile of runs side by side. Names are made of
indices and numbers, so that no text of a file can reach the code.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

from robot_dyn.compiled.source import Source
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.machine.places import ARGUMENTS, Ended, Places
from robot_dyn.simulation.machine.stages import indented, step_lines
from robot_dyn.simulation.machine.watch_text import watch_lines


@final
@dataclass(frozen=True)
class MarchText:
    """The texts of a march.

    Attributes:
        sources: Straight-line code of rate, energy, and where there are such, tick and actuation.
        places: Where rows stand.
        method: A method that `steps_whole`; None for the functions alone.
        n: Number of joints.
        memory: Number of states of the controller.
    """

    sources: dict[str, Source]
    places: Places
    method: Integrator | None
    n: int
    memory: int

    @property
    def lanes(self) -> int:
        """Runs side by side."""
        return self.places.lanes

    def function(self, name: str) -> str:
        """Text of energy(t, work, p, y), tick(…), …: y of the state in `work`, lane by lane."""
        state = self.places.x if name == "rate" else self.places.y
        lines = [*self._lines(name, "t", state, "p", "y", 0), "return 0"]
        return "\n".join([f"def {name}(t, work, p, y):", *indented(lines, 1), ""])

    def _lines(self, name: str, time: str, state: int, p: str, result: str, at: int) -> list[str]:
        """The straight-line code of a function for all lanes."""
        source, places, W = self.sources[name], self.places, self.lanes
        rows = {1: state, 3: places.x + places.state * W, 4: places.x + (places.state + places.held) * W}

        def load(i: int, k: int) -> str:
            if i == 0:
                return time
            return f"{p}[{k}]" if i == 2 else f"work[{rows[i] + k * W}{' + b' if W > 1 else ''}]"

        if W == 1:
            lines = source.scalar_lines(load, "result_")
            return [line.replace("result_[", f"{result}[{at} + ") for line in lines]
        alike = [f"{name_} = {load(i, k)}" for name_, i, k in source.loads if i in (0, 2)]
        code = [f"{name_} = {load(i, k)}" for name_, i, k in source.loads if i not in (0, 2)]
        code += map(str, source.lines)
        code += [f"{result}[{at + k * W} + b] = {made}" for k, made in enumerate(source.results)]
        return [*alike, f"for b in range({W}):", *("    " + line for line in code)]

    @cached_property
    def march(self) -> str:
        """Text of the march."""
        rate = [*self._lines("rate", "at", self.places.x, "p", "work", self.places.k), "evaluations += 1"]
        step = step_lines(self.method, self.places, rate) if self.method else []
        sampled = "tick" in self.sources
        body = [
            *self._opening(),
            "while s < counts.shape[0]:",
            "    h, start, last, p = lengths[s], starts[s], lasts[s], pieces[s]",
            *(indented(self._tick(), 1) if sampled else []),
            "    while k < counts[s]:",
            "        t = start + k * h",
            "        final = now[11] == 1 and s == counts.shape[0] - 1",
            *indented(self._record(), 2),
            "        if final:",
            "            k += 1",
            "            continue",
            *indented(step, 2),
            *(indented(self._sample(), 2) if self.lanes == 1 else []),
            *indented(watch_lines(self.places, self.n, self.memory, self._show(), self._leave), 2),
            "        k += 1",
            "        if left <= 0 or stop[0] != 0:",
            *indented(self._leave(Ended.PAUSED), 3),
            "    s, k = s + 1, 0",
            *self._leave(Ended.DONE),
        ]
        return "\n".join([f"def march({', '.join(ARGUMENTS)}):", *indented(body, 1), ""])

    def _opening(self) -> list[str]:
        W, places = self.lanes, self.places
        lines = [
            "s, k, row, steps, seen, shared, left = now[0], now[1], now[2], now[3], now[4], now[5], now[6]",
            "sampling, base, evaluations = now[7] == 1, now[10], now[12]",
            f"failed, stale, slack = np.zeros({W}, np.int64), np.zeros({W}, np.int64), np.zeros({W})",
            f"sizes, energies, made = np.zeros({W}), np.zeros({2 * W}), np.zeros({2 * max(self.n, 1) * W})",
            f"held = np.zeros({(self.n + self.memory) * W})" if places.held else "held = sizes",
        ]
        if W == 1:
            return lines
        return [
            *lines,
            "if s == 0 and k == 0:",
            "    energy(starts[0], work, pieces[0], energies)",
            f"    for b in range({W}):",
            f"        lanes[2, b] = energies[b] + energies[{W} + b]",
            f"        lanes[3, b] = one + abs(energies[b]) + abs(energies[{W} + b])",
        ]

    def _leave(self, why: Ended) -> list[str]:
        return [
            "now[0], now[1], now[2], now[3], now[4], now[5], now[6] = s, k, row, steps, seen, shared, left",
            "now[12] = evaluations",
            f"return {int(why)}",
        ]

    def _tick(self) -> list[str]:
        """The controller acts: what it holds goes to x, its next memory to y."""
        W, places, n = self.lanes, self.places, self.n
        finite = ["size = zero", f"for e in range({n}):", "    size += abs(held[e])", "if not size < infinity:"]
        finite += indented(self._leave(Ended.TICK), 1)
        to, z = places.x + places.state * W, 2 * n * W
        lines = [
            "tick(start, work, at_ticks[s], held)",
            *(finite if W == 1 else []),
            f"for e in range({n * W}):",
            f"    work[{to} + e] = held[e]",
            f"for e in range({self.memory * W}):",
            f"    work[{z} + e] = held[{n * W} + e]",
        ]
        return ["if k == 0 and ticks[s] == 1:", *indented(lines, 1)]

    def _record(self) -> list[str]:
        """Samples at the record period, and the states that companion runs share."""
        return [
            *(self._record_one() if self.lanes == 1 else []),
            "if not sampling and (t >= clock[0] - clock[2] or final):",
            "    out_step[row, 0], out_step[row, 1] = s, k",
            "    for j in range(which.shape[0]):",
            f"        for e in range({self.lanes}):",
            f"            out_y[row, j, base + e] = work[which[j] * {self.lanes} + e]",
            *(self._record_tile("out_u", "actuation") if "actuation" in self.sources else []),
            *(self._record_tile("out_e", "energy") if self.lanes > 1 else []),
            "    row += 1",
            "    clock[0] += clock[1]",
        ]

    def _record_one(self) -> list[str]:
        places = self.places
        return [
            "if sampling:",
            f"    for e in range({places.state + places.held}):",
            f"        work[{places.x} + e] = given[s, e]",
            f"    for e in range({places.state}):",
            "        work[e] = given[s, e]",
            "elif k % now[8] == 0:",
            "    if seen % now[9] == 0:",
            f"        for e in range({places.state}):",
            "            out_shared[shared, e] = work[e]",
            f"        out_shared[shared, {places.state}], out_shared[shared, {places.state + 1}] = s, k",
            "        shared += 1",
            "    seen += 1",
        ]

    def _record_tile(self, array: str, function: str) -> list[str]:
        """What follows from the state of each lane, where it is asked for."""
        W = self.lanes
        return [
            f"    if {array}.shape[0] > row:",
            f"        {function}(t, work, p, made)",
            f"        for e in range({self.sources[function].outputs}):",
            f"            for b in range({W}):",
            f"                {array}[row, e, base + b] = made[e * {W} + b] if alive[b] == 1 else np.nan",
        ]

    def _show(self) -> list[str]:
        """A column for the observer, as of `Observer.step`; there is one while Python leaves room for it."""
        places, n = self.places, self.n
        sampled, canonical = "tick" in self.sources, self.method is not None and self.method.canonical
        acted = "one if k == 0 and ticks[s] == 1 else zero" if sampled else "one"
        v = places.k if canonical else n
        u = places.x + places.state if sampled else places.k + places.state
        return [
            "if columns.shape[1] > 0:",
            "    c = now[13]",
            "    now[13] = c + 1",
            f"    columns[0, c], columns[1, c] = t + h, {acted}",
            f"    for e in range({n}):",
            f"        columns[2 + e, c], columns[{2 + n} + e, c] = work[e], work[{v} + e]",
            f"        columns[{2 + 2 * n} + e, c] = work[{u} + e]",
        ]

    def _sample(self) -> list[str]:
        """The rate and energies of a given state."""
        return [
            "if sampling:",
            f"    for e in range({self.places.made}):",
            f"        out_u[s, 0, e] = work[{self.places.k} + e]",
            "    energy(t, work, p, energies)",
            "    out_e[s, 0, 0], out_e[s, 1, 0] = energies[0], energies[1]",
            "    k += 1",
            "    continue",
        ]
