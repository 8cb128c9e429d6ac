"""Names that break a terminal, or must not be confused; numbers that do not fit, or are none."""

from __future__ import annotations

import re

from tests.hostile.kinds import ARM, AXIS, LIMIT, MASS, MOMENTS, Make, altered, text, welded

NOT_DECIMAL = (
    *("nan", "inf", "1e999", "1e99999", "1,5", "1_000", "0x1p4", "", "1.5 kg"),
    *("١٢", "1½", "0" * 65),
)
XYZ, RPY, CENTRE = 'xyz="0 0 0.7"', 'rpy="0 0 0.7"', 'xyz="0 0 0.1"'

LARGEST = re.sub(r'(value|i(?:xx|yy|zz)|damping|friction)="[^"]*"', r'\1="1e12"', ARM)
LARGEST = LARGEST.replace("0.4 0 0", "1e12 1e12 1e12")


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
    **{f"a mass of {number[:20] or 'nothing'}": altered(MASS, f'<mass value="{number}"/>') for number in NOT_DECIMAL},
    "a link with a mass below zero": altered(MASS, '<mass value="-1e-9"/>'),
    "a link with a mass of an expression": altered(MASS, '<mass value="${mass}"/>'),
    "a link with a mass without value": altered(MASS, "<mass/>"),
    "a link with no mass": altered(MASS, ""),
    "a link with two masses": altered(MASS, MASS + MASS),
    "a link with a moment missing": altered(' izz="0.01"', ""),
    "a link with a centre of four numbers": altered(CENTRE, 'xyz="0 0 0.1 0"'),
    "a link with a mass just too large": altered(MASS, '<mass value="1.0001e12"/>'),
    "a link with a moment of 1e308": altered(MOMENTS, MOMENTS.replace('ixx="0.02"', 'ixx="1e308"')),
    "a link with a centre at 1e200 m": altered(CENTRE, 'xyz="1e200 0 0.1"'),
    "a joint with zero axis": altered(AXIS, '<axis xyz="0 0 0"/>'),
    "a joint with an axis of 1e11": altered(AXIS, '<axis xyz="0 0 1e11"/>'),
    "a joint with an axis of 1e300": altered(AXIS, '<axis xyz="0 1e300 0"/>'),
    "a joint with an axis that is nan": altered(AXIS, '<axis xyz="0 0 nan"/>'),
    "a joint with an axis with commas": altered(AXIS, '<axis xyz="0,0,1"/>'),
    "a joint with an empty origin": altered(XYZ, 'xyz=""'),
    "a joint with an arm of 1e200 m": altered(XYZ, 'xyz="0 1e200 0"'),
    "a joint with a turn in terms of pi": altered(RPY, 'rpy="0 0 pi/2"'),
    "a joint with a turn of 1e308 rad": altered(RPY, 'rpy="0 0 1e308"'),
    "a joint with a limit of nan": altered('lower="-1"', 'lower="nan"'),
    "a joint with negative damping": altered('damping="0.1"', 'damping="-0.1"'),
    "a joint with damping of 1e200": altered('damping="0.1"', 'damping="1e200"'),
    "a joint with two dynamics": altered(LIMIT, LIMIT + "<dynamics/>"),
    "the widest turn": altered(RPY, 'rpy="1e12 -1e12 1e12"'),
    "the widest limits": altered(LIMIT, '<limit upper="1e300" effort="1e308"/>'),
    "a mass of 1e-320": altered(MASS, '<mass value="1e-320"/>'),
    "numbers in odd but sound spelling": altered(MASS, '<mass value=" +01.50E+0 "/>'),
    "an axis over several lines": altered(AXIS, '<axis xyz="\n0\t0\n1 "/>'),
    "every number the largest": text(LARGEST),
}
