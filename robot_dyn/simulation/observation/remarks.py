"""Remarks on a run: rows of numbers and names, and the table of their sentences.

To add a kind, add a member to `RemarkKind`, a row to `_SENTENCES`, and a function that yields its remarks.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, final

from robot_dyn.foundations.result import reported
from robot_dyn.foundations.sentences import Facts, Parts, prefixed, sentence
from robot_dyn.simulation.dynamics.fastest_motion import MOTION

_NAMED = 3  # joints in a line


class RemarkKind(StrEnum):
    """Subject of a remark."""

    CHATTER = "chatter"
    """The actuation reverses at ten or more ticks in a row; `value` is half of the change between two ticks."""
    EFFORT_REACHED = "effort_limit_reached"
    """An effort limit of the plant or of the controller cuts the actuation."""
    LINE_REACHED = "torque_speed_line_reached"
    """At samples, a motor is at its torque–speed line; `value` is its actuation at the largest speed there."""
    STOP_REACHED = "joint_stop_reached"
    """The joint touches a stop of the plant."""
    BEYOND = "beyond_limit_of_file"
    """A limit of position, velocity or effort in the file is exceeded; the plant does not enforce it."""
    COARSE = "record_too_coarse"
    """Between samples the quantity leaves the range of its neighbouring samples by more than a tenth of its range;
    `limit` is the value that the samples show."""
    GAINS = "dissipative_effect_gains"
    """An effect declared as dissipative does positive work; `joint` is the effect, `value` its largest power, in
    [W]."""
    CREEPS = "regularised_friction_creeps"
    """A joint creeps in the last tenth of the run under a load that dry friction would hold; `value` is its
    velocity."""
    ACCUMULATE = "events_accumulate"
    """Mode changes accumulate and the run continues by time stepping; `joint` is the last one that changed, `value` the
    largest velocity there."""
    STIFF = "steps_bounded_by_stability"
    """Stability limits more than a thousand steps of an explicit method; `value` is the fastest decay, in [1/s],
    `joint` its main joint, the fact `source` the effect."""
    TOO_LONG = "step_too_long"
    """Linearised about the start, a fixed step is unstable; and the run diverges, reaches an implausible speed, or its
    error estimate ends early. `value` is the step, `limit` the longest stable one, in [s]; `joint` is the main joint of
    the fastest motion, the fact `source` the effect."""
    UNSTABLE = "control_loop_unstable"
    """Linearised about start, middle or end, deviations grow because of the control; `joint` is the main joint.

    In a sampled loop they grow at least twice as fast as under continuous control; `value` is the growth in a period,
    `limit` is 1. In a continuous loop of a run that diverged or reached an implausible speed, they grow twice as fast
    as with constant actuation; `value` is the growth in [1/s], `limit` is 0.
    """
    DAMPED = "task_damped"
    """Operational-space control damps its task; `joint` is the frame, `value` the smallest eigenvalue of J M⁻¹ Jᵀ,
    `limit` the threshold of damping."""
    JUMPS = "reference_jumps"
    """A moving reference does not start at the position or velocity of the joint; `value` is the reference, `limit` the
    state."""
    HELD = "held_while_reference_moves"
    """Dry friction holds the joint at every step while its reference moves; `value` is its position, `limit` the motion
    of the reference."""


class Sentence(NamedTuple):
    """The parts of the line about a kind: its heading, the text of each remark, and the common remedy."""

    heading: str
    text: Parts
    remedy: Parts = ()


_LASTED = "for {duration:.3g} s from {start:.4g} s"
_SEEN = " (at samples and {instants} instants)"
_ELSEWHERE = ", {elsewhere}"  # the numbers are of another run of the batch
_SENTENCES: Mapping[RemarkKind, Sentence] = {
    RemarkKind.CHATTER: Sentence(
        "actuation reverses at every tick",
        ("{joint} ±{value:.3g} {unit} from {start:.4g} s for {duration:.3g} s",),
        (
            (
                "kd period_s / M is {ratio:.2g}, too small to reverse it: {blocks} of the measurement does; filter it "
                "with rd.control.LowPass, or use less damping; a shorter period does not help",
                "kd period_s / M is {ratio:.3g}, and above 1 it reverses, above 2 it grows: use period_s below "
                "{longest_s:.2g} s, or less damping",
                "use a shorter period_s than {period_s:g} or less damping: it reverses where an eigenvalue of "
                "M⁻¹ kd period_s is above 1",
                "the step of {step_s:g} s is too long for the gains: use a smaller one",
            ),
        ),
    ),
    RemarkKind.EFFORT_REACHED: Sentence(
        "effort limit reached", ("{joint} " + _LASTED + " ({bound:.4g} {unit})", _SEEN)
    ),
    RemarkKind.LINE_REACHED: Sentence(
        "torque–speed line reached",
        ("{joint} " + _LASTED + " ({value:.4g} {unit} at {speed:.4g} {unit_of_v})",),
        ("move slower, or use a motor with more torque at this speed",),
    ),
    RemarkKind.STOP_REACHED: Sentence(
        "joint stop reached", ("{joint} {value:.4g} {unit} (stop at {limit:.4g}) at {at:.4g} s, " + _LASTED,)
    ),
    RemarkKind.BEYOND: Sentence(
        "exceeds limits of the file",
        ("{joint} reached {value:.4g} {unit} at {at:.4g} s (limit {limit:.4g})", _SEEN),
        ("the plant does not enforce them",),
    ),
    RemarkKind.COARSE: Sentence(
        "record too coarse",
        ("{quantity} of {joint} {value:.4g} {unit} near {at:.4g} s (sampled: {limit:.4g})",),
        ("use a shorter record_every_s",),
    ),
    RemarkKind.GAINS: Sentence(
        "a dissipative effect does positive work",
        ("{joint} {value:.4g} W at {at:.4g} s",),
        ("declare it Active, or correct the sign of its torque",),
    ),
    RemarkKind.CREEPS: Sentence(
        "regularised friction creeps",
        ("{joint} at {value:.3g} {unit}, under {load:.3g} of {level:.3g} {unit_of_u}",),
        ("dry_friction would hold a load below its level",),
    ),
    RemarkKind.ACCUMULATE: Sentence(
        "events accumulate",
        ("{changes} changes of mode in {span_s:.1e} s, the last of joint {joint!r}, at t = {at:.6g} s",),
        ("made by time stepping with steps of {step_s} s, without an estimate of its error",),
    ),
    RemarkKind.STIFF: Sentence(
        "steps bounded by stability",
        (MOTION,),
        (("made by {method} instead of {before}", "use method={method!r}"),),
    ),
    RemarkKind.TOO_LONG: Sentence(
        "step too long to be stable",
        ("{value:.4g} s", ", {method} is stable up to {limit:.4g} s", prefixed("; ", MOTION)),
        ("use step_s={step_s}, or method='Rodas5PFixed'",),
    ),
    RemarkKind.UNSTABLE: Sentence(
        "control loop unstable, deviations grow",
        (
            (
                "{joint} by a factor of {growth} in each period of {period_s:.4g} s about the state at {start:.4g} s, "
                "by {over_run} over the run",
                "{joint} with {value:.3g} per second about the state at {start:.4g} s",
            ),
            ", {gains}",
        ),
        (
            (
                "they also grow under continuous control, by {continuous_rate:.3g} per second; periods beyond "
                "{limit_s:.3g} s add to that: use period_s={shorter_s}, or lower gains",
                "the loop is stable up to {limit_s:.3g} s: use period_s={shorter_s}, or lower gains",
                "no period makes it stable: use {otherwise}",
                "lower the gains: about this state the loop is stable with {stable_with:.3g} times these",
                "use a shorter period than {period_s:g} s, or lower gains",
                "lower the gains",
            ),
        ),
    ),
    RemarkKind.DAMPED: Sentence(
        "task damped near a singularity",
        (
            "{joint} " + _LASTED,
            " (smallest eigenvalue of J M⁻¹ Jᵀ {least:.2g} of threshold {limit:.2g} at {at:.4g} s)",
        ),
        (
            "it does not follow along that direction: keep the reference within reach, or use a larger threshold for "
            "smaller torques",
        ),
    ),
    RemarkKind.JUMPS: Sentence(
        "reference starts at another state than the joint",
        ("{quantity} of {joint} from {limit:.4g} to {value:.4g} {unit} at {at:.4g} s", _ELSEWHERE),
        ("start the reference at the position and velocity of the joint; rd.control.via_points(…) starts at rest",),
    ),
    RemarkKind.HELD: Sentence(
        "held by friction at every step",
        (
            "{joint} at {value:.4g} {unit}, its reference moves by {limit:.3g}, |u| up to {most:.3g} {unit_of_u}",
            _ELSEWHERE,
        ),
        ("the control demands less than friction holds: use larger gains, or less friction",),
    ),
}


@final
@dataclass(frozen=True)
class Remark:
    """An observation about one joint.

    Attributes:
        kind: Subject of the remark.
        joint: Name of the joint, or of the effect or frame that it concerns.
        quantity: "q", "v", "u" or "power": the quantity of value and limit.
        start_s: Time of its start, in [s].
        duration_s: Total duration, in [s].
        at_s: Time of the value, in [s].
        value: The extreme; for chatter the amplitude, half of the change of actuation between two ticks.
        limit: Number to compare with: a limit, or the extreme of the samples; None for chatter.
        facts: Further numbers and names of its sentence.
        runs: Numbers of the affected runs of a batch, first the worst, whose values and text these are; empty for a
            single run.
        looked: Number of runs of the batch that were examined.
    """

    kind: RemarkKind
    joint: str
    quantity: str
    start_s: float
    duration_s: float
    at_s: float
    value: float
    limit: float | None
    facts: dict[str, float | str] = field(default_factory=dict, hash=False)
    runs: tuple[int, ...] = ()
    looked: int = 0

    @property
    def fields(self) -> Facts:
        """The numbers and names of its sentence."""
        own: dict[str, float | str] = {
            "joint": self.joint, "quantity": self.quantity, "start": self.start_s, "duration": self.duration_s,
            "at": self.at_s, "value": self.value,
        }  # fmt: skip
        limit = {} if self.limit is None else {"limit": self.limit, "bound": abs(self.limit)}
        return own | limit | self.facts

    @reported
    def text(self) -> str:
        """Joint, value and time in a sentence."""
        return sentence(_SENTENCES[self.kind].text, self.fields)

    @reported
    def remedy(self) -> str:
        """The remedy, the same for all remarks of a kind in a run; empty if there is none."""
        return sentence(_SENTENCES[self.kind].remedy, self.fields)

    def __str__(self) -> str:
        return _line(self.kind, [self])


def line_parts(kind: RemarkKind) -> Parts:
    """Return the parts of the line about one remark of a kind."""
    heading, text, remedy = _SENTENCES[kind]
    return (f"{heading}: ", *text, *(prefixed("; ", part) for part in remedy))


def remark_lines(remarks: Iterable[Remark]) -> list[str]:
    """Return a line for each kind, with its joints and a remedy."""
    by_kind: dict[RemarkKind, list[Remark]] = {}
    for remark in remarks:
        by_kind.setdefault(remark.kind, []).append(remark)
    return [_line(kind, of_kind) for kind, of_kind in by_kind.items()]


def _line(kind: RemarkKind, remarks: list[Remark]) -> str:
    texts = [remark.text + _of_runs(remark) for remark in remarks[:_NAMED]]
    more = f", and {len(remarks) - _NAMED} more" if len(remarks) > _NAMED else ""
    remedy = f"; {remarks[0].remedy}" if remarks[0].remedy else ""
    return f"{_SENTENCES[kind].heading}: {', '.join(texts)}{more}{remedy}"


def _of_runs(remark: Remark) -> str:
    """Return the runs of a batch that a remark affects, as text; empty for a single run."""
    if not remark.runs:
        return ""
    count = f"{len(remark.runs)} of {remark.looked} runs" if remark.looked > 1 else "the only run examined"
    return f" (run {remark.runs[0]}; {count})"
