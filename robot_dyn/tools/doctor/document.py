"""A URDF as its file states it, including comments: the link or joint of each element, and its line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Set
from copy import copy
from typing import Any, final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description import declared_first, other_format, parse
from robot_dyn.foundations import DescriptionError
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind
from robot_dyn.tools.doctor.tags import Place, decoded, edited, tags

_NOT_IN_M = ("limit", "dynamics", "calibration", "safety_controller")


def parsed(text: str | None) -> float:
    """Return the number of a literal; nan if it is not a number."""
    try:
        return float(text or "nan")
    except ValueError:
        return float("nan")


@final
class Document:
    """Elements of a file.

    Args:
        text: Bytes of the file.
        source: Name of the file in messages.

    Raises:
        DescriptionError: If it is not XML.
    """

    def __init__(self, text: bytes, source: str) -> None:
        self.text, self.source = text, source
        self.root, self.assumed = parse(text, source, comments=True)
        self._written, self._encoding = decoded(declared_first(text)[0], self.root.getroottree().docinfo.encoding)
        self._rewritten: Set[Place] = frozenset()
        self._stated = {
            element: (tag, element.tag, dict(element.attrib))
            for element, tag in zip(self.root.iter("*"), tags(self._written), strict=True)
        }
        if self.root.tag != "robot":
            raise DescriptionError(f"{source}: line {self.root.sourceline}: {other_format(self.root.tag)}")

    def elements(self) -> Iterator[Any]:
        """Yield all links and joints with all their elements, without comments."""
        for part in self.root:
            if part.tag in ("link", "joint"):
                yield from (element for element in part.iter() if isinstance(element.tag, str))

    def named(self, kind: str, name: str) -> Any:
        """Return a link or joint by its name, or None."""
        matches = (element for element in self.root.iterfind(kind) if (element.get("name") or "").strip() == name)
        return next(matches, None)

    def mended(self, rewritten: Set[Place]) -> Document:
        """Return the document with the text of its current elements; all else in the text is as in the file.

        Args:
            rewritten: Pairs of element and attribute whose value is written even if only its blanks differ.
        """
        new = copy(self)
        new._rewritten = self._rewritten | rewritten
        text = edited(self._written, self._stated, self.root, new._rewritten, self._encoding)
        new.text = text.encode(self._encoding, "surrogateescape")
        return new

    def written(self, element: etree._Element, key: str) -> str:
        """Return the value of an attribute as the file writes it, with its line breaks and references."""
        return self._written[slice(*self._stated[element][0].attributes[key][1])]

    def line(self, where: str, text: str) -> int | None:
        """Return the line of the link or joint, or of an element in it, to which a refusal refers."""
        for part in self.root.iter("link", "joint"):
            if self.where(part) == where:
                tag = re.match(r"<(\w+)>", text)
                inner = () if tag is None else (*part.iterfind(tag[1]), *part.iterfind(f"inertial/{tag[1]}"))
                return next(iter(inner), part).sourceline
        return None

    def finding(
        self,
        severity: Severity,
        kind: FindingKind,
        element: Any,
        what: str,
        remedy: str,
        changes: tuple[Change, ...] = (),
    ) -> Finding:
        """Return a finding at an element, with its link or joint and its line."""
        return Finding(severity, kind, self.where(element), what, remedy, element.sourceline, changes)

    @staticmethod
    def moves_mass(element: Any) -> bool:
        """Return True if an element affects M: part of an inertial, or of a joint except limits and friction."""
        while (above := element.getparent()) is not None and above.tag not in ("link", "joint", "robot"):
            element = above
        inertial = above is not None and above.tag == "link" and element.tag == "inertial"
        return inertial or (above is not None and above.tag == "joint" and element.tag not in _NOT_IN_M)

    @staticmethod
    def where(element: Any) -> str:
        """Return the link or joint that contains an element."""
        while element.tag not in ("link", "joint") or element.getparent() is None or element.getparent().tag != "robot":
            if (above := element.getparent()) is None:
                return "robot"
            element = above
        return f"{element.tag} {(element.get('name') or '').strip()!r}"
