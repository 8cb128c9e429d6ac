"""Doubts about the accuracy of a run are rows of numbers and names; the one table of this file words them.

A doubt is the reason why an error estimate ends before its run, why it shows no order, or why the energy ledger does
not close. A kind more: a member of `DoubtKind`, and a row of `_SENTENCES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, final

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


class _Sentence(NamedTuple):
    """The text of a kind of doubt and its remedy."""

    text: Parts
    remedy: Parts = ()


_FINER: Part = "take rtol = {smaller_rtol:.0e}", "take step_s = {smaller_step_s:.0e}"
_AT = ", at t = {at:.4g} s"
_LIMIT: Part = "{tenth:.2g} [rad] or [m], a tenth of the motion", "{limit:.2g} rad or m"
_SENTENCES: Mapping[DoubtKind, _Sentence] = {
    DoubtKind.ENDED_AT_ONCE: _Sentence(("it ended in its first step",)),
    DoubtKind.INTERRUPTED: _Sentence(("it was interrupted",)),
    DoubtKind.IMPLAUSIBLE_SPEED: _Sentence(TOO_FAST),
    DoubtKind.NO_ORDER_OF_IMPACTS: _Sentence(
        ("the error of time stepping falls with the step, but from step to step by no order",),
        ("compare it with step_s / 4, or with method='DOP853'",),
    ),
    DoubtKind.OSCILLATION_DAMPED: _Sentence(
        (
            "the energy ledger does not close: ",
            MOTION,
            ", which {method} damps in steps longer than {longest_s:.0e} s, so that runs with other steps do not show "
            "it",
        ),
        ("take shorter ones",),
    ),
    DoubtKind.TURNS_TOO_FAR: _Sentence(
        ("a joint turns by {turn:.3g} rad in a step, so that runs with other steps may meet the same angles",),
        (_FINER,),
    ),
    DoubtKind.FEW_STEPS: _Sentence(("fewer than 3 steps between ticks, switches or breaks",), (_FINER,)),
    DoubtKind.COMPANIONS_DIFFER: _Sentence(("runs with other steps differ by more than ", _LIMIT), (_FINER,)),
    DoubtKind.ROUNDING: _Sentence(
        ("rounding of q, as the motion magnifies it, exceeds ", _LIMIT), ("take a shorter run",)
    ),
    DoubtKind.SWITCHES_TWICE: _Sentence(
        ("joint {joint!r} switches and switches back within {steps} steps", _AT), (_FINER,)
    ),
    DoubtKind.SWITCHES_LAST: _Sentence(("joint {joint!r} switches in the last step", _AT), (_FINER,)),
    DoubtKind.CROSSED_WITHIN_STEP: _Sentence(
        (
            "joint {joint!r} passes its {threshold} by {depth:.1e} and leaves it within one step of {step_s:.1e} s",
            _AT,
        ),
        (_FINER,),
    ),
    DoubtKind.ACTS_BETWEEN_STEPS: _Sentence(
        ("{part} acts between steps after t = {start:g} s and not at their ends; declare its times as `switches`",),
        (_FINER,),
    ),
    DoubtKind.ORDER_NOT_SEEN: _Sentence(("the order of the method does not show",)),
    DoubtKind.UNDECLARED: _Sentence(
        ("{part} {lacks}; changes shorter than {shortest_s:.1g} s are not seen",),
    ),
    DoubtKind.ROUNDED_AT_TICKS: _Sentence(("a value rounded at a tick may be rounded the other way",)),
    DoubtKind.PASSES_WITHIN_STEP: _Sentence(("{joint!r} passes its {threshold} within a step",)),
    DoubtKind.LAYER_CROSSED: _Sentence(("{joint!r} crosses a layer of {effect} in a few steps",)),
    DoubtKind.SATURATES: _Sentence(("a limit cuts the control",)),
    DoubtKind.DIVERGED: _Sentence(("the run diverged",)),
    DoubtKind.LOOSE_TOLERANCE: _Sentence(("the tolerance is too loose",), (_FINER,)),
    DoubtKind.LONG_STEPS: _Sentence(("the steps are too long for the motion",), (_FINER,)),
    DoubtKind.WORK_OF_POTENTIAL: _Sentence(
        (
            "{effect} does {power:.2g} W at t = {at:.4g} s that its potential does not give; its torque must be −∂E/∂q "
            "of a potential E(q), otherwise declare it Active",
        )
    ),
    DoubtKind.WORK_OF_NO_EFFECT: _Sentence(
        (
            "{power:.2g} W at t = {at:.4g} s are work of no effect; M, C and N of the dynamics must belong to its "
            "energies, and none of them may depend on time",
        )
    ),
}


@final
@dataclass(frozen=True)
class Doubt:
    """A doubt about the accuracy of a run.

    Attributes:
        kind: Its subject.
        facts: Numbers and names of its sentence, by name. With `smaller_step_s`, in [s], or `smaller_rtol`, a run with
            that setting is the remedy.
    """

    kind: DoubtKind
    facts: dict[str, float | str] = field(default_factory=dict, hash=False)

    @property
    def text(self) -> str:
        """The doubt in a sentence, without its remedy."""
        return sentence(_SENTENCES[self.kind].text, self.facts)

    @property
    def remedy(self) -> str:
        """The remedy; empty if there is none."""
        return sentence(_SENTENCES[self.kind].remedy, self.facts)

    @property
    def is_of_steps(self) -> bool:
        """True if smaller steps, or a smaller tolerance, are the remedy."""
        return "smaller_step_s" in self.facts or "smaller_rtol" in self.facts

    def __str__(self) -> str:
        return f"{self.text}; {self.remedy}" if self.remedy else self.text
