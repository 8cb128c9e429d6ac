"""Files that are not XML, or the XML of something else."""

from __future__ import annotations

import codecs
import gzip

from tests.hostile.kinds import ARM, CHILD, MASS, Make, altered, inside, text

XML_16 = '<?xml version="1.0" encoding="UTF-16"?>'
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
}
