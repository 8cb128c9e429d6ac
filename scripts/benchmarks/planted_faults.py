"""Faults planted one at a time in clean arms: how many the doctor finds at their place, and what it says of clean ones.

    PYTHONPATH=scripts python -m benchmarks.planted_faults ur3 kinova ARM.urdf ARM.urdf.xacro …

An arm takes part if the doctor finds no error in it as it stands; what it warns of there is listed as false alarms. A
fault counts as found if the check has a finding at the link or joint of the fault that it does not have without it.

    PYTHONPATH=scripts python -m benchmarks.planted_faults --repairs 40 ur3 kinova …

repairs each planted fault, and so many pairs of faults for each arm, with and without conversion of units: repairing
the repaired file must change no byte, and what is left must be what a check of that file finds.
"""

from __future__ import annotations

import re
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections import Counter
from collections.abc import Callable, Sequence
from copy import deepcopy
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description import catalog
from robot_dyn.description.description import content
from robot_dyn.description.sources.xacro import expand
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.tools.doctor.checkup import Checkup, checked
from robot_dyn.tools.doctor.finding import Severity

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
Fault = Callable[[Any], bool]  # plants itself in a link or joint; False where it does not apply


def at(element: Any, path: str, key: str, change: Callable[[str], str | None]) -> bool:
    """Change an attribute, where there is one and the change applies."""
    target = element.find(path)
    if target is None or target.get(key) is None or (new := change(target.get(key))) is None:
        return False
    target.set(key, new)
    return True


def scaled(text: str, factor: float) -> str:
    return " ".join(f"{factor * float(word):.9g}" for word in text.split())


def inertia(factor: float) -> Fault:
    def plant(link: Any) -> bool:
        moments = link.find("inertial/inertia")
        if moments is None or not all(moments.get(key) for key in MOMENTS):
            return False
        for key in MOMENTS:
            moments.set(key, scaled(moments.get(key), factor))
        return True

    return plant


def izz(link: Any) -> bool:
    moments = link.find("inertial/inertia")
    total = sum(float(moments.get(key)) for key in ("ixx", "iyy"))
    moments.set("izz", repr(3 * total))
    return total > 0


def misspelt(link: Any) -> bool:
    link.find("inertial").tag = "inertal"
    return True


def removed(tag: str) -> Fault:
    def plant(element: Any) -> bool:
        if (child := element.find(tag)) is None:
            return False
        element.remove(child)
        return True

    return plant


def uper(joint: Any) -> bool:
    limit = joint.find("limit")
    if limit is None or limit.get("upper") is None:
        return False
    limit.set("uper", limit.attrib.pop("upper"))
    return True


def crossed(joint: Any) -> bool:
    limit = joint.find("limit")
    if limit is None or not float(limit.get("lower", 0)) < float(limit.get("upper", 0)):
        return False
    lower, upper = limit.get("lower", "0"), limit.get("upper", "0")
    limit.set("lower", upper)
    limit.set("upper", lower)
    return True


def limits_in_degrees(joint: Any) -> bool:
    limit = joint.find("limit")
    if joint.get("type") != "revolute" or limit is None or limit.get("upper") is None:
        return False
    for key in ("lower", "upper"):
        limit.set(key, f"{degrees(float(limit.get(key, 0))):.4g}")
    return True


def rpy_in_degrees(text: str) -> str | None:
    angles = [float(word) for word in text.split()]
    return " ".join(f"{degrees(x):.6g}" for x in angles) if max(map(abs, angles)) > 0.2 else None


def com_moved(text: str) -> str:
    x, *yz = text.split()
    return " ".join([repr(float(x) + 2.0), *yz])


def longer(least: float) -> Callable[[str], str | None]:
    """A length in mm, where it is at least so many metres."""
    return lambda text: scaled(text, 1e3) if np.linalg.norm([float(x) for x in text.split()]) > least else None


def meshes_in_mm(link: Any) -> bool:
    meshes = [*link.iterfind("*/geometry/mesh")]
    for mesh in meshes:
        mesh.set("scale", scaled(mesh.get("scale", "1 1 1"), 1e3))
    return bool(meshes)


