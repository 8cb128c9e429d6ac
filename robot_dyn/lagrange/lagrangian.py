"""Lagrangian of a manipulator: M(q) a + C(q, v) v + N(q) = τ from L = K − V, in closed form and any arithmetic.

The formulas are in `lagrange/formulas.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.description.description import Description
from robot_dyn.description.inertial_parameters import NAMES as PARAMETERS
from robot_dyn.description.inertial_parameters import Parametrised, parameters
from robot_dyn.foundations.arithmetic import Arithmetic, Array, arithmetic_of, in_arithmetic
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import JointValues, shaped
from robot_dyn.lagrange.formulas import FORMULAS
from robot_dyn.lagrange.linkage import Linkage, linkage_of
from robot_dyn.lagrange.summand import mass_matrix_derivative, summands_of_bodies
from robot_dyn.lagrange.tree import Described, tree_of
from robot_dyn.queries.batch import answered, into
from robot_dyn.queries.dynamics import QUANTITIES, Axes, Dynamics, entry
from robot_dyn.queries.quantity import Quantity

if TYPE_CHECKING:
    from numpy.typing import DTypeLike


_MASS_MATRIX_DERIVATIVE = Quantity("mass_matrix_derivative", ("q",), ("n", "n", "n"))


@final
@dataclass(frozen=True)
class Lagrangian(Dynamics[Array], Parametrised):
    """Dynamics of a robot by its Lagrangian, independent of Pinocchio after the checks of the file.

    Attributes:
        robot: Robot whose file, edits and order of joints are used, but not its computed numbers.
        dtype: float32, float64, np.longdouble, or `Ball(bits)` for results with a proven radius.
    """

    robot: Described
    dtype: DTypeLike | Arithmetic = np.float64

    def __post_init__(self) -> None:
        if not isinstance(getattr(self.robot, "description", None), Description):
            raise QueryError(f"robot must be a Robot, for example rd.load('ur5'), got {shown(self.robot)}")
        _ = self.linkage

    def __reduce__(self) -> tuple[object, ...]:
        return Lagrangian, (self.robot, self.dtype)

    @cached_property
    def arithmetic(self) -> Arithmetic:
        """Number type of all computations."""
        return arithmetic_of(self.dtype)

    @cached_property
    @in_arithmetic
    def linkage(self) -> Linkage:
        """The tree converted to numbers."""
        return linkage_of(tree_of(self.robot.description, self.robot.edits), self.joint_names, self.arithmetic)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Names of the n joints, in the order of q."""
        return self.robot.joint_names

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.joint_names)

    @property
    def sizes(self) -> dict[str, int]:
        """Numbers for the letters in the shapes of quantities."""
        return {"n": self.n, "p": len(PARAMETERS) * len(self.linkage.bodies)}

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return tuple(self.linkage.bodies[i].joint for i in self.linkage.order)

    @property
    @in_arithmetic
    def inertial_parameters(self) -> Array:  # pyright: ignore[reportIncompatibleMethodOverride]
        return np.concatenate([parameters(self.linkage.inertias[i]) for i in self.linkage.order])

    def mass_matrix_derivative(self, q: JointValues) -> Array:
        """Return ∂M_ij/∂q_k at index [..., i, j, k], exact; shape (..., n, n, n)."""
        return self._evaluated(
            _MASS_MATRIX_DERIVATIVE, lambda at: mass_matrix_derivative(at, summands_of_bodies(at)), (q,), False
        )

    def _answer(
        self, name: str, state: tuple[Any, ...], out: Any, frame: tuple[str, ...] = (), *, nan: bool = False
    ) -> Array:
        if frame:
            frame = (self._link(frame[0]), *map(Axes.from_name, frame[1:]))
        return into(out, self._evaluated(QUANTITIES[name], FORMULAS[name], state, nan, *frame))

    def _link(self, frame: str) -> str:
        """Return the link of a frame, which may be named by its joint; raise QueryError for an unknown frame."""
        joints = self.robot.description.joint_frames
        entry(self.linkage.links | joints, frame)
        return joints.get(frame, frame)

    @in_arithmetic
    def _evaluated(
        self, quantity: Quantity, formula: Callable[..., Any], state: tuple[Any, ...], nan: bool, *frame: str
    ) -> Array:
        """Evaluate a formula at the configuration of all bodies, or only of those that carry a link."""

        def equation(q: Array, *rates: Array) -> Array:
            at = self.linkage.at_link(q, frame[0]) if frame else self.linkage.at(q)
            return formula(at, *rates, *frame)

        arrays = {
            name: shaped(name, x, self.joint_names, self.arithmetic)
            for name, x in zip(quantity.arguments, state, strict=True)
        }
        shape = quantity.shape(self.sizes)
        return answered(equation, arrays, shape, self.joint_names, nan, self.arithmetic)
