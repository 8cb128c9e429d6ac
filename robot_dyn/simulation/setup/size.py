"""The size of a run, known before it starts: its steps, segments and samples, and the memory that they take.

bytes = samples · 8 · numbers of a sample,   or   segments · (an object, and a polynomial of the reference)
"""

from __future__ import annotations

from math import inf, ulp
from sys import float_info
from typing import TYPE_CHECKING

from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.validate import LEAST_EXACT

if TYPE_CHECKING:
    from robot_dyn.simulation.setup.setup import Setup

MOST_BYTES = 8 * 2**30  # of all that is recorded, by default
LONGEST_S = LEAST_EXACT / float_info.epsilon  # up to there floats resolve the times of a run
MOST_CUT = 200_000  # steps of a run of fixed step that is cut at events
MOST_STEPS = 1e11  # about a day of the fastest machine code
_SEGMENT_BYTES, _SEGMENT_BYTES_PER_JOINT = 500, 100  # by estimate; the second is a quintic at its start and along it


def check_segments(setup: Setup) -> None:
    """Refuse a run of more steps, ticks or switches than are possible, or of times that floats do not resolve.

    Raises:
        QueryError: If it is one; with the number and the remedy.
    """
    cut = segments(setup)
    size = cut * (_SEGMENT_BYTES + _SEGMENT_BYTES_PER_JOINT * setup.plant.dynamics.n)
    if size > MOST_BYTES:
        raise QueryError(
            f"a run of {setup.duration_s:g} s with {cut:.3g} ticks and switches takes {_gib(size)}, more than "
            f"{_gib(MOST_BYTES)}: take a longer period_s of the controller, or a shorter duration_s"
        )
    if steps(setup) > MOST_STEPS:
        raise QueryError(
            f"a run of {setup.duration_s:g} s takes {steps(setup):.3g} steps of step_s = {setup.nominal_step_s:g} s,"
            f" more than {MOST_STEPS:g}: take a longer step_s, or a shorter duration_s"
        )
    if setup.duration_s > LONGEST_S:
        raise QueryError(
            f"a run of {setup.duration_s:g} s ends at a time that floats resolve to {ulp(setup.duration_s):.1g} s only:"
            f" take a shorter duration_s, {LONGEST_S:.2g} s at most"
        )


def check_record(setup: Setup) -> None:
    """Refuse a run whose samples take more than MOST_BYTES.

    Raises:
        QueryError: If they do; with the size and the remedy.
    """
    equation = setup.equation
    n, s, m = equation.plant.dynamics.n, len(equation.sources), len(equation.widths)
    # t, y, zero-order hold; q, v, a, u, work, power, energies; desired, deviation; and copies of all meanwhile
    size = 2 * 8 * samples(setup) * (1 + m + n + 4 * n + 2 * s + 2 + 2 * n)
    if size > MOST_BYTES:
        raise too_large(f"{samples(setup):.3g} samples", size, MOST_BYTES)


def check_batch(setup: Setup, runs: int, numbers: int, most: float) -> None:
    """Refuse a batch of so many runs, with so many numbers in each sample, that takes more than `most` bytes.

    Raises:
        QueryError: If it does; with the size and the remedy.
    """
    size = 8 * samples(setup) * runs * numbers
    if size > most:
        raise too_large(
            f"at most {samples(setup):.3g} samples of {runs} runs", size, most, ", fewer runs, or record less"
        )


def too_large(what: str, size: float, most: float, or_else: str = "") -> QueryError:
    """The refusal of a record."""
    remedy = f"take a longer record_period_s or a shorter duration_s{or_else}"
    return QueryError(f"recording {what} takes {_gib(size)}, more than {_gib(most)}: {remedy}")


def segments(setup: Setup) -> float:
    """At most so many segments between ticks, breaks and switches."""
    controller = setup.controller
    period = controller.period_s / len(controller.instants) if controller else 0.0
    cuts = sum(len(effect.switches) for effect in setup.plant.effects) + len(controller.knots if controller else ())
    return 2.0 + cuts + (setup.duration_s / period if period > 0 else 0.0)


def steps(setup: Setup) -> float:
    """About so many steps of a fixed-step method; 0 for an adaptive one, which chooses them."""
    if setup.integrator.controls_error:
        return 0.0
    step = min(setup.nominal_step_s, setup.record_period_s or inf)  # samples lie on steps
    return setup.duration_s / step + 4 * segments(setup)


def samples(setup: Setup) -> float:
    """At most so many samples."""
    periods = setup.duration_s / setup.record_period_s + 2 if setup.record_period_s else inf
    adaptive = setup.integrator.controls_error
    return min(periods, 1000 + segments(setup) if adaptive and periods == inf else inf, steps(setup) or inf)


def _gib(size: float) -> str:
    return f"{size / 2**30:.3g} GiB"
