"""Checks of masses and inertias: impossible values, missing values, disproportionate masses.

I₁ ≥ 0,   I₁ + I₂ ≥ I₃,   for each link and for the links that joints merge into one body
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from robot_dyn import Robot
from robot_dyn.description import Structure, implausibility, structure_of
from robot_dyn.model import findings as doctor
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

_QUOTED = r"""(?:'[^']*'|"[^"]*")"""  # a name, which may contain colons and semicolons
_SENTENCE = re.compile(rf"((?:link|joint)s? {_QUOTED}(?:, {_QUOTED})*)(?:: | )(.*?); (.*)", re.DOTALL)
_NOTHING = 1e-9  # relative to the largest moment
_LOST = 1e-6  # relative to the heaviest link and to the largest moment
_RATIO = 1e4  # largest ratio of two masses in an arm, for example a base of 100 kg and a finger of 10 g
_KINDS = (
    (Severity.ERROR, FindingKind.INERTIA_IMPOSSIBLE, doctor.impossible_inertias),
    (Severity.WARNING, FindingKind.INERTIA_WITHOUT_MASS, doctor.moments_without_mass),
    (Severity.WARNING, FindingKind.MASS_TINY, doctor.tiny_masses),
    (Severity.WARNING, FindingKind.LENGTH_LONG, doctor.long_lengths),
    (Severity.WARNING, FindingKind.MIMIC_RATIO, doctor.large_ratios),
    (Severity.WARNING, FindingKind.MIMIC_LIMITS, doctor.followers_beyond_limits),
    (Severity.NOTE, FindingKind.BASE_MOBILE, doctor.welded_base),
    (Severity.NOTE, FindingKind.INERTIA_IMPOSSIBLE, doctor.impossible_inertias_of_the_base),
)


def masses(document: Document, robot: Robot) -> Iterator[Finding]:
    """Report faulty masses and inertias of a robot that loads."""
    stated = structure_of(robot.description, robot.edits)
    for finding in (*_in_words(robot, stated), *_massless(document, robot, stated)):
        yield replace(finding, line=document.line(finding.where, ""))
    yield from _rods_and_points(document, stated)
    yield from _merged(document, robot, stated)
    yield from _proportions(document, stated)


def beyond_reach(document: Document, robot: Robot, others: Iterable[Finding]) -> Iterator[Finding]:
    """Report inertias out of proportion to the robot, unless the shape of the link has already revealed them."""
    shown = {other.where for other in others if other.kind == FindingKind.INERTIA_SHAPE}
    for text in doctor.inertias_beyond_reach(structure_of(robot.description, robot.edits)):
        finding = _of_words(Severity.ERROR, FindingKind.INERTIA_FAR, text)
        if finding.where not in shown:
            yield replace(finding, line=document.line(finding.where, ""))


def _in_words(robot: Robot, stated: Structure) -> Iterator[Finding]:
    """Yield the findings that `load` also reports."""
    for text in doctor.no_inertia_about_axis(stated, robot.joint_without_inertia):
        yield _of_words(Severity.ERROR, FindingKind.INERTIA_MISSING, text)
    for text in doctor.for_other_programs(stated, robot.description):
        yield _of_words(Severity.NOTE, FindingKind.OTHER_PROGRAMS, text)
    idle = _negligible(stated)
    for severity, kind, find in _KINDS:
        for text in find(stated):
            finding = _of_words(severity, kind, text)
            mild = severity is Severity.ERROR and finding.where in idle
            yield replace(finding, severity=Severity.WARNING) if mild else finding


def _negligible(stated: Structure) -> set[str]:
    """Return the links whose mass and moments are too small to affect M, for example 1e-8 kg on a frame."""
    heaviest = max((link.mass for link in stated.links.values()), default=0.0)
    largest = max((float(np.trace(link.inertia)) for link in stated.links.values()), default=0.0)
    return {
        f"link {name!r}"
        for name, link in stated.links.items()
        if link.mass <= _LOST * heaviest and np.abs(link.inertia).max() <= _LOST * largest
    }


