"""Lagrange's equations of any energies, d/dt ∂L/∂v − ∂L/∂q = Q with L = K(t, q, v) − V(t, q) and v = dq/dt.

    M a + b = Q,   M = ∂²K/∂v²,   b = (∂²K/∂v∂q) v + ∂²K/∂v∂t − ∂K/∂q + ∂V/∂q

The derivatives are exact, by CasADi's automatic differentiation of the functions the user writes. K need not be
quadratic in v: moving constraints and relativistic particles are allowed.
[Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., 2002, ch. 1 and 2]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.foundations.arithmetic import apply
from robot_dyn.foundations.errors import OverflowedError, QueryError, RobotDynError, SingularError
from robot_dyn.foundations.linear_algebra import NotPositiveDefiniteError, cholesky_solve
from robot_dyn.foundations.validate import integer, rows

Kinetic = Callable[[Any, Any, Any], Any]
Potential = Callable[[Any, Any], Any]


@final
@dataclass(frozen=True, eq=False)
class EulerLagrange:
    """The equation of motion M(t, q, v) a + b(t, q, v) = Q of a system of n coordinates; built by `euler_lagrange`.

    Every method takes t (...) in [s], and q, v, a, Q (..., n) in the units of the energies' coordinates; it raises
    QueryError for a wrong shape or a value that is not finite, and OverflowedError where the energies are not finite.

    Attributes:
        n: Number of coordinates.
        kernels: CasADi functions of (t, q, v) by name.
        no_coriolis: Why there is no matrix C, or "" if there is.
    """

    n: int
    kernels: Mapping[str, Any]
    no_coriolis: str

    def M(self, t: Any, q: Any, v: Any) -> np.ndarray:
        """Mass matrix ∂²K/∂v², symmetric, shape (..., n, n); it depends on v unless K is quadratic in v."""
        return self._evaluate("M", t, q, v, shape=(self.n, self.n))

    def C(self, t: Any, q: Any, v: Any) -> np.ndarray:
        """Coriolis matrix of the Christoffel symbols, shape (..., n, n): Ṁ = C + Cᵀ and M a + C v + N = Q.

        C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k

        Raises:
            RobotDynError: If K is not ½ vᵀ M(q) v, for then b ≠ C v + N for any such C.

        Source: Murray, Li, Sastry 1994, eq. 4.23.
        """
        if self.no_coriolis:
            raise RobotDynError(f"no Coriolis matrix: {self.no_coriolis}; use bias(t, q, v), which serves every K")
        return self._evaluate("C", t, q, v, shape=(self.n, self.n))

    def N(self, t: Any, q: Any) -> np.ndarray:
        """Potential's gradient ∂V/∂q, shape (..., n)."""
        return self._evaluate("N", t, q, shape=(self.n,))

    def bias(self, t: Any, q: Any, v: Any) -> np.ndarray:
        """What Q must be for a = 0: b = (∂²K/∂v∂q) v + ∂²K/∂v∂t − ∂K/∂q + ∂V/∂q, shape (..., n)."""
        return self._evaluate("bias", t, q, v, shape=(self.n,))

    def momentum(self, t: Any, q: Any, v: Any) -> np.ndarray:
        """Generalised momentum p = ∂K/∂v, shape (..., n); ṗ = ∂L/∂q + Q."""
        return self._evaluate("momentum", t, q, v, shape=(self.n,))

    def kinetic_energy(self, t: Any, q: Any, v: Any) -> np.ndarray:
        """K in [J], shape (...)."""
        return self._evaluate("K", t, q, v, shape=())

    def potential_energy(self, t: Any, q: Any) -> np.ndarray:
        """V in [J], shape (...)."""
        return self._evaluate("V", t, q, shape=())

    def energy(self, t: Any, q: Any, v: Any) -> np.ndarray:
        """K + V in [J], shape (...); not constant where a moving constraint does work."""
        return self.kinetic_energy(t, q, v) + self.potential_energy(t, q)

    def jacobi_integral(self, t: Any, q: Any, v: Any) -> np.ndarray:
        """Jacobi's integral h = vᵀ p − L in [J], shape (...): constant if Q = 0 and ∂L/∂t = 0; K + V if K = ½ vᵀ M v.

        Source: Goldstein, 3rd ed., §2.7.
        """
        return self._evaluate("jacobi", t, q, v, shape=())

    def inverse_dynamics(self, t: Any, q: Any, v: Any, a: Any) -> np.ndarray:
        """Generalised force Q = M a + b, shape (..., n)."""
        a = rows("a", a, self.n)
        M, b = self.M(t, q, v), self.bias(t, q, v)
        _batches("a", a.shape[:-1], b.shape[:-1])
        return _finite(apply(M, a) + b)

    def forward_dynamics(self, t: Any, q: Any, v: Any, Q: Any) -> np.ndarray:
        """Acceleration a = M⁻¹ (Q − b), shape (..., n).

        Raises:
            SingularError: If M is not positive definite here, as Euler angles make it at gimbal lock.
        """
        Q = rows("Q", Q, self.n)
        M, b = self.M(t, q, v), self.bias(t, q, v)
        batch = _batches("Q", Q.shape[:-1], b.shape[:-1])
        try:
            a = cholesky_solve(np.broadcast_to(M, (*batch, self.n, self.n)), np.broadcast_to(Q - b, (*batch, self.n)))
        except NotPositiveDefiniteError as error:
            raise SingularError(f"q[{error.row}]", "at this state; choose other coordinates near it") from None
        return _finite(a)

    def __str__(self) -> str:
        """The equation of motion in CasADi's notation, @i being intermediate results."""
        t, q, v = _symbols(self.n)
        M, b = self.kernels["M"](t, q, v).reshape((self.n, self.n)), self.kernels["bias"](t, q, v)
        return f"M a + b = Q\nM = {M}\nb = {b}"

    def _evaluate(self, name: str, t: Any, q: Any, v: Any = None, *, shape: tuple[int, ...]) -> np.ndarray:
        t, q = rows("t", t), rows("q", q, self.n)
        v = np.zeros(self.n) if v is None else rows("v", v, self.n)
        batch = _batches("v", v.shape[:-1], _batches("t", t.shape, q.shape[:-1]))
        size = int(np.prod(batch))
        columns = [
            np.broadcast_to(x, (*batch, width)).reshape(size, width).T
            for x, width in ((t[..., None], 1), (q, self.n), (v, self.n))
        ]
        if size == 0:
            return np.zeros((*batch, *shape))
        values = self.kernels[name](*columns).full().T  # CasADi takes and gives one column a state
        return _finite(values.reshape((*batch, *shape))[()])


