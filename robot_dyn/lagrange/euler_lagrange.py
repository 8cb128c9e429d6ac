"""Lagrange's equations for any energies, d/dt ∂L/∂v − ∂L/∂q = Q with L = K(t, q, v) − V(t, q) and v = dq/dt.

    M a + b = Q,   M = ∂²K/∂v²,   b = (∂²K/∂v∂q) v + ∂²K/∂v∂t − ∂K/∂q + ∂V/∂q

The derivatives are exact, by CasADi's automatic differentiation of the user's functions. K need not be quadratic in v:
moving constraints and relativistic particles are allowed.
[Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., 2002, ch. 1 and 2]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations.arithmetic import apply
from robot_dyn.foundations.errors import MissingTimeError, OverflowedError, QueryError, RobotDynError, SingularError
from robot_dyn.foundations.linear_algebra import NotPositiveDefiniteError, cholesky_solve
from robot_dyn.foundations.validate import integer, rows
from robot_dyn.lagrange.formula import formula

if TYPE_CHECKING:
    import casadi as ca

    Kinetic = Callable[[ca.SX, ca.SX, ca.SX], object]
    Potential = Callable[[ca.SX, ca.SX], object]


@final
@dataclass(frozen=True, eq=False)
class EulerLagrange:
    """The equation of motion M(t, q, v) a + b(t, q, v) = Q of a system of n coordinates; built by `euler_lagrange`.

    All methods accept q, v, a, Q (..., n) in the units of the coordinates, and times t (...) in [s], which are required
    if the result depends on the time. They raise QueryError for a wrong shape or a non-finite value, MissingTimeError
    for a missing t, and OverflowedError if the energies are not finite.

    Attributes:
        n: Number of coordinates.
        kernels: CasADi functions of (t, q, v) by name.
        timed: Names of the kernels that depend on t.
        no_coriolis: Reason why C is undefined, or "" if it is defined.
    """

    n: int
    kernels: Mapping[str, ca.Function]
    timed: frozenset[str]
    no_coriolis: str

    def M(self, q: ArrayLike, v: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return the mass matrix ∂²K/∂v², symmetric, shape (..., n, n); it depends on v unless K is quadratic in v."""
        return self._evaluate("M", t, q, v, shape=(self.n, self.n))

    def C(self, q: ArrayLike, v: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return the Coriolis matrix of the Christoffel symbols, shape (..., n, n): Ṁ = C + Cᵀ and M a + C v + N = Q.

        C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k

        Raises:
            RobotDynError: If K is not ½ vᵀ M(q) v; no C of this form then satisfies b = C v + N.

        Source: Murray, Li, Sastry 1994, eq. 4.23.
        """
        if self.no_coriolis:
            raise RobotDynError(f"no Coriolis matrix: {self.no_coriolis}; use bias(q, v), which every K has")
        return self._evaluate("C", t, q, v, shape=(self.n, self.n))

    def N(self, q: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return the gradient of the potential ∂V/∂q, shape (..., n)."""
        return self._evaluate("N", t, q, shape=(self.n,))

    def bias(self, q: ArrayLike, v: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return Q for a = 0: b = (∂²K/∂v∂q) v + ∂²K/∂v∂t − ∂K/∂q + ∂V/∂q, shape (..., n)."""
        return self._evaluate("bias", t, q, v, shape=(self.n,))

    def momentum(self, q: ArrayLike, v: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return the generalised momentum p = ∂K/∂v, shape (..., n); ṗ = ∂L/∂q + Q."""
        return self._evaluate("momentum", t, q, v, shape=(self.n,))

    def kinetic_energy(self, q: ArrayLike, v: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return K in [J], shape (...)."""
        return self._evaluate("K", t, q, v, shape=())

    def potential_energy(self, q: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return V in [J], shape (...)."""
        return self._evaluate("V", t, q, shape=())

    def energy(self, q: ArrayLike, v: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return K + V in [J], shape (...); not constant if a moving constraint does work."""
        return self.kinetic_energy(q, v, t=t) + self.potential_energy(q, t=t)

    def jacobi_integral(self, q: ArrayLike, v: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return Jacobi's integral h = vᵀ p − L in [J], shape (...).

        It is constant if Q = 0 and ∂L/∂t = 0, and equals K + V if K = ½ vᵀ M v.

        Source: Goldstein, 3rd ed., §2.7.
        """
        return self._evaluate("jacobi", t, q, v, shape=())

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return the generalised force Q = M a + b, shape (..., n)."""
        a = rows("a", a, self.n)
        M, b = self.M(q, v, t=t), self.bias(q, v, t=t)
        _batches("a", a.shape[:-1], b.shape[:-1])
        return _finite(apply(M, a) + b)

    def forward_dynamics(self, q: ArrayLike, v: ArrayLike, Q: ArrayLike, *, t: ArrayLike | None = None) -> np.ndarray:
        """Return the acceleration a = M⁻¹ (Q − b), shape (..., n).

        Raises:
            SingularError: If M is not positive definite at this state, for example Euler angles in gimbal lock.
        """
        Q = rows("Q", Q, self.n)
        M, b = self.M(q, v, t=t), self.bias(q, v, t=t)
        batch = _batches("Q", Q.shape[:-1], b.shape[:-1])
        try:
            a = cholesky_solve(np.broadcast_to(M, (*batch, self.n, self.n)), np.broadcast_to(Q - b, (*batch, self.n)))
        except NotPositiveDefiniteError as error:
            raise SingularError(f"q[{error.row}]", "at this state; use other coordinates near it") from None
        return _finite(a)

    def __str__(self) -> str:
        """Return M a + b = Q with the nonzero entries as formulas in t, q1, …, v1, …; of M only the upper triangle."""
        import casadi as ca

        t, (q, v) = ca.SX.sym("t"), (ca.vertcat(*(ca.SX.sym(f"{x}{k + 1}") for k in range(self.n))) for x in "qv")
        M, b = self.kernels["M"](t, q, v).reshape((self.n, self.n)), self.kernels["bias"](t, q, v)
        comma = "," if self.n > 9 else ""
        entries = {f"M{i + 1}{comma}{j + 1}": M[i, j] for i in range(self.n) for j in range(i, self.n)}
        entries |= {f"b{i + 1}": b[i] for i in range(self.n)}
        lines = [f"{name} = {formula(x)}" for name, x in entries.items() if not x.is_zero()]
        return "\n".join(["M a + b = Q", *lines])

    def _evaluate(self, name: str, t: Any, q: Any, v: Any = None, *, shape: tuple[int, ...]) -> np.ndarray:
        if t is None and name in self.timed:
            raise MissingTimeError("the energies depend on the time: pass t=, in [s]")
        t, q = rows("t", 0.0 if t is None else t), rows("q", q, self.n)
        v = np.zeros(self.n) if v is None else rows("v", v, self.n)
        batch = _batches("v", v.shape[:-1], _batches("t", t.shape, q.shape[:-1]))
        size = int(np.prod(batch))
        columns = [
            np.broadcast_to(x, (*batch, width)).reshape(size, width).T
            for x, width in ((t[..., None], 1), (q, self.n), (v, self.n))
        ]
        if size == 0:
            return np.zeros((*batch, *shape))
        values = self.kernels[name](*columns).full().T  # CasADi uses one column per state
        return _finite(values.reshape((*batch, *shape))[()])


def euler_lagrange(kinetic: Kinetic, potential: Potential | None, n: int) -> EulerLagrange:
    """Return the equation of motion for the energies K(t, q, v) and V(t, q).

    The energies are Python functions of CasADi symbols: `import casadi as ca`, then ca.sin(q[0]), ca.sqrt(…),
    v[0] ** 2. They receive t as a scalar and q, v as columns (n, 1) of symbols, and return a scalar in [J].

        pendulum = euler_lagrange(lambda t, q, v: m * l**2 * v[0] ** 2 / 2, lambda t, q: -m * g * l * ca.cos(q[0]), 1)

    Args:
        kinetic: K(t, q, v); t is used by moving constraints.
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
    timed = frozenset(name for name, x in results.items() if ca.depends_on(ca.densify(ca.vec(x)), t))
    return EulerLagrange(n, kernels, timed, no_coriolis)


def traced(
    name: str, function: Callable[..., object], symbols: tuple[ca.SX, ...], shape: tuple[int, int] = (1, 1)
) -> ca.SX:
    """Return the expression that a user's function returns for CasADi symbols.

    Raises:
        QueryError: If the function cannot take symbols, or returns another shape, other symbols or NaN.
    """
    import casadi as ca

    try:
        value: Any = function(*symbols)
        value = ca.vertcat(*value) if isinstance(value, list | tuple) else ca.SX(value)
        kernel = ca.Function("traced", list(symbols), [value])
    except QueryError:
        raise
    except Exception as error:
        # the remedy is the same for all exceptions in a user's function; the original one stays attached
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise QueryError(
            f"{name} cannot be evaluated on CasADi symbols ({reason}); write it with casadi.sin, casadi.sqrt, … of q[i]"
        ) from error
    if value.shape != shape:
        raise QueryError(f"{name} must have shape {shape}, got {value.shape}")
    constants = [
        kernel.instruction_constant(i)
        for i in range(kernel.n_instructions())
        if kernel.instruction_id(i) == ca.OP_CONST
    ]
    if not np.isfinite(constants).all():
        # math.sin(q[0]) does not raise: Python converts the symbol to NaN
        raise QueryError(f"{name} contains a constant that is not finite; use casadi.sin instead of math.sin")
    return value


def _symbols(n: int) -> tuple[Any, Any, Any]:
    import casadi as ca

    return ca.SX.sym("t"), ca.SX.sym("q", n), ca.SX.sym("v", n)


def _why_no_coriolis(K: Any, p: Any, M: Any, t: Any, v: Any) -> str:
    """Return the reason why K as written is not ½ vᵀ M(q) v, or ""."""
    import casadi as ca

    if ca.depends_on(M, v):
        return "K as written is not quadratic in v (square a speed with ca.sumsqr rather than ca.norm_2)"
    if ca.depends_on(K, t):
        return "K depends on t"
    at_rest = ca.substitute(ca.vertcat(K, p), v, ca.SX.zeros(v.shape))
    return (
        ""
        if at_rest.is_zero()
        else "K has terms that are constant or linear in v, for example from a moving constraint"
    )


def _christoffel(M: Any, q: Any, v: Any) -> Any:
    """Return ½ (Ṁ + W − Wᵀ) = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k with W = ∂(M v)/∂q at fixed v."""
    import casadi as ca

    rate = ca.jtimes(M, q, v)
    W = ca.jacobian(M @ v, q)
    return (rate + W - W.T) / 2


def _batches(name: str, ours: tuple[int, ...], theirs: tuple[int, ...]) -> tuple[int, ...]:
    """Return the common batch shape; raise QueryError if there is none."""
    try:
        return np.broadcast_shapes(ours, theirs)
    except ValueError:
        raise QueryError(f"batch axes of {name}, {ours}, do not match {theirs} of the other arguments") from None


def _finite(result: np.ndarray) -> np.ndarray:
    if not np.isfinite(result).all():
        raise OverflowedError(
            "the result is not finite: the energies or their derivatives are singular at this state; use another state"
        )
    return result
