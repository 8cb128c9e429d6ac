"""The step of a method as lines of machine code, around the one place where the rate y' = f(t, y) stands.

    k_i = f(t + c_i h, y + h Σ_j a_ij k_j),    y⁺ = y + h Σ_i b_i k_i

The coefficients are those of the method's tableau. Entry e of lane b is number e W + b, so that one text serves one
state (W = 1) and W of them side by side.
"""

from __future__ import annotations

import numpy as np

from robot_dyn.integrate.explicit import ExplicitRungeKutta, SemiImplicitEuler
from robot_dyn.integrate.fixed_point import INFLATED_ROUNDING, MOST_ITERATIONS, NOISE, PATIENCE
from robot_dyn.integrate.gauss import Gauss
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.tableau import Numbers
from robot_dyn.simulation.machine.places import Places


def steps_whole(method: object) -> bool:
    """Whether the steps of a method run whole in machine code."""
    return isinstance(method, ExplicitRungeKutta | SemiImplicitEuler | Gauss)


def kept(method: Integrator) -> int:
    """Rows of length m that a method keeps during a step."""
    if isinstance(method, Gauss):
        return 2 * len(numbers(method).b) + 4
    if isinstance(method, ExplicitRungeKutta):
        return 1 + len(_slots(numbers(method)))
    return 1


def numbers(method: Integrator) -> Numbers:
    """The tableau of a method in float64."""
    tableau = method.tableau if isinstance(method, ExplicitRungeKutta | Gauss) else None
    if tableau is None:
        raise TypeError(f"{method.name} has no tableau")
    return tableau.numbers(np.empty(0))


def step_lines(method: Integrator, places: Places, rate: list[str]) -> list[str]:
    """Lines that leave y⁺ in x, and `failed[b]` other than 0 for a lane whose stages are not found.

    They read t, h, last and `sampling`, which asks for the rate at (t, y) alone, in k.

    Args:
        method: One that `steps_whole`.
        places: Where rows stand.
        rate: Lines that make k of x at time `at`.
    """
    if isinstance(method, Gauss):
        return _gauss(method, places, rate)
    end = _semi_implicit(places) if isinstance(method, SemiImplicitEuler) else None
    nodes = (0.0,) if end else numbers(method).c
    lines = [
        *_each(places, places.state, f"work[{places.x} + e] = work[e]"),
        f"for stage in range(1 if sampling else {len(nodes)}):",
        "    at = t + h * nodes[stage]" if len(nodes) > 1 else "    at = t",
        "    at = last if at > last else at",
        *indented(rate),
        "    if sampling:",
        "        break",
    ]
    for i in range(len(nodes)):
        body = end or _explicit_stage(numbers(method), places, i)
        lines += [f"    {'if' if i == 0 else 'elif'} stage == {i}:", *indented(body, 2)]
    return lines


def _explicit_stage(tableau: Numbers, places: Places, i: int) -> list[str]:
    """What follows stage i: the sum of weighted stages, and the state of the next stage or the end of the step."""
    slots, weights = _slots(tableau), dict(tableau.b)
    lines = [f"new = work[{places.k} + e]"]
    first = i == min(weights)
    total = f"work[{places.spare(0)} + e]"
    if i in weights:
        lines.append(f"total = {weights[i]!r} * new" if first else f"total = {total} + {weights[i]!r} * new")
    elif i > min(weights):
        lines.append(f"total = {total}")
    if i in slots:
        lines.append(f"work[{places.spare(1 + slots[i])} + e] = new")
    if i + 1 == len(tableau.c):
        return _each(places, places.state, *lines, f"work[{places.x} + e] = work[e] + total * h")
    if i in weights:
        lines.append(f"{total} = total")
    terms = [
        f"{a!r} * new" if j == i else f"{a!r} * work[{places.spare(1 + slots[j])} + e]" for j, a in tableau.a[i + 1]
    ]
    lines.append(f"work[{places.x} + e] = work[e] + ({' + '.join(terms) or 'zero'}) * h")
    return _each(places, places.state, *lines)


def _slots(tableau: Numbers) -> dict[int, int]:
    """The stages that are needed later than by the next one, and where each is kept."""
    needed = sorted({j for i, row in enumerate(tableau.a) for j, _ in row if j < i - 1})
    return {stage: slot for slot, stage in enumerate(needed)}


def _semi_implicit(places: Places) -> list[str]:
    """v⁺ = v + h a, q⁺ = q + h v⁺; the rest as Euler's."""
    n, W = "n", places.lanes
    return [
        *_each(places, places.state, f"work[{places.x} + e] = work[e] + work[{places.k} + e] * h"),
        f"for e in range({n} * {W}):",
        f"    work[{places.x} + e] = work[e] + work[{places.x} + {n} * {W} + e] * h",
    ]


