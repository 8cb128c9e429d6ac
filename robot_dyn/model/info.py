"""Summary of a robot: its joints, couplings, mass, edits and findings."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, final

from robot_dyn.description.catalog import abbreviated
from robot_dyn.description.coordinate_limits import position_limits, speed_limits
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits, Payload
from robot_dyn.description.other_programs import Statement, in_words
from robot_dyn.description.structure import Structure
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.model.remarks import gravity_lines, order_lines, short_order

_HEADINGS = "joint", "kind", "lower", "upper", "effort", "velocity", "damping", "dry friction", "armature"


@final
@dataclass(frozen=True)
class Joint:
    """A joint of the robot.

    Attributes:
        name: Name of the joint.
        kind: "revolute", "continuous" or "prismatic".
        lower, upper: Position limits, in [rad] or [m]; infinite if not stated.
        effort_limit: Largest torque or force, in [N m] or [N]; infinite if not stated.
        velocity_limit: Largest velocity, in [rad/s] or [m/s]; infinite if not stated.
        damping: Coefficient of viscous friction, in [N m s/rad] or [N s/m]; 0 if not stated.
        friction: Torque or force of dry friction, in [N m] or [N]; 0 if not stated.
        armature: Reflected rotor inertia of the robot, in [kg m²] or [kg].
    """

    name: str
    kind: str
    lower: float
    upper: float
    effort_limit: float
    velocity_limit: float
    damping: float
    friction: float
    armature: float


@final
@dataclass(frozen=True)
class Coupling:
    """A joint that follows another one: q = multiplier · q_source + offset.

    Attributes:
        joint: Name of the follower.
        source: Name of the joint that it follows.
        multiplier: Ratio of the positions.
        offset: Position of the follower where the source is at 0, in [rad] or [m].
    """

    joint: str
    source: str
    multiplier: float
    offset: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class Info(Answer):
    """Result of `info`: a summary of a robot.

    Attributes:
        robot: Name in its file.
        source: Path of the file.
        n: Degrees of freedom.
        total_mass: Mass of all links, in [kg].
        gravity: Acceleration of free fall in base axes, in [m/s²].
        gravity_acts: True if gravity exerts a torque on a joint at some position.
        gravity_free: Joints on which gravity exerts no torque at any position in the robot's mounting.
        balanced: Joints on which gravity exerts no torque in any mounting.
        file_order: Independent joints in the order of the file.
        joints: Independent joints, in the order of q.
        couplings: Joints that follow another one, as stated by the file.
        narrowed: By joint: followers that reach their limits before the joint reaches its own, and therefore narrow
            its `lower`, `upper` or `velocity_limit`.
        locked: Value of each locked joint, in [rad] or [m].
        payloads: Payloads added to the robot.
        estimated: Basis of each estimated inertia, by link.
        links: Names of the frames.
        other_programs: Rotors, springs and soft limits that the file states for other programs, see
            `Robot.statements`.
        findings: Doubtful values in the description, each with its remedy.
    """

    robot: str
    source: str
    n: int
    total_mass: float
    gravity: tuple[float, float, float]
    gravity_acts: bool
    gravity_free: tuple[str, ...]
    balanced: tuple[str, ...]
    file_order: tuple[str, ...]
    joints: tuple[Joint, ...]
    couplings: tuple[Coupling, ...]
    narrowed: dict[str, tuple[str, ...]]
    locked: dict[str, float]
    payloads: tuple[Payload, ...]
    estimated: dict[str, str]
    links: tuple[str, ...]
    other_programs: tuple[Statement, ...]
    findings: tuple[str, ...]

    def blocks(self) -> Iterator[Block]:
        yield _heading(self.robot, self.n, self.total_mass, self.gravity)
        yield abbreviated(self.source)
        yield from gravity_lines(self.gravity, self.gravity_free, self.balanced, self.n)
        yield from order_lines(tuple(joint.name for joint in self.joints), self.file_order)
        yield Table(_HEADINGS, tuple(tuple(vars(joint).values()) for joint in self.joints), digits=4)
        yield "units: rad and N m for revolute joints, m and N for prismatic joints; —: not stated"
        for coupling in self.couplings:
            equation = f"{coupling.multiplier:g} · {coupling.source} + {coupling.offset:g}"
            yield f"coupled: {coupling.joint} = {equation}"
        for joint, followers in self.narrowed.items():
            yield f"limits of {joint}: narrowed by those of {', '.join(followers)}"
        yield from _edits(self.locked, self.payloads)
        yield from (f"estimated: {link}: {basis}" for link, basis in self.estimated.items())
        yield from (f"for other programs: {line}" for line in in_words(self.other_programs))
        yield from (f"finding: {finding}" for finding in self.findings)


def robot_line(name: str, joints: tuple[str, ...], file_order: tuple[str, ...], total_mass: float, edits: Edits) -> str:
    """Return the `repr` of a robot: one line, also used within the `repr` of controllers and other values."""
    heading = _heading(name, len(joints), total_mass, edits.gravity)
    parts = heading, *_edits(dict(edits.lock), edits.payloads), *_other_edits(edits), *short_order(joints, file_order)
    return f"<Robot: {'; '.join(parts)}>"


def _heading(name: str, n: int, total_mass: float, gravity: tuple[float, float, float]) -> str:
    g = ", ".join(f"{x:g}" for x in gravity)
    return f"{name}: {n} joint{'s' * (n != 1)}, {total_mass:.4g} kg, gravity ({g}) m/s²"


def _edits(locked: Mapping[str, float], payloads: Iterable[Payload]) -> Iterator[str]:
    yield from (f"locked: {name} = {value:g}" for name, value in locked.items())
    yield from (f"payload: {payload.mass:g} kg on {payload.frame}" for payload in payloads)


def _other_edits(edits: Edits) -> Iterator[str]:
    if edits.mass_scale != 1:
        yield f"mass_scale: {edits.mass_scale:g}"
    if edits.mass_scales:
        yield f"mass_scales: {', '.join(f'{link} {x:g}' for link, x in edits.mass_scales)}"
    for name, changed in (("armature", edits.armature), ("mass", edits.masses), ("inertia", edits.inertias)):
        if changed:
            yield f"{name} changed: {', '.join(key for key, _ in changed)}"


def couplings_of(description: Description, moving: Collection[str]) -> Iterator[Coupling]:
    """Yield the couplings of moving joints, as stated by the file."""
    for joint in description.element.iterfind("joint[mimic]"):
        mimic: Any = joint.find("mimic")
        if joint.get("name") in moving:
            name: Any = joint.get("name")
            yield Coupling(name, mimic.get("joint"), float(mimic.get("multiplier")), float(mimic.get("offset")))


def narrowed(robot: Structure) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each joint whose limits are narrowed by followers, with the names of the followers."""
    speeds = speed_limits(robot)
    for joint, position in position_limits(robot).items():
        if names := (*position.narrowed_by, *speeds[joint].narrowed_by):
            yield joint, tuple(dict.fromkeys(names))
