"""Findings of the doctor, and the changes of the file that repair them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, final

from robot_dyn.foundations import UNREPORTED, shorten
from robot_dyn.tools.doctor.kinds import FindingKind


class Severity(Enum):
    """Severity of a finding.

    ERROR: the file is refused, or M is wrong by a factor. WARNING: the numbers are probably unintended. NOTE: other
    programs read the file differently, or a value is missing.
    """

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@final
@dataclass(frozen=True, eq=False)
class Change:
    """A change of one element.

    Attributes:
        element: Element of the document; None in copies and after `pickle`, which omit the document.
        key: Attribute that is changed; "" for the name of the element itself.
        value: New value.
        renames: Old name of the attribute `key`, if it is renamed.
        text: Description of the change.
    """

    element: Any = field(metadata=UNREPORTED)
    key: str
    value: str
    renames: str = ""
    text: str = field(init=False)

    def __post_init__(self) -> None:
        tag, before = self.element.tag, self.element.get(self.key or "x", "")
        text = f'{self.key} of <{tag}> was "{shorten(before)}"'  # before the old value is overwritten
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
        """Attributes that are changed, each with its element; an element counts as a place of its parent."""
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
    """A fault or a doubtful value.

    Attributes:
        severity: Severity.
        kind: Fixed identifier for programs.
        where: Link, joint or line.
        message: Description of the fault, with the value.
        remedy: Suggested correction.
        line: Line of the file, or None.
        changes: Changes by `--fix`; empty if the intended value is unclear.
        supposed: True if the changes undo a suspected unit or mistake and need `--units`.
        expanded_from: Line of a xacro file, and the macro calls that led there, innermost first; "" for a URDF.
    """

    severity: Severity
    kind: FindingKind
    where: str
    message: str
    remedy: str
    line: int | None = None
    changes: tuple[Change, ...] = ()
    supposed: bool = False
    expanded_from: str = ""

    @property
    def place(self) -> str:
        """Link, joint or file, with its line if known."""
        line = self.expanded_from or (f"line {self.line}" if self.line else "")
        return f"{self.where} ({line})" if line else self.where

    def __str__(self) -> str:
        return f"{self.place}: {self.message}; {self.remedy}"

    def __repr__(self) -> str:
        return f"<Finding, {self.severity.value}: {self}>"