def _gauss(method: Gauss, places: Places, rate: list[str]) -> list[str]:
    """The iteration of `fixed_point`, on each lane by itself: a lane that has ended waits for the others."""
    tableau, m, W, x, k = numbers(method), places.state, places.lanes, places.x, places.k
    s, size = len(tableau.b), m * W
    old, new, least, own, step, length = (places.spare(i) for i in (0, s, 2 * s, 2 * s + 1, 2 * s + 2, 2 * s + 3))
    lines = [
        *_each(places, s * m, f"work[{old} + e] = zero"),
        *_each(places, m, f"work[{least} + e] = infinity", f"work[{length} + e] = abs(work[e])"),
        f"for b in range({W}):",
        "    stale[b], failed[b], slack[b] = 0, 1 if alive[b] == 1 else 0, one",
        *_by_lane(m, W, f"slack[b] = max(slack[b], work[{length} + e * {W} + b])"),
        f"waiting = {W}",
        f"for turn_ in range(1 if sampling else {MOST_ITERATIONS}):",
        "    if waiting == 0:",
        "        break",
        f"    for stage in range(1 if sampling else {s}):",
        "        at = t if sampling else t + h * nodes[stage]",
        "        at = last if at > last else at",
        "        if sampling:",
        *indented(_each(places, m, f"work[{x} + e] = work[e]"), 3),
    ]
    for i, row in enumerate(tableau.a):
        terms = " + ".join(f"{a!r} * work[{old + j * size} + e]" for j, a in row)
        lines += [
            f"        elif stage == {i}:",
            *indented(_each(places, m, f"work[{x} + e] = work[e] + ({terms})"), 3),
        ]
    lines += [
        *indented(rate, 2),
        "        if sampling:",
        "            break",
        f"        for e in range({size}):",
        f"            work[{new} + stage * {size} + e] = work[{k} + e] * h",
        "    if sampling:",
        "        break",
        *indented(_each(places, m, f"work[{step} + e], work[{own} + e] = zero, zero")),
        f"    for stage in range({s}):",
        f"        for e in range({size}):",
        f"            change = abs(work[{new} + stage * {size} + e] - work[{old} + stage * {size} + e])",
        f"            work[{step} + e] = change if not change <= work[{step} + e] else work[{step} + e]",
        f"            work[{own} + e] = max(work[{own} + e], abs(work[{new} + stage * {size} + e]))",
        "    waiting = 0",
        f"    for b in range({W}):",
        "        if failed[b] != 1:",
        "            continue",
        "        shrinks, rounding, largest = False, True, zero",
        f"        for e in range({m}):",
        f"            change, mine = work[{step} + e * {W} + b], work[{own} + e * {W} + b]",
        f"            shrinks |= (change < work[{least} + e * {W} + b]) & (change > epsilon * mine)",
        f"            work[{least} + e * {W} + b] = min(change, work[{least} + e * {W} + b])",
        f"            bound = {NOISE!r} * epsilon * slack[b] + {INFLATED_ROUNDING!r} * "
        f"(work[{length} + e * {W} + b] + mine)",
        "            rounding &= change <= bound",
        "            largest = change if not change <= largest else largest",
        f"        for i in range({s * m}):",
        f"            work[{old} + i * {W} + b] = work[{new} + i * {W} + b]",
        "        stale[b] = 0 if shrinks else stale[b] + 1",
        "        if not largest < infinity:",
        "            failed[b] = 2",
        f"        elif largest == 0 or (stale[b] >= {PATIENCE} and rounding):",
        "            failed[b] = 0",
        "        else:",
        "            waiting += 1",
    ]
    terms = " + ".join(f"{b!r} * work[{old + j * size} + e]" for j, b in tableau.b)
    return [*lines, *_each(places, m, f"work[{x} + e] = work[e] + ({terms})")]


def _each(places: Places, rows: int, *lines: str) -> list[str]:
    """A loop over the numbers of so many rows."""
    return [f"for e in range({rows * places.lanes}):", *indented(list(lines))]


def _by_lane(rows: int, lanes: int, line: str) -> list[str]:
    return [f"for e in range({rows}):", f"    for b in range({lanes}):", f"        {line}"]


def indented(lines: list[str], by: int = 1) -> list[str]:
    """Lines moved to the right by so many steps."""
    return ["    " * by + line for line in lines]
