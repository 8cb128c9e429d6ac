"""Rosenbrock methods: one matrix a step, one linear system a stage, no iteration.

    (1 − h γ J) u_i = h γ f(t + α_i h, y + Σ_{j<i} a_ij u_j) + γ Σ_{j<i} c_ij u_j + γ γ_i h² ∂f/∂t
    y⁺ = y + Σ_i m_i u_i

with J = ∂f/∂y and ∂f/∂t at (t, y). [Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.7,
(7.25)]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.arithmetic import Arithmetic, Array
from robot_dyn.errors import QueryError
from robot_dyn.integrate.integrator import IntegrationError, PlainMethod, RightSide, Stepper
from robot_dyn.integrate.primitives import combination, evaluate, factor, solve

Row = tuple[float, ...]


class Numbers(NamedTuple):
    """The coefficients in one arithmetic.

    Attributes:
        a, c: Of the stages before each, (s, s).
        m: Weights, (s,).
        alpha: α_i, (s,).
        f: Weights of f at the start, of h ∂f/∂t, and of the latest f, for each stage, (s, 3).
        gamma, one: γ and 1.
        last: The weights that choose ∂f/∂t of the m + 1 derivatives, (m + 1,).
    """

    a: Array
    c: Array
    m: Array
    alpha: Array
    f: Array
    gamma: Any
    one: Any
    last: Array


@final
@dataclass(frozen=True)
class RosenbrockTable:
    """Coefficients of a Rosenbrock method, for the u_i in place of the k_i: no product with J is needed.

    Attributes:
        gamma: γ = γ_ii.
        a, c: One row a stage, of the entries before it.
        m: Weights.
        alpha: α_i, where a stage is in time.
        gammas: γ_i = Σ_j γ_ij, the weights of ∂f/∂t.
        order: That the source states; its conditions are checked in the tests.
    """

    gamma: float
    a: tuple[Row, ...]
    c: tuple[Row, ...]
    m: Row
    alpha: Row
    gammas: Row
    order: int

    def numbers(self, kind: Arithmetic, size: int) -> Numbers:
        """The coefficients as arrays, for states of so many entries."""
        s, dtype = len(self.m), kind.dtype
        a, c = (np.array([[*row, *[0.0] * (s - len(row))] for row in each], dtype) for each in (self.a, self.c))
        m, alpha = (np.array(each, dtype) for each in (self.m, self.alpha))
        first = np.arange(s) == 0
        f = np.column_stack([first, self.gammas, ~first]).astype(dtype)
        return Numbers(a, c, m, alpha, f, kind.number(self.gamma), kind.number(1), np.eye(size + 1, dtype=dtype)[-1])


class Linear(NamedTuple):
    """The arrays of a step.

    Attributes:
        K: f at the start, h ∂f/∂t, and the latest f, (3, r, W).
        U: u_i, (s, m, W).
        J: ∂f/∂y_j for each j, then ∂f/∂t, (m + 1, m, W).
        A, rows: Factors of 1 − h γ J, (m, m, W), and the rows that they exchange, (m, W).
        known, zero: A right-hand side, and 0, (m, W).
    """

    K: Array
    U: Array
    J: Array
    A: Array
    rows: Array
    known: Array
    zero: Array


def start(f: RightSide, t: Any, y: Array, p: Array, own: Array, work: Linear) -> int:
    """What depends on t and y alone: f and its derivatives."""
    evaluate(f.rate, t, y, p, own, work.K[0])
    evaluate(f.jacobian, t, y, p, own, work.J)
    return 1


def stages(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, own: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """The step from there."""
    K, U, h_gamma = work.K, work.U, h * table.gamma
    factor(work.A, work.J, h_gamma, work.rows, lost)
    combination(K[1][: len(y)], work.zero, h, table.last, work.J, len(work.J))
    for i in range(len(table.m)):
        if i > 0:
            combination(after, y, table.one, table.a[i], U, i)
            evaluate(f.rate, t + table.alpha[i] * h, after, p, own, K[2])
        combination(work.known, work.zero, h_gamma, table.f[i], K, 3 if i > 0 else 2)
        combination(U[i], work.known, table.gamma, table.c[i], U, i)
        solve(work.A, work.rows, U[i])
    combination(after, y, table.one, table.m, U, len(table.m))
    return len(table.m) - 1


def rosenbrock_step(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, own: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """A step of a Rosenbrock method; arguments as of `Stepper`."""
    first = start(f, t, y, p, own, work)
    return first + stages(f, table, t, h, y, p, own, after, work, lost)


@final
@dataclass(frozen=True)
class Rosenbrock(PlainMethod):
    """The Rosenbrock method of a table, in floats.

    J is that of the start of a step: where the rate bends within less than a step changes, as dry friction of a narrow
    layer does when a joint comes to rest, a step does not see the bend ahead, and v chatters about 0 by h |a|. The
    order rests on an exact J, which machine code has; differences err by u^(2/3) = 4e-11 of it.
    """

    name: str
    table: RosenbrockTable
    order: int = field(init=False)
    evaluations_per_step: int | None = field(init=False)
    stiff: ClassVar[bool] = True
    needs_jacobian: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", self.table.order)
        object.__setattr__(self, "evaluations_per_step", len(self.table.m))

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> Stepper:
        if kind.dtype == object:
            raise QueryError(
                f"{self.name} works in floats, not in balls: convert y, or take an explicit or a Gauss method"
            )
        s, dtype = len(self.table.m), kind.dtype
        K, U, J, A = (
            np.empty(shape, dtype) for shape in ((3, rows, runs), (s, m, runs), (m + 1, m, runs), (m, m, runs))
        )
        known, zero = np.zeros((2, m, runs), dtype)
        work = Linear(K, U, J, A, np.empty((m, runs), np.int64), known, zero)
        return Stepper(rosenbrock_step, self.table.numbers(kind, m), work)

    def not_found(self, t: Any, h: Any) -> IntegrationError:
        return IntegrationError(
            f"{self.name}: 1 − h γ J is singular for the step {float(h)} at t = {float(t)}: take a smaller step", t
        )


_FIFTH = (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946)

# Rodas5P: eight stages, stiffly accurate, R(∞) = 0, of an order that stiffness reduces less than that of its relatives.
# Steinebach, Construction of Rosenbrock–Wanner method Rodas5P and numerical benchmarks within the Julia Differential
# Equations package, BIT Numerical Mathematics 63, 2023
RODAS5P = RosenbrockTable(
    gamma=0.21193756319429014,
    a=(
        (),
        (3.0,),
        (2.849394379747939, 0.45842242204463923),
        (-6.954028509809101, 2.489845061869568, -10.358996098473584),
        (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
        _FIFTH,
        (*_FIFTH, 1.0),
        (*_FIFTH, 1.0, 1.0),
    ),
    c=(
        (),
        (-14.155112264123755,),
        (-17.97296035885952, -2.859693295451294),
        (147.12150275711716, -1.41221402718213, 71.68940251302358),
        (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
        (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
        (
            30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
            -28.087943162872662,
        ),
        (
            37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
            -54.66780262877968, -9.48861652309627,
        ),
    ),
    m=(*_FIFTH, 1.0, 1.0, 1.0),
    alpha=(0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0),
    gammas=(
        0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0.0, 0.0,
        0.0,
    ),
    order=5,
)  # fmt: skip

ROSENBROCK_5 = Rosenbrock("rosenbrock_5", RODAS5P)
