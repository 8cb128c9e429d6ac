"""Numbers that are not numbers, do not fit, are too many or too large."""

from __future__ import annotations

import re

from tests.hostile.kinds import ARM, AXIS, LIMIT, MASS, MOMENTS, Kind, altered, text

NOT_DECIMAL = (
    *("nan", "inf", "1e999", "1e99999", "1,5", "1_000", "0x1p4", "", "1.5 kg"),
    *("١٢", "1½", "0" * 65),
)
XYZ, RPY, CENTRE = 'xyz="0 0 0.7"', 'rpy="0 0 0.7"', 'xyz="0 0 0.1"'

LARGEST = re.sub(r'(value|i(?:xx|yy|zz)|damping|friction)="[^"]*"', r'\1="1e12"', ARM)
LARGEST = LARGEST.replace("0.4 0 0", "1e12 1e12 1e12")


def moment(key: str, value: str) -> tuple[str, str]:
    """Another value for one of the moments of inertia."""
    old = next(pair for pair in MOMENTS.split() if pair.startswith(key))
    return MOMENTS, MOMENTS.replace(old, f'{key}="{value}"')


ON_LINK = (
    ("a mass below zero", MASS, '<mass value="-1e-9"/>', ("<mass> value", "below 0", "-1e-9", "correct it")),
    ("a mass of an expression", MASS, '<mass value="${mass}"/>', ("<mass> value", "'${mass}'", "expand the file")),
    ("a mass without value", MASS, "<mass/>", ("<mass> has no value", 'write value="')),
    ("no mass", MASS, "", ("<inertial> has no <mass>", "add it")),
    ("two masses", MASS, MASS + MASS, ("2 <mass> elements", "keep one")),
    ("a moment missing", ' izz="0.01"', "", ("<inertia> has no izz", 'write izz="')),
    ("a centre of four numbers", CENTRE, 'xyz="0 0 0.1 0"', ("<origin> xyz", "three numbers", "'0 0 0.1 0'")),
    ("a mass just too large", MASS, '<mass value="1.0001e12"/>',
     ("is 1.0001e12, beyond ±1e+12 in SI units; correct",)),
    ("a moment of 1e308", *moment("ixx", "1e308"), ("<inertia> ixx is 1e308, beyond ±1e+12", "correct it")),
    ("a centre at 1e200 m", CENTRE, 'xyz="1e200 0 0.1"', ("<origin> xyz is 1e200, beyond ±1e+12", "correct it")),
)  # fmt: skip
ON_JOINT = (
    ("zero axis", AXIS, '<axis xyz="0 0 0"/>', ("<axis> xyz must be a direction", "'0 0 0'", "write a unit vector")),
    ("an axis of 1e11", AXIS, '<axis xyz="0 0 1e11"/>', ("must be a direction", "'0 0 1e11'", "unit vector")),
    ("an axis of 1e300", AXIS, '<axis xyz="0 1e300 0"/>', ("<axis> xyz is 1e300, beyond ±1e+12", "correct it")),
    ("an axis that is nan", AXIS, '<axis xyz="0 0 nan"/>', ("<axis> xyz", "'nan'", "correct it")),
    ("an axis with commas", AXIS, '<axis xyz="0,0,1"/>', ("<axis> xyz", "three numbers", "'0,0,1'", "correct it")),
    ("an empty origin", XYZ, 'xyz=""', ("<origin> xyz", "three numbers", "''", "correct it")),
    ("an arm of 1e200 m", XYZ, 'xyz="0 1e200 0"', ("<origin> xyz is 1e200, beyond ±1e+12 in SI units", "correct it")),
    ("a turn in terms of pi", RPY, 'rpy="0 0 pi/2"', ("<origin> rpy", "'pi/2'", "correct it")),
    ("a turn of 1e308 rad", RPY, 'rpy="0 0 1e308"', ("<origin> rpy is 1e308, beyond ±1e+12", "correct it")),
    ("a limit of nan", 'lower="-1"', 'lower="nan"', ("<limit> lower", "'nan'", "correct it")),
    ("negative damping", 'damping="0.1"', 'damping="-0.1"', ("damping", "-0.1", "below 0", "correct it")),
    ("damping of 1e200", 'damping="0.1"', 'damping="1e200"', ("<dynamics> damping is 1e200, beyond", "correct it")),
    ("two dynamics", LIMIT, LIMIT + "<dynamics/>", ("2 <dynamics> elements", "keep one")),
)
KINDS = [
    *(
        Kind(
            f"a mass of {number[:20] or 'nothing'}",
            altered(MASS, f'<mass value="{number}"/>'),
            ("link 'upper': <mass> value must be a finite decimal number", f"got '{number[:40]}", "correct it"),
        )
        for number in NOT_DECIMAL
    ),
    *(Kind(f"a link with {word}", altered(old, new), ("link 'upper'", *said)) for word, old, new, said in ON_LINK),
    *(Kind(f"a joint with {word}", altered(old, new), ("joint 'shoulder'", *said)) for word, old, new,
      said in ON_JOINT),
    Kind("the widest turn", altered(RPY, 'rpy="1e12 -1e12 1e12"'), upper=(1, 2)),
    Kind("the widest limits", altered(LIMIT, '<limit upper="1e300" effort="1e308"/>'), upper=(1e300, 2)),
    Kind("a mass of 1e-320", altered(MASS, '<mass value="1e-320"/>'),
         warned=("link 'upper': its mass of 9.99989e-321 kg is below 1e-12 kg", "correct it"), upper=(1, 2)),
    Kind("numbers in odd but sound spelling", altered(MASS, '<mass value=" +01.50E+0 "/>'), upper=(1, 2)),
    Kind("an axis over several lines", altered(AXIS, '<axis xyz="\n0\t0\n1 "/>'), upper=(1, 2)),
    Kind("every number the largest", text(LARGEST),
         warned=("origin is 1.73205e+12 m away, over 10000 m, which loses digits", "correct it"), upper=(1, 2)),
]  # fmt: skip
