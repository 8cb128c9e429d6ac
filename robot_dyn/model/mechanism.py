"""The mechanism of a robot: its `pinocchio.Model`, its couplings, and what its file states of links and joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.couplings import Couplings
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.description.inertial_parameters import NAMES, ordered
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.errors import DescriptionError, EditError
from robot_dyn.foundations.validate import instance
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.kernels import FrameKernels, Scratch
from robot_dyn.model.pinocchio_model import build, joint_ids, link_frames

T = TypeVar("T")


def forwarded(stated: cached_property[T]) -> cached_property[T]:
    """A property of a `Mechanism` as a property of the robot that has it, with the same docstring."""

    def read(robot: Any) -> T:
        return stated.__get__(robot._mechanism)

    read.__doc__ = stated.__doc__
    return cached_property(read)


def _frozen(x: ndarray) -> ndarray:
    x.setflags(write=False)
    return x


@final
@dataclass(frozen=True, eq=False)
class Mechanism:
    """Links and joints of a description with its edits; vectors are in the order of q, and read-only.

    Attributes:
        description: The checked file.
        edits: Gravity, locks, payloads, armature.
    """

    description: Description
    edits: Edits

    def __post_init__(self) -> None:
        instance("edits", self.edits, Edits, "give those of another robot, or use with_", error=EditError)
        if not isinstance(self.description, Description):
            given = type(self.description).__name__
            raise DescriptionError(
                f"a Robot is made of a Description, got {given}; use rd.load, Robot.from_text or Robot.from_pinocchio"
            )
        _ = self._built  # so that errors are raised now, not by the first query

    @cached_property
    def _built(self) -> tuple[Any, Couplings, tuple[str, ...]]:
        return build(self.description, self.edits)

    @cached_property
    def model(self) -> Any:
        """The `pinocchio.Model` of all joints that move, coupled ones included. Read it, do not change it."""
        return self._built[0]

    @cached_property
    def couplings(self) -> Couplings:
        """How the joints of `model` follow q."""
        return self._built[1]

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        return self._built[2]

    @cached_property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.joint_names)

    @cached_property
    def sizes(self) -> Mapping[str, int]:
        """The numbers that letters in the shapes of quantities stand for."""
        return MappingProxyType({"n": self.n, "p": len(NAMES) * self.model.nv})

    @cached_property
    def estimated(self) -> Mapping[str, str]:
        """Links whose inertia was estimated from shapes, not measured, and what from: see `load`."""
        return MappingProxyType(self.description.estimated)

    @cached_property
    def scratch(self) -> Scratch:
        """Memory that the algorithms of `model` write to."""
        return Scratch(self.model)

    @cached_property
    def weightless(self) -> Any:
        """The model without gravity."""
        model = self.model.copy()
        model.gravity = pin.Motion.Zero()
        return model

    @cached_property
    def coriolis(self) -> Coriolis:
        """How C of `model` is computed, and the bound of its rounding."""
        return Coriolis.of(self.model, self.couplings)

    @cached_property
    def frame_kernels(self) -> FrameKernels:
        """Kernels of frames, by the name of a link or of a joint."""
        links = link_frames(self.model)
        joints = {joint: links[child] for joint, child in self.description.joint_frames.items()}
        return FrameKernels(links | joints)

    @cached_property
    def body_order(self) -> list[int]:
        """Indices of the bodies in `model`, in the order of their parameters."""
        names = list(self.model.names[1:])
        return [names.index(name) for name in ordered(self.joint_names, names)]

    @cached_property
    def inertial_parameters(self) -> ndarray:
        """See `Parametrised.inertial_parameters`."""
        return _frozen(np.concatenate([self.model.inertias[i + 1].toDynamicParameters() for i in self.body_order]))

    @cached_property
    def name(self) -> str:
        """The robot's name in its file."""
        return self.description.name

    @cached_property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the links; each has a placement and a Jacobian."""
        return tuple(link_frames(self.model))

    @cached_property
    def joint_types(self) -> tuple[str, ...]:
        """Types of the n joints: "revolute", "continuous" (revolute without limits) or "prismatic"."""
        return tuple(self.description.joint_kinds[name] for name in self.joint_names)

    @cached_property
    def gravity(self) -> ndarray:
        """Acceleration of free fall, (3,) in base axes, in [m/s²]; `with_(gravity=…)` changes it."""
        return _frozen(np.array(self.edits.gravity))

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

    def random_configuration(self, rng: np.random.Generator) -> ndarray:
        """See `Robot.random_configuration`."""
        instance("rng", rng, np.random.Generator, "give one, such as numpy.random.default_rng(0)")
        slides = np.array([each == "prismatic" for each in self.joint_types])
        half = (self.upper - self.lower) / 2
        half = np.where(np.isfinite(half) & slides, half, np.minimum(half, np.where(slides, 1.0, np.pi)))
        middle = np.clip(0.0, self.lower + half, self.upper - half)
        return rng.uniform(np.maximum(self.lower, middle - half), np.minimum(self.upper, middle + half))

    def _per_joint(self, full: ndarray) -> ndarray:
        ids = joint_ids(self.model)
        values = full[[self.model.idx_vs[ids[name]] for name in self.joint_names]]
        values[np.abs(values) >= float(UNBOUNDED)] *= np.inf
        return _frozen(values)
