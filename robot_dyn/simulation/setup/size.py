"""The samples of a run, known before it starts, and the memory that they take: samples · 8 · numbers of a sample."""

from __future__ import annotations

from math import inf

from robot_dyn.foundations.errors import QueryError
from robot_dyn.simulation.setup.setup import MOST_BYTES, Setup, gibibytes, segments, steps


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
    return QueryError(f"recording {what} takes {gibibytes(size)}, more than {gibibytes(most)}: {remedy}")


def samples(setup: Setup) -> float:
    """At most so many samples."""
    periods = setup.duration_s / setup.record_period_s + 2 if setup.record_period_s else inf
    adaptive = setup.integrator.controls_error
    return min(periods, 1000 + segments(setup) if adaptive and periods == inf else inf, steps(setup) or inf)
