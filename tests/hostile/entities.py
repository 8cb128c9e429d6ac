"""Files that would grow without bound or read other files, by document types, entities and inclusions."""

from __future__ import annotations

from tests.hostile.kinds import ARM, MASS, Kind, altered, arm, beside, inside, text


def doctype(declaration: str, robot: str = ARM) -> str:
    return f"<!DOCTYPE robot {declaration}>{robot}"


def laughs() -> str:
    """Entities that would grow to 10⁹ words."""
    grow = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 10))
    return f'[<!ENTITY e0 "lol">{grow}]'


def encoded(encoding: str) -> str:
    return f'<?xml version="1.0" encoding="{encoding}"?>'


NO_DOCTYPE = ("<!DOCTYPE", "remove the declaration")
TOO_MUCH = ("line 1", "entity", "exceeds the limits of the parser", "remove it")
UNDECLARED = ("which is not declared", "write its text instead")
KINDS = [
    Kind("a document type that declares nothing", text(doctype("")), NO_DOCTYPE),
    Kind("a document type in UTF-16", text(encoded("UTF-16") + doctype("[]"), "utf-16"), NO_DOCTYPE),
    Kind("a document type in UTF-7",
         text((encoded("UTF-7") + doctype('[<!ENTITY m "1.5">]').replace("<", "+ADw-")).encode()), NO_DOCTYPE),
    Kind("a document type of another file", beside(lambda secret: doctype(f'SYSTEM "{secret.as_uri()}"')),
         NO_DOCTYPE),
    Kind("a default attribute by document type",
         text(doctype('[<!ATTLIST mass value CDATA "1.5">]', arm((MASS, "<mass/>")))), NO_DOCTYPE),
    Kind("an entity in a number", text(doctype('[<!ENTITY m "1.5">]', arm((MASS, '<mass value="&m;"/>')))),
         NO_DOCTYPE),
    Kind("an entity without declaration after a comment and in UTF-16",
         text(encoded("UTF-16") + arm((MASS, '<!-- &mdash; --><mass value="&heavy;"/>')), "utf-16"),
         ("line 6", "&heavy;", *UNDECLARED)),
    Kind("an entity without declaration", altered(MASS, '<mass value="&heavy;"/>'),
         ("line 6", "&heavy;", *UNDECLARED)),
    Kind("entities that grow in a text", text(doctype(laughs(), "<robot name='a'>&e9;</robot>")), TOO_MUCH),
    Kind("entities that grow in an attribute", text(doctype(laughs(), "<robot name='&e9;'/>")), TOO_MUCH),
    Kind(
        "an entity of another file",
        beside(
            lambda secret: doctype(f'[<!ENTITY x SYSTEM "{secret.as_uri()}">]', inside("<link name='l'>&x;</link>"))
        ),
        NO_DOCTYPE,
    ),
    Kind("parameter entities of another file",
         beside(lambda secret: doctype(f'[<!ENTITY % x SYSTEM "{secret.as_uri()}"> %x;]')), NO_DOCTYPE),
    Kind("a parameter entity that holds itself", text(doctype('[<!ENTITY % x "&#37;x;"> %x;]')),
         ("line 1", "entity reference loop", "correct the file")),
    Kind(
        "an inclusion of another file",
        beside(
            lambda secret: inside(
                f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{secret.as_uri()}" parse="text"/>'
            )
        ),
        upper=(1, 2),
    ),
]  # fmt: skip
