"""How a run ended: its outcome, or why it gives up for another run to replace it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import final

from robot_dyn.simulation.observation.remarks import Remark


class Ending(StrEnum):
    """How a run ended."""

    FINISHED = "finished"
    DIVERGED = "diverged"
    STOPPED = "stopped"


@final
@dataclass(frozen=True)
class Outcome:
    """How a run ended: `ending` at time `t` in [s], and `advice` for a reader."""

    ending: Ending
    t: float
    advice: str = ""


@final
@dataclass(frozen=True)
class TooLong:
    """A run gives up after more evaluations than were allowed."""

    evaluations: int


@final
@dataclass(frozen=True)
class Stiff:
    """A run by an explicit method gives up: a stiff method is faster, for the reason of the remark."""

    remark: Remark


@final
@dataclass(frozen=True)
class Accumulation:
    """A run gives up because its events accumulate, as the remark says: time stepping is to make it."""

    remark: Remark


GivesUp = TooLong | Stiff | Accumulation
