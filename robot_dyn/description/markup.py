"""XML of a robot description, read without entities, DTDs, network access, error recovery or unbounded nesting.

Four departures that occur in published files are accepted, each with a finding: an XML declaration that is not at the
start, an XML version that does not exist, undeclared prefixes, and a default namespace.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import nan
from typing import SupportsFloat

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.foundations.errors import DescriptionError, shorten

MAX_DEPTH = 32  # deepest nesting of elements; a URDF needs 6

# Atomic groups avoid backtracking over many blanks or comments.
_LATE_DECLARATION = re.compile(rb"(\xef\xbb\xbf)?((?>\s++|<!--(?>.*?-->))*+)(<\?xml\s[^>]*\?>)", re.DOTALL)
_VERSION = re.compile(rb"(\sversion\s*=\s*[\"'])([0-9.]{1,16})(?=[\"'])")
_PREFIX = re.compile(r"Namespace prefix (\S+) ")


def parse(text: bytes, source: str, comments: bool = False) -> tuple[etree._Element, tuple[str, ...]]:
    """Return the root of an XML text and the assumptions made to read it; `comments` keeps its comments.

    Raises:
        DescriptionError: If it is not well-formed XML or uses a refused feature; `source` names it in the message.
    """
    if not text.strip():
        raise DescriptionError(f"{source}: is empty; give a URDF file")
    text, findings = declared_first(text)
    root, errors = _fed(text, source, False, comments)
    if root is not None:
        return root, (*findings, *_without_namespace(root))
    root, _ = _fed(text, source, True, comments)  # recovers from undeclared prefixes only: there are no other errors
    prefixes = dict.fromkeys(match[1] for error in errors if (match := _PREFIX.search(error.message)))
    prefixes.pop("xacro", None)  # reported where the robot is read
    findings = (*findings, *_without_namespace(root))
    if not prefixes:
        return root, findings
    listed = ", ".join(shorten(prefix, 40) for prefix in [*prefixes][:5])
    return root, (
        *findings,
        f"line {errors[0].line}: uses undeclared prefixes ({listed}); elements and attributes with them are left"
        ' out; declare them: <robot xmlns:PREFIX="…">',
    )


def number_of(text: str | None) -> float:
    """Return the number of a literal; nan if it is not a number."""
    try:
        return float(text or "nan")
    except ValueError:
        return nan


def _without_namespace(root: etree._Element) -> tuple[str, ...]:
    """Remove the default namespace from the elements of a robot and return the findings."""
    namespace = root.nsmap.get(None)
    prefix = f"{{{namespace}}}"
    if not namespace or root.tag != f"{prefix}robot":
        return ()
    for element in root.iter(f"{prefix}*"):
        element.tag = element.tag.removeprefix(prefix)
    return (
        f'line {root.sourceline}: <robot> declares the default namespace "{shorten(namespace)}"; its elements are read'
        " without it; remove xmlns=…",
    )


def declared_first(text: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Return the text with its XML declaration at the start and an existing version; line numbers are unchanged."""
    match = _LATE_DECLARATION.match(text)
    if not match:
        return text, ()
    byte_order_mark, before, declaration, findings = match[1] or b"", match[2], match[3], []
    if before:
        findings.append(
            "the XML declaration <?xml …?> is not at the start; read as if it were; remove what precedes it"
        )
    version = _VERSION.search(declaration)
    if version and not re.fullmatch(rb"1\.[0-9]+", version[2]):
        declaration = declaration[: version.start(2)] + b"1.0" + declaration[version.end(2) :]
        findings.append(f'XML version "{version[2].decode()}" does not exist; read as 1.0; write version="1.0"')
    return byte_order_mark + declaration + before + text[match.end() :], tuple(findings)


def _fed(
    text: bytes, source: str, recover: bool, comments: bool
) -> tuple[etree._Element | None, list[etree._LogEntry]]:
    """Return the root; or None and the parser's errors if all of them are undeclared prefixes."""
    parser = etree.XMLPullParser(
        events=("start", "end"),
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        recover=recover,
        huge_tree=False,
        remove_comments=not comments,
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
                        " a URDF needs at most 6 levels; remove the others"
                    )
        root = parser.close()
    except etree.XMLSyntaxError as error:
        errors = [entry for entry in parser.feed_error_log if entry.level > etree.ErrorLevels.WARNING]
        serious = [entry for entry in errors if entry.type != etree.ErrorTypes.NS_ERR_UNDEFINED_NAMESPACE]
        if errors and not serious:
            return None, errors
        message, line = (serious[0].message, serious[0].line) if serious else (str(error.msg), error.lineno or 1)
        raise DescriptionError(f"{source}: {_syntax(message, line)}") from None
    _refuse_document_type(root, source)
    return root, []


def _syntax(message: str, line: int) -> str:
    """Return the parser's first error with a remedy."""
    why = shorten(" ".join(message.split()), 200)
    if entity := re.search(r"Entity '(.*?)' not defined", why):
        return f"line {line}: uses the entity &{entity[1]};, which is not declared; write its text instead"
    if "XML_PARSE_HUGE" in why or "mplification" in why:
        return f"line {line}: a text, the nesting or an entity exceeds the limits of the parser; remove it"
    return f"is not well-formed XML: line {line}: {why}; correct the file"


def _refuse_document_type(element: etree._Element, source: str) -> None:
    if str(element.tag).rpartition("}")[2].lower() == "html":
        raise DescriptionError(f"{source}: is a web page, not a URDF; download the file itself (raw)")
    if element.getroottree().docinfo.internalDTD is not None:
        raise DescriptionError(
            f"{source}: declares a document type (<!DOCTYPE …>), through which a file can grow without bound or read"
            " other files; remove the declaration"
        )


def vector_text(values: Iterable[SupportsFloat]) -> str:
    """Return numbers as the text of an attribute, from which `float` restores each exactly."""
    return " ".join(repr(float(value)) for value in values)
