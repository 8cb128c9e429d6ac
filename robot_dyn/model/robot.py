"""Robot: a URDF arm behind the Dynamics protocol, M(q) a + C(q, v) v + N(q) = τ, computed by Pinocchio.

A thin layer over CRBA, RNEA and ABA [Featherstone 2008, ch. 5–7], and C by `coriolis`. One state of float64 goes
straight to Pinocchio, after checks of a fraction of a microsecond; coupled joints, lists and batches to `evaluation`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, Unpack, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.couplings import Couplings
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Changes, Edits, takes_changes
from robot_dyn.description.inertial_parameters import Parametrised, ordered
from robot_dyn.foundations.errors import announce
from robot_dyn.foundations.validate import is_moderate, is_plain, is_state
from robot_dyn.model import kernels
from robot_dyn.model.conditioning import LEAST_DIGITS, checked_digits
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.evaluation import Evaluation, warn_of_digits, warning_answer
from robot_dyn.model.findings import findings_of
from robot_dyn.model.gravity import warn_without_torque
from robot_dyn.model.info import info_html, robot_line
from robot_dyn.model.mechanism import Mechanism, forwarded
from robot_dyn.model.to_urdf import to_urdf
from robot_dyn.queries.dynamics import Array, Axes, Dynamics
from robot_dyn.queries.quantity import DOUBTFUL


@final
@dataclass(frozen=True)
class Robot(Dynamics, Parametrised):
    """A robot: its description and its edits. Immutable; may be shared between threads and pickled.

    Attributes:
        description: The checked file.
        edits: Gravity, locks, payloads, armature.
        least_digits: Of answers, below which queries warn; None if they do not. See `warn_below`.
    """

    description: Description
    edits: Edits = field(default_factory=Edits)
    least_digits: float | None = None
    __repr__, _repr_html_ = robot_line, info_html
    to_urdf = to_urdf

    def M(self, q: Array, *, errors: str = "raise") -> ndarray:
        if is_plain(q, self._shape):
            return pin.crba(self.model, self._scratch.data, q)
        return self._ask("M", errors, pin.crba, Couplings.matrix, self.model, q)

    def C(self, q: Array, v: Array, *, errors: str = "raise") -> ndarray:
        if is_plain(q, self._shape) and is_plain(v, self._shape):
            return self.coriolis.matrix(self._scratch.data, q, v)
        return self._ask("C", errors, Coriolis.matrix, Couplings.matrix, self.coriolis, q, v)

    def N(self, q: Array, *, errors: str = "raise") -> ndarray:
        if is_plain(q, self._shape):
            return pin.computeGeneralizedGravity(self.model, self._scratch.data, q)
        return self._ask("N", errors, pin.computeGeneralizedGravity, Couplings.torque, self.model, q)

    def inverse_dynamics(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> ndarray:
        shape = self._shape
        if is_state(q, shape) and is_state(v, shape) and is_state(a, shape):
            tau = pin.rnea(self.model, self._scratch.data, q, v, a)
            if is_moderate(tau):  # NaN and inf, in any argument, show in tau
                return tau
        return self._ask("inverse_dynamics", errors, pin.rnea, Couplings.torque, self.model, q, v, a)

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *, errors: str = "raise") -> ndarray:
        shape = self._regular_shape
        if is_state(q, shape) and is_state(v, shape) and is_state(tau, shape):
            a = pin.aba(self.model, self._scratch.data, q, v, tau)
            if is_moderate(a, DOUBTFUL):
                return a
        a = self._evaluation.forward_dynamics(errors, q, v, tau)
        return a if self.least_digits is None else warn_of_digits(self, "forward_dynamics", a, q, v, tau)

    def coriolis_torque(self, q: Array, v: Array, *, errors: str = "raise") -> ndarray:
        if is_plain(q, self._shape) and is_plain(v, self._shape):
            return pin.nonLinearEffects(self._weightless, self._scratch.data, q, v)
        kernel, model = pin.nonLinearEffects, self._weightless  # less N, that of `model` would keep the digits of N
        return self._ask("coriolis_torque", errors, kernel, Couplings.torque, model, q, v)

    def coriolis_transpose(self, q: Array, v: Array, *, errors: str = "raise") -> ndarray:
        if is_plain(q, self._shape) and is_plain(v, self._shape):
            return v.dot(self.coriolis.matrix(self._scratch.data, q, v))
        kernel = kernels.coriolis_transpose
        return self._ask("coriolis_transpose", errors, kernel, Couplings.torque, self.coriolis, q, v)

    def kinetic_energy(self, q: Array, v: Array, *, errors: str = "raise") -> Any:
        return self._ask("kinetic_energy", errors, kernels.kinetic_energy, None, self.model, q, v)

    def potential_energy(self, q: Array, *, errors: str = "raise") -> Any:
        return self._ask("potential_energy", errors, pin.computePotentialEnergy, None, self.model, q)

    def momentum(self, q: Array, v: Array, *, errors: str = "raise") -> ndarray:
        return self._ask("momentum", errors, kernels.momentum, Couplings.torque, self.model, q, v)

    def regressor(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> ndarray:
        shape = self._shape
        if is_plain(q, shape) and is_plain(v, shape) and is_plain(a, shape):
            return kernels.regressor(self.model, self._scratch.data, q, v, a)
        reduce = partial(kernels.regressor_of_coordinates, self._mechanism.body_order)
        return self._ask("regressor", errors, kernels.regressor, reduce, self.model, q, v, a)

    def placement(self, q: Array, frame: str, *, errors: str = "raise") -> ndarray:
        kernel = self._mechanism.frame_kernels(kernels.placement, frame)
        return self._ask("placement", errors, kernel, None, self.model, q)

    def jacobian(self, q: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise") -> Array:
        kernel = self._mechanism.frame_kernels(kernels.jacobian, frame, expressed_in)
        return self._ask("jacobian", errors, kernel, Couplings.columns, self.model, q)

    def jacobian_rate(
        self, q: Array, v: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise"
    ) -> ndarray:
        kernel = self._mechanism.frame_kernels(kernels.jacobian_rate, frame, expressed_in)
        return self._ask("jacobian_rate", errors, kernel, Couplings.columns, self.model, q, v)

    name = forwarded(Mechanism.name)
    estimated = forwarded(Mechanism.estimated)
    frame_names = forwarded(Mechanism.frame_names)
    joint_types = forwarded(Mechanism.joint_types)
    gravity = forwarded(Mechanism.gravity)
    lower, upper = forwarded(Mechanism.lower), forwarded(Mechanism.upper)
    effort_limit = forwarded(Mechanism.effort_limit)
    velocity_limit = forwarded(Mechanism.velocity_limit)
    armature = forwarded(Mechanism.armature)
    damping = forwarded(Mechanism.damping)
    friction = forwarded(Mechanism.friction)
    total_mass = forwarded(Mechanism.total_mass)
    couplings = forwarded(Mechanism.couplings)
    coriolis = forwarded(Mechanism.coriolis)
    model = forwarded(Mechanism.model)
    sizes = forwarded(Mechanism.sizes)
    n = forwarded(Mechanism.n)  # pyright: ignore
    joint_names = forwarded(Mechanism.joint_names)  # pyright: ignore
    _scratch = forwarded(Mechanism.scratch)
    _weightless = forwarded(Mechanism.weightless)

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return ordered(self.joint_names, self.model.names[1:])

    @property
    def inertial_parameters(self) -> ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._mechanism.inertial_parameters

    @property
    def joint_without_inertia(self) -> str | None:
        """The joint at which M is singular at every configuration, or None: then forward dynamics has no answer."""
        return self._evaluation.regularity.joint

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """What is doubtful in the description and its edits, each with its remedy; see docs/reference/findings.md."""
        return findings_of(self.description, self.edits, self._evaluation.regularity)

    def random_configuration(self, rng: np.random.Generator) -> ndarray:
        """A position within the joint limits, uniformly distributed.

        Of revolute joints without limits, or more than a turn between them, a turn near 0; of prismatic ones ±1 m.

        Args:
            rng: Source of random numbers, such as numpy.random.default_rng(0).

        Returns:
            Positions, shape (n,), in [rad] or [m] by joint.

        Raises:
            QueryError: If rng is not a numpy.random.Generator.
        """
        return self._mechanism.random_configuration(rng)

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

    def digits(self, quantity: str, *state: Array) -> float:
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
        _ = self._mechanism  # so that errors are raised now, not by the first query

    def __reduce__(self) -> tuple[Any, ...]:
        return Robot, (self.description, self.edits, self.least_digits)

    @cached_property
    def _mechanism(self) -> Mechanism:
        return Mechanism(self.description, self.edits)

    @cached_property
    def _evaluation(self) -> Evaluation:
        return Evaluation(self._mechanism)

    @cached_property
    def _shape(self) -> tuple[int] | None:
        """Shape of a state that goes straight to Pinocchio; None if joints are coupled, or queries may warn."""
        return (self.n,) if self.couplings.trivial and self.least_digits is None else None

    @cached_property
    def _regular_shape(self) -> tuple[int] | None:
        """The same for forward dynamics; None if M is singular."""
        return None if self._evaluation.regularity.singular else self._shape

    @cached_property
    def _ask(self) -> Callable[..., Any]:
        """`Evaluation.answer`, with a warning where the answer has few digits."""
        answer = self._evaluation.answer
        return answer if self.least_digits is None else warning_answer(self, answer)
