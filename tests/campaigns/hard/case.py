"""A hard case: what was run, what was found, what is allowed, and whether what does not hold was said."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, final

OURS = "robot_dyn"


@final
@dataclass(frozen=True)
class Row:
    """One figure of a case.

    Attributes:
        case: What was run.
        measure: What `found` is, with its unit.
        found: The figure; nan where there is none.
        allowed: The largest that holds.
        said: The words of the library where it does not hold: a refusal, a finding, the verdict of a run.
        program: Who was asked: ours, or a peer with its version and settings.
    """

    case: str
    measure: str
    found: float
    allowed: float
    said: str = ""
    program: str = OURS

    @property
    def holds(self) -> bool:
        """Whether the figure is within what is allowed; nan is not."""
        return self.found <= self.allowed

    @property
    def ours(self) -> bool:
        return self.program.startswith(OURS)

    @property
    def silent(self) -> bool:
        """Whether a figure of ours is wrong without a word."""
        return self.ours and not self.holds and not self.said

    @property
    def verdict(self) -> str:
        return "holds" if self.holds else "said" if self.said else "SILENT" if self.silent else "fails"


@final
@dataclass(frozen=True)
class Case:
    """Something to run.

    Attributes:
        name: What is run.
        rows: Runs it, given a seed.
        full: Whether it takes long, so that `make stress` alone runs it.
    """

    name: str
    rows: Callable[[int], Iterable[Row]]
    full: bool = False


class Family(Protocol):
    """A module of cases; its docstring is the law they are held to and the reason of each tolerance."""

    __name__: str
    __doc__: str | None
    TITLE: str
    CASES: Sequence[Case]
