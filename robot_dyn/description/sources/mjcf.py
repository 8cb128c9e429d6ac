"""MJCF, the format of MuJoCo: compiled by MuJoCo itself, and written as a URDF of hinges and slides.

A body with joints 1 … k, with anchors p_i and axes a_i in body axes, has the placement in its parent

    T_body · Π_i Tr(p_i) exp(â_i (q_i − q0_i)) Tr(−p_i)        for a hinge; a slide is Tr(a_i (q_i − q0_i))

so several joints of one body are separated by massless links. The compiler resolves defaults and `inertiafromgeom`.
The URDF contains damping, dry friction, ranges and actuator limits; armature and gravity become edits, shapes become
<visual> elements. Contacts, actuators, sensors and springs are left out.

Source: MuJoCo documentation, Computation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.couplings import Mimic, resolve
from robot_dyn.description.description import content
from robot_dyn.description.edits import Changes
from robot_dyn.description.markup import vector_text
from robot_dyn.description.sources.mjcf_actuators import Actuators
from robot_dyn.description.sources.mjcf_model import Compiled, compile_model
from robot_dyn.description.sources.mjcf_shapes import Shapes
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.errors import DescriptionError, shorten, shown
from robot_dyn.foundations.spatial import rotation, rpy_of

SUFFIXES = (".xml", ".mjcf")
_START = 2**16  # bytes searched for the root element
LEAVABLE = ("tendon", "equality", "free", "ball")
_EQUALITIES = ("connect", "weld", "joint", "tendon", "flex", "flexvert", "flexstrain", "distance")


@final
@dataclass(frozen=True)
class Mjcf:
    """Contents of an MJCF file.

    Attributes:
        urdf: The model as a URDF.
        armature: Armature by joint, in [kg m²] or [kg]; that of a mimic joint is added to the joint it follows.
        gravity: Acceleration of free fall, in [m/s²].
        findings: Notes on left-out elements.
    """

    urdf: bytes
    armature: dict[str, float]
    gravity: tuple[float, ...]
    findings: tuple[str, ...]

    def edits(self, joint_names: Iterable[str]) -> Changes:
        """Return the edits of a robot with these joints."""
        armature = {name: value for name, value in self.armature.items() if name in joint_names and value}
        return Changes(armature=armature, gravity=self.gravity)


def is_mjcf(path: Path) -> bool:
    """Return True if a file has a suffix and a root element of MJCF."""
    return path.suffix.lower() in SUFFIXES and b"<mujoco" in content(path)[:_START]


def leavable(without: Iterable[str]) -> frozenset[str]:
    """Return the kinds of elements to leave out, as a checked set.

    Raises:
        DescriptionError: If it is not several of `LEAVABLE`.
    """
    if not isinstance(without, set | frozenset | tuple | list) or not all(kind in LEAVABLE for kind in without):
        unknown = [kind for kind in without if kind not in LEAVABLE] if isinstance(without, set | frozenset) else []
        names = ", ".join(sorted(map(shown, unknown))) or shown(without)
        raise DescriptionError(f"without must be a set of {', '.join(LEAVABLE)}, got {names}")
    return frozenset(without)


def read(path: Path, without: frozenset[str] = frozenset()) -> Mjcf:
    """Read an MJCF file as a URDF with edits.

    Raises:
        MissingExtraError: If MuJoCo is not installed.
        DescriptionError: If MuJoCo refuses the file; or if it has tendons, free or ball joints, or equalities other
            than linear ones between two joints, and `without` does not list them.
    """
    return _Reader(compile_model(path), without).read()


@dataclass
class _Reader:
    """Writes the URDF of one compiled model."""

    compiled: Compiled
    without: frozenset[str]
    mimics: dict[str, Mimic] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.mujoco, self.model, self.source = self.compiled.mujoco, self.compiled.model, str(self.compiled.path)
        self.findings, self.shapes = [*self.compiled.warnings], Shapes(self.compiled)

    def read(self) -> Mjcf:
        self.refuse_tendons()
        self.equalities()
        self.note_the_rest()
        out = etree.Element("robot", name=self.name_of_model())
        self.shapes.draw(etree.SubElement(out, "link", name=self.body(0)), 0)
        for body in range(1, self.model.nbody):
            self.write_body(out, body)
        for kind, number in Counter(self.shapes.left_out).items():
            self.findings.append(f"{number} geoms of kind {kind} are not drawn, because URDF has no such shape")
        gravity = (0.0,) * 3 if self.compiled.disabled("gravity") else tuple(map(float, self.model.opt.gravity))
        return Mjcf(etree.tostring(out), self.at_joints("armature", 2), gravity, tuple(self.findings))

    def leave(self, kind: str, where: str, why: str) -> None:
        """Add a finding if `without` lists this kind of element; raise DescriptionError otherwise."""
        if kind not in self.without:
            remedy = f"remove it, or leave it out by --without {kind}, in Python without={{{kind!r}}}"
            raise DescriptionError(f"{self.source}: {where}: {why}; {remedy}")
        self.findings.append(f"{where}: {why}; left out")

    def new(self, name: str) -> str:
        """Return a name that no body or joint has, for an element without a counterpart in MuJoCo."""
        taken = {*map(self.body, range(self.model.nbody)), *map(self.joint, range(self.model.njnt))}
        while name in taken:
            name += "_"
        return name

    def name_of_model(self) -> str:
        names = bytes(self.model.names)
        return names[: names.index(b"\0")].decode(errors="replace").strip() or "mjcf"

    def body(self, index: int) -> str:
        return self.compiled.name("body", index)

    def joint(self, index: int) -> str:
        return self.compiled.name("joint", index)

    def moves(self, joint: int) -> bool:
        return self.kind(joint) in ("hinge", "slide")

    def kind(self, joint: int) -> str:
        return self.mujoco.mjtJoint(int(self.model.jnt_type[joint])).name.removeprefix("mjJNT_").lower()

    def dof(self, what: str, joint: int) -> float:
        """Return the armature, damping or dry friction of a joint, including its actuators."""
        of_joint = float(getattr(self.model, f"dof_{what}")[self.model.jnt_dofadr[joint]])
        off = {"damping": ("passive", "damper"), "frictionloss": ("constraint", "frictionloss")}.get(what, ())
        return of_joint * (not self.compiled.disabled(*off)) + self.actuators.added(what, joint)

    @property
    def actuators(self) -> Actuators:
        return Actuators(self.mujoco, self.model)

    def reference(self, joint: int) -> float:
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])

    def at_joints(self, what: str, power: int) -> dict[str, float]:
        """Return values by joint; those of mimic joints count |ratio|ᵖ at the joint they follow, by virtual work."""
        total: dict[str, float] = {}
        for j in filter(self.moves, range(self.model.njnt)):
            source, ratio, _ = resolve(self.joint(j), self.mimics, FLOAT64)
            total[source] = total.get(source, 0.0) + abs(float(ratio)) ** power * self.dof(what, j)
        return total

    def refuse_tendons(self) -> None:
        for index in range(self.model.ntendon):
            name = self.compiled.name("tendon", index)
            self.leave("tendon", f"tendon {name!r}", "tendons are not supported")

    def equalities(self) -> None:
        """Turn a linear equality of two joints into a mimic joint; refuse or leave out any other."""
        model = self.model
        for index in range(model.neq):
            kind, (one, other) = int(model.eq_type[index]), (int(model.eq_obj1id[index]), int(model.eq_obj2id[index]))
            name = self.compiled.name("equality", index)
            a0, a1, *higher = model.eq_data[index][:5].tolist()
            if not model.eq_active0[index] or self.compiled.disabled("equality", "constraint"):
                self.findings.append(f"equality {name!r}: is not active; left out")
            elif kind == int(self.mujoco.mjtEq.mjEQ_JOINT) and other >= 0 and a1 and not any(higher):
                if self.joint(one) in self.mimics:
                    self.leave("equality", f"equality {name!r}", f"joint {self.joint(one)!r} already follows another")
                    continue
                offset = a0 + self.reference(one) - a1 * self.reference(other)
                self.mimics[self.joint(one)] = Mimic(self.joint(other), repr(a1), repr(offset))
            else:
                what = _EQUALITIES[kind] if kind < len(_EQUALITIES) else f"type {kind}"
                self.leave("equality", f"equality {name!r}", f"an equality of {what} that is not q₁ = a₀ + a₁ q₂")

    def note_the_rest(self) -> None:
        """Add findings for physics that MuJoCo models and a URDF cannot state; effects can."""
        model = self.model
        springs = [self.joint(j) for j in range(model.njnt) if model.jnt_stiffness[j].any()]
        if springs:
            listed = shorten(", ".join(springs), 200)
            self.findings.append(f"joints {listed}: their springs are left out; add them as effects")
        if getattr(model, "dof_dampingpoly", np.zeros(1)).any():  # from MuJoCo 4 on
            self.findings.append("nonlinear damping is left out; add it as an effect")
        for what in filter(self.actuators.not_at_joints, ("armature", "damping")):
            self.findings.append(f"{what} of actuators that do not act at a joint is left out")
        if model.opt.density or model.opt.viscosity:
            self.findings.append("forces of the medium (density, viscosity) are left out; add them as effects")
        if model.body_gravcomp.any():
            self.findings.append("gravity compensation of bodies is left out; add it in a controller")

    def write_body(self, out: Any, body: int) -> None:
        """Write the joints of a body and its link, whose frame is the body's frame in MuJoCo."""
        model, name = self.model, self.body(body)
        R, p, parent = (
            self.compiled.rotation(model.body_quat[body]),
            model.body_pos[body],
            self.body(model.body_parentid[body]),
        )
        first = int(model.body_jntadr[body])
        for j in range(first, first + int(model.body_jntnum[body])):
            if not self.moves(j):
                why = f"is a {self.kind(j)} joint; its body {name!r} would be fixed"
                self.leave(self.kind(j), f"joint {self.joint(j)!r}", why)
                continue
            anchor, axis, q0 = model.jnt_pos[j], model.jnt_axis[j], self.reference(j)
            hinge = self.kind(j) == "hinge"
            p = p + R @ anchor if hinge else p - R @ axis * q0
            R = R @ rotation(axis, np.float64(-q0)) if hinge else R
            child = self.new(f"{name}_{self.joint(j)}")
            etree.SubElement(out, "link", name=child)
            self.write_joint(out, j, (R, p), parent, child, hinge)
            R, p, parent = np.eye(3), -anchor if hinge else np.zeros(3), child
        link = etree.SubElement(out, "link", name=name)
        joint = etree.SubElement(out, "joint", name=self.new(f"{name}_frame"), type="fixed")
        self.ends(joint, (R, p), parent, name)
        if model.body_mass[body] > 0:
            self.inertial(link, body)
        self.shapes.draw(link, body)

    def write_joint(self, out: Any, j: int, pose: tuple[Any, Any], parent: str, child: str, hinge: bool) -> None:
        model, name, limited = self.model, self.joint(j), bool(self.model.jnt_limited[j])
        kind = ("revolute" if limited else "continuous") if hinge else "prismatic"
        joint = etree.SubElement(out, "joint", name=name, type=kind)
        self.ends(joint, pose, parent, child)
        etree.SubElement(joint, "axis", xyz=vector_text(model.jnt_axis[j]))
        limit = etree.SubElement(joint, "limit", effort=self.effort(j), velocity=UNBOUNDED)
        lower, upper = map(float, model.jnt_range[j]) if limited else (-float(UNBOUNDED), float(UNBOUNDED))
        if kind != "continuous":
            limit.set("lower", repr(lower))
            limit.set("upper", repr(upper))
        if name in self.mimics:
            mimic = self.mimics[name]
            etree.SubElement(joint, "mimic", joint=mimic.source, multiplier=mimic.multiplier, offset=mimic.offset)
            return
        damping, friction = (self.at_joints(*term)[name] for term in (("damping", 2), ("frictionloss", 1)))
        etree.SubElement(joint, "dynamics", damping=repr(damping), friction=repr(friction))

    def effort(self, j: int) -> str:
        """Return the largest force of a joint's actuators, if limited and equal in both directions."""
        limits = self.actuators.range(j)
        if limits is not None and limits[0] != -limits[1]:
            self.findings.append(
                f"joint {self.joint(j)!r}: its actuators exert {limits[0]:g} to {limits[1]:g}, different in the two"
                " directions; no effort limit is set"
            )
            limits = None
        return UNBOUNDED if limits is None else repr(limits[1])

    def ends(self, joint: Any, pose: tuple[Any, Any], parent: str, child: str) -> None:
        R, p = pose
        etree.SubElement(joint, "origin", xyz=vector_text(p), rpy=vector_text(rpy_of(R)))
        etree.SubElement(joint, "parent", link=parent)
        etree.SubElement(joint, "child", link=child)

    def inertial(self, link: Any, body: int) -> None:
        model, R = self.model, self.compiled.rotation(self.model.body_iquat[body])
        with np.errstate(all="ignore"):  # the URDF reader refuses infinite values
            inertia = R * model.body_inertia[body] @ R.T
        element = etree.SubElement(link, "inertial")
        etree.SubElement(element, "origin", xyz=vector_text(model.body_ipos[body]), rpy="0 0 0")
        etree.SubElement(element, "mass", value=repr(float(model.body_mass[body])))
        keys = {f"i{a}{b}": (i, k) for i, a in enumerate("xyz") for k, b in enumerate("xyz") if k >= i}
        etree.SubElement(element, "inertia", {key: repr(float(inertia[at])) for key, at in keys.items()})
