"""The error estimate of a run: companion runs are made until one of the verdicts of `companions` holds to its end.

Longer steps cost about as much as the run and come first; shorter ones cost five times as much, and are taken where
longer ones cannot be made or show nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

from robot_dyn.integrate.adaptive import LEAST_RTOL, Adaptive
from robot_dyn.simulation.between import stepped_over
from robot_dyn.simulation.companions import (
    COARSE,
    FINE,
    from_longer_steps,
    from_shorter_steps,
    from_tolerances,
    lost_at,
)
from robot_dyn.simulation.error import ErrorEstimate, Verdict, no_estimate
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.record import Path, Record
from robot_dyn.simulation.schedule import LEAST_STEPS
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.smoothness import first_kink

_GAIN = 1.3  # in the time resolved, that a shorter step must bring
_TENTH, _TENFOLD = Fraction(1, 10), Fraction(10)


def estimate(setup: Setup, motion: Motion, run: Record, companion: Callable[[Fraction], Record]) -> ErrorEstimate:
    """The estimated error of a run.

    Args:
        setup: What was run.
        motion: Its equation of motion.
        run: What it left behind.
        companion: Runs the setup with steps, or tolerances, multiplied by a factor.
    """
    if len(run.shared.t) < 2:
        return no_estimate("it ended in its first step")
    kink, why = first_kink(setup, motion, run.walked)
    if isinstance(setup.integrator, Adaptive):
        made = _by_tolerances(setup, motion, run, companion, kink)
    else:
        made = _by_steps(setup, motion, run, companion, kink)
    return _advised(setup, _looked_between(setup, motion, run, made), why)


def _by_steps(
    setup: Setup, motion: Motion, run: Record, companion: Callable[[Fraction], Record], kink: float
) -> ErrorEstimate:
    """From longer steps, then from shorter ones."""
    n, order = motion.plant.dynamics.n, setup.integrator.order  # pyright: ignore[reportAttributeAccessIssue]
    made = no_estimate("fewer than 3 steps between ticks, switches or breaks")
    if min(each.steps for each in setup.stretches) >= LEAST_STEPS:
        made = from_longer_steps(run.shared, n, _paths(companion, COARSE), order, kink)
        if made.resolved_until >= run.shared.t[-1]:
            return made
    half = companion(FINE[0]).shared
    if made.resolved_until > 0 and lost_at(run.shared, half, n) < _GAIN * made.resolved_until:
        return made  # chaos: no step of practical length resolves it
    return from_shorter_steps(run.shared, n, {FINE[0]: half, **_paths(companion, FINE[1:])}, order, kink)


def _by_tolerances(
    setup: Setup, motion: Motion, run: Record, companion: Callable[[Fraction], Record], kink: float
) -> ErrorEstimate:
    """From a tenth of the tolerance, where floats have it, and from ten times."""
    method = setup.integrator
    assert isinstance(method, Adaptive)
    tight = companion(_TENTH).shared if method.rtol / 10 > LEAST_RTOL else None
    return from_tolerances(run.shared, motion.plant.dynamics.n, tight, companion(_TENFOLD).shared, kink)


def _paths(companion: Callable[[Fraction], Record], paces: tuple[Fraction, ...]) -> dict[Fraction, Path]:
    return {pace: companion(pace).shared for pace in paces}


def _looked_between(setup: Setup, motion: Motion, run: Record, made: ErrorEstimate) -> ErrorEstimate:
    """The estimate up to where something acted between two steps only, if that matters beside it."""
    missed = stepped_over(setup, motion, run.walked, made.final)
    if missed is None or missed.t >= made.resolved_until:
        return made
    return replace(made, resolved_until=missed.t, note=missed.why)


def _advised(setup: Setup, made: ErrorEstimate, why: str) -> ErrorEstimate:
    """The estimate with what to do where it ends early, and the reason where it is a bound."""
    if made.verdict is Verdict.BOUND:
        made = replace(made, reason=why or "the order of the method does not show")
    if not made.note:
        return made
    method = setup.integrator
    finer = f"rtol = {method.rtol / 100:.0e}" if isinstance(method, Adaptive) else f"step_s = {setup.taken_step_s / 4:.0e}"
    return replace(made, note=f"{made.note}; take {finer}, or a shorter run")
