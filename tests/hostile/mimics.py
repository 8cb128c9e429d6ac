"""Joints that follow nothing, themselves, or another one without bound."""

from __future__ import annotations

from tests.hostile.kinds import AXIS, ELBOW, Kind, Make, arm, chain, text, welded


def mimicking(elbow: str, shoulder: str = "") -> Make:
    return text(arm((ELBOW, ELBOW + elbow), (AXIS, AXIS + shoulder)))


def following(ratios: tuple[str, ...], offsets: tuple[str, ...] = ()) -> Make:
    """A chain of joints, each following the one before."""

    def mimic(i: int) -> str:
        offset = offsets[i - 1] if offsets else "0"
        return f'<mimic joint="j{i - 1}" multiplier="{ratios[i - 1]}" offset="{offset}"/>' if i else ""

    return text(chain(len(ratios) + 1, len(ratios) + 1, mimic))


KINDS = [
    Kind("a mimic of an unknown joint", mimicking('<mimic joint="sholder"/>'),
         ("joint 'elbow'", "mimics 'sholder'", "not defined", "nearest: shoulder")),
    Kind("a mimic of itself", mimicking('<mimic joint="elbow"/>'), ("joint 'elbow'", "elbow → elbow", "remove one")),
    Kind("two joints that mimic each other", mimicking('<mimic joint="shoulder"/>', '<mimic joint="elbow"/>'),
         ("mimics itself", "shoulder → elbow → shoulder", "remove one <mimic>")),
    Kind("a mimic of a fixed joint", text(welded("weld").replace(ELBOW, ELBOW + '<mimic joint="weld"/>')),
         ("joint 'elbow'", "mimics 'weld'", "fixed", "make 'elbow' fixed too")),
    Kind("a mimic multiplier of nan", mimicking('<mimic joint="shoulder" multiplier="nan"/>'),
         ("joint 'elbow'", "<mimic> multiplier", "'nan'", "correct it")),
    Kind("a mimic multiplier of 1e200", mimicking('<mimic joint="shoulder" multiplier="1e200"/>'),
         ("joint 'elbow'", "<mimic> multiplier is 1e200, beyond ±1e+12", "correct it")),
    Kind("a mimic offset of 1e200", mimicking('<mimic joint="shoulder" offset="-1e200"/>'),
         ("joint 'elbow'", "<mimic> offset is -1e200, beyond ±1e+12", "correct it")),
    Kind("multipliers whose product is too large", following(("1e7", "1e7")),
         ("joint 'j2'", "chain of mimics multiplies by 1e+14", "correct a multiplier")),
    Kind("multipliers whose product overflows but for a zero at its end", following(("0", *["1e12"] * 30)),
         ("chain of mimics multiplies by", "correct a multiplier")),
    Kind("offsets that grow along a chain whose multipliers cancel out",
         following(("1e-12",) * 14 + ("1e12",) * 14, ("1e12",) * 28), ("chain of mimics", "correct")),
    Kind("offsets of which a multiplier makes one too large", following(("1e-6", "1e6"), ("1e12", "0")),
         ("joint 'j2'", "chain of mimics adds up to an offset of 1e+18", "correct an offset")),
    Kind("multipliers whose product vanishes", following(("1e-200", "1e-200"))),
    Kind("the largest multiplier and offset", mimicking('<mimic joint="shoulder" multiplier="1e12" offset="1e12"/>'),
         warned=("joint 'elbow': moves 1e+12 times as far as 'shoulder'", "correct the multiplier")),
    Kind("a multiplier of 0", mimicking('<mimic joint="shoulder" multiplier="0"/>')),
    Kind("a mimic on a fixed joint", text(welded("weld", '<mimic joint="nobody"/>')), upper=(1, 2)),
]  # fmt: skip
