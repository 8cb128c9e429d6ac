"""The hardened read of a URDF file: bytes in, checked bytes out, or a refusal.

It stands before both parsers. Pinocchio and yourdfpy only ever see the canonical bytes written here, in which each
element occurs once, every number is a finite decimal literal, and links and joints form one tree; what dynamics does
not need (meshes, materials, simulator extensions) is left out.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.errors import DescriptionError, shorten
from robot_dyn.model import urdf

MAX_BYTES = 16 * 2**20  # the largest robot of example-robot-data has 0.2 MiB
MAX_DEPTH = 32  # of nested elements; a URDF needs 6


@final
@dataclass(frozen=True)
class Description:
    """A checked robot description.

    Attributes:
        name: The robot's name in the file.
        source: Where it was read from, as shown in messages.
        text: The bytes of the file.
        xml: The checked bytes: a minimal URDF with the same literals.
    """

    name: str
    source: str
    text: bytes = field(repr=False)
    xml: bytes = field(repr=False)

    @property
    def element(self) -> etree._Element:
        """The checked bytes as a fresh XML element."""
        return parse(self.xml, self.source)


def read(path: str | Path) -> Description:
    """Read and check a URDF file.

    Raises:
        DescriptionError: If the file cannot be read safely or does not describe one tree of rigid bodies.
    """
    path = Path(path)
    try:
        mode = path.stat().st_mode
        if not S_ISREG(mode):
            kind = "a folder" if S_ISDIR(mode) else "no regular file"
            raise DescriptionError(f"{path}: is {kind}; give the path of a URDF file")
        with path.open("rb") as stream:
            text = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise DescriptionError(
            f"{path}: cannot be read ({error.strerror}); check the path and its permissions"
        ) from None
    return check(text, source=str(path))


def check(text: bytes, source: str) -> Description:
    """Check the bytes of a URDF; `source` names them in messages.

    Raises:
        DescriptionError: As `read`.
    """
    if len(text) > MAX_BYTES:
        raise DescriptionError(
            f"{source}: is larger than {MAX_BYTES >> 20} MiB, the limit for a robot description;"
            " keep meshes in files of their own"
        )
    checked = urdf.checked_robot(parse(text, source), source)
    return Description(checked.get("name", ""), source, text, etree.tostring(checked))


def parse(text: bytes, source: str) -> etree._Element:
    """The root of an XML text, read without entities, DTD, network, recovery, or unbounded nesting.

    Raises:
        DescriptionError: If it is none, or uses one of these; `source` names it.
    """
    if not text.strip():
        raise DescriptionError(f"{source}: is empty; give a URDF file")
    parser = etree.XMLPullParser(
        events=("start", "end"),
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        recover=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    depth = 0
    try:
        for start in range(0, len(text), 2**16):
            parser.feed(text[start : start + 2**16])
            for event, element in parser.read_events():
                depth += 1 if event == "start" else -1
                _refuse_document_type(element, source)
                if depth > MAX_DEPTH:
                    raise DescriptionError(
                        f"{source}: line {element.sourceline}: elements are nested deeper than {MAX_DEPTH};"
                        " a URDF needs 6 levels at most: remove the others"
                    )
        root = parser.close()
    except etree.XMLSyntaxError as error:
        raise DescriptionError(f"{source}: {_syntax(error, parser)}") from None
    _refuse_document_type(root, source)
    return root


def _syntax(error: etree.XMLSyntaxError, parser: etree.XMLPullParser) -> str:
    """What is wrong with the XML, from the first complaint of the parser, and what to do."""
    log = parser.feed_error_log
    message, line = (log[0].message, log[0].line) if len(log) else (str(error.msg), error.lineno or 1)
    why = shorten(" ".join(message.split()), 200)
    if entity := re.search(r"Entity '(.*?)' not defined", why):
        return f"line {line}: uses the entity &{entity[1]};, which is not declared; write its text instead"
    if "XML_PARSE_HUGE" in why or "mplification" in why:
        return f"line {line}: a text, the nesting or an entity exceeds the limits of the parser; remove it"
    if "xacro" in why:
        return f"line {line}: holds xacro macros; expand the file first: xacro robot.xacro > robot.urdf"
    return f"is not well-formed XML: line {line}: {why}; correct the file"


def _refuse_document_type(element: etree._Element, source: str) -> None:
    if element.getroottree().docinfo.internalDTD is not None:
        raise DescriptionError(
            f"{source}: declares a document type (<!DOCTYPE …>), through which a file can grow without bound or read"
            " other files; remove the declaration"
        )
