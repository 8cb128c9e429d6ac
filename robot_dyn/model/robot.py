"""Robot: the dynamics of a URDF arm, M(q) a + C(q, v) v + N(q) = τ, computed by Pinocchio.

A thin layer over CRBA, RNEA and ABA [Featherstone 2008, ch. 5–7], and C by `coriolis`. One state of float64 goes
straight to Pinocchio, after checks of a fraction of a microsecond; coupled joints, lists and batches to `evaluation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import hypot
from types import MappingProxyType
from typing import Any, Unpack, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray
from numpy.typing import ArrayLike

from robot_dyn.description.couplings import Couplings
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Changes, Edits, takes_changes
from robot_dyn.description.inertial_parameters import NAMES, Parametrised, ordered
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.errors import DescriptionError, EditError, announce
from robot_dyn.foundations.validate import instance, is_moderate, is_plain, is_state
from robot_dyn.foundations.values import OnFirstUse
from robot_dyn.model.calls import Scratch
from robot_dyn.model.conditioning import LEAST_DIGITS, checked_digits
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.evaluation import Evaluation, warn_of_digits
from robot_dyn.model.findings import findings_of
from robot_dyn.model.gravity import warn_without_torque
from robot_dyn.model.info import info_html, robot_line
from robot_dyn.model.pinocchio_model import build, joint_ids, link_frames
from robot_dyn.model.to_urdf import to_urdf
from robot_dyn.queries.batch import into
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.quantity import DOUBTFUL

_F8 = np.dtype(float)
_RAISE = "raise"


@final
@dataclass(frozen=True)
class Robot(Dynamics[ndarray], Parametrised):
    """A robot: its description and its edits. Immutable; may be shared between threads and pickled.

    Attributes:
        description: The checked file.
        edits: Gravity, locks, payloads, armature.
        least_digits: Number of correct digits below which queries warn; None for no warnings. See `warn_below`.
    """

    description: Description
    edits: Edits = field(default_factory=Edits)
    least_digits: float | None = None
    __repr__, _repr_html_ = robot_line, info_html
    to_urdf = to_urdf

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
        answer = into(out, self._evaluation.answer(name, state, errors, *frame))
        return answer if self.least_digits is None else warn_of_digits(self, name, answer, *state)

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
        return self._built[2]

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
        return self._built[0]

    @cached_property
    def couplings(self) -> Couplings:
        """How the joints of `model` follow q."""
        return self._built[1]

    @cached_property
    def coriolis(self) -> Coriolis:
        """How C of `model` is computed, and the bound of its rounding."""
        return Coriolis.of(self.model, self.couplings)

    @cached_property
    def sizes(self) -> Mapping[str, int]:
        """The numbers that letters in the shapes of quantities stand for."""
        return MappingProxyType({"n": self.n, "p": len(NAMES) * self.model.nv})

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return ordered(self.joint_names, self.model.names[1:])

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
        from robot_dyn.model.from_pinocchio import robot_of

        return robot_of(model).announced()

    def announced(self) -> Robot:
        """The robot as it is loaded: warns of its findings; its queries warn below 8 digits if M is nearly singular."""
        announce(self.name, self.findings)
        regularity = self._evaluation.regularity
        return self.warn_below(LEAST_DIGITS) if regularity.near and not regularity.singular else self

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
        if robot.edits.gravity != self.edits.gravity:
            warn_without_torque(robot)
        return robot if self.least_digits is None else robot.warn_below(self.least_digits)

    def digits(self, quantity: str, *state: ArrayLike) -> float:
        """Number of correct decimal digits of the answer to a query, counted against true values in balls.

            −log10(error),  from 0 to 20

        Errors are relative to √(M_ii M_jj) for M; for C, N and inverse dynamics to the largest entry in the units
        √M_ii of the joints; for forward dynamics to Σ ‖M⁻¹ τ_k‖ of τ, C v and N, in the norm of M. An answer that
        cancels to nearly nothing has few digits. Numbers of the file count as the decimals written. Takes milliseconds.

        Args:
            quantity: "M", "C", "N", "inverse_dynamics" or "forward_dynamics".
            *state: Its arguments at one state, shape (n,) each, as of the method of that name.

        Raises:
            QueryError: If there is no such quantity, or an argument is wrong.
            SingularError: Of forward dynamics where M is singular; names the joint.
        """
        from robot_dyn.lagrange.digits import digits

        return digits(self, quantity, state)

    def warn_below(self, digits: float | None) -> Robot:
        """A robot whose queries warn where their answers have fewer digits, as `digits` counts them.

        Of M, C, N, inverse and forward dynamics. Digits are counted only where an estimate, 8 n u κ of the terms, is
        below, for up to 64 joints, in milliseconds a state; machine code of the robot does not warn. A robot is loaded
        with 8 digits if M is nearly singular at a configuration without symmetries.

        Args:
            digits: From above 0 to 20; None for no warnings, and no cost.

        Raises:
            QueryError: If it is not such a number.
        """
        return Robot(self.description, self.edits, digits)

    def __post_init__(self) -> None:
        object.__setattr__(self, "least_digits", checked_digits(self.least_digits))
        instance("edits", self.edits, Edits, "give those of another robot, or use with_", error=EditError)
        if not isinstance(self.description, Description):
            given = type(self.description).__name__
            raise DescriptionError(
                f"a Robot is made of a Description, got {given}; use rd.load, Robot.from_text or Robot.from_pinocchio"
            )
        _ = self._built  # so that errors are raised now, not by the first query

    def __reduce__(self) -> tuple[Any, ...]:
        return Robot, (self.description, self.edits, self.least_digits)

    @cached_property
    def _built(self) -> tuple[Any, Couplings, tuple[str, ...]]:
        return build(self.description, self.edits)

    @cached_property
    def _evaluation(self) -> Evaluation:
        return Evaluation(self, self._scratch)

    @cached_property
    def _shape(self) -> tuple[int] | None:
        """Shape of one state that is answered at once; None if queries may warn."""
        return (self.n,) if self.least_digits is None else None

    @cached_property
    def _at_once(self) -> tuple[tuple[int] | None, Scratch, OnFirstUse]:
        """That shape, and the calls that answer it."""
        return self._shape, self._scratch, self._evaluation.one_state

    @cached_property
    def _uncoupled_shape(self) -> tuple[int] | None:
        """Shape of arguments that Pinocchio takes as they are; None if joints are coupled, or queries may warn."""
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


def _frozen(x: ndarray) -> ndarray:
    x.setflags(write=False)
    return x
