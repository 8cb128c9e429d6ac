"""Files that would grow without bound or read other files, by document types, entities and inclusions."""

from __future__ import annotations

from tests.hostile.kinds import ARM, MASS, Make, altered, arm, beside, inside, text


def doctype(declaration: str, robot: str = ARM) -> str:
    return f"<!DOCTYPE robot {declaration}>{robot}"


def laughs() -> str:
    """Entities that would grow to 10⁹ words."""
    grow = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 10))
    return f'[<!ENTITY e0 "lol">{grow}]'


def encoded(encoding: str) -> str:
    return f'<?xml version="1.0" encoding="{encoding}"?>'


KINDS: dict[str, Make] = {
    "a document type that declares nothing": text(doctype("")),
    "a document type in UTF-16": text(encoded("UTF-16") + doctype("[]"), "utf-16"),
    "a document type in UTF-7": text(
        (encoded("UTF-7") + doctype('[<!ENTITY m "1.5">]').replace("<", "+ADw-")).encode()
    ),
    "a document type of another file": beside(lambda secret: doctype(f'SYSTEM "{secret.as_uri()}"')),
    "a default attribute by document type": text(
        doctype('[<!ATTLIST mass value CDATA "1.5">]', arm((MASS, "<mass/>")))
    ),
    "an entity in a number": text(doctype('[<!ENTITY m "1.5">]', arm((MASS, '<mass value="&m;"/>')))),
    "an entity without declaration after a comment and in UTF-16": text(
        encoded("UTF-16") + arm((MASS, '<!-- &mdash; --><mass value="&heavy;"/>')), "utf-16"
    ),
    "an entity without declaration": altered(MASS, '<mass value="&heavy;"/>'),
    "entities that grow in a text": text(doctype(laughs(), "<robot name='a'>&e9;</robot>")),
    "entities that grow in an attribute": text(doctype(laughs(), "<robot name='&e9;'/>")),
    "an entity of another file": beside(
        lambda secret: doctype(f'[<!ENTITY x SYSTEM "{secret.as_uri()}">]', inside("<link name='l'>&x;</link>"))
    ),
    "parameter entities of another file": beside(
        lambda secret: doctype(f'[<!ENTITY % x SYSTEM "{secret.as_uri()}"> %x;]')
    ),
    "a parameter entity that holds itself": text(doctype('[<!ENTITY % x "&#37;x;"> %x;]')),
    "an inclusion of another file": beside(
        lambda secret: inside(
            f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{secret.as_uri()}" parse="text"/>'
        )
    ),
}
