"""The states at which each implementation loses most digits of inverse and forward dynamics, judged by balls.

lost = −log₁₀(2⁻⁵³) − digits
"""

from __future__ import annotations

from collections.abc import Iterator
from math import log10

import numpy as np

from robot_dyn import Robot
from robot_dyn.accuracy import Batch, DigitCount, Held, Implementation, digits_of, implementations
from robot_dyn.queries import FORWARD_DYNAMICS, INVERSE_DYNAMICS, Quantity
from robot_dyn.report import Budget
from robot_dyn.tools.stress.result import WorstCase
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import listed, shrunk_state

_OF_FLOAT64 = -log10(2.0**-53)
_ROUNDS, _MOST_TRIES = 3, 60
_OTHER_NUMBERS = ("Lagrangian, float32", "Lagrangian, longdouble")


def lost_digits(robot: Robot, states: Batch, rng: np.random.Generator, work: Work) -> Iterator[WorstCase]:
    """The implementations in float64, one after the other."""
    quantities = (INVERSE_DYNAMICS, FORWARD_DYNAMICS)
    names = tuple(f"digits lost in {quantity.name}" for quantity in quantities)
    known = work.do("implementations, machine code among them", lambda _: implementations(robot), names)
    if known is None:
        return
    found, left_out = known
    work.left_out += left_out
    digit_count = DigitCount(robot, states, None, rng)
    for what, quantity in zip(names, quantities, strict=True):
        for implementation in found:
            if quantity in implementation.quantities and implementation.name not in _OTHER_NUMBERS:
                yield from _lost(digit_count, implementation, quantity, what, work)


def _lost(
    digit_count: DigitCount, implementation: Implementation, quantity: Quantity, what: str, work: Work
) -> Iterator[WorstCase]:
    """What one implementation loses; nothing for lack of time."""
    name = f"{what} by {implementation.name}"
    held = work.do(name, lambda budget: _counted(digit_count, implementation, quantity, budget))
    if held is None:
        return

    def losses(batch: Batch) -> np.ndarray:
        state = {name: batch[name][0] for name in quantity.arguments}
        return np.array([_OF_FLOAT64 - digits_of(digit_count.judged(implementation, quantity, state))])

    typical, random, lost = (_OF_FLOAT64 - digits for digits in (held.typical, held.random, held.searched))
    at = {name: np.array(x) for name, x in held.state.items()}
    state, minimal = shrunk_state(at, digit_count.states, losses, lost, name, work, _MOST_TRIES)
    note = f"{implementation.name}: {held.searched:.1f} digits hold, {held.typical:.1f} typically"
    yield WorstCase(what, "", "digits", typical, random, max(lost, minimal), minimal, listed(state), note)


def _counted(digit_count: DigitCount, implementation: Implementation, quantity: Quantity, budget: Budget) -> Held:
    """The fewest digits of some searches."""
    best = digit_count.count(implementation, quantity, budget.check)
    for _ in range(_ROUNDS - 1):
        if best.searched < best.random:
            break
        best = min(best, digit_count.count(implementation, quantity, budget.check), key=lambda held: held.searched)
    return best
