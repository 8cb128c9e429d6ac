"""Robot: the dynamics of a URDF arm, M(q) a + C(q, v) v + N(q) = τ, computed by Pinocchio.

A thin layer over CRBA, RNEA and ABA [Featherstone 2008, ch. 5–7], with C from `coriolis`. A single float64 state is
passed straight to Pinocchio after checks of a fraction of a microsecond; coupled joints, lists and batches go through
`evaluation`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot
from pathlib import Path
from pkgutil import resolve_name
from types import MappingProxyType
from typing import Any, Unpack, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray
from numpy.typing import ArrayLike

from robot_dyn.description.attachment import attached, attached_edits
from robot_dyn.description.coordinate_limits import CoordinateLimit, position_limits, speed_limits
from robot_dyn.description.couplings import Couplings
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Changes, Edits, takes_changes
from robot_dyn.description.inertial_parameters import Parametrised
from robot_dyn.description.markup import parse
from robot_dyn.description.other_programs import (
    ARMATURE,
    LOWER,
    REST,
    STIFFNESS,
    UPPER,
    Statement,
    of_coordinates,
    statements,
)
from robot_dyn.description.soft_limits import within_soft_limits
from robot_dyn.description.structure import Structure, structure_of
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.errors import (
    DescriptionError,
    EditError,
    ModelWarning,
    RobotDynError,
    announce,
)
from robot_dyn.foundations.local_ascent import search_box
from robot_dyn.foundations.validate import JointValues, function, instance, is_moderate, is_plain, is_state, numbers
from robot_dyn.foundations.values import Caching, OnFirstUse
from robot_dyn.model.calls import Scratch
from robot_dyn.model.conditioning import MIN_DIGITS
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.evaluation import Evaluation
from robot_dyn.model.findings import findings_of, zero_efforts
from robot_dyn.model.from_pinocchio import described
from robot_dyn.model.info import Info, Joint, couplings_of, narrowed, robot_line
from robot_dyn.model.newton_euler import JointWrenches, NewtonEuler, joint_wrenches
from robot_dyn.model.pinocchio_model import Built, build, joint_ids, link_frames
from robot_dyn.model.reading import read_file
from robot_dyn.model.remarks import no_torque
from robot_dyn.model.to_urdf import write_urdf
from robot_dyn.queries.batch import into
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.quantity import DOUBTFUL

_F8 = np.dtype(float)
_STATES = 3  # N is analytic in q: if zero at random states, it is zero everywhere
# named like an entry point, so that building a model does not import the digit counter
_CHECK_OF_NEARLY_SINGULAR = "robot_dyn.accuracy.correct_digits:DigitCheck"
_ROUNDING = 1e-12  # relative to the weight that a joint carries × length of the robot
AnswerCheck = Callable[["Robot", str, tuple[ArrayLike, ...], ArrayLike], None]


@final
@dataclass(frozen=True)
class Robot(Dynamics[ndarray], Parametrised, Caching):
    """A robot: its description and edits. Immutable; can be shared between threads and pickled.

    Attributes:
        description: Checked file.
        edits: Gravity, locks, payloads, armature, masses.
        answer_check: Function (robot, query, arguments, answer) called after each query, which may warn or raise, or
            None. `rd.accuracy.warn_below` sets it.
    """

    description: Description
    edits: Edits = field(default_factory=Edits)
    answer_check: AnswerCheck | None = None

    def _answer(
        self, name: str, state: tuple[Any, ...], out: Any, frame: tuple[str, ...] = (), *, nan: bool = False
    ) -> Any:
        if out is None and not nan:
            shape, scratch, one_state = self._at_once
            for x in state:
                if not (x.__class__ is ndarray and x.dtype is _F8 and x.shape == shape and hypot(*x.tolist()) < 1e50):
                    break
            else:
                try:
                    call = one_state[(name, *frame) if frame else name]
                except TypeError:  # an unhashable frame is refused below
                    pass
                else:
                    return call(scratch.data, *state)
        answer = self._evaluation.answer(name, state, nan, *frame)
        if self.answer_check is not None:
            self.answer_check(self, name, state, answer)
        return into(out, answer)

    # --- queries that take microseconds, with a fast path

    def M(self, q: JointValues, *, out: ndarray | None = None) -> ndarray:
        if out is None and is_plain(q, self._uncoupled_shape):
            return pin.crba(self.model, self._scratch.data, q)
        return self._answer("M", (q,), out)

    def N(self, q: JointValues, *, out: ndarray | None = None) -> ndarray:
        if out is None and is_plain(q, self._uncoupled_shape):
            return pin.computeGeneralizedGravity(self.model, self._scratch.data, q)
        return self._answer("N", (q,), out)

    def inverse_dynamics(
        self, q: JointValues, v: JointValues, a: JointValues, *, out: ndarray | None = None
    ) -> ndarray:
        shape = self._uncoupled_shape
        if out is None and is_state(q, shape) and is_state(v, shape) and is_state(a, shape):
            tau = pin.rnea(self.model, self._scratch.data, q, v, a)
            if is_moderate(tau):  # NaN and inf in any argument propagate to tau
                return tau
        return self._answer("inverse_dynamics", (q, v, a), out)

    def forward_dynamics(
        self, q: JointValues, v: JointValues, tau: JointValues, *, out: ndarray | None = None
    ) -> ndarray:
        shape = self._regular_shape
        if out is None and is_state(q, shape) and is_state(v, shape) and is_state(tau, shape):
            a = pin.aba(self.model, self._scratch.data, q, v, tau)
            if is_moderate(a, DOUBTFUL):
                return a
        return self._answer("forward_dynamics", (q, v, tau), out)

    def joint_wrenches(
        self, q: JointValues, v: JointValues, a: JointValues, *, external: Mapping[str, ArrayLike] | None = None,
        frame: str | None = None, at: str | None = None,
    ) -> JointWrenches:  # fmt: skip
        """Return the force and torque through every joint, moving or fixed, and of the ground on the root link.

            F_j = Σ_l (𝓜_l V̇_l − ad_{V_l}ᵀ 𝓜_l V_l − F_gravity,l − F_external,l),   links l that joint j carries

        F = (f, τ) is exerted by the parent link on the child link, at the joint's origin and in the axes of the child
        link. Its component on the axis of a joint is the torque on the load side of the drive: inverse dynamics without
        friction and without armature, whose rotors do not count. An impact is an impulse in N s, and is not included.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].
            a: Accelerations, shape (..., n), in [rad/s²] or [m/s²].
            external: Wrenches on links, (..., 6) in [N] and [N m] by link, in base axes at the link's frame; those of
                effects are not included automatically.
            frame: Link whose axes are used for all wrenches; None for those of each child link.
            at: Link at whose origin all torques are taken; None for the origin of each joint.

        Raises:
            QueryError: If an argument has the wrong shape or is not finite, or a link is unknown.
            OverflowedError: If the result would not be finite.
            DescriptionError: If the file has 250 joints or more.

        Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 5.
        """
        state = {"q": q, "v": v, "a": a}
        return joint_wrenches(self._recursion, self, self.description.joint_frames, state, external, frame, at)

    # --- properties

    @cached_property
    def name(self) -> str:
        """Name of the robot in its file."""
        return self.description.name

    @cached_property
    def n(self) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Number of degrees of freedom."""
        return len(self.joint_names)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        return self._built.joint_names

    @cached_property
    def joint_types(self) -> tuple[str, ...]:
        """Types of the n joints: "revolute", "continuous" (revolute without limits) or "prismatic"."""
        return tuple(self.description.joint_kinds[name] for name in self.joint_names)

    @cached_property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the links; each has a placement and a Jacobian."""
        return tuple(link_frames(self.model))

    @cached_property
    def lower(self) -> ndarray:
        """Lower position limits, (n,) in [rad] or [m]; −inf if unstated; followers may narrow them, see `info`."""
        return self._limits(position_limits, "lower")

    @cached_property
    def upper(self) -> ndarray:
        """Upper position limits, (n,) in [rad] or [m]; inf if unstated; followers may narrow them, see `info`."""
        return self._limits(position_limits, "upper")

    @cached_property
    def effort_limit(self) -> ndarray:
        """Effort limits, (n,) in [N m] or [N]; inf if unstated."""
        return self._per_joint(self.model.effortLimit)

    @cached_property
    def velocity_limit(self) -> ndarray:
        """Velocity limits, (n,) in [rad/s] or [m/s]; inf if unstated; followers may narrow them, see `info`."""
        return self._limits(speed_limits, "upper")

    @cached_property
    def gravity(self) -> ndarray:
        """Acceleration of free fall, (3,) in base axes, in [m/s²]; `with_(gravity=…)` changes it."""
        return _frozen(np.array(self.edits.gravity))

    @cached_property
    def armature(self) -> ndarray:
        """Inertia of the drives reflected to the joints, (n,) in [kg m²] or [kg]; part of M."""
        return self._per_joint(self.model.armature)

    @cached_property
    def statements(self) -> tuple[Statement, ...]:
        """Rotors, springs and soft limits that the file states for other programs; they have no effect by default."""
        return statements(parse(self.description.text, self.description.source)[0])

    @cached_property
    def stated_armature(self) -> ndarray:
        """Reflected rotor inertia n² J that the file states for other programs, (n,) in [kg m²] or [kg]; 0 if none.

        `with_(armature="urdf")` adds it to M.
        """
        return self._stated(ARMATURE, 0.0)

    @cached_property
    def stated_stiffness(self) -> ndarray:
        """Stiffness of joint springs that the file states for other programs, (n,) in [N m/rad] or [N/m]; 0 if none."""
        return self._stated(STIFFNESS, 0.0)

    @cached_property
    def stated_rest(self) -> ndarray:
        """Rest positions of these springs, (n,) in [rad] or [m]."""
        return self._stated(REST, 0.0)

    @cached_property
    def soft_lower(self) -> ndarray:
        """Lower soft limits of <safety_controller>, (n,) in [rad] or [m]; −inf if unstated; see `with_soft_limits`."""
        return self._stated(LOWER, -np.inf)

    @cached_property
    def soft_upper(self) -> ndarray:
        """Upper soft limits of <safety_controller>, (n,) in [rad] or [m]; inf if unstated; see `with_soft_limits`."""
        return self._stated(UPPER, np.inf)

    @cached_property
    def damping(self) -> ndarray:
        """Viscous friction stated by the file, Σ s² b for coupled joints, (n,) in [N m s/rad] or [N s/m]."""
        return _frozen(self.model.damping @ self.couplings.S**2)

    @cached_property
    def friction(self) -> ndarray:
        """Dry friction stated by the file, Σ |s| f for coupled joints, (n,) in [N m] or [N]; see `Plant`."""
        return _frozen(self.model.friction @ np.abs(self.couplings.S))

    @cached_property
    def total_mass(self) -> float:
        """Mass of all links, including the base, in [kg]."""
        return sum(body.mass for body in self.model.inertias)

    @cached_property
    def estimated(self) -> Mapping[str, str]:
        """Basis of each inertia estimated from shapes, by link; see `load`."""
        return MappingProxyType(self.description.estimated)

    @cached_property
    def model(self) -> pin.Model:
        """The `pinocchio.Model` of all moving joints, including coupled ones. Do not modify it."""
        return self._built.model

    @cached_property
    def couplings(self) -> Couplings:
        """Map from q to the positions of the joints of `model`."""
        return self._built.couplings

    @cached_property
    def coriolis(self) -> Coriolis:
        """Coriolis matrix of `model`, with the bound on its rounding error."""
        return self._built.coriolis

    @property
    def sizes(self) -> Mapping[str, int]:
        """Numbers for the letters in the shapes of quantities."""
        return self._built.sizes

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._built.body_names

    @property
    def inertial_parameters(self) -> ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._inertial_parameters

    @property
    def joint_without_inertia(self) -> str | None:
        """Joint at which M is singular at every configuration, so that forward dynamics fails, or None."""
        return self._evaluation.regularity.joint

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """Doubtful values of the description and its edits, each with its remedy; see docs/reference/findings.md."""
        return findings_of(self.description, self.edits, self._evaluation.regularity)

    @cached_property
    def announced_findings(self) -> tuple[str, ...]:
        """Findings that `load` warns of: all except effort limits of 0, which only comparisons of torques need."""
        unannounced = {*zero_efforts(structure_of(self.description, self.edits))}
        return tuple(finding for finding in self.findings if finding not in unannounced)

    @property
    def gravity_acts(self) -> bool:
        """True if gravity exerts a torque or force on a joint at some position."""
        return len(self.gravity_free) < self.n

    @cached_property
    def gravity_free(self) -> tuple[str, ...]:
        """Joints on which gravity exerts no torque or force at any position, for example about a vertical axis."""
        g = float(np.linalg.norm(self.edits.gravity))
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (_STATES, self.n))
        length = 1.0 + sum(float(np.linalg.norm(place.translation)) for place in self.model.jointPlacements)
        length += max(float(np.linalg.norm(body.lever)) for body in self.model.inertias)
        carried = np.array([body.mass for body in self.model.inertias])
        for i in range(self.model.njoints - 1, 0, -1):
            carried[self.model.parents[i]] += carried[i]
        weight = g * (np.abs(self.couplings.S).T @ carried[1:])
        try:
            largest = np.abs(self._evaluation.answer("N", (q,), nan=False)).max(axis=0)
        except RobotDynError:  # overflows: far from zero
            return ()
        free = largest <= _ROUNDING * weight * length
        return tuple(name for name, is_free in zip(self.joint_names, free, strict=True) if is_free)

    @cached_property
    def balanced(self) -> tuple[str, ...]:
        """Joints of `gravity_free` that are free in any mounting, because their load is balanced about the axis."""
        free = set(self.gravity_free)
        for axis in np.eye(3) if free else ():
            mounted = replace(self, edits=replace(self.edits, gravity=tuple(axis.tolist())), answer_check=None)
            free &= set(mounted.gravity_free)
        return tuple(name for name in self.joint_names if name in free)

    @cached_property
    def file_order(self) -> tuple[str, ...]:
        """Names of the n joints in the order of the file; `joint_names` has the order of q, from base to tips."""
        return structure_of(self.description, self.edits).free

    def random_configuration(self, rng: np.random.Generator) -> ndarray:
        """Return a position within the joint limits, uniformly distributed.

        A revolute joint without limits, or with over a turn between them, gets one turn around 0; a prismatic one ±1 m.

        Args:
            rng: Source of random numbers, such as numpy.random.default_rng(0).

        Returns:
            Positions, shape (n,), in [rad] or [m] by joint.

        Raises:
            QueryError: If rng is not a numpy.random.Generator.
        """
        instance("rng", rng, np.random.Generator, "give a generator, for example numpy.random.default_rng(0)")
        return rng.uniform(*search_box(self.lower, self.upper, self.joint_types))

    @staticmethod
    def from_text(urdf: str | bytes, *, source: str = "the text of the URDF") -> Robot:
        """Return a robot in standard gravity from the text of a URDF; warns like `load`.

        Args:
            urdf: Text, or bytes of a file.
            source: Name used in messages. If it is a path, meshes with relative paths are searched in its folder.

        Raises:
            DescriptionError: If the text is refused.
        """
        return Robot(check(urdf, source)).announced()

    @staticmethod
    def from_pinocchio(model: pin.Model) -> Robot:
        """Return a robot from a `pinocchio.Model`, with its gravity and armature; warns like `load`.

        The model is written as a URDF and read like any other. An unbounded joint becomes one angle. A warning reports
        a changed order of joints.

        Raises:
            DescriptionError: If it is not a `pinocchio.Model`, or has joints that are not revolute or prismatic.
        """
        return Robot(*described(model)).announced()

    def announced(self, *, known: tuple[str, ...] = ()) -> Robot:
        """Warn of `announced_findings`; if M is nearly singular, return a robot whose queries warn of lost digits.

        Args:
            known: Findings that were announced before.
        """
        new = [finding for finding in self.announced_findings if finding not in known]
        announce(self.name, new, len({*self.findings} - {*known}))
        regularity = self._evaluation.regularity
        if regularity.singular or not regularity.near:
            return self
        return replace(self, answer_check=resolve_name(_CHECK_OF_NEARLY_SINGULAR)(MIN_DIGITS))

    @takes_changes
    def with_(self, **changes: Unpack[Changes]) -> Robot:
        """Return a robot with more edits. Locks and payloads accumulate; others replace earlier values.

        Args:
            **changes: gravity (3,) in base axes, in [m/s²]; lock: values by joint, in [rad] or [m]; payload: one or
                several; armature: inertia of the drives, a scalar, (n,) or by joint, in [kg m²] or [kg], or
                "urdf" for `stated_armature`; mass_scale: factor on mass and inertia of all links; mass_scales: the
                same factor by link, for another density; masses and inertias: values by link that replace the file's,
                in [kg] and (3, 3) in [kg m²]; masses alone do not change the inertia.

        Raises:
            EditError: If a name is unknown or a value is not allowed, or "urdf" is given and the file states none.

        Warns:
            ModelWarning: If the new gravity is not zero and exerts no torque on any joint.
        """
        if isinstance(armature := changes.get("armature"), str) and armature == "urdf":
            changes["armature"] = self._armature_of_file()
        robot = Robot(self.description, self.edits.with_(self.joint_names, **changes))
        gravity = robot.edits.gravity
        if gravity != self.edits.gravity and any(gravity) and not robot.gravity_acts:
            remedy = "give its direction in base axes, or (0, 0, 0)"
            warnings.warn(f"{robot.name}: {no_torque(gravity)}; {remedy}", ModelWarning, stacklevel=2)
        return robot if self.answer_check is None else replace(robot, answer_check=self.answer_check)

    def attach(
        self, gripper: Robot | str | Path, *, frame: str, prefix: str = "", xyz: ArrayLike = (0.0, 0.0, 0.0),
        rpy: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Robot:  # fmt: skip
        """Return this arm with a gripper whose root is fixed to a link of the arm.

        Edits of both are kept. Joints of the gripper keep their names, with the prefix; `joint_names` is their order.

        Args:
            gripper: A robot with a fixed base, for example from `rd.load("gripper.urdf", xacro={})`; or a name or path
                as in `load`, where a tool without moving joints is allowed.
            frame: Link of the arm that carries it, for example "tool0".
            prefix: Text before the names of links and joints of the gripper, for example "g_".
            xyz: Position of the gripper's root in the frame, (3,) in [m].
            rpy: Its orientation there as roll, pitch and yaw, as in a URDF, (3,) in [rad].

        Raises:
            EditError: If there is no such link, a name occurs in both robots, the base of the gripper moves, or the
                gripper's gravity was changed.
            CatalogError: If there is no such file.
            DescriptionError: If the file is refused.

        Warns:
            ModelWarning: Once, if the file of the gripper adds findings.
        """
        from_file = not isinstance(gripper, Robot)
        instance("gripper", gripper, Robot | str | Path, "give a robot, or the path of its file", error=EditError)
        tool, of_tool = read_file(gripper) if from_file else (gripper.description, gripper.edits)
        place = (numbers(name, value, (3,), error=EditError) for name, value in (("xyz", xyz), ("rpy", rpy)))
        description = attached(self.description, tool, frame, prefix, *place)
        edits = attached_edits(self.edits, of_tool, tool, prefix)
        robot = Robot(description, edits, self.answer_check or (None if from_file else gripper.answer_check))
        return robot.announced(known=self.findings) if from_file else robot

    def with_soft_limits(self) -> Robot:
        """Return a robot whose position limits are narrowed to the soft limits of its file, for example for a planner.

        Continuous joints, which have no position limits, do not change. Effects that stop at `soft_lower` and
        `soft_upper` do not need it.

        Raises:
            EditError: If the file states no soft limits, or those of a joint are not numbers or leave no position.
        """
        return Robot(within_soft_limits(self.description), self.edits, self.answer_check)

    def to_urdf(self, path: str | Path) -> Path:
        """Write the robot with its edits as a URDF; an existing file is replaced.

        Locked joints become fixed joints, payloads become links. Soft limits and mesh addresses are kept; relative
        addresses are adapted to the new folder.

        Args:
            path: Path with suffix .urdf, which is added if missing; not the file that the robot was read from.

        Returns:
            The path.

        Raises:
            DescriptionError: If the file cannot be written there.

        Warns:
            ModelWarning: If there is armature or nonstandard gravity, which URDF cannot express.
        """
        return write_urdf(self.description, self.edits, path)

    def __repr__(self) -> str:
        return robot_line(self.name, self.joint_names, self.file_order, self.total_mass, self.edits)

    def _repr_html_(self) -> str:
        return info(self)._repr_html_()

    def __post_init__(self) -> None:
        function("answer_check", self.answer_check, "(robot, query, arguments, answer)")
        instance("edits", self.edits, Edits, "use the edits of another robot, or with_", error=EditError)
        if not isinstance(self.description, Description):
            kind = type(self.description).__name__
            raise DescriptionError(
                f"description must be a Description, got {kind}; use rd.load, Robot.from_text or Robot.from_pinocchio"
            )
        _ = self._built  # raises errors now, not at the first query

    def __reduce__(self) -> tuple[object, ...]:
        return Robot, (self.description, self.edits, self.answer_check)

    @cached_property
    def _built(self) -> Built:
        return build(self.description, self.edits)

    @cached_property
    def _evaluation(self) -> Evaluation:
        return Evaluation(self._built, self._scratch)

    @cached_property
    def _recursion(self) -> NewtonEuler:
        return NewtonEuler.from_edits(self.description, self.edits, self.joint_names)

    @cached_property
    def _shape(self) -> tuple[int] | None:
        """Input shape of the fast path for one state; None if an `answer_check` is set."""
        return (self.n,) if self.answer_check is None else None

    @cached_property
    def _at_once(self) -> tuple[tuple[int] | None, Scratch, OnFirstUse]:
        """Input shape of the fast path, working memory, and the functions by query."""
        return self._shape, self._scratch, self._evaluation.one_state

    @cached_property
    def _uncoupled_shape(self) -> tuple[int] | None:
        """Input shape passed straight to Pinocchio; None if joints are coupled or an `answer_check` is set."""
        return self._shape if self.couplings.trivial else None

    @cached_property
    def _regular_shape(self) -> tuple[int] | None:
        """Input shape of forward dynamics passed straight to Pinocchio; None also if M is singular."""
        return None if self._evaluation.regularity.singular else self._uncoupled_shape

    @cached_property
    def _scratch(self) -> Scratch:
        """Working memory of Pinocchio's algorithms."""
        return Scratch(self.model)

    @cached_property
    def _inertial_parameters(self) -> ndarray:
        ids = joint_ids(self.model)
        return _frozen(np.concatenate([self.model.inertias[ids[x]].toDynamicParameters() for x in self.body_names]))

    def _limits(self, limits: Callable[[Structure], dict[str, CoordinateLimit]], side: str) -> ndarray:
        """Return one side of the limits of the coordinates, in the order of q."""
        of_joints = limits(structure_of(self.description, self.edits))
        return _frozen(np.array([getattr(of_joints[name], side) for name in self.joint_names]))

    def _stated(self, quantity: str, unstated: float) -> ndarray:
        """Return a quantity that the file states for other programs, in the order of q."""
        numbers = of_coordinates(structure_of(self.description, self.edits), self.statements)
        return _frozen(np.array([numbers[name].get(quantity, unstated) for name in self.joint_names]))

    def _armature_of_file(self) -> ndarray:
        if not self.stated_armature.any():
            raise EditError(f"armature='urdf': the file of {self.name} states no rotor inertia; give it by joint")
        return self.stated_armature

    def _per_joint(self, full: ndarray) -> ndarray:
        """Return values of the joints of `model` in the order of q; infinite where the file states no limit."""
        ids = joint_ids(self.model)
        values = full[[self.model.idx_vs[ids[name]] for name in self.joint_names]]
        values[np.abs(values) >= float(UNBOUNDED)] *= np.inf
        return _frozen(values)


