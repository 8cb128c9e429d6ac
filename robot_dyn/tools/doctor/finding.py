"""Findings of the doctor, and the changes of the file that remove them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, final

from robot_dyn.foundations import UNREPORTED, shorten


class Severity(Enum):
    """How grave a finding is.

    ERROR: the file is refused, or M is wrong by a factor. WARNING: its numbers are hardly meant. NOTE: other programs
    read it in another way, or something is not stated.
    """

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@final
@dataclass(frozen=True, eq=False)
class Change:
    """A change of one element.

    Attributes:
        element: The element of the document; None in copies and after `pickle`, which leave the document out.
        key: The attribute that is changed; "" for the name of the element itself.
        value: What it is then.
        renames: The attribute that `key` was called before, if it is renamed.
        text: Its description.
    """

    element: Any = field(metadata=UNREPORTED)
    key: str
    value: str
    renames: str = ""
    text: str = field(init=False)

    def __post_init__(self) -> None:
        tag, before = self.element.tag, self.element.get(self.key or "x", "")
        text = f'{self.key} of <{tag}> was "{shorten(before)}"'  # while the old value is still there
        if not self.key:
            text = f"<{tag}> is now <{self.value}>"
        elif self.key not in self.element.attrib and not self.renames:
            text = f"{self.key} of <{tag}> is added"
        elif self.renames:
            text = f"{self.renames} of <{tag}> is now called {self.key}"
        object.__setattr__(self, "text", text)

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"element": None}

    @property
    def places(self) -> tuple[tuple[Any, str], ...]:
        """The attributes that it changes, each with its element; an element is a place of the one around it."""
        if not self.key:
            return ((self.element.getparent(), f"<{self.value}>"),)
        return ((self.element, self.key), *([(self.element, self.renames)] if self.renames else []))

    def apply(self) -> None:
        """Apply the change to the element."""
        if not self.key:
            self.element.tag = self.value
        elif self.renames:
            attributes = {self.key if key == self.renames else key: x for key, x in self.element.items()}
            self.element.attrib.clear()
            self.element.attrib.update(attributes)
        else:
            self.element.set(self.key, self.value)


@final
@dataclass(frozen=True, eq=False, repr=False)
class Finding:
    """What is wrong, or doubtful.

    Attributes:
        severity: How grave it is.
        kind: What it is about, a fixed word for programs.
        where: Link, joint or line.
        what: What is found there, with its value.
        remedy: What to do.
        line: Line of the file, where it is known.
        changes: What `--fix` changes; nothing where the file does not say what is meant.
        supposed: Whether the changes rest on a unit that is only suspected, and are made on request alone.
    """

    severity: Severity
    kind: str
    where: str
    what: str
    remedy: str
    line: int | None = None
    changes: tuple[Change, ...] = ()
    supposed: bool = False

    @property
    def place(self) -> str:
        """Link, joint or file, with its line where it is known."""
        return f"{self.where} (line {self.line})" if self.line else self.where

    def __str__(self) -> str:
        return f"{self.place}: {self.what}; {self.remedy}"

    def __repr__(self) -> str:
        return f"<Finding, {self.severity.value}: {self}>"
