"""Tags of an XML text, and edits of the text that leave all its other characters unchanged."""

from __future__ import annotations

import re
from codecs import lookup
from collections.abc import Iterator, Mapping, Set
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from typing import final
from xml.sax.saxutils import escape, quoteattr

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

_MARKUP = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    r"|<(/?)([^\s/>]+)((?:[^>\"'/]|\"[^\"]*\"|'[^']*')*+)(/?)>",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"([^\s=]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_STARTS = {b"\xef\xbb\xbf": "utf-8", b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}  # byte order marks

Span = tuple[int, int]
Place = tuple[etree._Element, str]  # an attribute of an element


@final
@dataclass(frozen=True)
class Tag:
    """An element of a text, by positions in the text.

    Attributes:
        names: Name in the start tag, and in the end tag if there is one.
        attributes: Names of the attributes, each with the spans of name and value.
        start: Span of the start tag.
        stop: End of the element.
    """

    names: tuple[Span, ...]
    attributes: Mapping[str, tuple[Span, Span]]
    start: Span
    stop: int


Stated = tuple[Tag, str, Mapping[str, str]]  # an element as read: its tag, name and attributes


def decoded(text: bytes, declared: str | None) -> tuple[str, str]:
    """Return the characters of an XML text, with its byte order mark, and its encoding."""
    encoding = next((name for start, name in _STARTS.items() if text.startswith(start)), None)
    if encoding is None:  # a text in single bytes that declares UTF-16 is read as UTF-8
        encoding = "utf-8"
        with suppress(LookupError):
            encoding = lookup(declared or "utf-8").name
        encoding = "utf-8" if encoding.startswith("utf-16") else encoding
    return text.decode(encoding, "surrogateescape"), encoding


def tags(text: str) -> list[Tag]:
    """Return the elements of a well-formed text, in the order of their start tags."""
    result: list[Tag] = []
    open_: list[int] = []
    for match in _MARKUP.finditer(text):
        if match[2] is None:
            continue
        if match[1]:
            tag = result[at := open_.pop()]
            result[at] = Tag((*tag.names, match.span(2)), tag.attributes, tag.start, match.end())
            continue
        attributes = {
            stated[1]: (stated.span(1), stated.span(2) if stated[2] is not None else stated.span(3))
            for stated in _ATTRIBUTE.finditer(text, *match.span(3))
        }
        if not match[4]:
            open_.append(len(result))
        result.append(Tag((match.span(2),), attributes, match.span(), match.end()))
    return result


def edited(
    text: str, stated: Mapping[etree._Element, Stated], root: etree._Element, rewritten: Set[Place], encoding: str
) -> str:
    """Return a text with the changes of its elements since they were read.

    Args:
        text: The text.
        stated: Elements of the text, with their tags, and their names and attributes as read.
        root: Root of the changed elements. Elements that are not in `stated` are inserted; missing ones are removed.
        rewritten: Pairs of element and attribute whose value is written even if only its blanks differ.
        encoding: Encoding of the text; characters that it lacks are written as references.
    """
    edits: list[tuple[Span, str]] = []
    present = {*root.iter("*")}
    for element, (tag, name, attributes) in stated.items():
        if element not in present:
            before = len(text[: tag.start[0]].rstrip())
            edits.append(((before, tag.stop), ""))
            continue
        edits += [(span, element.tag) for span in tag.names if element.tag != name]
        written = {key for of, key in rewritten if of is element}
        edits += _of_attributes(text, tag, attributes, element.attrib, written)
        if new := [child for child in element.iterchildren("*") if child not in stated]:
            edits.append(_inserted(text, tag, new))
    edits = [(a, x) for a, x in edits if not any(b[0] <= a[0] and a[1] <= b[1] and a != b and not y for b, y in edits)]
    for (start, stop), new in sorted(edits, reverse=True):
        new = new.encode(encoding, "xmlcharrefreplace").decode(encoding)
        text = text[:start] + new + text[stop:]
    return text


def _of_attributes(
    text: str, tag: Tag, before: Mapping[str, str], after: Mapping[str, str], written: Set[str]
) -> Iterator[tuple[Span, str]]:
    """Yield the edits of attributes: values, names, and additions at the end."""
    new_keys = [key for key in after if key not in before]  # a renamed attribute keeps its position
    renamed = dict(zip([key for key in before if key not in after], new_keys, strict=False))
    for key, new in renamed.items():
        yield tag.attributes[key][0], new
    for key, value in before.items():
        new = after[renamed.get(key, key)]
        if new != value or key in written:
            start, stop = tag.attributes[key][1]
            yield (start, stop), _value(text[start:stop], value, new, text[start - 1])
    end = max([tag.names[0][1], *(value[1] + 1 for _, value in tag.attributes.values())])
    if added := new_keys[len(renamed) :]:
        yield (end, end), "".join(f" {key}={quoteattr(after[key])}" for key in added)


def _value(raw: str, before: str, after: str, quote: str) -> str:
    """Return the new text of a value; words that are the same keep their text and the blanks around them."""
    quoted = {'"': "&quot;"} if quote == '"' else {"'": "&apos;"}
    words = [before.split(), after.split(), raw.split()]
    if words[0] == words[1] or len({*map(len, words)}) > 1:
        return escape(after, quoted)
    new = iter([old if a == b else escape(b, quoted) for a, b, old in zip(*words, strict=True)])
    return re.sub(r"\S+", lambda _: next(new), raw)


def _inserted(text: str, tag: Tag, elements: list[etree._Element]) -> tuple[Span, str]:
    """Return the edit that inserts elements after a start tag, on new lines if the text has a line break there."""
    blank = re.compile(r"\s*").match(text, tag.start[1])
    before = blank[0] if blank and "\n" in blank[0] else ""
    new = ""
    for element in elements:
        element = deepcopy(element)
        etree.cleanup_namespaces(element)
        for part in element.iter():
            part.tail = part.text = None
        new += before + etree.tostring(element, encoding="unicode")
    (start, end), *closing = tag.names
    if closing:
        return (tag.start[1], tag.start[1]), new
    slash, name = text.rindex("/", *tag.start), text[start:end]
    return (slash, tag.start[1]), f">{new}</{name}>"
