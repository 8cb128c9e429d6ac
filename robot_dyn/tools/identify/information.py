"""Information that a motion gives about base parameters and friction, with its derivatives along the motion.

    W = [Y_k, diag v, diag tanh(v/v_s)],   A = Σ_t Wᵀ Σ⁻¹ W,   cov = A⁻¹

    ∂ log det A/∂(q, v, a) = 2 tr(A⁻¹ Wᵀ Σ⁻¹ ∂W):   one reverse pass through the regressor, as machine code

The Coulomb column is smooth, so that rows near rest count little. [Swevers et al. 1997; Gautier, Khalil 1992]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import Robot, compiled
from robot_dyn.foundations import Value, read_only
from robot_dyn.tools.identify.base_parameters import BaseParameters

if TYPE_CHECKING:
    from robot_dyn.codegen import CompiledDynamics, Kernel

SHIFT_M = 0.05  # [m]: the shift of a centre of mass that an identification must see
_VISIBLE = 0.5  # standard error, of the size of a parameter, up to which a 95 % interval is narrower than the size


@final
@dataclass(frozen=True, eq=False)
class ExpectedPrecision(Value):
    """The precision that a log of a motion can reach: the Cramér–Rao bound.

    Attributes:
        log_det: log det of the information matrix of the parameters, each in units of its size.
        parameters: Names of base parameters and friction coefficients, (p,).
        standard_errors: Standard errors, (p,), in units of each parameter.
        sizes: Differences worth seeing, (p,): of a mass, the mass; of a first moment, that of a shift by 5 cm; of a
            moment of inertia, m (5 cm)²; of friction, twice the noise, at 1 rad/s or 1 m/s.
    """

    log_det: float
    parameters: tuple[str, ...]
    standard_errors: np.ndarray
    sizes: np.ndarray

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def relative(self) -> np.ndarray:
        """Standard errors in units of the sizes, (p,)."""
        return self.standard_errors / self.sizes

    @property
    def worst(self) -> tuple[str, float]:
        """The parameter with the largest standard error in units of its size, and that error."""
        k = int(np.argmax(self.relative))
        return self.parameters[k], float(self.relative[k])

    @property
    def weak(self) -> tuple[str, ...]:
        """Parameters whose 95 % interval is wider than their size."""
        return tuple(name for name, x in zip(self.parameters, self.relative, strict=True) if x > _VISIBLE)


@final
@dataclass(frozen=True, eq=False)
class Information(Value):
    """The information of motions of one arm.

    Attributes:
        arm: The arm.
        base: Its base parameters.
        noise: Standard deviation of the torque of each joint in one row, (n,), in [N m] or [N].
        slow: v_s, below which Coulomb friction is smooth, (n,), in [rad/s] or [m/s].
    """

    arm: Robot
    base: BaseParameters
    noise: np.ndarray
    slow: np.ndarray

    @cached_property
    def compiled(self) -> CompiledDynamics:
        """The arm as machine code."""
        return compiled(self.arm)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of base parameters, viscous and Coulomb friction, (p,)."""
        kinds = ("viscous", "coulomb")
        return (*self.base.names, *(f"{joint} {kind}" for kind in kinds for joint in self.arm.joint_names))

    @cached_property
    def sizes(self) -> np.ndarray:
        """Differences worth seeing, (p,); see `ExpectedPrecision`."""
        mass = self.arm.inertial_parameters.reshape(-1, 10)[:, 0]
        mass = np.maximum(mass, mass.sum() / 100)  # the motion does not depend on a body without mass
        by_kind = np.array([1.0, *[SHIFT_M] * 3, *[SHIFT_M**2] * 6])
        inertial = np.outer(mass, by_kind).ravel()[self.base.columns]
        return np.concatenate([inertial, 2 * self.noise, 2 * self.noise])

    def rows(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return Σ^(−1/2) W in units of the sizes, (m, n, p)."""
        Y = self.compiled.regressor(q, v, a)
        n, r, j = self.arm.n, len(self.base.columns), np.arange(self.arm.n)
        W = np.zeros((*q.shape, r + 2 * n))
        W[..., :r] = Y[..., self.base.columns]
        W[:, j, r + j], W[:, j, r + n + j] = v, np.tanh(v / self.slow)
        return W * (self.sizes / self.noise[:, None])

    def expected(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> ExpectedPrecision:
        """Return the precision of a log with these rows, each (m, n)."""
        A = gram(self.rows(q, v, a))
        try:
            L = np.linalg.cholesky(A)
        except np.linalg.LinAlgError:  # some combination of parameters does not appear
            return ExpectedPrecision(-np.inf, self.parameters, np.full(len(A), np.inf), self.sizes)
        errors = np.linalg.norm(np.linalg.inv(L), axis=0)
        return ExpectedPrecision(float(2 * np.log(np.diag(L)).sum()), self.parameters, errors * self.sizes, self.sizes)

    def slope(
        self, state: tuple[np.ndarray, np.ndarray, np.ndarray], W: np.ndarray, A: np.ndarray, by_torque: np.ndarray
    ) -> Iterator[np.ndarray]:
        """Yield the derivatives of log det A + Σ by_torque · τ by q, v and a, each (m, n).

        Args:
            state: The motion (q, v, a), each (m, n).
            W: Its rows, (m, n, p).
            A: Its information matrix, (p, p).
            by_torque: Weights of the torque of the file's parameters, (m, n).
        """
        n, r, j = self.arm.n, len(self.base.columns), np.arange(self.arm.n)
        G = 2 * (W @ np.linalg.inv(A)) * (self.sizes / self.noise[:, None])
        by_regressor = by_torque[..., None] * self.arm.inertial_parameters
        by_regressor[..., self.base.columns] += G[..., :r]
        inputs = [np.ascontiguousarray(x) for x in (*state, by_regressor.reshape(len(W), -1))]
        result = np.empty((len(W), 3 * n))
        self._reverse.many(inputs, result)
        q, v, a = np.split(result, 3, axis=1)
        smooth = (1 - np.tanh(state[1] / self.slow) ** 2) / self.slow
        yield q
        yield v + G[:, j, r + j] + G[:, j, r + n + j] * smooth
        yield a + by_torque * self.arm.armature

    @cached_property
    def _reverse(self) -> Kernel:
        """Machine code of ∂(G · Y)/∂(q, v, a)."""
        import casadi as ca

        from robot_dyn.codegen import Kernel, Trace, default_store, program_of

        Y = Trace(self.arm).quantity("regressor").function
        q, v, a = (ca.SX.sym(name, self.arm.n) for name in "qva")
        G = ca.SX.sym("G", Y.numel_out(0))
        slope = ca.gradient(ca.dot(G, Y(q, v, a)), ca.vertcat(q, v, a))
        function = ca.Function("slope", [q, v, a, G], [ca.cse(ca.densify(slope))])
        about = f"{self.arm.name}: derivative of the regressor"
        return Kernel(program_of(function), (3 * self.arm.n,), store=default_store(), about=about)


def gram(W: np.ndarray) -> np.ndarray:
    """Return Σ_t Wᵀ W, (p, p), of rows (m, n, p)."""
    flat = W.reshape(-1, W.shape[-1])
    return flat.T @ flat