def info(robot: Robot) -> Info:
    """Return a summary of a robot: joints with limits and stated friction, couplings, mass, edits and findings.

    Its `repr` is the table that `robot-dyn info` prints, `to_json()` the document of `robot-dyn info --json`.

    Args:
        robot: A robot with its edits, for example from `rd.load`.

    Raises:
        QueryError: If `robot` is not a Robot.
    """
    instance("robot", robot, Robot, "give a robot, for example rd.load('ur5')")
    columns = [getattr(robot, name) for name in list(Joint.__dataclass_fields__)[2:]]
    rows = zip(robot.joint_names, robot.joint_types, *(np.asarray(x).tolist() for x in columns), strict=True)
    return Info(
        robot=robot.name,
        source=robot.description.source,
        n=robot.n,
        total_mass=robot.total_mass,
        gravity=robot.edits.gravity,
        gravity_acts=robot.gravity_acts,
        gravity_free=robot.gravity_free,
        balanced=robot.balanced,
        file_order=robot.file_order,
        joints=tuple(Joint(*row) for row in rows),
        couplings=tuple(couplings_of(robot.description, set(robot.model.names[1:]))),
        narrowed=dict(narrowed(structure_of(robot.description, robot.edits))),
        locked=dict(robot.edits.lock),
        payloads=robot.edits.payloads,
        estimated=dict(robot.estimated),
        links=robot.frame_names,
        other_programs=robot.statements,
        findings=robot.findings,
    )


def _frozen(x: ndarray) -> ndarray:
    x.setflags(write=False)
    return x
