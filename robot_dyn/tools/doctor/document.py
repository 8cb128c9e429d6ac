"""A URDF as its file has it, comments included: where each element belongs, and where its line is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from copy import copy
from typing import Any, final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description import other_format, parse
from robot_dyn.foundations import DescriptionError
from robot_dyn.tools.doctor.finding import Change, Finding, Severity

_NOT_IN_M = ("limit", "dynamics", "calibration", "safety_controller")


def parsed(text: str | None) -> float:
    """Return the number of a literal; nan if it is not one."""
    try:
        return float(text or "nan")
    except ValueError:
        return float("nan")


@final
class Document:
    """The elements of a file.

    Args:
        text: Its bytes.
        source: Names it in messages.

    Raises:
        DescriptionError: If it is not XML.
    """

    def __init__(self, text: bytes, source: str) -> None:
        self.text, self.source = text, source
        self.root, self.assumed = parse(text, source, comments=True)
        if self.root.tag != "robot":
            raise DescriptionError(f"{source}: line {self.root.sourceline}: {other_format(self.root.tag)}")

    def elements(self) -> Iterator[Any]:
        """All elements of links and joints, and these themselves, without comments."""
        for part in self.root:
            if part.tag in ("link", "joint"):
                yield from (each for each in part.iter() if isinstance(each.tag, str))

    def named(self, kind: str, name: str) -> Any:
        """A link or joint by its name, or None."""
        found = (each for each in self.root.iterfind(kind) if (each.get("name") or "").strip() == name)
        return next(found, None)

    def mended(self) -> Document:
        """The document with the text of its elements as they are now; these keep the lines of the file."""
        text = etree.tostring(self.root.getroottree(), xml_declaration=True, encoding="UTF-8")
        new = copy(self)
        new.text = text + b"\n" if not text.endswith(b"\n") else text
        return new

    def line(self, where: str, what: str) -> int | None:
        """Return the line of the link or joint, or of the element in it or in its inertial, that a refusal names."""
        for part in self.root.iter("link", "joint"):
            if self.where(part) == where:
                tag = re.match(r"<(\w+)>", what)
                inner = () if tag is None else (*part.iterfind(tag[1]), *part.iterfind(f"inertial/{tag[1]}"))
                return next(iter(inner), part).sourceline
        return None

    def finding(
        self, severity: Severity, kind: str, element: Any, what: str, remedy: str, changes: tuple[Change, ...] = ()
    ) -> Finding:
        """Return a finding at an element: with its link or joint, and its line."""
        return Finding(severity, kind, self.where(element), what, remedy, element.sourceline, changes)

    @staticmethod
    def moves_mass(element: Any) -> bool:
        """Whether an element has a part in M: that of an inertial, or of a joint, limits and friction excepted."""
        while (above := element.getparent()) is not None and above.tag not in ("link", "joint", "robot"):
            element = above
        inertial = above is not None and above.tag == "link" and element.tag == "inertial"
        return inertial or (above is not None and above.tag == "joint" and element.tag not in _NOT_IN_M)

    @staticmethod
    def where(element: Any) -> str:
        """The link or joint that an element belongs to."""
        while element.tag not in ("link", "joint") or element.getparent() is None or element.getparent().tag != "robot":
            if (above := element.getparent()) is None:
                return "robot"
            element = above
        return f"{element.tag} {(element.get('name') or '').strip()!r}"
