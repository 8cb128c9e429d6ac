"""Names that break a terminal, and odd ones that must not be confused."""

from __future__ import annotations

from tests.hostile.kinds import ARM, Kind, altered, text, welded

RENAME = ("rename", "control characters, or more than 256 characters")
KINDS = [
    Kind("a line break in a name", altered('<link name="base"/>', '<link name="ba&#10;se"/>'), (r"'ba\nse'", *RENAME)),
    Kind("a terminal command in a name", altered('"elbow"', '"&#x9b;2Jelbow"'), (r"\x9b2J", "joint", *RENAME)),
    Kind("a change of writing direction in a name", altered('"arm"', '"a&#x202e;mr"'), (r"\u202e", "robot", *RENAME)),
    Kind("a name of 257 letters", altered('"arm"', f'"{"a" * 257}"'), ("robot", "'aaaa", *RENAME)),
    Kind(
        "a terminal command in a value",
        altered('type="revolute">\n    <origin xyz="0 0 0.7"', 'type="&#x9b;2J"><origin xyz="0 0 0.7"'),
        ("joint 'shoulder'", r"\x9b2J", "write one of"),
    ),
    Kind("a name of 256 letters", text(ARM.replace("elbow", "e" * 256)), upper=(1, 2)),
] + [
    Kind(word, text(robot), upper=(1, 2))
    for word, robot in (
        ("letters of all scripts in names", ARM.replace("elbow", "肘 Ж 🦾 é").replace("fore", "ذراع")),
        ("markup of a terminal in a name", ARM.replace("fore", "[red]x[/red]").replace("elbow", "[/]%s{0}\\")),
        ("markup of XML in names", ARM.replace("fore", "&lt;/robot&gt;&quot;&amp;").replace("elbow", "&apos;]]&gt;")),
        ("names that only look alike", ARM.replace('"upper"', '"\u00e9"').replace('"fore"', '"e\u0301"')),
        ("the first joint named like Pinocchio's world", ARM.replace("shoulder", "universe")),
        ("the last joint named like Pinocchio's world", ARM.replace("elbow", "universe")),
        ("the first link named like Pinocchio's world", ARM.replace('"base"', '"universe"')),
        ("a fixed joint named like Pinocchio's world", welded("universe")),
        ("a joint named like the library's mark", ARM.replace("shoulder", "joint:elbow")),
        ("links named like their joints", ARM.replace('"upper"', '"shoulder"').replace('"fore"', '"elbow"')),
        ("a fixed joint named like a link", welded("fore")),
    )
]
