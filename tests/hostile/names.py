"""Names that break a terminal, and odd ones that must not be confused."""

from __future__ import annotations

from tests.hostile.kinds import ARM, Make, altered, text, welded

KINDS: dict[str, Make] = {
    "a line break in a name": altered('<link name="base"/>', '<link name="ba&#10;se"/>'),
    "a terminal command in a name": altered('"elbow"', '"&#x9b;2Jelbow"'),
    "a change of writing direction in a name": altered('"arm"', '"a&#x202e;mr"'),
    "a name of 257 letters": altered('"arm"', f'"{"a" * 257}"'),
    "a terminal command in a value": altered(
        'type="revolute">\n    <origin xyz="0 0 0.7"', 'type="&#x9b;2J"><origin xyz="0 0 0.7"'
    ),
    "a name of 256 letters": text(ARM.replace("elbow", "e" * 256)),
    "letters of all scripts in names": text(ARM.replace("elbow", "肘 Ж 🦾 é").replace("fore", "ذراع")),
    "markup of a terminal in a name": text(ARM.replace("fore", "[red]x[/red]").replace("elbow", "[/]%s{0}\\")),
    "markup of XML in names": text(ARM.replace("fore", "&lt;/robot&gt;&quot;&amp;").replace("elbow", "&apos;]]&gt;")),
    "names that only look alike": text(ARM.replace('"upper"', '"\u00e9"').replace('"fore"', '"e\u0301"')),
    "the first joint named like Pinocchio's world": text(ARM.replace("shoulder", "universe")),
    "the last joint named like Pinocchio's world": text(ARM.replace("elbow", "universe")),
    "the first link named like Pinocchio's world": text(ARM.replace('"base"', '"universe"')),
    "a fixed joint named like Pinocchio's world": text(welded("universe")),
    "a joint named like the library's mark": text(ARM.replace("shoulder", "joint:elbow")),
    "links named like their joints": text(ARM.replace('"upper"', '"shoulder"').replace('"fore"', '"elbow"')),
    "a fixed joint named like a link": text(welded("fore")),
}