LINK, JOINT = "link", "joint"
FAULTS: dict[str, tuple[str, Fault]] = {
    "decimal comma": (
        LINK, lambda x: at(x, "inertial/mass", "value", lambda t: t.replace(".", ",") if "." in t else None),
    ),
    "<inertal>": (LINK, misspelt),
    "uper=": (JOINT, uper),
    "line break in a number": (
        LINK, lambda x: at(x, "inertial/origin", "xyz", lambda t: re.sub(r"\s+", "LINEBREAK", t.strip(), count=1)),
    ),
    "limits crossed": (JOINT, crossed),
    "limits in degrees": (JOINT, limits_in_degrees),
    "rpy in degrees": (JOINT, lambda x: at(x, "origin", "rpy", rpy_in_degrees)),
    "inertia in kg mm²": (LINK, inertia(1e6)),
    "inertia in kg cm²": (LINK, inertia(1e4)),
    "inertia in g m²": (LINK, inertia(1e3)),
    "mass in g": (LINK, lambda x: at(x, "inertial/mass", "value", lambda t: scaled(t, 1e3))),
    "ixx < 0": (LINK, lambda x: at(x, "inertial/inertia", "ixx", lambda t: scaled(t, -1) if float(t) > 0 else None)),
    "izz = 3 (ixx + iyy)": (LINK, izz),
    "inertial removed": (LINK, removed("inertial")),
    "mesh in mm": (LINK, meshes_in_mm),
    "effort 0": (JOINT, lambda x: at(x, "limit", "effort", lambda t: "0" if float(t) > 0 else None)),
    "com + 2 m": (LINK, lambda x: at(x, "inertial/origin", "xyz", com_moved)),
    "com in mm": (LINK, lambda x: at(x, "inertial/origin", "xyz", longer(0.002))),
    "mass × 10": (LINK, lambda x: at(x, "inertial/mass", "value", lambda t: scaled(t, 10))),
    "origin in mm": (JOINT, lambda x: at(x, "origin", "xyz", longer(0.02))),
    "<axis> removed": (JOINT, removed("axis")),
}  # fmt: skip


def places(root: Any, kind: str) -> list[Any]:
    """Joints that move, or the links they carry, with mass and moments."""
    joints = [each for each in root.iterfind("joint") if each.get("type") in ("revolute", "continuous", "prismatic")]
    if kind == JOINT:
        return joints
    children = {each.find("child").get("link") for each in joints}
    return [each for each in root.iterfind("link") if each.get("name") in children and heavy(each)]


def heavy(link: Any) -> bool:
    mass, moments = link.find("inertial/mass"), link.find("inertial/inertia")
    return mass is not None and moments is not None and float(mass.get("value")) > 0 and float(moments.get("ixx")) > 0


def planted(root: Any, name: str, rng: np.random.Generator) -> tuple[bytes, str] | None:
    """The text with the fault at a random place that takes it, and where; None if there is none."""
    kind, fault = FAULTS[name]
    names = [each.get("name") for each in places(root, kind)]
    for index in rng.permutation(len(names)):
        copy = deepcopy(root)
        element = next(each for each in copy.iterfind(kind) if each.get("name") == names[index])
        if fault(element):
            return etree.tostring(copy).replace(b"LINEBREAK", b"\n"), f"{kind} {names[index].strip()!r}"
    return None


def text_of(name: str) -> tuple[bytes, str]:
    """The text of an arm and its path; a xacro file is expanded with the defaults of its arguments."""
    path = catalog.find(name)
    return (expand(path, {}, ())[0] if path.suffix == ".xacro" else content(path)), str(path)


def found(checkup: Checkup) -> set[tuple[str, str]]:
    return {(each.kind, each.where) for each in checkup.findings}


def unlike(text: bytes, source: str, units: bool) -> list[str]:
    """How the repaired file breaks its promises: repairs of it change nothing, and its findings are those left."""
    once = checked(text, source, units=units)
    if once.repaired is None:
        return [] if once.left == once.findings and not once.gone else ["left without a repair"]
    twice = checked(once.repaired, source, units=units)
    broken = [] if twice.repaired is None else ["repaired again"]
    left, again = ([str(each) for each in found] for found in (once.left, twice.findings))
    return broken + ([] if left == again else ["left is not what is found"])


