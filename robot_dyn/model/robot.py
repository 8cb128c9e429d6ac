"""Robot: the dynamics of a URDF arm, M(q) a + C(q, v) v + N(q) = τ, computed by Pinocchio.

A thin layer over CRBA, RNEA and ABA [Featherstone 2008, ch. 5–7], and C by `coriolis`. One state of float64 goes
straight to Pinocchio, after checks of a fraction of a microsecond; coupled joints, lists and batches to `evaluation`.
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

from robot_dyn.description.couplings import Couplings
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Changes, Edits, takes_changes
from robot_dyn.description.inertial_parameters import Parametrised
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.errors import (
    DescriptionError,
    EditError,
    ModelWarning,
    RobotDynError,
    announce,
)
from robot_dyn.foundations.validate import function, instance, is_moderate, is_plain, is_state
from robot_dyn.foundations.values import Caching, OnFirstUse
from robot_dyn.model.calls import Scratch
from robot_dyn.model.conditioning import LEAST_DIGITS
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.evaluation import Evaluation
from robot_dyn.model.findings import findings_of
from robot_dyn.model.from_pinocchio import described
from robot_dyn.model.info import Info, Joint, couplings_of, no_torque, robot_line
from robot_dyn.model.pinocchio_model import Built, build, joint_ids, link_frames
from robot_dyn.model.to_urdf import write_urdf
from robot_dyn.queries.batch import into
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.quantity import DOUBTFUL

_F8 = np.dtype(float)
_RAISE = "raise"
_STATES = 3  # N is analytic in q: zero at random states, it is zero at all
# named as an entry point is: a model needs no balls, and does not import what counts digits
_CHECK_OF_NEARLY_SINGULAR = "robot_dyn.accuracy.correct_digits:DigitCheck"
_ROUNDING = 1e-12  # of the weight times the length of the robot
AnswerCheck = Callable[["Robot", str, tuple[ArrayLike, ...], ArrayLike], None]


@final
@dataclass(frozen=True)
class Robot(Dynamics[ndarray], Parametrised, Caching):
    """A robot: its description and its edits. Immutable; may be shared between threads and pickled.

    Attributes:
        description: The checked file.
        edits: Gravity, locks, payloads, armature.
        answer_check: A function (robot, query, arguments, answer) called after each query, which may warn or raise;
            None for none. `rd.accuracy.warn_below` sets it.
    """

    description: Description
    edits: Edits = field(default_factory=Edits)
    answer_check: AnswerCheck | None = None

    def _answer(self, name: str, state: tuple[Any, ...], out: Any, errors: str, frame: tuple[str, ...] = ()) -> Any:
        if out is None and errors is _RAISE:
            shape, scratch, one_state = self._at_once
            for x in state:
                if not (x.__class__ is ndarray and x.dtype is _F8 and x.shape == shape and hypot(*x.tolist()) < 1e50):
                    break
            else:
                try:
                    call = one_state[(name, *frame) if frame else name]
                except TypeError:  # a frame that is not hashable is refused below
                    pass
                else:
                    return call(scratch.data, *state)
        answer = self._evaluation.answer(name, state, errors, *frame)
        if self.answer_check is not None:
            self.answer_check(self, name, state, answer)
        return into(out, answer)

    # --- queries of microseconds, answered at once

    def M(self, q: ArrayLike, *, out: ndarray | None = None, errors: str = "raise") -> ndarray:
        if out is None and is_plain(q, self._uncoupled_shape):
            return pin.crba(self.model, self._scratch.data, q)
        return self._answer("M", (q,), out, errors)

    def N(self, q: ArrayLike, *, out: ndarray | None = None, errors: str = "raise") -> ndarray:
        if out is None and is_plain(q, self._uncoupled_shape):
            return pin.computeGeneralizedGravity(self.model, self._scratch.data, q)
        return self._answer("N", (q,), out, errors)

    def inverse_dynamics(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, out: ndarray | None = None, errors: str = "raise"
    ) -> ndarray:
        shape = self._uncoupled_shape
        if out is None and is_state(q, shape) and is_state(v, shape) and is_state(a, shape):
            tau = pin.rnea(self.model, self._scratch.data, q, v, a)
            if is_moderate(tau):  # NaN and inf, in any argument, show in tau
                return tau
        return self._answer("inverse_dynamics", (q, v, a), out, errors)

    def forward_dynamics(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, out: ndarray | None = None, errors: str = "raise"
    ) -> ndarray:
        shape = self._regular_shape
        if out is None and is_state(q, shape) and is_state(v, shape) and is_state(tau, shape):
            a = pin.aba(self.model, self._scratch.data, q, v, tau)
            if is_moderate(a, DOUBTFUL):
                return a
        return self._answer("forward_dynamics", (q, v, tau), out, errors)

    # --- properties

    @cached_property
    def name(self) -> str:
        """The robot's name in its file."""
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
        """Lower position limits, −inf where none is stated, (n,) in [rad] or [m]."""
        return self._per_joint(self.model.lowerPositionLimit)

    @cached_property
    def upper(self) -> ndarray:
        """Upper position limits, inf where none is stated, (n,) in [rad] or [m]."""
        return self._per_joint(self.model.upperPositionLimit)

    @cached_property
    def effort_limit(self) -> ndarray:
        """Effort limits, inf where none is stated, (n,) in [N m] or [N]."""
        return self._per_joint(self.model.effortLimit)

    @cached_property
    def velocity_limit(self) -> ndarray:
        """Velocity limits, inf where none is stated, (n,) in [rad/s] or [m/s]."""
        return self._per_joint(self.model.velocityLimit)

    @cached_property
    def gravity(self) -> ndarray:
        """Acceleration of free fall, (3,) in base axes, in [m/s²]; `with_(gravity=…)` changes it."""
        return _frozen(np.array(self.edits.gravity))

    @cached_property
    def armature(self) -> ndarray:
        """Inertia of the drives felt at the joints, (n,) in [kg m²] or [kg]; part of M."""
        return self._per_joint(self.model.armature)

    @cached_property
    def damping(self) -> ndarray:
        """Viscous friction the file states, with coupled joints Σ s² b, (n,) in [N m s/rad] or [N s/m]; see `Plant`."""
        return _frozen(self.model.damping @ self.couplings.S**2)

    @cached_property
    def friction(self) -> ndarray:
        """Dry friction the file states, with coupled joints Σ |s| f, (n,) in [N m] or [N]; see `Plant`."""
        return _frozen(self.model.friction @ np.abs(self.couplings.S))

    @cached_property
    def total_mass(self) -> float:
        """Mass of all links, those of the base included, in [kg]."""
        return sum(body.mass for body in self.model.inertias)

    @cached_property
    def estimated(self) -> Mapping[str, str]:
        """Links whose inertia was estimated from shapes, not measured, and what from: see `load`."""
        return MappingProxyType(self.description.estimated)

    @cached_property
    def model(self) -> Any:
        """The `pinocchio.Model` of all joints that move, coupled ones included. Read it, do not change it."""
        return self._built.model

    @cached_property
    def couplings(self) -> Couplings:
        """How the joints of `model` follow q."""
        return self._built.couplings

    @cached_property
    def coriolis(self) -> Coriolis:
        """How C of `model` is computed, and the bound of its rounding."""
        return self._built.coriolis

    @property
    def sizes(self) -> Mapping[str, int]:
        """The numbers that letters in the shapes of quantities stand for."""
        return self._built.sizes

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._built.body_names

    @property
    def inertial_parameters(self) -> ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._inertial_parameters

    @property
    def joint_without_inertia(self) -> str | None:
        """The joint at which M is singular at every configuration, or None: then forward dynamics has no answer."""
        return self._evaluation.regularity.joint

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """Doubtful values of the description and its edits, each with its remedy; see docs/reference/findings.md."""
        return findings_of(self.description, self.edits, self._evaluation.regularity)

    @cached_property
    def gravity_acts(self) -> bool:
        """True if gravity has a torque or force on a joint, at some position."""
        g = float(np.linalg.norm(self.edits.gravity))
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (_STATES, self.n))
        length = 1.0 + sum(float(np.linalg.norm(place.translation)) for place in self.model.jointPlacements)
        length += max(float(np.linalg.norm(body.lever)) for body in self.model.inertias)
        try:
            return bool(
                np.abs(self._evaluation.answer("N", (q,), _RAISE)).max() > _ROUNDING * self.total_mass * g * length
            )
        except RobotDynError:  # overflows: far from zero
            return True

    def random_configuration(self, rng: np.random.Generator) -> ndarray:
        """Return a position within the joint limits, uniformly distributed.

        A revolute joint without limits, or with more than a turn between them, has a turn near 0; a prismatic one ±1 m.

        Args:
            rng: Source of random numbers, such as numpy.random.default_rng(0).

        Returns:
            Positions, shape (n,), in [rad] or [m] by joint.

        Raises:
            QueryError: If rng is not a numpy.random.Generator.
        """
        instance("rng", rng, np.random.Generator, "give one, such as numpy.random.default_rng(0)")
        slides = np.array([each == "prismatic" for each in self.joint_types])
        half = (self.upper - self.lower) / 2
        half = np.where(np.isfinite(half) & slides, half, np.minimum(half, np.where(slides, 1.0, np.pi)))
        middle = np.clip(0.0, self.lower + half, self.upper - half)
        return rng.uniform(np.maximum(self.lower, middle - half), np.minimum(self.upper, middle + half))

    @staticmethod
    def from_text(urdf: str | bytes, *, source: str = "the text of the URDF") -> Robot:
        """A robot in standard gravity, from the text of a URDF; warns as `load` does.

        Args:
            urdf: The text, or the bytes of a file.
            source: What messages call it; meshes with relative paths are searched in its folder, if it is a path.

        Raises:
            DescriptionError: If the text is refused.
        """
        return Robot(check(urdf, source)).announced()

    @staticmethod
    def from_pinocchio(model: Any) -> Robot:
        """A robot of a `pinocchio.Model` that was built elsewhere, with its gravity and armature; warns as `load` does.

        It is written as a URDF and read as any other; an unbounded joint is one angle; a warning says if order changes.

        Raises:
            DescriptionError: If it is not a `pinocchio.Model`, or has joints that are not revolute or prismatic.
        """
        return Robot(*described(model)).announced()

    def announced(self) -> Robot:
        """Return the robot as it is loaded: warn of its findings, and let its queries warn if M is nearly singular."""
        announce(self.name, self.findings)
        regularity = self._evaluation.regularity
        if regularity.singular or not regularity.near:
            return self
        return replace(self, answer_check=resolve_name(_CHECK_OF_NEARLY_SINGULAR)(LEAST_DIGITS))

    @takes_changes
    def with_(self, **changes: Unpack[Changes]) -> Robot:
        """A new robot with more edits. Locks and payloads add up; the others replace what was given before.

        Args:
            **changes: gravity (3,) in base axes, in [m/s²]; lock: values by joint, in [rad] or [m]; payload: one or
                several; armature: inertia of the drives, a scalar, (n,) or by joint, in [kg m²] or [kg]; mass_scale;
                masses and inertias: values by link in place of the file's, in [kg], and (3, 3) in [kg m²].

        Raises:
            EditError: If a name is unknown or a value is not allowed.

        Warns:
            ModelWarning: If the new gravity is not zero and has no torque on any joint.
        """
        robot = Robot(self.description, self.edits.with_(self.joint_names, **changes))
        gravity = robot.edits.gravity
        if gravity != self.edits.gravity and any(gravity) and not robot.gravity_acts:
            remedy = "give its direction in base axes, or (0, 0, 0)"
            warnings.warn(f"{robot.name}: {no_torque(gravity)}; {remedy}", ModelWarning, stacklevel=2)
        return robot if self.answer_check is None else replace(robot, answer_check=self.answer_check)

    def to_urdf(self, path: str | Path) -> Path:
        """Write the robot with its edits as a URDF; an older one of that name is replaced.

        Locks become fixed joints and payloads links; meshes keep their addresses, relative ones are those from the new
        place.

        Args:
            path: Ends with .urdf, which is added if it has no suffix; not the file that the robot was read from.

        Returns:
            The path.

        Raises:
            DescriptionError: If the file cannot be written there.

        Warns:
            ModelWarning: If there is armature, or a gravity that is not the standard one: URDF has no place for them.
        """
        return write_urdf(self.description, self.edits, path)

    def __repr__(self) -> str:
        return robot_line(self.name, self.n, self.total_mass, self.edits)

    def _repr_html_(self) -> str:
        return info(self)._repr_html_()

    def __post_init__(self) -> None:
        function("answer_check", self.answer_check, "(robot, query, arguments, answer)")
        instance("edits", self.edits, Edits, "give those of another robot, or use with_", error=EditError)
        if not isinstance(self.description, Description):
            given = type(self.description).__name__
            raise DescriptionError(
                f"a Robot is made of a Description, got {given}; use rd.load, Robot.from_text or Robot.from_pinocchio"
            )
        _ = self._built  # so that errors are raised now, not by the first query

    def __reduce__(self) -> tuple[Any, ...]:
        return Robot, (self.description, self.edits, self.answer_check)

    @cached_property
    def _built(self) -> Built:
        return build(self.description, self.edits)

    @cached_property
    def _evaluation(self) -> Evaluation:
        return Evaluation(self._built, self._scratch)

    @cached_property
    def _shape(self) -> tuple[int] | None:
        """Shape of one state that is answered at once; None if answers are checked."""
        return (self.n,) if self.answer_check is None else None

    @cached_property
    def _at_once(self) -> tuple[tuple[int] | None, Scratch, OnFirstUse]:
        """That shape, and the calls that answer it."""
        return self._shape, self._scratch, self._evaluation.one_state

    @cached_property
    def _uncoupled_shape(self) -> tuple[int] | None:
        """Shape of arguments that Pinocchio takes as they are; None if joints are coupled, or answers are checked."""
        return self._shape if self.couplings.trivial else None

    @cached_property
    def _regular_shape(self) -> tuple[int] | None:
        """The same for forward dynamics; None if M is singular too."""
        return None if self._evaluation.regularity.singular else self._uncoupled_shape

    @cached_property
    def _scratch(self) -> Scratch:
        """Memory that the algorithms of `model` write to."""
        return Scratch(self.model)

    @cached_property
    def _inertial_parameters(self) -> ndarray:
        ids = joint_ids(self.model)
        return _frozen(np.concatenate([self.model.inertias[ids[x]].toDynamicParameters() for x in self.body_names]))

    def _per_joint(self, full: ndarray) -> ndarray:
        """Values of the joints of `model` in the order of q; infinite where the file states no limit."""
        ids = joint_ids(self.model)
        values = full[[self.model.idx_vs[ids[name]] for name in self.joint_names]]
        values[np.abs(values) >= float(UNBOUNDED)] *= np.inf
        return _frozen(values)


def info(robot: Robot) -> Info:
    """What is known of a robot: joints with limits and stated friction, couplings, mass, edits and findings.

    Its `repr` is the table that `robot-dyn info` prints, `to_json()` the document of `robot-dyn info --json`.

    Args:
        robot: Of `rd.load`, with its edits.

    Raises:
        QueryError: If it is no robot.
    """
    instance("robot", robot, Robot, "give one, such as rd.load('ur5')")
    columns = [getattr(robot, name) for name in list(Joint.__dataclass_fields__)[2:]]
    rows = zip(robot.joint_names, robot.joint_types, *(np.asarray(x).tolist() for x in columns), strict=True)
    return Info(
        robot.name, robot.description.source, robot.n, robot.total_mass, robot.edits.gravity, robot.gravity_acts,
        tuple(Joint(*row) for row in rows), tuple(couplings_of(robot.description, set(robot.model.names[1:]))),
        dict(robot.edits.lock), robot.edits.payloads, dict(robot.estimated), robot.frame_names, robot.findings,
    )  # fmt: skip


def _frozen(x: ndarray) -> ndarray:
    x.setflags(write=False)
    return x