def euler_lagrange(kinetic: Kinetic, potential: Potential | None, n: int) -> EulerLagrange:
    """The equation of motion of the energies K(t, q, v) and V(t, q).

    The energies are Python functions written in CasADi's operations: `import casadi as ca`, then ca.sin(q[0]),
    ca.sqrt(…), v[0] ** 2. They get t as a scalar and q, v as columns (n, 1) of CasADi symbols, and return a scalar [J].

        pendulum = euler_lagrange(lambda t, q, v: m * l**2 * v[0] ** 2 / 2, lambda t, q: -m * g * l * ca.cos(q[0]), 1)

    Args:
        kinetic: K(t, q, v). t is there for constraints that move.
        potential: V(t, q), or None for 0.
        n: Number of coordinates.

    Raises:
        QueryError: If n is not a positive integer, or an energy cannot be evaluated or is not a scalar.
    """
    import casadi as ca

    n = integer("n, the number of coordinates,", n, least=1, most=1000)
    t, q, v = _symbols(n)
    K = traced("K(t, q, v)", kinetic, (t, q, v))
    V = traced("V(t, q)", potential, (t, q)) if potential is not None else ca.SX(0)
    p, N = ca.gradient(K, v), ca.gradient(V, q)
    M = ca.tril2symm(ca.tril(ca.jacobian(p, v)))  # symmetric to the last bit
    bias = ca.jacobian(p, q) @ v + ca.jacobian(p, t) - ca.gradient(K, q) + N
    results = {"K": K, "V": V, "M": M, "bias": bias, "N": N, "momentum": p, "jacobi": ca.dot(v, p) - K + V}
    no_coriolis = _why_no_coriolis(K, p, M, t, v)
    if not no_coriolis:
        results["C"] = _christoffel(M, q, v).T  # CasADi stores columns first, NumPy rows
    kernels = {name: ca.Function(name, [t, q, v], [ca.densify(ca.vec(x))]) for name, x in results.items()}
    return EulerLagrange(n, kernels, no_coriolis)


