"""How a run ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import final


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
