"""Outcomes of runs: reason, time and the numbers that explain it; and the one place that words them.

To answer "why did this run end?": find the reason below, then search for `Reason.<NAME>` to see where it is raised.
Time loops return a number, `Ended` or `LaneEnd` in dynamics/loop_state.py; search for it to see the condition.
`explained` in diagnostics/unstable_loop.py and `judged` in diagnostics/runaway.py may replace it afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import final

from robot_dyn.foundations.sentences import Parts, prefixed, sentence
from robot_dyn.simulation.dynamics.fastest_motion import MOTION, Fastest
from robot_dyn.simulation.observation.remarks import RemarkKind, line_parts


class Ending(StrEnum):
    """A run ends in one of three ways."""

    FINISHED = "finished"
    DIVERGED = "diverged"
    STOPPED = "stopped"


class Reason(StrEnum):
    """A run ends for one of these reasons."""

    END = "end"
    """The run reached its duration."""

    TERMINAL_EVENT = "terminal_event"
    """A user-defined event with `terminal=True` occurred. The last sample is the state at the event.

    If the run should continue past it, pass `terminal=False`.
    """

    CONTROL_LOOP_UNSTABLE = "control_loop_unstable"
    """The gains or the control period make deviations grow. A linearisation about a state of the run shows it.

    Take lower gains or a shorter control period, as the message proposes; a smaller step does not help.
    """

    STEP_TOO_LONG = "step_too_long"
    """The fixed step exceeds the stability limit of the method at the start of the run.

    Use the step that the message names, or Rodas5PFixed, which damps fast motions at any step.
    """

    IMPLAUSIBLE_SPEED = "implausible_speed"
    """A joint moved faster than 100 times its velocity limit, or 1e6 rad/s or m/s.

    If the file states no limit, 100 rad/s or m/s is assumed.

    A run with fixed steps ends here only if its energy ledger does not close. Check gains, period, step and effects.
    """

    ENERGY_WITHOUT_SOURCE = "energy_without_source"
    """The energy grew by 1000 times more than the work of all effects and of the control explains.

    The step is too long, or an effect computes a wrong torque. Halve the step and compare.
    """

    STATE_OVERFLOWS = "state_overflows"
    """A number of the state became infinite, nan or larger than 1e100.

    The step is too long, the loop is unstable, an effect feeds in energy, or the inertia of a joint is close to zero.
    """

    RATE_NOT_FINITE = "rate_not_finite"
    """The equation of motion returned nan or infinity, and shorter steps did not help.

    The state grows without bound, or a tolerance is too tight.
    """

    STEP_BELOW_FLOAT_SPACING = "step_below_float_spacing"
    """Error control reduced the step until t + h = t.

    The state grows without bound, or a tolerance is too tight.
    """

    STALLED = "stalled"
    """Error control takes steps so short that the rest of the run would need more than 1e7: the system is stiff.

    Take Rodas5P, softer effects or a larger tolerance.
    """

    STAGES_NOT_FOUND = "stages_not_found"
    """An implicit method could not solve the equations of a step.

    Take a smaller step, or a method for stiff systems.
    """

    EVENTS_ACCUMULATE = "events_accumulate"
    """Impacts or changes between sliding and sticking follow each other at ever shorter intervals.

    Take `method="MoreauJean"` with a step, or soft stops and regularised friction.
    """

    TORQUE_NOT_FINITE = "torque_not_finite"
    """The controller returned nan or infinity.

    Check its gains and its reference, and that the state has not grown without bound before.
    """

    CANNOT_EVALUATE = "cannot_evaluate"
    """A part of the equation of motion has no value at the state reached, such as a spring whose ends coincide.

    The message names the part. Keep the motion away from that state, or change the part.
    """

    INTERRUPTED = "interrupted"
    """Ctrl-C stopped the run. All samples up to that time are kept."""

    INTERRUPTED_IN_ESTIMATE = "interrupted_in_estimate"
    """Ctrl-C stopped the companion runs of the error estimate. The run itself is complete."""


_FINISHED = Reason.END, Reason.TERMINAL_EVENT
_STOPPED = Reason.INTERRUPTED, Reason.INTERRUPTED_IN_ESTIMATE


@final
@dataclass(frozen=True)
class Outcome:
    """The end of a run.

    Attributes:
        reason: The reason by name.
        t: Time of the end, in [s].
        joint: Name of the joint it concerns: the fastest, or the one that takes part most in the motion; empty if none.
        facts: Numbers and names that explain it, by name; see `outcome.py` for those of each reason.
    """

    reason: Reason
    t: float
    joint: str = ""
    facts: dict[str, float | str] = field(default_factory=dict, hash=False)

    @property
    def ending(self) -> Ending:
        """Finished, diverged or stopped, as the reason implies."""
        if self.reason in _FINISHED:
            return Ending.FINISHED
        return Ending.STOPPED if self.reason in _STOPPED else Ending.DIVERGED

    @property
    def text(self) -> str:
        """The reason in a sentence, with a remedy; empty if the run reached its duration."""
        return sentence(_SENTENCES[self.reason], {"joint": self.joint, "t": self.t, **self.facts})


TOO_FAST = ("{joint} reached {value:.3g} {unit}, over 100 times its limit ({limit:.3g}): check gains and step",)
_FASTEST = "; the fastest joint is {joint!r}: use a smaller step than {step_s:g} s, or an implicit method"
_PERIOD = "; or, if the sampled loop is unstable, a shorter period than {period_s:g} s"
_BENDS = " ({effect} of joint {effect_joint!r} bends within {width:.1e} {unit})"
_GROWS = " at t = {t:.9g}, max |y| = {largest:.3g}: y grows without bound, or tolerances are too tight"
_SENTENCES: Mapping[Reason, Parts] = {
    Reason.END: (),
    Reason.TERMINAL_EVENT: ("ended by the event {event!r}",),
    Reason.CONTROL_LOOP_UNSTABLE: line_parts(RemarkKind.UNSTABLE),
    Reason.STEP_TOO_LONG: line_parts(RemarkKind.TOO_LONG),
    Reason.IMPLAUSIBLE_SPEED: (
        (*TOO_FAST, "{joint} moves faster than {limit:g} rad/s or m/s: check gains and effects"),
        "; the energy ledger does not close: use a smaller step than {step_s:g} s, or an implicit method",
    ),
    Reason.ENERGY_WITHOUT_SOURCE: ("energy grows without a source", _FASTEST, _PERIOD),
    Reason.STATE_OVERFLOWS: ("a number overflowed", _GROWS, _FASTEST, _PERIOD),
    Reason.RATE_NOT_FINITE: ("the rate is not finite", _GROWS),
    Reason.STEP_BELOW_FLOAT_SPACING: ("the step became smaller than the spacing of floats", _GROWS),
    Reason.STALLED: (
        "stalled: the last {steps} steps advanced {advanced_s:.1e} s, {remaining:.0e} more would be needed: the system "
        "is stiff",
        prefixed("; ", MOTION),
        ": use {remedy}",
        _BENDS,
    ),
    Reason.STAGES_NOT_FOUND: (
        ("{error}", "the stage equations of an implicit step could not be solved"),
        _FASTEST,
        _PERIOD,
        _BENDS,
    ),
    Reason.EVENTS_ACCUMULATE: (
        "events accumulate at t = {t:.9g}: {changes} changes of mode in {span_s:.1e} s, the last of joint {joint!r}; "
        "use {remedy}",
    ),
    Reason.TORQUE_NOT_FINITE: ("the controller returned a torque that is not finite", _FASTEST, _PERIOD),
    Reason.CANNOT_EVALUATE: ("{error}, at t = {t:.9g}", _FASTEST, _PERIOD),
    Reason.INTERRUPTED: ("interrupted; all samples up to here are kept",),
    Reason.INTERRUPTED_IN_ESTIMATE: ("interrupted after the run, in its error estimate",),
}


@final
@dataclass(frozen=True)
class TooLong:
    """A run gives up after more evaluations than were allowed."""

    evaluations: int


@final
@dataclass(frozen=True)
class Stiff:
    """A run by an explicit method gives up: stability limits its steps, and a stiff method is faster.

    Attributes:
        t: Time reached, in [s].
        motion: The fastest motion there.
    """

    t: float
    motion: Fastest


@final
@dataclass(frozen=True)
class Accumulation:
    """A run gives up because its events accumulate: time stepping continues it.

    Attributes:
        joint: Name of the joint of the last event.
        start: Time of the first of these events, in [s].
        t: Time reached, in [s].
        speed: Largest speed of a joint there, in [rad/s] or [m/s].
        changes: Number of changes of mode.
        span_s: Time between the first and the last of them, in [s].
    """

    joint: str
    start: float
    t: float
    speed: float
    changes: int
    span_s: float


GivesUp = TooLong | Stiff | Accumulation
