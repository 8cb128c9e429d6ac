"""Robot: a URDF arm behind the Dynamics protocol, M(q) a + C(q, v) v + N(q) = τ, computed by Pinocchio.

A thin layer over CRBA, RNEA and ABA [Featherstone 2008, ch. 5–7], and C by `coriolis`. One state of float64 goes
straight to Pinocchio, after checks that cost a fraction of a microsecond, with coupled joints by `_coupled`; lists and
batches take the general way, `answered`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, Unpack, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.couplings import Couplings
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Changes, Edits
from robot_dyn.description.inertial_parameters import NAMES as PARAMETERS
from robot_dyn.description.inertial_parameters import Parametrised, ordered
from robot_dyn.description.structure import structure
from robot_dyn.errors import (
    DescriptionError,
    EditError,
    ModelWarning,
    PrecisionWarning,
    QueryError,
    SingularError,
    UndecidedError,
    announce,
)
from robot_dyn.model import findings as doctor
from robot_dyn.model import kernels, pinocchio_model
from robot_dyn.model.conditioning import LEAST_DIGITS, NearlySingular, nearly_singular
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.gravity import gravity_acts, no_torque
from robot_dyn.model.kernels import Kernel, Reduction, Scratch, frozen
from robot_dyn.queries.batch import answered
from robot_dyn.queries.dynamics import Array, Axes, Dynamics, acceleration, entry
from robot_dyn.queries.quantity import ALL, DOUBTFUL, MOST_DIGITS
from robot_dyn.validate import instance, is_moderate, is_plain, is_state, number, shaped


@final
@dataclass(frozen=True)
class Robot(Dynamics, Parametrised):
    """A robot: its description and what was changed of it. Immutable; may be shared between threads and pickled.

    Attributes:
        description: The checked file.
        edits: Gravity, locks, payloads, armature.
        least_digits: Of answers, below which queries warn; None if they do not. See `warn_below`.
    """

    description: Description
    edits: Edits = field(default_factory=Edits)
    least_digits: float | None = None

    def __post_init__(self) -> None:
        if self.least_digits is not None:
            object.__setattr__(self, "least_digits", number("digits", self.least_digits, above=0))
            if self.least_digits > MOST_DIGITS:
                raise QueryError(
                    f"digits must be at most {MOST_DIGITS}, got {self.least_digits:g}: no more are counted"
                )
        instance("edits", self.edits, Edits, "give those of another robot, or use with_", error=EditError)
        if not isinstance(self.description, Description):
            given = type(self.description).__name__
            raise DescriptionError(
                f"a Robot is made of a Description, got {given}; use rd.load, Robot.from_text or Robot.from_pinocchio"
            )
        _ = self._built  # so that what is wrong is said now, not at the first query

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

        A URDF is written of it and read as any other (`model/from_pinocchio.py`), so that `Lagrangian` and `Compiled`
        take it too; the model itself is neither kept nor changed. An unbounded joint becomes one angle. Where branches
        come in another order than in the model, a warning says so.

        Raises:
            DescriptionError: If it is not a `pinocchio.Model`, or has joints that are not revolute or prismatic.
        """
        from robot_dyn.model.from_pinocchio import robot_of

        return robot_of(model).announced()

    def announced(self) -> Robot:
        """The robot as it is loaded: warns of its findings; its queries warn below 8 digits if M is nearly singular."""
        announce(self.name, self.findings)
        answers = self._nearly_singular is not None and self._singular is None
        return self.warn_below(LEAST_DIGITS) if answers else self

    def __reduce__(self) -> tuple[Any, ...]:
        return Robot, (self.description, self.edits, self.least_digits)

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
        if gravity != self.edits.gravity and any(gravity) and not gravity_acts(robot):
            remedy = "give its direction in base axes, or (0, 0, 0)"
            warnings.warn(f"{robot.name}: {no_torque(gravity)}; {remedy}", ModelWarning, stacklevel=2)
        return robot if self.least_digits is None else robot.warn_below(self.least_digits)

    def digits(self, quantity: str, *state: Array) -> float:
        """Number of decimal digits that hold of the answer to a query, counted against true values in balls.

            −log10(error),  from 0 to 20

        Errors are relative to √(M_ii M_jj) for M; for C, N and inverse dynamics to the largest entry in the units
        √M_ii of the joints; for forward dynamics to Σ ‖M⁻¹ τ_k‖ of τ, C v and N, in the norm of M. An answer that
        cancels to nearly nothing has few digits. Numbers of the file count as the decimals that are written there.
        Takes milliseconds.

        Args:
            quantity: "M", "C", "N", "inverse_dynamics" or "forward_dynamics".
            *state: Its arguments at one state, shape (n,) each, as of the method of that name.

        Raises:
            QueryError: If there is no such quantity, or an argument is wrong.
            SingularError: Of forward dynamics where M is singular; names the joint.
        """
        from robot_dyn.lagrange.digits import digits  # the one import upward: who asks holds a Robot

        return digits(self, quantity, state)

    def warn_below(self, digits: float | None) -> Robot:
        """A robot whose queries warn where their answers have fewer digits, as `digits` counts them.

        Of M, C, N, inverse and forward dynamics. An estimate, 8 n u κ of the terms, is made first; digits are counted
        only where it is below, and of up to 64 joints. Takes milliseconds a state, and does not reach machine code made
        of the robot. A robot is loaded with 8 digits if M is nearly singular at a configuration without symmetries.

        Args:
            digits: From above 0 to 20; None for no warnings, and no cost.

        Raises:
            QueryError: If it is not such a number.
        """
        return Robot(self.description, self.edits, digits)

    @property
    def name(self) -> str:
        """The robot's name in its file."""
        return self.description.name

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.joint_names)

    @property
    def sizes(self) -> dict[str, int]:
        """The numbers that letters in the shapes of quantities stand for."""
        return {"n": self.n, "p": len(PARAMETERS) * self.model.nv}

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

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        return self._built[2]

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the links; each can be asked for its placement and Jacobian."""
        return tuple(pinocchio_model.link_frames(self.model))

    @cached_property
    def _frames(self) -> dict[str, int]:
        """Index of each frame, by the name of its link and of its joint."""
        links = pinocchio_model.link_frames(self.model)
        return links | {joint: links[child] for joint, child in self.description.joint_frames.items()}

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Types of the n joints: "revolute", "continuous" (revolute without limits) or "prismatic"."""
        return tuple(self.description.joint_kinds[name] for name in self.joint_names)

    @property
    def gravity(self) -> ndarray:
        """Acceleration of free fall, (3,) in base axes, in [m/s²]; `with_(gravity=…)` changes it."""
        return frozen(np.array(self.edits.gravity))

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
    def armature(self) -> ndarray:
        """Inertia of the drives felt at the joints, (n,) in [kg m²] or [kg]; part of M."""
        return self._per_joint(self.model.armature)

    @property
    def damping(self) -> ndarray:
        """Viscous friction the file states, with coupled joints Σ s² b, (n,) in [N m s/rad] or [N s/m]; see `Plant`."""
        return frozen(self.model.damping @ self.couplings.S**2)

    @property
    def friction(self) -> ndarray:
        """Dry friction the file states, with coupled joints Σ |s| f, (n,) in [N m] or [N]; see `Plant`."""
        return frozen(self.model.friction @ np.abs(self.couplings.S))

    @property
    def total_mass(self) -> float:
        """Mass of all links, those of the base included, in [kg]."""
        return sum(body.mass for body in self.model.inertias)

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """What is doubtful in the description and its edits, in words, each with its remedy; see docs/findings.md."""
        of_body = doctor.findings(
            structure(self.description, self.edits),
            None if self._nearly_singular else self.joint_without_inertia,
            self._nearly_singular,
        )
        return (*self.description.findings, *of_body)

    def random_configuration(self, rng: np.random.Generator) -> ndarray:
        """A position within the joint limits, uniformly distributed.

        A revolute joint that has no limits, or more than one turn between them, is drawn from one turn, as near to 0 as
        its limits allow; a prismatic one without limits from −1 m to 1 m.

        Args:
            rng: Source of random numbers, such as numpy.random.default_rng(0).

        Returns:
            Positions, shape (n,), in [rad] or [m] by joint.

        Raises:
            QueryError: If rng is not a numpy.random.Generator.
        """
        instance("rng", rng, np.random.Generator, "give one, such as numpy.random.default_rng(0)")
        slides = np.array([each == "prismatic" for each in self.joint_types])
        lower, upper = self.lower, self.upper
        half = (upper - lower) / 2
        half = np.where(np.isfinite(half) & slides, half, np.minimum(half, np.where(slides, 1.0, np.pi)))
        middle = np.clip(0.0, lower + half, upper - half)
        return rng.uniform(np.maximum(lower, middle - half), np.minimum(upper, middle + half))

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

    def inverse_dynamics(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> ndarray:
        shape = self._shape
        if is_state(q, shape) and is_state(v, shape) and is_state(a, shape):
            tau = pin.rnea(self.model, self._scratch.data, q, v, a)
            if is_moderate(tau):  # NaN and inf, in any argument, show in tau
                return tau
        return self._ask("inverse_dynamics", errors, pin.rnea, Couplings.torque, self.model, q, v, a)

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *, errors: str = "raise") -> ndarray:
        shape = self._shape if self._singular is None else None
        if is_state(q, shape) and is_state(v, shape) and is_state(tau, shape):
            a = pin.aba(self.model, self._scratch.data, q, v, tau)
            if is_moderate(a, DOUBTFUL):
                return a
        return self._forward_dynamics(errors, q, v, tau)

    def kinetic_energy(self, q: Array, v: Array, *, errors: str = "raise") -> Any:
        return self._ask("kinetic_energy", errors, kernels.kinetic_energy, None, self.model, q, v)

    def potential_energy(self, q: Array, *, errors: str = "raise") -> Any:
        return self._ask("potential_energy", errors, pin.computePotentialEnergy, None, self.model, q)

    def momentum(self, q: Array, v: Array, *, errors: str = "raise") -> ndarray:
        return self._ask("momentum", errors, kernels.momentum, Couplings.torque, self.model, q, v)

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return ordered(self.joint_names, self.model.names[1:])

    @cached_property
    def _order(self) -> list[int]:
        """Indices of the bodies in `model`, in the order of their parameters."""
        names = list(self.model.names[1:])
        return [names.index(name) for name in self.body_names]

    @property
    def inertial_parameters(self) -> ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        return frozen(np.concatenate([self.model.inertias[i + 1].toDynamicParameters() for i in self._order]))

    def regressor(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> ndarray:
        shape = self._shape
        if is_plain(q, shape) and is_plain(v, shape) and is_plain(a, shape):
            return kernels.regressor(self.model, self._scratch.data, q, v, a)
        return self._ask("regressor", errors, kernels.regressor, self._of_bodies, self.model, q, v, a)

    def _of_bodies(self, couplings: Couplings, Y: ndarray) -> ndarray:
        """The regressor of all joints, (..., N, 10 N) with bodies as in `model`, coupled and in the order of θ."""
        N = self.model.nv
        return couplings.rows(Y.reshape(*Y.shape[:-1], N, -1)[..., self._order, :].reshape(Y.shape))

    def placement(self, q: Array, frame: str, *, errors: str = "raise") -> ndarray:
        return self._ask("placement", errors, self._kernel(kernels.placement, frame), None, self.model, q)

    def jacobian(
        self, q: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise"
    ) -> ndarray:
        kernel = self._kernel(kernels.jacobian, frame, expressed_in)
        return self._ask("jacobian", errors, kernel, Couplings.columns, self.model, q)

    def jacobian_rate(
        self, q: Array, v: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise"
    ) -> ndarray:
        kernel = self._kernel(kernels.jacobian_rate, frame, expressed_in)
        return self._ask("jacobian_rate", errors, kernel, Couplings.columns, self.model, q, v)

    def _kernel(self, make: Callable[..., Kernel], frame: str, *axes: str) -> Kernel:
        """The kernel of a frame, which is kept."""
        try:
            return self._kernels[make, frame, axes]
        except (KeyError, TypeError):  # TypeError of what is not a name
            pass
        kernel = make(entry(self._frames, frame), *map(Axes.of, axes))
        return self._kernels.setdefault((make, frame, axes), kernel)

    @cached_property
    def _kernels(self) -> dict[tuple[Any, ...], Kernel]:
        return {}

    @cached_property
    def _built(self) -> tuple[Any, Couplings, tuple[str, ...]]:
        return pinocchio_model.build(self.description, self.edits)

    @cached_property
    def _weightless(self) -> Any:
        """The model without gravity."""
        model = self.model.copy()
        model.gravity = pin.Motion.Zero()
        return model

    @cached_property
    def _scratch(self) -> Scratch:
        return Scratch(self.model)

    @cached_property
    def _shape(self) -> tuple[int] | None:
        """Shape of a state that goes straight to Pinocchio; None if joints are coupled, or digits are looked at."""
        return self._one_state if self.couplings.trivial else None

    @cached_property
    def _one_state(self) -> tuple[int] | None:
        """Shape of a state that is answered without `answered`; None if digits are looked at."""
        return (self.n,) if self.least_digits is None else None

    @property
    def joint_without_inertia(self) -> str | None:
        """The joint at which M is singular at every configuration, or None: then forward dynamics has no answer."""
        return None if self._singular is None else self._singular().joint

    @cached_property
    def _general_inertia(self) -> ndarray:
        """M at a configuration without symmetries."""
        return self._equation(pin.crba, Couplings.matrix, self.model)(np.linspace(0.3, 0.9, self.n))

    @cached_property
    def _nearly_singular(self) -> NearlySingular | None:
        if self._singular is not None and not isinstance(self._singular(), UndecidedError):
            return None
        return nearly_singular(self._general_inertia, self.joint_names)

    @cached_property
    def _singular(self) -> Callable[[], SingularError] | None:
        """Makes the error of a robot without forward dynamics."""
        M = self._general_inertia
        try:
            acceleration(M, np.ones(self.n), self.joint_names)
        except UndecidedError as error:
            return partial(UndecidedError, error.joint, "at any q", "float64")
        except SingularError as error:
            return partial(SingularError, error.joint, "at any q; give its link a mass, or lock it")
        return None

    def _ask(
        self, quantity: str, errors: str, kernel: Kernel, reduce: Reduction | None, model: Any, *state: Array
    ) -> Any:
        if errors.__class__ is str and errors == "raise":
            shape = self._one_state
            for x in state:
                if not is_plain(x, shape):
                    break
            else:
                if self._shape:
                    return kernel(model, self._scratch.data, *state)
                return self._coupled(kernel, reduce, model, *state)
        named = dict(zip(ALL[quantity].arguments, state, strict=True))
        return self._answered(quantity, errors, self._equation(kernel, reduce, model), named)

    def _coupled(self, kernel: Kernel, reduce: Reduction | None, model: Any, q: ndarray, *rates: ndarray) -> Any:
        """The answer at one state of coupled joints."""
        couplings = self.couplings
        answer = kernel(model, self._scratch.data, couplings.position(q), *map(couplings.velocity, rates))
        return answer if reduce is None else reduce(couplings, answer)

    def _equation(self, kernel: Kernel, reduce: Reduction | None, model: Any) -> Callable[..., ndarray]:
        return kernels.by_state(kernel, reduce, model, self._scratch.data, self.couplings)

    def _answered(self, quantity: str, errors: str, equation: Callable[..., ndarray], state: dict[str, Array]) -> Any:
        arrays = {name: shaped(name, x, self.joint_names) for name, x in state.items()}
        answer = answered(equation, arrays, ALL[quantity].shape(self.sizes), self.joint_names, errors)
        if self.least_digits is not None:
            from robot_dyn.lagrange.digits import doubt

            if said := doubt(self, quantity, arrays, answer, self.least_digits):
                warnings.warn(said, PrecisionWarning, stacklevel=4)
        return answer if answer.ndim else float(answer)

    def _forward_dynamics(self, errors: str, q: Array, v: Array, tau: Array) -> ndarray:
        """Forward dynamics in general: coupled joints by factorising M, which also tells where M is singular."""
        if self._singular is not None:
            raise self._singular()
        if not self._shape and all(is_plain(x, self._one_state) for x in (q, v, tau)):
            inertia = self._coupled(pin.crba, Couplings.matrix, self.model, q)
            bias = self._coupled(pin.nonLinearEffects, Couplings.torque, self.model, q, v)
            a = acceleration(inertia, tau - bias, self.joint_names)
            if is_moderate(a, DOUBTFUL):
                return a
        M = self._equation(pin.crba, Couplings.matrix, self.model)
        bias = self._equation(pin.nonLinearEffects, Couplings.torque, self.model)
        solved = self._equation(pin.aba, None, self.model)

        def equation(q: ndarray, v: ndarray, tau: ndarray) -> ndarray:
            a = solved(q, v, tau) if self.couplings.trivial else acceleration(M(q), tau - bias(q, v), self.joint_names)
            if not np.all(np.abs(a) <= DOUBTFUL) and np.isfinite(here := M(q)).all():
                acceleration(here, tau, self.joint_names)  # tells if M is singular at this q
            return a

        return self._answered("forward_dynamics", errors, equation, {"q": q, "v": v, "tau": tau})

    def _per_joint(self, full: ndarray) -> ndarray:
        return pinocchio_model.per_joint(self.model, self.joint_names, full)