def pair(root: Any, names: Sequence[str], rng: np.random.Generator) -> bytes | None:
    """The text with two faults at random places, the second after the first; None if one does not apply."""
    text = None
    for name in names:
        try:
            if (faulty := planted(root, name, rng)) is None:
                return None
        except (ValueError, AttributeError):  # the second fault reads a number that the first one broke
            return None
        text, _ = faulty
        root = etree.fromstring(text)
    return text


def repairs(arms: list[tuple[bytes, str]], faults: list[str], pairs: int) -> None:
    """Print how many texts were repaired, and each that does not stay repaired."""
    tried: Counter[str] = Counter()
    for number, (text, source) in enumerate(arms, start=1):
        root, rng = etree.fromstring(text), np.random.default_rng(number)
        single = [(name, faulty and faulty[0]) for name in faults for faulty in [planted(root, name, rng)]]
        chosen = [tuple(map(str, rng.choice(faults, 2))) for _ in range(pairs)]
        double = [(" + ".join(names), pair(root, names, rng)) for names in chosen]
        for kind, texts in (("as it stands", [("", text)]), ("one fault", single), ("two faults", double)):
            for name, broken in texts:
                if broken is None:
                    continue
                for units in (False, True):
                    tried[kind] += 1
                    for why in unlike(broken, source, units):
                        tried[f"{kind}: {why}"] += 1
                        print(f"{Path(source).name}: {name}, units={units}: {why}", flush=True)
        print(f"{number} {Path(source).name}", flush=True)
    print(*(f"{kind}: {count}" for kind, count in tried.items()), sep="\n")


def main() -> None:
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="+", help="names of the catalog, URDF or xacro files")
    parser.add_argument("--faults", nargs="*", choices=FAULTS, default=[*FAULTS])
    parser.add_argument("--repairs", type=int, metavar="PAIRS", help="repair faults, and so many pairs per arm")
    options = parser.parse_args()
    if options.repairs is not None:
        repairs([text_of(name) for name in options.arms], options.faults, options.repairs)
        return
    clean, tried, hit, elsewhere, missed = 0, Counter(), Counter(), Counter(), {}
    alarms: Counter[tuple[str, str]] = Counter()
    with_errors, refused = [], []
    for name in options.arms:
        try:
            text, source = text_of(name)
        except RobotDynError as error:
            refused.append(f"{name}: {error}")
            continue
        before = checked(text, source)
        if not before.ok:
            kinds = Counter(each.kind for each in before.findings if each.severity is Severity.ERROR)
            with_errors.append(f"{name}: {', '.join(f'{kind} {count}' for kind, count in kinds.items())}")
            continue
        clean += 1
        alarms += Counter((x.severity.value, x.kind) for x in before.findings if x.severity is Severity.WARNING)
        root = etree.fromstring(text)
        for fault in options.faults:
            if (faulty := planted(root, fault, np.random.default_rng(clean))) is None:
                continue
            changed, where = faulty
            new = found(checked(changed, source)) - found(before)
            tried[fault] += 1
            hit[fault] += any(place == where for _, place in new)
            elsewhere[fault] += bool(new) and not any(place == where for _, place in new)
            if not any(place == where for _, place in new):
                missed.setdefault(fault, []).append(f"{Path(name).name} {where}")
        print(f"{clean} {Path(name).name}", flush=True)
    print(f"\n{clean} arms without errors; {len(with_errors)} with errors, {len(refused)} not read")
    print("| fault | planted | found at its place | found elsewhere alone |\n|---|--:|--:|--:|")
    for fault in options.faults:
        print(f"| {fault} | {tried[fault]} | {hit[fault]} | {elsewhere[fault]} |")
    print("\nwarnings in the clean arms:", ", ".join(f"{kind} {count}" for (_, kind), count in alarms.most_common()))
    print("\nwith errors as they stand:", *with_errors, sep="\n  ")
    print("\nnot read:", *refused, sep="\n  ")
    print("\nnot found:", *(f"{fault}: {', '.join(where)}" for fault, where in missed.items()), sep="\n  ")


if __name__ == "__main__":
    main()