def traced(what: str, function: Callable[..., Any], symbols: tuple[Any, ...], shape: tuple[int, int] = (1, 1)) -> Any:
    """The expression that a user's function returns for CasADi symbols.

    Raises:
        QueryError: If the function cannot take symbols, or returns another shape, other symbols or NaN.
    """
    import casadi as ca

    try:
        value = function(*symbols)
        value = ca.vertcat(*value) if isinstance(value, list | tuple) else ca.SX(value)
        kernel = ca.Function("traced", list(symbols), [value])
    except QueryError:
        raise
    except Exception as error:
        # whatever a user's function raises on symbols, the remedy is the same, and the cause stays attached
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise QueryError(
            f"{what} cannot be evaluated on CasADi symbols ({reason}); write it with casadi.sin, casadi.sqrt, … of q[i]"
        ) from error
    if value.shape != shape:
        raise QueryError(f"{what} must have shape {shape}, got {value.shape}")
    constants = [
        kernel.instruction_constant(i)
        for i in range(kernel.n_instructions())
        if kernel.instruction_id(i) == ca.OP_CONST
    ]
    if not np.isfinite(constants).all():
        # math.sin(q[0]) does not fail: Python makes NaN of the symbol
        raise QueryError(f"{what} contains a constant that is not finite; use casadi.sin and its like, not math.sin")
    return value


def _symbols(n: int) -> tuple[Any, Any, Any]:
    import casadi as ca

    return ca.SX.sym("t"), ca.SX.sym("q", n), ca.SX.sym("v", n)


def _why_no_coriolis(K: Any, p: Any, M: Any, t: Any, v: Any) -> str:
    """Why K is not ½ vᵀ M(q) v as it is written, or ""."""
    import casadi as ca

    if ca.depends_on(M, v):
        return "K as written is not quadratic in v (square a speed with ca.sumsqr rather than ca.norm_2)"
    if ca.depends_on(K, t):
        return "K depends on t"
    at_rest = ca.substitute(ca.vertcat(K, p), v, ca.SX.zeros(v.shape))
    return "" if at_rest.is_zero() else "K has terms that remain, or are linear, at small v, as of a moving constraint"


def _christoffel(M: Any, q: Any, v: Any) -> Any:
    """C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k = ½ (Ṁ + W − Wᵀ) with W = ∂(M v)/∂q at fixed v."""
    import casadi as ca

    rate = ca.jtimes(M, q, v)
    W = ca.jacobian(M @ v, q)
    return (rate + W - W.T) / 2


def _batches(name: str, ours: tuple[int, ...], theirs: tuple[int, ...]) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(ours, theirs)
    except ValueError:
        raise QueryError(f"batch axes of {name} {ours} do not match {theirs} of the other arguments") from None


def _finite(result: np.ndarray) -> np.ndarray:
    if not np.isfinite(result).all():
        raise OverflowedError("the result is not finite: the energies or their derivatives are singular at this state")
    return result
