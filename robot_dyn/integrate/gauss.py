"""Gauss–Legendre collocation: implicit Runge–Kutta methods of s stages and order 2 s, symmetric and symplectic.

    k_i = f(t + c_i h, y + h Σ_j a_ij k_j),    y⁺ = y + h Σ_i b_i k_i,    Pₛ(2 c_i − 1) = 0

They preserve every quadratic invariant, and the energy of a Hamiltonian system in (q, p) up to a bounded O(h²ˢ). The
stage iteration continues until rounding dominates: ending it earlier is a systematic error that makes energy drift.
[Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., 2006, II.1.3, IV.2.1, VI.4 and VIII.6]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array, Scalar, midpoint, radius
from robot_dyn.foundations.errors import OverflowedError, QueryError
from robot_dyn.foundations.validate import integer
from robot_dyn.foundations.values import aligned
from robot_dyn.integrate.integrator import (
    FixedStepper,
    IntegrationError,
    PlainMethod,
    RightSide,
    States,
    System,
    arithmetic_like,
)
from robot_dyn.integrate.primitives import GOING, MAX_ITERATIONS, SETTLED, combination, evaluate, settle
from robot_dyn.integrate.tableau import ButcherTableau, Coefficients, Surd, combine

_INFLATION = 1.1  # Rump's ε-inflation: more than the rounding, less than 1 / the rate of contraction


def _surd(rational: tuple[int, int], factor: tuple[int, int], radicand: int) -> Surd:
    return Surd(Fraction(*rational), Fraction(*factor), radicand)


_TABLEAUS = {
    # the implicit midpoint rule
    2: ButcherTableau(a=((Fraction(1, 2),),), b=(1,), c=(Fraction(1, 2),), order=2),
    # Hammer and Hollingsworth, 1955. HLW, table II.1.1
    4: ButcherTableau(
        a=(
            (Fraction(1, 4), _surd((1, 4), (-1, 6), 3)),
            (_surd((1, 4), (1, 6), 3), Fraction(1, 4)),
        ),
        b=(Fraction(1, 2), Fraction(1, 2)),
        c=(_surd((1, 2), (-1, 6), 3), _surd((1, 2), (1, 6), 3)),
        order=4,
    ),
    # Kuntzmann and Butcher. HLW, table II.1.1
    6: ButcherTableau(
        a=(
            (Fraction(5, 36), _surd((2, 9), (-1, 15), 15), _surd((5, 36), (-1, 30), 15)),
            (_surd((5, 36), (1, 24), 15), Fraction(2, 9), _surd((5, 36), (-1, 24), 15)),
            (_surd((5, 36), (1, 30), 15), _surd((2, 9), (1, 15), 15), Fraction(5, 36)),
        ),
        b=(Fraction(5, 18), Fraction(4, 9), Fraction(5, 18)),
        c=(_surd((1, 2), (-1, 10), 15), Fraction(1, 2), _surd((1, 2), (1, 10), 15)),
        order=6,
    ),
}


class Increments(NamedTuple):
    """The increments Z_i = h k_i of a step, (s, m, W), and the arrays of their iteration; see `settle`."""

    K: Array
    Z: Array
    new: Array
    least: Array
    stale: Array
    state: Array
    epsilon: float


def gauss_step(f: RightSide, tableau: Coefficients, work: Increments, t: Scalar, h: Scalar, x: States) -> int:
    """Take a step of a Gauss method; see `FixedStepper` for the arguments."""
    y, after, Z, m, s = x.y, x.after, work.Z, len(x.y), len(tableau.c)
    Z[...] = tableau.zero
    work.least[...], work.stale[...], work.state[...] = np.inf, 0, GOING
    rounds, going = 0, 1
    while going > 0 and rounds < MAX_ITERATIONS:
        for i in range(s):
            combination(after, y, tableau.one, tableau.a[i], Z, s)
            evaluate(f.rate, t + tableau.c[i] * h, after, x.p, x.run_parameters, work.K[0])
            np.multiply(work.K[0, :m], h, work.new[i])
        going = settle(Z, work.new, y, work.least, work.stale, work.state, work.epsilon)
        rounds += 1
    combination(after, y, tableau.one, tableau.b, Z, s)
    for run in range(len(x.failed)):
        x.failed[run] = work.state[run] != SETTLED
    return s * rounds


@final
@dataclass(frozen=True)
class GaussLegendre(PlainMethod):
    """Gauss–Legendre collocation of order 2, 4 or 6, with stages solved to rounding by fixed-point iteration.

    The iteration converges if h is short compared with the fastest motion: h L ‖A‖ < 1, with the Lipschitz constant L
    of f. It may take up to MAX_ITERATIONS (100) rounds. The method is A-stable, but this iteration does not suit stiff
    systems. In balls the step contains an exact solution of the stage equations, proven by Brouwer's theorem.

    Attributes:
        order: Order of the method, 2, 4 or 6.

    Raises:
        QueryError: If the order is not 2, 4 or 6.
    """

    order: int
    name: str = field(init=False)
    evaluations_per_step: int | None = field(default=None, init=False)
    canonical: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if integer("order", self.order) not in _TABLEAUS:
            raise QueryError(f"order of a Gauss method must be 2, 4 or 6, got {self.order!r}")
        object.__setattr__(self, "name", f"GaussLegendre{self.order}")

    @property
    def tableau(self) -> ButcherTableau:
        """Coefficients of the method."""
        return _TABLEAUS[self.order]

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> FixedStepper:
        s = len(self.tableau.b)
        K, Z, new = (aligned(shape, kind.dtype) for shape in ((1, rows, runs), (s, m, runs), (s, m, runs)))
        stale, state = np.empty(runs, np.int64), np.empty(runs, np.int64)
        least, epsilon = np.empty((m, runs)), float(unit_roundoff(K))
        work = Increments(K=K, Z=Z, new=new, least=least, stale=stale, state=state, epsilon=epsilon)
        return FixedStepper(gauss_step, self.tableau.arrays(kind), work)

    def step(self, system: System, t: Scalar, y: Array, h: Scalar) -> Array:
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # an iteration that diverges is reported
                after, failed, work = self.stepped(system, t, y, h)
        except OverflowedError:
            raise self.not_found(t, h) from None
        if failed.any():
            raise self.not_found(t, h)
        return after if y.dtype != object else self._enclosed(system, t, y, h, work.Z)

    def _enclosed(self, system: System, t: Scalar, y: Array, h: Scalar, Z: Array) -> Array:
        """Return the step in balls, from approximate increments (s, m, B) near a solution."""
        kind = arithmetic_like(y)
        a, b, c, *_ = self.tableau.arrays(kind)
        h, times = kind.number(h), [t + node * kind.number(h) for node in c]

        def update(x: Array) -> Array:
            return np.stack([system.rate(at, y + combine(row, x)) * h for at, row in zip(times, a, strict=True)])

        x = enclose_fixed_point(update, np.stack([stage.T.reshape(y.shape) for stage in Z]))
        if x is None:
            raise self.not_found(t, h)
        return y + combine(b, x)

    def not_found(self, t: Scalar, h: Scalar) -> IntegrationError:
        return IntegrationError(
            f"{self.name}: the stages of the step {float(h)} at t = {float(t)} do not converge in "
            f"{MAX_ITERATIONS} iterations; use a smaller step, or a method for stiff systems",
            t,
        )


def enclose_fixed_point(update: Callable[[Array], Array], x: Array) -> Array | None:
    """Return balls that are proven to contain a fixed point of Φ, near an approximate one.

    The stages of a step are a fixed point. A box that Φ maps into its interior contains a fixed point, by Brouwer's
    theorem, and every further image of the box contains it too.

    Args:
        update: Φ, in balls.
        x: Exact balls near the fixed point.

    Returns:
        The enclosure; None if no box is mapped into itself within MAX_ITERATIONS.

    Source: Rump, Verification methods, Acta Numerica 19, 2010, section 13.
    """
    box = update(x)
    for _ in range(MAX_ITERATIONS):
        inflated = _inflate(box)
        box = update(inflated)
        if all(outer.contains_interior(inner) for outer, inner in zip(inflated.flat, box.flat, strict=True)):
            break
    else:
        return None
    for _ in range(MAX_ITERATIONS):
        closer = update(box)
        if not (radius(closer) < 0.9 * radius(box)).any():
            break
        box = closer
    return box


def _inflate(box: Array) -> Array:
    """Return slightly wider balls, of positive radius."""
    from flint import arb

    least = 8 * unit_roundoff(box) * max(_sizes(box).max(), 1e-300)
    result = np.empty_like(box)
    result.flat[:] = [arb(ball.mid(), _INFLATION * float(ball.rad().upper()) + least) for ball in box.flat]
    return result


def _sizes(x: Array) -> np.ndarray:
    """Return the largest absolute value of each entry over stages and batch, shape (m,)."""
    return np.abs(x if x.dtype != object else midpoint(x)).reshape(-1, x.shape[-1]).max(axis=0)


def unit_roundoff(x: Array) -> float | np.floating:
    """Return the unit roundoff of the arithmetic of an array."""
    if x.dtype != object:
        return np.finfo(x.dtype).eps
    from flint import ctx

    return 2.0**-ctx.prec
