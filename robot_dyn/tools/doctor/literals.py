"""Numbers as written in the file: decimal commas, line breaks, right angles with few digits, degrees."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from math import degrees, isfinite, pi, radians
from typing import Any

from robot_dyn.tools.doctor.document import Document, parsed
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

NUMBERS = {
    "origin": ("xyz", "rpy"), "mass": ("value",), "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "axis": ("xyz",), "limit": ("lower", "upper", "effort", "velocity"), "dynamics": ("damping", "friction"),
    "mimic": ("multiplier", "offset"), "box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",),
    "mesh": ("scale",),
}  # fmt: skip
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_TURN = 2 * pi
_DRAWN = ("box", "cylinder", "sphere", "mesh")
_ROUNDED = 0.011  # [degrees]: error of an angle converted from radians with four digits
_TURNS = 4 * _TURN  # [rad]: larger limits are in degrees; some joints turn several times
_FEW = 20.0  # [rad]: smaller whole limits, such as ±10, belong to joints without stops
_LEAST_DECIMALS = 2
_WHOLE = 15.0  # [degrees]: angles in degrees are most often multiples of this


def numbers(document: Document) -> Iterator[tuple[Any, str, list[str]]]:
    """Yield each element and attribute that contains numbers, with its words."""
    for element in document.elements():
        for key in NUMBERS.get(element.tag, ()):
            if (text := element.get(key)) is not None:
                yield element, key, text.split()


def decimal_commas(document: Document) -> Iterator[Finding]:
    """Report numbers with a decimal comma."""
    for element, key, words in numbers(document):
        if words and any(_COMMA.fullmatch(word) for word in words):
            text = " ".join(word.replace(",", ".") if _COMMA.fullmatch(word) else word for word in words)
            drawn = element.tag in _DRAWN or element.getparent().tag in ("visual", "collision")
            yield document.finding(
                Severity.WARNING if drawn else Severity.ERROR, FindingKind.DECIMAL_COMMA, element,
                f'{key} of <{element.tag}> is "{" ".join(words)}", with decimal commas',
                "write a point; many programs read only the digits before the comma, or drop the element",
                (Change(element, key, text),),
            )  # fmt: skip


def line_breaks(document: Document) -> Iterator[Finding]:
    """Report numbers separated by line ends or tabs: urdfdom then drops the element, and a whole <inertial>.

    XML converts them to blanks, as this library does; urdfdom's reader does not.
    """
    for element, key, words in numbers(document):
        if re.search(r"[\r\n\t]", document.written(element, key)):
            inertial = element.getparent().tag == "inertial"
            drops = "urdfdom drops the whole <inertial> for that" if inertial else "urdfdom refuses that"
            yield document.finding(
                Severity.ERROR if inertial else Severity.WARNING, FindingKind.LINE_BREAK, element,
                f"{key} of <{element.tag}> has a line break or tab between its numbers; {drops}",
                "write its numbers in one line", (Change(element, key, " ".join(words)),),
            )  # fmt: skip


def near_right_angles(document: Document) -> Iterator[Finding]:
    """Report angles that are multiples of π/2 up to the written digits, but less exact than a float."""
    for element, key, words in numbers(document):
        if key != "rpy":
            continue
        full = [_right_angle(word) or word for word in words]
        if full != words:
            rounded = [(a, b) for a, b in zip(full, words, strict=True) if a != b]
            deviation = max(abs(float(a) - float(b)) for a, b in rounded)
            meant = " and ".join(dict.fromkeys(_named(float(a)) for a, _ in rounded))
            drawn = element.getparent().tag in ("visual", "collision")
            severity = Severity.WARNING if deviation > 1e-6 and not drawn else Severity.NOTE
            yield document.finding(
                severity, FindingKind.NEAR_RIGHT_ANGLE, element,
                f'rpy "{" ".join(words)}" differs from {meant} by {deviation:.1e} rad', f"write {meant} to 16 digits",
                (Change(element, key, " ".join(full)),),
            )  # fmt: skip


def _right_angle(word: str) -> str | None:
    """Return the multiple of π/2 to which a literal was rounded, in full; None if it is none, or exact."""
    match = re.fullmatch(r"[+-]?\d*\.(\d+)", word)
    if not match or len(match[1]) < _LEAST_DECIMALS or not float(word):
        return None
    x, unit = float(word), 10.0 ** -len(match[1])
    nearest = round(x / (pi / 2)) * (pi / 2)
    if nearest == 0 or x == nearest or abs(x - nearest) > unit:
        return None
    return repr(nearest)


def _named(angle: float) -> str:
    """Return the name of a multiple of π/2, such as "−π/2", "π" or "3π/2"."""
    k = round(angle / (pi / 2))
    whole, symbol = (k // 2, "π") if k % 2 == 0 else (k, "π/2")
    return f"{'−' if k < 0 else ''}{'' if abs(whole) == 1 else abs(whole)}{symbol}"


def angles_in_degrees(document: Document) -> Iterator[Finding]:
    """Report angles above one turn that are whole degrees; both limits of a joint have the same unit."""
    for element, key, words in numbers(document):
        values = [x for word in words if isfinite(x := parsed(word))]
        if key != "rpy" or len(values) != len(words) or not _beyond_a_turn(values):
            continue
        whole = _all_whole(values, _WHOLE)
        meant = " ".join(repr(radians(x)) for x in values)
        yield document.finding(
            Severity.WARNING, FindingKind.DEGREES, element,
            f'{key} "{" ".join(words)}" exceeds one turn ({degrees(max(values, key=abs)):.0f}°)'
            + (": degrees are suspected" if whole else ""),
            "convert to radians", (Change(element, key, meant),) if whole else (),
        )  # fmt: skip
    for limit in document.root.iterfind("joint/limit"):
        if values := limits_in_degrees(limit):
            stated = " and ".join(f'{key} "{limit.get(key).strip()}"' for key in values)
            whole, most = _all_whole(values.values(), 1.0), max(values.values(), key=abs)
            yield document.finding(
                Severity.WARNING, FindingKind.DEGREES, limit,
                f"{stated}: over one turn ({degrees(most):.0f}°): degrees are suspected",
                "convert to radians", tuple(Change(limit, key, repr(radians(x))) for key, x in values.items() if whole),
            )  # fmt: skip


def limits_in_degrees(limit: Any) -> dict[str, float]:
    """Return the stated position limits if one of them may be in degrees; otherwise an empty dict."""
    stated = {key: parsed(limit.get(key)) for key in ("lower", "upper") if limit.get(key) is not None}
    values = [*stated.values()]
    if limit.getparent().get("type") != "revolute" or not all(map(isfinite, values)) or not _beyond_a_turn(values):
        return {}
    return stated if max(map(abs, values)) > (_FEW if _all_whole(values, 1.0) else _TURNS) else {}


def _beyond_a_turn(values: Iterable[float]) -> bool:
    return any(_TURN * 1.01 < abs(x) <= 720 for x in values)


def _all_whole(values: Iterable[float], unit: float) -> bool:
    """Return True if angles are multiples of a unit in degrees, to the rounded digits of radians."""
    return all(abs(x - unit * round(x / unit)) <= _ROUNDED for x in values)
