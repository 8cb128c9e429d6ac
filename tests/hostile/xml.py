"""Files that are not XML, or of something else, and such that would grow without bound or read other files."""

from __future__ import annotations

import codecs
import gzip

from tests.hostile.kinds import ARM, CHILD, MASS, Make, altered, arm, beside, inside, text

XML_16 = '<?xml version="1.0" encoding="UTF-16"?>'


def doctype(declaration: str, robot: str = ARM) -> str:
    return f"<!DOCTYPE robot {declaration}>{robot}"


def laughs() -> str:
    """Entities that would grow to 10⁹ words."""
    grow = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 10))
    return f'[<!ENTITY e0 "lol">{grow}]'


def encoded(encoding: str) -> str:
    return f'<?xml version="1.0" encoding="{encoding}"?>'


KINDS: dict[str, Make] = {
    "nothing": text(""),
    "a byte order mark alone": text(codecs.BOM_UTF8),
    "a compressed robot": text(gzip.compress(ARM.encode(), mtime=0)),
    "a robot cut off": text(ARM[:700]),
    "a tag that is not closed": altered('</link>\n  <link name="fore">', '<link name="fore">'),
    "two robots in one file": text(ARM + ARM),
    "an attribute given twice": altered(MASS, '<mass value="1.5" value="2.5"/>'),
    "an ampersand in a name": altered(CHILD, '<child link="f&b"/>'),
    "a raw control character": altered(MASS, '<mass value="1\x1b[2J"/>'),
    "a Latin-1 file that calls itself UTF-8": text(inside("<!-- é -->"), "latin-1"),
    "an encoding nobody knows": text('<?xml version="1.0" encoding="klingon"?>' + ARM),
    "an encoding that is another one": text(XML_16 + ARM),
    "another format": text('<sdf version="1.7"><model name="arm"/></sdf>'),
    "a robot of another namespace": text('<x:robot xmlns:x="urn:x" name="a"/>'),
    "macros with an expression": text(
        inside('<xacro:arm xmlns:xacro="http://www.ros.org/wiki/xacro" side="${side}"/>')
    ),
    "macros of no namespace with a substitution": text(inside('<xacro:include filename="$(find arms)/arm.xacro"/>')),
    "macros beside an expression elsewhere": text(inside('<xacro:arm side="left"/>').replace('"1.5"', '"${mass}"')),
    "a robot in UTF-16": text(XML_16 + ARM, "utf-16"),
    "a robot after a byte order mark": text(ARM, "utf-8-sig"),
    "comments in all places": text(ARM.replace("<", "<!-- - --><").removeprefix("<!-- - -->")),
    "a style sheet of the network": text('<?xml-stylesheet href="http://127.0.0.1:9/x.xsl"?>' + ARM),
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
