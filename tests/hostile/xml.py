"""Files that are not XML, or the XML of something else."""

from __future__ import annotations

import codecs
import gzip

from tests.hostile.kinds import ARM, CHILD, MASS, Kind, altered, inside, text

NOT_XML = ("is not well-formed XML: ", "line ", "correct the file")
XML_16 = '<?xml version="1.0" encoding="UTF-16"?>'
KINDS = [
    Kind("nothing", text(""), ("is empty", "give a URDF file")),
    Kind("a byte order mark alone", text(codecs.BOM_UTF8), NOT_XML),
    Kind("a compressed robot", text(gzip.compress(ARM.encode(), mtime=0)), NOT_XML),
    Kind("a robot cut off", text(ARM[:700]), NOT_XML),
    Kind("a tag that is not closed", altered('</link>\n  <link name="fore">', '<link name="fore">'), NOT_XML),
    Kind("two robots in one file", text(ARM + ARM), NOT_XML),
    Kind("an attribute given twice", altered(MASS, '<mass value="1.5" value="2.5"/>'), (*NOT_XML, "value")),
    Kind("an ampersand in a name", altered(CHILD, '<child link="f&b"/>'), NOT_XML),
    Kind("a raw control character", altered(MASS, '<mass value="1\x1b[2J"/>'), NOT_XML),
    Kind("a Latin-1 file that calls itself UTF-8", text(inside("<!-- é -->"), "latin-1"), (*NOT_XML, "encoding")),
    Kind("an encoding nobody knows", text('<?xml version="1.0" encoding="klingon"?>' + ARM), (*NOT_XML, "klingon")),
    Kind("an encoding that is another one", text(XML_16 + ARM), NOT_XML),
    Kind("another format", text('<sdf version="1.7"><model name="arm"/></sdf>'), ("SDF, not URDF", "give a URDF")),
    Kind("a robot of another namespace", text('<x:robot xmlns:x="urn:x" name="a"/>'), ("urn:x", "give a URDF")),
    Kind("macros with an expression",
         text(inside('<xacro:arm xmlns:xacro="http://www.ros.org/wiki/xacro" side="${side}"/>')),
         ("line 28", "xacro macros", "expand")),
    Kind("macros of no namespace with a substitution",
         text(inside('<xacro:include filename="$(find arms)/arm.xacro"/>')), ("line 28", "xacro macros", "expand")),
    Kind("macros beside an expression elsewhere",
         text(inside('<xacro:arm side="left"/>').replace('"1.5"', '"${mass}"')),
         ("line 6", "xacro macros", "expand")),
    Kind("a robot in UTF-16", text(XML_16 + ARM, "utf-16"), upper=(1, 2)),
    Kind("a robot after a byte order mark", text(ARM, "utf-8-sig"), upper=(1, 2)),
    Kind("comments in all places", text(ARM.replace("<", "<!-- - --><").removeprefix("<!-- - -->")), upper=(1, 2)),
    Kind("a style sheet of the network", text('<?xml-stylesheet href="http://127.0.0.1:9/x.xsl"?>' + ARM),
         upper=(1, 2)),
]  # fmt: skip
