"""Particles in generalised coordinates: positions r_i(t, q), forces F_i, and the generalised forces Q_j.

    Q_j = Σ_i F_i · ∂r_i/∂q_j,   ṙ_i = (∂r_i/∂q) v + ∂r_i/∂t,   K = Σ_i ½ m_i ‖ṙ_i‖²

N particles with k holonomic constraints, which may move, have 3N − k coordinates q. [Goldstein, 3rd ed., §1.4]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations.errors import OverflowedError, QueryError
from robot_dyn.foundations.validate import integer, number, numbers
from robot_dyn.lagrange.euler_lagrange import EulerLagrange, euler_lagrange, traced

if TYPE_CHECKING:
    import casadi as ca

    from robot_dyn.lagrange.euler_lagrange import Potential

    Positions = Callable[[ca.SX, ca.SX], Sequence[object]]


@final
@dataclass(frozen=True, eq=False)
class GeneralizedForce:
    """Map from forces on N particles to generalised forces on n coordinates; built by `generalized_force`.

    Arguments are t in [s] and q (n,). The methods raise QueryError for a wrong shape or a non-finite value.

    Attributes:
        n: Number of coordinates.
        count: Number of particles N.
        kernels: CasADi functions of (t, q) by name.
    """

    n: int
    count: int
    kernels: dict[str, ca.Function]

    def __call__(self, t: float, q: ArrayLike, forces: ArrayLike) -> np.ndarray:
        """Return Q_j = Σ_i F_i · ∂r_i/∂q_j, shape (n,); the virtual work Σ F_i · δr_i is Q · δq.

        Args:
            t: Time, in [s].
            q: Coordinates, shape (n,).
            forces: Forces F_i, shape (N, 3), in [N].
        """
        forces = numbers("forces", forces, (self.count, 3))
        return np.einsum("ik,ikj->j", forces, self.jacobian(t, q))

    def positions(self, t: float, q: ArrayLike) -> np.ndarray:
        """Return r_i, shape (N, 3), in [m]."""
        return self._evaluate("r", t, q).reshape(self.count, 3)

    def jacobian(self, t: float, q: ArrayLike) -> np.ndarray:
        """Return ∂r_i/∂q_j at index [i, :, j], shape (N, 3, n)."""
        return self._evaluate("J", t, q).reshape(self.count, 3, self.n)

    def _evaluate(self, name: str, t: Any, q: Any) -> np.ndarray:
        result = self.kernels[name](number("t", t), numbers("q", q, (self.n,))).full()
        if not np.isfinite(result).all():
            raise OverflowedError("positions or their derivatives are not finite at this q; choose another")
        return result


def generalized_force(positions: Positions, n: int) -> GeneralizedForce:
    """Return the map from forces on particles to generalised forces, Q_j = Σ_i F_i · ∂r_i/∂q_j.

    Args:
        positions: Function r(t, q) that returns N vectors of 3, of CasADi symbols as in `euler_lagrange`.
        n: Number of coordinates.

    Raises:
        QueryError: If n is not a positive integer, or a position cannot be evaluated or is not a 3-vector.

    Source: Goldstein, 3rd ed., eq. 1.49.
    """
    import casadi as ca

    n = integer("n, the number of coordinates,", n, least=1, most=1000)
    t, q = ca.SX.sym("t"), ca.SX.sym("q", n)
    r = _positions(positions, t, q)
    expressions = {"r": r, "J": ca.jacobian(r, q)}
    kernels = {name: ca.Function(name, [t, q], [ca.densify(x)]) for name, x in expressions.items()}
    return GeneralizedForce(n, r.shape[0] // 3, kernels)


def lagrangian_of_particles(
    masses: Sequence[float],
    positions: Positions,
    n: int,
    *,
    gravity: ArrayLike = (0.0, 0.0, 0.0),
    potential: Potential | None = None,
) -> EulerLagrange:
    """Return the equation of motion of N particles at r_i(t, q), which satisfies fixed or moving constraints.

        K = Σ ½ m_i ‖(∂r_i/∂q) v + ∂r_i/∂t‖²,   V = V_extra − Σ m_i gᵀ r_i

    Args:
        masses: Masses m_i, N positive numbers, in [kg].
        positions: Function r(t, q) that returns N vectors of 3, in [m], of CasADi symbols.
        n: Number of coordinates, 3N − k.
        gravity: Acceleration of free fall g, shape (3,), in [m/s²].
        potential: Function V_extra(t, q) in [J], for example of springs between the particles.

    Raises:
        QueryError: If a shape is wrong, a mass is not positive, or a function cannot be evaluated.
    """
    import casadi as ca

    m, g = numbers("masses", masses, ("N",), above=0), numbers("gravity", gravity, (3,))
    weights = ca.DM(np.repeat(m, 3))

    def kinetic(t: Any, q: Any, v: Any) -> Any:
        r = placed(t, q)
        velocity = ca.jacobian(r, q) @ v + ca.jacobian(r, t)
        return ca.dot(weights * velocity, velocity) / 2

    def total_potential(t: Any, q: Any) -> Any:
        extra = 0 if potential is None else potential(t, q)
        return extra - ca.dot(weights * ca.DM(np.tile(g, len(m))), placed(t, q))

    def placed(t: Any, q: Any) -> Any:
        r = _positions(positions, t, q)
        if r.shape[0] != 3 * len(m):
            raise QueryError(f"got {len(m)} masses but {r.shape[0] // 3} positions; give one mass per particle")
        return r

    return euler_lagrange(kinetic, total_potential, n)


def _positions(positions: Positions, t: Any, q: Any) -> Any:
    """Return all positions stacked, (3N, 1)."""
    import casadi as ca

    try:
        vectors = list(positions(t, q))
    except QueryError:
        raise
    except Exception as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise QueryError(f"positions(t, q) cannot be evaluated on CasADi symbols ({reason})") from error
    if not vectors:
        raise QueryError("positions(t, q) must return at least one particle")
    return ca.vertcat(*(traced(f"position {i}", lambda *_, r=r: r, (t, q), (3, 1)) for i, r in enumerate(vectors)))
