"""Remarks on a run: what its samples need not show, seen at the end of every step.

chatter · an effort limit or a stop reached · beyond a limit that the file states · a record coarser than the motion ·
an effect declared dissipative that does positive work · friction that creeps · steps that stability bounds ·
a step that is too long · a control loop that is unstable · a task that is damped · a reference that jumps where it
begins · a joint that is held while its reference moves
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import final

_NAMED = 3  # joints in a line


class RemarkKind(StrEnum):
    """What a remark is about."""

    CHATTER = "chatter"
    EFFORT_REACHED = "effort_limit_reached"
    STOP_REACHED = "joint_stop_reached"
    BEYOND = "beyond_limit_of_file"
    COARSE = "record_too_coarse"
    GAINS = "dissipative_effect_gains"
    CREEPS = "regularised_friction_creeps"
    ACCUMULATE = "events_accumulate"
    STIFF = "steps_bounded_by_stability"
    TOO_LONG = "step_too_long"
    UNSTABLE = "control_loop_unstable"
    DAMPED = "task_damped"
    JUMPS = "reference_jumps"
    HELD = "held_while_reference_moves"


_HEADINGS = {
    RemarkKind.CHATTER: "actuation reverses at every tick",
    RemarkKind.EFFORT_REACHED: "effort limit reached",
    RemarkKind.STOP_REACHED: "joint stop reached",
    RemarkKind.BEYOND: "beyond the file's limits",
    RemarkKind.COARSE: "record too coarse",
    RemarkKind.GAINS: "a dissipative effect does positive work",
    RemarkKind.CREEPS: "regularised friction creeps",
    RemarkKind.ACCUMULATE: "events accumulate",
    RemarkKind.STIFF: "steps bounded by stability",
    RemarkKind.TOO_LONG: "step too long to be stable",
    RemarkKind.UNSTABLE: "control loop unstable, deviations grow",
    RemarkKind.DAMPED: "task damped near a singularity",
    RemarkKind.JUMPS: "reference does not begin as the joint does",
    RemarkKind.HELD: "held by friction at every step",
}


@final
@dataclass(frozen=True)
class Remark:
    """One thing about one joint.

    Attributes:
        kind: What it is about.
        joint: Name of the joint; of the effect or the frame, if it is about one.
        quantity: "q", "v", "u" or "power", of which value and limit are.
        start: When it began, in [s].
        duration: How long it lasted in all, in [s].
        at: When the value was reached, in [s].
        value: The extreme; the amplitude of a chatter, half of what the actuation changes between two ticks.
        limit: What it compares with: a limit, or the extreme that the samples show; None for a chatter.
        text: Joint, value and time in words.
        remedy: What to do about it; alike for all remarks of a kind in a run.
        runs: Of a batch, the numbers of the runs that it is about; the first is the worst, whose values and text these
            are. Empty for a single run.
        looked: Of a batch, how many runs were looked at.
    """

    kind: RemarkKind
    joint: str
    quantity: str
    start: float
    duration: float
    at: float
    value: float
    limit: float | None
    text: str
    remedy: str = ""
    runs: tuple[int, ...] = ()
    looked: int = 0


def remark_lines(remarks: Iterable[Remark]) -> list[str]:
    """A line for each kind: its joints, and what to do."""
    said: dict[RemarkKind, list[Remark]] = {}
    for remark in remarks:
        said.setdefault(remark.kind, []).append(remark)
    return [_line(kind, each) for kind, each in said.items()]


def _line(kind: RemarkKind, remarks: list[Remark]) -> str:
    texts = [remark.text + _of_runs(remark) for remark in remarks[:_NAMED]]
    more = f", and {len(remarks) - _NAMED} more" if len(remarks) > _NAMED else ""
    remedy = f"; {remarks[0].remedy}" if remarks[0].remedy else ""
    return f"{_HEADINGS[kind]}: {', '.join(texts)}{more}{remedy}"


def _of_runs(remark: Remark) -> str:
    """Of which runs of a batch; nothing of a single run."""
    if not remark.runs:
        return ""
    count = f"{len(remark.runs)} of {remark.looked} runs" if remark.looked > 1 else "the only run looked at"
    return f" (run {remark.runs[0]}; {count})"
