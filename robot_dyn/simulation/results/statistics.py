"""Steps, evaluations and times of a run; a requested accuracy and its cost."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import final


@final
@dataclass(frozen=True)
class Statistics:
    """Steps, evaluations and times of a run.

    Attributes:
        method: Name of the integration method.
        step_s: Step of the method, in [s]; 0 if it chooses its own steps.
        steps: Number of steps.
        evaluations: Evaluations of the equation of motion, excluding those for its Jacobian.
        wall_s: Time of the run itself, in [s].
        companions_s: Time of the error estimate, in [s].
        engine: The loop that ran; with the reason for it, if another loop was possible.
        compile_s: Time before the run, for the choice of the loop and for compiling it, in [s].
        samples_s: Time after the run, for quantities at its samples that cannot be computed later, in [s].
        companion_evaluations: Evaluations of the error estimate.
        companion_runs: Companion runs of the error estimate.
        user_code: Names of the user-defined parts of the setup, which each run calls.
        one_by_one: Runs of a batch that were simulated one by one, not in lock step.
        one_by_one_s: Time of these runs, in [s].
    """

    method: str
    step_s: float
    steps: int
    evaluations: int
    wall_s: float
    companions_s: float = 0.0
    engine: str = "interpreted"
    compile_s: float = 0.0
    samples_s: float = 0.0
    companion_evaluations: int = 0
    companion_runs: int = 0
    user_code: str = ""
    one_by_one: int = 0
    one_by_one_s: float = 0.0


@final
@dataclass(frozen=True)
class Accuracy:
    """A requested accuracy, the estimated one, and the cost in evaluations of the equation of motion.

    Attributes:
        requested: Largest error of q over joints and times, in [rad] and [m].
        estimated: Estimated error of the run, in [rad] and [m].
        rtol: Chosen relative tolerance, with atol a hundredth of it; 0 for a method with a fixed step.
        run: Evaluations of the run.
        pilots: Evaluations of the runs before it, with their error estimates.
        check: Evaluations of the error estimate of the run.
        digit_more, digit_less: Predicted evaluations of a run with a ten times smaller, or larger, error, from the
            order of the method.
    """

    requested: float
    estimated: float
    rtol: float
    run: int
    pilots: int
    check: int
    digit_more: float
    digit_less: float

    @property
    def margin(self) -> float:
        """Requested over estimated error: at least 2, or at least 1 at the smallest tolerance; inf for no error."""
        return self.requested / self.estimated if self.estimated > 0 else inf

    def __str__(self) -> str:
        at = f" at rtol {self.rtol:.1e}" if self.rtol else ""
        return (
            f"requested {self.requested:.1e}, estimated {self.estimated:.1e}{at}, a margin of {self.margin:.1f};"
            f" {self.run} evaluations,"
            f" pilots {self.pilots}, check {self.check}; one digit more would take about {self.digit_more:.0f}, one"
            f" less {self.digit_less:.0f}"
        )
