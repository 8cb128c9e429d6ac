"""True values of queries such as M, C, N, by ball arithmetic with increasing precision until the balls are narrow.

    radius ≤ 1e-20 · scale

The scale of M_ij is √(M_ii M_jj). The scale of accelerations, in the norm of M, is Σ ‖M⁻¹ τ_k‖_M over τ, C v and N.
The scale of other entries is the largest of them in the joint units √M_ii, or a typical size if that is larger.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array, Ball, Numeral, midpoint, radius
from robot_dyn.foundations.errors import UndecidedError
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.scale import diagonal_scale, floored, joint_units, mass_norm, scaled, solved_norm
from robot_dyn.lagrange.tree import Described
from robot_dyn.queries.dynamics import CORIOLIS_TORQUE, M, N
from robot_dyn.queries.quantity import MAX_DIGITS, Quantity

if TYPE_CHECKING:
    from flint import arb
    from numpy.typing import ArrayLike


RESOLUTION = 10.0**-MAX_DIGITS
_FIRST_BITS, _MAX_BITS = 128, 4096

NEGLIGIBLE = 1e-12  # in the units of the joints: smaller values are rounding errors of zero

State = Mapping[str, np.ndarray]  # q, v, a, tau


@final
@dataclass(frozen=True)
class RoundedLiterals(Arithmetic):
    """Balls that contain the float64 nearest to each decimal of a file, instead of the decimal itself."""

    ball: Ball
    dtype: np.dtype = field(default_factory=lambda: np.dtype(object), init=False, repr=False)

    def number(self, literal: Numeral) -> arb:
        return self.ball.number(float(literal) if isinstance(literal, str) else literal)

    def scope(self) -> AbstractContextManager[None]:
        return self.ball.scope()

    def asarray(self, values: object) -> Array:
        return self.ball.asarray(values)

    def finite(self, x: Array) -> np.ndarray:
        return self.ball.finite(x)


@final
@dataclass(frozen=True, eq=False)
class Scale:
    """The divisor of errors, at one state or several (S, …).

    Attributes:
        size: Scale of each entry, or of the whole vector in the norm of M.
        M: Mass matrix of the norm, (..., n, n); None for entrywise errors.
    """

    size: np.ndarray
    M: np.ndarray | None = None

    def relative(self, error: np.ndarray, radius: np.ndarray | float = 0.0) -> np.ndarray:
        """Return a bound on errors relative to the scale: on the norm, (...,), or entrywise if M is None.

        The errors themselves are exact up to `radius`.
        """
        if self.M is None:
            return scaled(np.abs(error) + radius, self.size)
        return scaled(mass_norm(self.M, error) + (radius * joint_units(self.M)).sum(axis=-1), self.size)


def entry_units(quantity: Quantity, M: np.ndarray) -> np.ndarray:
    """Return the product of √M_ii over the joint axes of a quantity: √(M_ii M_jj) for C, √M_ii for torques.

    The result has the shape of the quantity, with other axes of length 1. The unit of a
    joint without inertia is 1e-12 of the largest unit.
    """
    units = joint_units(M)
    units = np.maximum(units, NEGLIGIBLE * units.max(axis=-1, keepdims=True))
    batch = units.shape[:-1]
    product = np.ones(batch)
    for k, axis in enumerate(quantity.axes):
        along = units if axis == "n" else np.ones((*batch, 1))
        product = product[..., None] * along.reshape(*batch, *(1,) * k, -1)
    return product


def in_joint_units(quantity: Quantity, values: np.ndarray, M: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Return the scale of each entry: its unit times the largest entry in joint units, or `least` if larger."""
    units, axes = entry_units(quantity, M), tuple(range(-len(quantity.axes), 0))
    return units * np.maximum(np.max(np.abs(values) / units, axis=axes, keepdims=True), least)


@final
@dataclass(frozen=True, eq=False)
class Truth:
    """True values of a quantity at one state.

    Attributes:
        values: Balls, of the shape of the quantity.
        scale: Scale of errors.
        bits: Precision of the balls.
    """

    values: Array
    scale: Scale
    bits: int

    def error(self, answer: ArrayLike) -> float:
        """Return a bound on the largest relative error of an answer (floats or balls); inf if not finite."""
        ball = Ball(2 * self.bits)
        with ball.scope():
            difference = ball.asarray(answer) - self.values
            if not ball.finite(difference).all():
                return float("inf")
            return float(np.max(self.scale.relative(midpoint(difference), radius(difference))))


@final
class Exact:
    """The exact equations of a robot.

    Args:
        robot: Only its file and edits are used, not its computed numbers.
        rounded: Use the float64 nearest to each decimal of the file instead of the decimal itself.
    """

    def __init__(self, robot: Described, rounded: bool = False) -> None:
        self._robot, self._rounded = robot, rounded
        self._engines: dict[int, Lagrangian] = {}

    def at(self, quantity: Quantity, state: State, typical: float = 0.0) -> Truth:
        """Return the true values at one state.

        Args:
            quantity: A query without a frame.
            state: Arguments of the quantity by name, (n,) each.
            typical: Minimum scale of entries, in the units of the joints; not for M and forward dynamics.

        Raises:
            SingularError: If M is singular and the quantity is forward dynamics; names the joint.
        """
        bits = _FIRST_BITS
        while True:
            engine = self._engine(bits)
            try:
                values = np.asarray(quantity.evaluate(engine, state), dtype=object)
                scale = self._scale(engine, quantity, state, values, typical)
                if np.all(scale.relative(0 * midpoint(values), radius(values)) <= RESOLUTION) or bits >= _MAX_BITS:
                    return Truth(values, scale, bits)
            except UndecidedError:
                if bits >= _MAX_BITS:
                    raise
            bits *= 2

    def _scale(self, engine: Lagrangian, quantity: Quantity, state: State, values: Array, typical: float) -> Scale:
        if quantity.definite:
            return Scale(floored(diagonal_scale(midpoint(values))))
        inertia = midpoint(M.evaluate(engine, state))
        if quantity.solves:
            torques = (state["tau"], *(midpoint(term.evaluate(engine, state)) for term in (CORIOLIS_TORQUE, N)))
            return Scale(solved_norm(inertia, torques), inertia)
        certain = np.where(np.abs(midpoint(values)) > radius(values), midpoint(values), 0.0)
        return Scale(in_joint_units(quantity, certain, inertia, typical))

    def _engine(self, bits: int) -> Lagrangian:
        if bits not in self._engines:
            ball = Ball(bits)
            self._engines[bits] = Lagrangian(self._robot, RoundedLiterals(ball) if self._rounded else ball)
        return self._engines[bits]
