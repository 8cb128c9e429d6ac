"""The equation of motion of a plant in words: its terms, the effects, and their coefficients."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, final

from robot_dyn.description.catalog import abbreviated
from robot_dyn.description.edits import Edits
from robot_dyn.effects.effect import Effect, Force
from robot_dyn.foundations.answer import Answer, Block
from robot_dyn.model.findings import reading_findings
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import coefficient_texts, joint_types_of

EDITED = {
    "gravity": "∂V/∂q in N, with V = −Σ m gᵀ p",
    "lock": "a joint fixed at a value, which makes its link part of the parent link",
    "payload": "a rigid body on a link, in M, C and N",
    "armature": "added to the diagonal of M",
    "mass_scale": "factor on mass and inertia of all links, except payloads",
    "mass_scales": "factors on mass and inertia of single links, except payloads",
    "mass": "replaces the mass of a link in the file",
    "inertia": "replaces the inertia of a link in the file",
}
"""Description of each edit of a robot, in one line."""


@final
@dataclass(frozen=True)
class Number:
    """A number of a scene.

    Attributes:
        key: Key in the scene.
        value: The number or numbers, as text.
        source: "scene", "default" or "the robot's file".
    """

    key: str
    value: str
    source: str


@final
@dataclass(frozen=True)
class Term:
    """An edit of the robot, or an effect.

    Attributes:
        kind: Name in scenes.
        term: Equation in one line; empty for a user-defined effect without `term`.
        numbers: Numbers as written in a scene.
        coefficients: Resolved coefficients, with units.
    """

    kind: str
    term: str
    numbers: tuple[Number, ...] = ()
    coefficients: tuple[str, ...] = ()


@final
@dataclass(frozen=True, eq=False, repr=False)
class Explanation(Answer):
    """The equations that a plant, a setup or a scene integrates.

    Attributes:
        robot: Name of the robot.
        joints: Names of the joints.
        equation: Lines of the equation of motion.
        effects: Edits of the robot and effects.
        absent: Kinds of effects that do not act.
        absent_of_control: Features of a digital loop that the controller does not have.
        control: Lines on controller and reference.
        method: Lines on method and start.
        machine_code: Lines on instructions.
        source: Path of the robot's file; empty if there is none.
        findings: Estimated values of the robot, and assumptions and omissions made while reading its file.
    """

    robot: str
    joints: tuple[str, ...]
    equation: tuple[str, ...]
    effects: tuple[Term, ...]
    absent: tuple[str, ...] = ()
    absent_of_control: tuple[str, ...] = ()
    control: tuple[str, ...] = ()
    method: tuple[str, ...] = ()
    machine_code: tuple[str, ...] = ()
    source: str = ""
    findings: tuple[str, ...] = ()

    def blocks(self) -> Iterator[Block]:
        n = len(self.joints)
        yield f"{self.robot}: {n} joint{'s' if n > 1 else ''}, {', '.join(self.joints)}"
        yield ""
        yield from (f"    {line}" for line in self.equation)
        yield ""
        yield "effects:" if self.effects else "effects: none"
        for effect in self.effects:
            yield f"  {effect.kind}: {effect.term}" if effect.term else f"  {effect.kind}"
            yield from (f"    {x.key} = {x.value}  ({x.source})" for x in effect.numbers)
            if effect.coefficients:
                yield f"    resolved: {'; '.join(effect.coefficients)}"
        if self.absent:
            yield ""
            yield "not simulated (not part of the setup):"
            yield f"  {', '.join(self.absent)}"
        if self.absent_of_control:
            yield f"  of the control: {', '.join(self.absent_of_control)}"
        for lines in (self.control, self.method, self.machine_code):
            yield from ("", *lines) if lines else ()
        if self.source:
            yield ""
            yield f"robot file: {abbreviated(self.source)}"
            yield from (f"  {finding}" for finding in self.findings)


def explanation(dynamics: Dynamics, effects: tuple[Effect, ...]) -> Explanation:
    """Return the equation of motion of rigid bodies with effects."""
    robot: Any = getattr(dynamics, "robot", dynamics)
    edits = tuple(edit_terms(robot.edits)) if hasattr(robot, "edits") else ()
    weight = ["∂V/∂q"] if not hasattr(robot, "edits") or any(robot.edits.gravity) else []
    forces = dict.fromkeys(force.name for force in effects if isinstance(force, Force))
    bounds = dict.fromkeys(part.name for part in effects if hasattr(part, "actuation"))
    return Explanation(
        getattr(robot, "name", type(dynamics).__name__),
        dynamics.joint_names,
        (
            "M(q) a + C(q, v) v + N = τ",
            f"N = {_sum([*weight, *(f'− τ_{name}' for name in forces)])}",
            " after ".join(["τ = u", *([", ".join(bounds)] if bounds else [])]),
        ),
        (
            *edits,
            *(Term(x[0].name, term_of(x), coefficients=acting_coefficients(x, dynamics)) for x in _by_effect(effects)),
        ),
        source=robot.description.source if hasattr(robot, "description") else "",
        findings=reading_findings(robot.description) if hasattr(robot, "description") else (),
    )


def _sum(terms: list[str]) -> str:
    """Join the terms of N, without a space after a leading sign."""
    return " ".join(terms).replace("− ", "−", 1) if terms and terms[0][0] == "−" else " ".join(terms) or "0"


def _by_effect(effects: Iterable[Effect]) -> Iterator[list[Effect]]:
    """Yield the parts of each effect: consecutive ones with the same name and different classes."""
    parts: list[Effect] = []
    for effect in effects:
        if parts and (effect.name != parts[0].name or type(effect) in map(type, parts)):
            yield parts
            parts = []
        parts.append(effect)
    if parts:
        yield parts


def term_of(parts: Iterable[Effect | type[Effect]]) -> str:
    """Return the sum of the terms of an effect's parts, or of their classes."""
    first, *rest = (part.term for part in parts)
    return " ".join((first, *(f"− {term[1:]}" if term[:1] == "−" else f"+ {term}" for term in rest)))


def acting_coefficients(parts: Iterable[object], dynamics: Dynamics, signal: str = "signal") -> tuple[str, ...]:
    """Return the coefficients of the parts of an effect or a controller, with units; see `coefficient_texts`."""
    types = joint_types_of(dynamics)
    texts = {name: text for part in parts for name, text in coefficient_texts(part, types, signal).items()}
    return tuple(texts.values())


def edit_terms(edits: Edits) -> Iterator[Term]:
    """Yield a term for each edit of a robot, gravity included."""
    texts = {
        "gravity": [f"g = ({', '.join(f'{x:g}' for x in edits.gravity)}) m/s²"] if any(edits.gravity) else [],
        "lock": [f"{joint} = {x:g}" for joint, x in edits.lock],
        "payload": [f"{x.mass:g} kg on {x.frame} at ({', '.join(f'{c:g}' for c in x.com)}) m" for x in edits.payloads],
        "armature": [f"{joint} {x:g}" for joint, x in edits.armature if x],
        "mass_scale": [f"{edits.mass_scale:g}"] if edits.mass_scale != 1 else [],
        "mass_scales": [f"{link} {x:g}" for link, x in edits.mass_scales],
        "mass": [f"{link} {x:g} kg" for link, x in edits.masses],
        "inertia": [link for link, _ in edits.inertias],
    }
    yield from (Term(kind, EDITED[kind], coefficients=tuple(lines)) for kind, lines in texts.items() if lines)
