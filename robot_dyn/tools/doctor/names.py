"""Names that programs read differently, and remains of exporters."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

_EXPRESSION = re.compile(r"\$[{(][^})]*[})]")


def names(document: Document) -> Iterator[Finding]:
    """Report names with blanks around or within them, with non-ASCII letters, or shared by a link and a joint."""
    listed = {
        kind: [(element.get("name") or "") for element in document.root.iterfind(kind)] for kind in ("link", "joint")
    }
    for kind, names_of_kind in listed.items():
        for name, count in Counter(x.strip() for x in names_of_kind).items():
            if count > 1:
                *_, last = (x for x in document.root.iterfind(kind) if (x.get("name") or "").strip() == name)
                what, remedy = f"is defined {count} times", "rename all but one, or remove the copies"
                yield document.finding(Severity.ERROR, FindingKind.NAME_TWICE, last, what, remedy)
    for element in document.elements():
        for key in ("name", "link", "joint"):
            name = element.get(key)
            if element.tag not in ("link", "joint", "parent", "child", "mimic") or name is None:
                continue
            if name != name.strip():
                yield document.finding(
                    Severity.WARNING, FindingKind.NAME_BLANKS, element,
                    f"{key} {name!r} of <{element.tag}> has blanks around it",
                    "remove them: other programs do not find that name", (Change(element, key, name.strip()),),
                )  # fmt: skip
            elif key == "name" and (not name.isascii() or re.search(r"[\s/]", name)):
                yield document.finding(
                    Severity.NOTE, FindingKind.NAME_LETTERS, element,
                    "its name has blanks, slashes or letters beyond ASCII",
                    "rename it: programs that use names as topics or variables refuse it",
                )  # fmt: skip
    for name in sorted({*listed["link"]} & {*listed["joint"]}):
        yield Finding(
            Severity.NOTE, FindingKind.NAME_SHARED, f"link {name!r}", "a joint has the same name",
            "rename one of them: programs with one table of names confuse them",
        )  # fmt: skip


def leftovers(document: Document) -> Iterator[Finding]:
    """Report xacro expressions that were not expanded."""
    for element in sorted(document.root.iter(), key=lambda node: not document.moves_mass(node)):
        if isinstance(element.tag, str) and (match := _EXPRESSION.search(" ".join(map(str, element.attrib.values())))):
            grave = document.moves_mass(element) or element.tag in ("link", "joint", "limit", "dynamics")
            yield document.finding(
                Severity.ERROR if grave else Severity.WARNING, FindingKind.XACRO, element,
                f"contains {match[0]}, which was not expanded",
                "expand the file: xacro robot.xacro > robot.urdf, or add --xacro NAME=VALUE for its arguments (xacro="
                " in Python)",
            )  # fmt: skip
            return
