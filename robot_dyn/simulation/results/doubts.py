"""Doubts about the accuracy of a run: rows of numbers and names, and the table of their sentences.

A doubt is the reason why an error estimate ends before its run, why it shows no order, or why the energy ledger does
not close. To add a kind, add a member to `DoubtKind` and a row
to `_SENTENCES`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from typing import NamedTuple, final

from robot_dyn.foundations.result import reported
from robot_dyn.foundations.sentences import Part, Parts, sentence
from robot_dyn.simulation.dynamics.fastest_motion import MOTION
from robot_dyn.simulation.run.outcome import TOO_FAST


class DoubtKind(StrEnum):
    """Subject of a doubt."""

    # no estimate, or none after a time
    ENDED_AT_ONCE = "ended_in_first_step"
    INTERRUPTED = "interrupted"
    IMPLAUSIBLE_SPEED = "implausible_speed"
    NO_ORDER_OF_IMPACTS = "time_stepping_has_no_order"
    OSCILLATION_DAMPED = "oscillation_damped"
    TURNS_TOO_FAR = "turns_too_far_in_a_step"
    FEW_STEPS = "few_steps_between_ticks"
    COMPANIONS_DIFFER = "companions_differ"
    ROUNDING = "rounding_magnified"
    SWITCHES_TWICE = "switches_twice_within_few_steps"
    SWITCHES_LAST = "switches_in_last_step"
    CROSSED_WITHIN_STEP = "threshold_crossed_within_step"
    ACTS_BETWEEN_STEPS = "acts_between_steps"
    # an estimate without a visible order
    ORDER_NOT_SEEN = "order_not_seen"
    UNDECLARED = "part_declares_no_thresholds"
    ROUNDED_AT_TICKS = "rounded_at_ticks"
    PASSES_WITHIN_STEP = "threshold_passed_within_step"
    LAYER_CROSSED = "layer_crossed_in_few_steps"
    SATURATES = "control_saturates"
    # an energy ledger that does not close
    DIVERGED = "diverged"
    LOOSE_TOLERANCE = "tolerance_too_loose"
    LONG_STEPS = "steps_too_long"
    WORK_OF_POTENTIAL = "work_unlike_potential"
    WORK_OF_NO_EFFECT = "work_of_no_effect"


_FINER: Part = "use rtol = {smaller_rtol:.0e}", "use step_s = {smaller_step_s:.0e}"
_AT = ", at t = {at:.4g} s"
_LIMIT: Part = "{tenth:.2g} [rad] or [m], a tenth of the motion", "{limit:.2g} rad or m"
_SENTENCES: Mapping[DoubtKind, Parts] = {
    DoubtKind.ENDED_AT_ONCE: ("it ended in its first step",),
    DoubtKind.INTERRUPTED: ("it was interrupted",),
    DoubtKind.IMPLAUSIBLE_SPEED: TOO_FAST,
    DoubtKind.NO_ORDER_OF_IMPACTS: ("the error of time stepping falls with the step, but has no definite order",),
    DoubtKind.OSCILLATION_DAMPED: (
        "the energy ledger does not close: ",
        MOTION,
        ", which {method} damps in steps longer than {longest_s:.0e} s, so that runs with other steps do not show it",
    ),
    DoubtKind.TURNS_TOO_FAR: (
        "a joint turns by {turn:.3g} rad in a step, so that runs with other steps may reach the same angles",
    ),
    DoubtKind.FEW_STEPS: ("fewer than 3 steps between ticks, switches or breaks",),
    DoubtKind.COMPANIONS_DIFFER: ("runs with other steps differ by more than ", _LIMIT),
    DoubtKind.ROUNDING: ("rounding of q, as the motion magnifies it, exceeds ", _LIMIT),
    DoubtKind.SWITCHES_TWICE: ("joint {joint!r} switches and switches back within {steps} steps", _AT),
    DoubtKind.SWITCHES_LAST: ("joint {joint!r} switches in the last step", _AT),
    DoubtKind.CROSSED_WITHIN_STEP: (
        "joint {joint!r} passes its {threshold} by {depth:.1e} and leaves it within one step of {step_s:.1e} s",
        _AT,
    ),
    DoubtKind.ACTS_BETWEEN_STEPS: (
        "{part} acts between steps after t = {start:g} s and not at their ends; declare its times as `switches`",
    ),
    DoubtKind.ORDER_NOT_SEEN: ("the order of the method does not show",),
    DoubtKind.UNDECLARED: ("{part} {lacks}; changes shorter than {shortest_s:.1g} s are not seen",),
    DoubtKind.ROUNDED_AT_TICKS: ("a value rounded at a tick may be rounded the other way",),
    DoubtKind.PASSES_WITHIN_STEP: ("{joint!r} passes its {threshold} within a step",),
    DoubtKind.LAYER_CROSSED: ("{joint!r} crosses a layer of {effect} in a few steps",),
    DoubtKind.SATURATES: ("a limit cuts the control",),
    DoubtKind.DIVERGED: ("the run diverged",),
    DoubtKind.LOOSE_TOLERANCE: ("the tolerance is too loose",),
    DoubtKind.LONG_STEPS: ("the steps are too long for the motion",),
    DoubtKind.WORK_OF_POTENTIAL: (
        "{effect} does {power:.2g} W at t = {at:.4g} s that its potential does not give; its torque must be −∂E/∂q of "
        "a potential E(q), otherwise declare it Active",
    ),
    DoubtKind.WORK_OF_NO_EFFECT: (
        "{power:.2g} W at t = {at:.4g} s belong to no effect; M, C and N of the dynamics must belong to its energies, "
        "and none of them may depend on time",
    ),
}
_REMEDIES: Mapping[DoubtKind, Parts] = {  # other kinds: a smaller step or tolerance, if the facts name one
    DoubtKind.NO_ORDER_OF_IMPACTS: ("compare it with step_s / 4, or with method='DOP853'",),
    DoubtKind.OSCILLATION_DAMPED: ("use shorter steps",),
    DoubtKind.ROUNDING: ("use a shorter run",),
}


@final
@dataclass(frozen=True)
class Doubt:
    """A doubt about the accuracy of a run.

    Attributes:
        kind: Subject of the doubt.
        facts: Numbers and names of its sentence, by name. With `smaller_step_s`, in [s], or `smaller_rtol`, a run with
            that setting is the remedy.
    """

    kind: DoubtKind
    facts: dict[str, float | str] = field(default_factory=dict, hash=False)

    @reported
    def text(self) -> str:
        """The doubt in a sentence, without its remedy."""
        return sentence(_SENTENCES[self.kind], self.facts)

    @reported
    def remedy(self) -> str:
        """The remedy; empty if there is none."""
        return sentence(_REMEDIES.get(self.kind, (_FINER,)), self.facts)

    @property
    def is_of_steps(self) -> bool:
        """True if smaller steps, or a smaller tolerance, are the remedy."""
        return "smaller_step_s" in self.facts or "smaller_rtol" in self.facts

    def __str__(self) -> str:
        return f"{self.text}; {self.remedy}" if self.remedy else self.text


class Onset(NamedTuple):
    """Time from which a doubt applies, in [s], and the doubt; inf and None for no doubt."""

    t: float = inf
    doubt: Doubt | None = None


def first_onset(onsets: Iterable[Onset]) -> Onset:
    """Return the onset with the earliest time."""
    return min(onsets, key=lambda onset: onset.t, default=Onset())