def _of_words(severity: Severity, kind: FindingKind, text: str) -> Finding:
    """Convert a sentence of `model.findings` to a finding with place, fault and remedy."""
    if match := _SENTENCE.fullmatch(text):
        return Finding(severity, kind, match[1], match[2], match[3])
    what, _, remedy = text.rpartition("; ")  # a name with both kinds of quotes, or an abbreviated list
    return Finding(severity, kind, "robot", what, remedy)


def _massless(document: Document, robot: Robot, stated: Structure) -> Iterator[Finding]:
    """Report bodies without mass: an error if they have a shape or M is singular, else a warning, as in a wrist."""
    for text in doctor.massless_bodies(stated):
        finding = _of_words(Severity.WARNING, FindingKind.MASS_MISSING, text)
        links = next((links for links in stated.bodies.values() if finding.where == f"link {links[0]!r}"), ())
        drawn = any(_has_shape(document, name) for name in links)
        singular = robot.joint_without_inertia is not None
        yield replace(finding, severity=Severity.ERROR) if drawn or singular or not links else finding


def _rods_and_points(document: Document, stated: Structure) -> Iterator[Finding]:
    """Report moving links with mass and a zero principal moment, which other programs reject."""
    moving = {name: link for name, link in stated.links.items() if link.mass > 0 and name not in stated.base}
    moments = {name: np.linalg.eigvalsh(link.inertia) for name, link in moving.items()}
    points = [name for name, (_, _, most) in moments.items() if most == 0 and _has_shape(document, name)]
    for name, (least, _, most) in moments.items():
        if name in points and len(points) >= max(2, len(moving) / 2):
            yield document.finding(
                Severity.WARNING, FindingKind.INERTIA_ZERO, document.named("link", name),
                f"all its moments are 0, like those of a point of {moving[name].mass:g} kg, but it has a shape",
                "add moments, or remove its <inertia> and estimate them: --fix with --density",
            )  # fmt: skip
        elif abs(least) <= _NOTHING * most:
            yield document.finding(
                Severity.NOTE, FindingKind.INERTIA_ZERO, document.named("link", name),
                f"its smallest principal moment is 0, like that of a rod or a point of {moving[name].mass:g} kg, which"
                " MuJoCo rejects",
                "give it the moments of a body with some width",
            )  # fmt: skip


def _has_shape(document: Document, name: str) -> bool:
    link = document.named("link", name)
    return any(link.find(f"{tag}/geometry") is not None for tag in ("visual", "collision"))


def _merged(document: Document, robot: Robot, stated: Structure) -> Iterator[Finding]:
    """Report merged bodies with an impossible inertia, even if the inertia of each link is possible."""
    for joint, body in zip(robot.model.names[1:], list(robot.model.inertias)[1:], strict=True):
        links = next((links for name, links in stated.bodies.items() if joint.endswith(name)), ())
        if len(links) > 1 and body.mass > 0 and (why := implausibility(body.mass, body.lever, body.inertia)):
            listed = ", ".join(map(repr, links[:4]))
            yield document.finding(
                Severity.ERROR, FindingKind.INERTIA_IMPOSSIBLE, document.named("link", links[0]),
                f"merged with the links fixed to it ({listed}), {why}",
                "correct the inertias of these links: their numbers, order or signs",
            )  # fmt: skip


def _proportions(document: Document, stated: Structure) -> Iterator[Finding]:
    """Report the lightest or heaviest moving body if the masses are out of proportion."""
    mass_of = {
        stated.joints[joint].child: sum(stated.links[name].mass for name in links)
        for joint, links in stated.bodies.items()
    }
    mass_of = {name: mass for name, mass in mass_of.items() if mass > 0}
    if not mass_of:
        return
    (light, least), (heavy, most) = min(mass_of.items(), key=lambda x: x[1]), max(mass_of.items(), key=lambda x: x[1])
    if most > _RATIO * least:
        typical = float(np.exp(np.median(np.log(list(mass_of.values())))))
        odd = light if typical / least > most / typical else heavy
        yield document.finding(
            Severity.WARNING, FindingKind.MASS_RATIO, document.named("link", odd),
            f"the masses of moving bodies range from {least:.3g} kg ({light!r}) to {most:.3g} kg ({heavy!r})",
            "check its mass and unit",
        )  # fmt: skip
