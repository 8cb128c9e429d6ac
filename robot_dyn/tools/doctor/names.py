"""Names that programs read in different ways, and what exporters leave behind."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity

_EXPRESSION = re.compile(r"\$[{(][^})]*[})]")


def names(document: Document) -> Iterator[Finding]:
    """Names with blanks around or within them, of other alphabets, or shared by a link and a joint."""
    listed = {kind: [(each.get("name") or "") for each in document.root.iterfind(kind)] for kind in ("link", "joint")}
    for kind, names_of_kind in listed.items():
        for name, count in Counter(x.strip() for x in names_of_kind).items():
            if count > 1:
                yield Finding(
                    Severity.ERROR, "name_twice", f"{kind} {name!r}", f"is defined {count} times", "rename all but one"
                )
    for element in document.elements():
        for key in ("name", "link", "joint"):
            name = element.get(key)
            if element.tag not in ("link", "joint", "parent", "child", "mimic") or name is None:
                continue
            if name != name.strip():
                yield document.finding(
                    Severity.WARNING, "name_blanks", element, f"{key} {name!r} of <{element.tag}> has blanks around it",
                    "remove them: other programs find no part of that name", (Change(element, key, name.strip()),),
                )  # fmt: skip
            elif key == "name" and (not name.isascii() or re.search(r"[\s/]", name)):
                yield document.finding(
                    Severity.NOTE, "name_letters", element, "its name has blanks, slashes or letters beyond ASCII",
                    "rename it: programs that use names as topics or variables do not take it",
                )  # fmt: skip
    for name in sorted({*listed["link"]} & {*listed["joint"]}):
        yield Finding(
            Severity.NOTE, "name_shared", f"link {name!r}", "a joint has the same name",
            "rename one of them: programs with one table of names take the other",
        )  # fmt: skip


def leftovers(document: Document) -> Iterator[Finding]:
    """Expressions of xacro that nobody expanded."""
    for element in sorted(document.root.iter(), key=lambda each: not document.moves_mass(each)):
        if isinstance(element.tag, str) and (found := _EXPRESSION.search(" ".join(map(str, element.attrib.values())))):
            grave = document.moves_mass(element) or element.tag in ("link", "joint", "limit", "dynamics")
            yield document.finding(
                Severity.ERROR if grave else Severity.WARNING, "xacro", element,
                f"holds {found[0]}, which is still to be computed",
                "expand the file: xacro robot.xacro > robot.urdf, or robot-dyn … --xacro ''",
            )  # fmt: skip
            return
