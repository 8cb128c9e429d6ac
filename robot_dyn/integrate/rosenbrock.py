"""Rosenbrock methods: one matrix a step, one linear system a stage, no iteration.

    (1 − h γ J) u_i = h γ f(t + α_i h, y + Σ_{j<i} a_ij u_j) + γ Σ_{j<i} c_ij u_j + γ γ_i h² ∂f/∂t
    y⁺ = y + Σ_i m_i u_i,   y(t + θ h) = y + θ (y⁺ − y) + θ (1 − θ) Σ_i (h_0i + θ (h_1i + θ h_2i)) u_i

with J = ∂f/∂y and ∂f/∂t at (t, y); y⁺ without its last u_i is of an order less. [Hairer, Wanner, Solving Ordinary
Differential Equations II, 2nd ed., 1996, IV.7, (7.25)]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.arithmetic import FLOAT64, Arithmetic, Array
from robot_dyn.errors import QueryError
from robot_dyn.integrate.integrator import IntegrationError, PlainMethod, RightSide, Stepper
from robot_dyn.integrate.primitives import combination, copy, evaluate, factor, norm, solve, subtract
from robot_dyn.integrate.step_control import ControlledStepper
from robot_dyn.values import aligned

Row = tuple[float, ...]


class Numbers(NamedTuple):
    """The coefficients in one arithmetic.

    Attributes:
        a, c: Of the stages before each, (s, s).
        m: Weights, (s,).
        alpha: α_i, (s,).
        f: Weights of f at the start, of h ∂f/∂t, and of the latest f, for each stage, (s, 3).
        dense: Weights of the polynomial between, (3, s), as of `between`.
        gamma, one: γ and 1.
        last: The weights that choose ∂f/∂t of the m + 1 derivatives, (m + 1,).
    """

    a: Array
    c: Array
    m: Array
    alpha: Array
    f: Array
    dense: Array
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
        dense: h_0, h_1, h_2, weights of the polynomial between.
        order: That the source states; its conditions are checked in the tests.
    """

    gamma: float
    a: tuple[Row, ...]
    c: tuple[Row, ...]
    m: Row
    alpha: Row
    gammas: Row
    dense: tuple[Row, Row, Row]
    order: int

    def numbers(self, kind: Arithmetic, size: int) -> Numbers:
        """The coefficients as arrays, for states of so many entries."""
        s, dtype = len(self.m), kind.dtype
        a, c = (np.array([[*row, *[0.0] * (s - len(row))] for row in each], dtype) for each in (self.a, self.c))
        m, alpha = (np.array(each, dtype) for each in (self.m, self.alpha))
        first = np.arange(s) == 0
        f = np.column_stack([first, self.gammas, ~first]).astype(dtype)
        h0, h1, h2 = np.array(self.dense)
        dense = np.stack([h0, h1 + h2, -h2]).astype(dtype)
        last = np.eye(size + 1, dtype=dtype)[-1]
        return Numbers(a, c, m, alpha, f, dense, kind.number(self.gamma), kind.number(1), last)


class Linear(NamedTuple):
    """The arrays of a step.

    Attributes:
        K: f at the start, h ∂f/∂t, and the latest f, (3, r, W).
        last: The latest f, (r, W).
        U: u_i, (s, m, W).
        J: ∂f/∂y_j for each j, then ∂f/∂t, (m + 1, m, W).
        A, rows: Factors of 1 − h γ J, (m, m, W), and the rows that they exchange, (m, W).
        known, zero: A right-hand side, and 0, (m, W).
        at, y: Time and state of J, (1,) and (m, W).
        F: Dense output of one run, (4, m, W), as of `between`.
        error: Local error of the entries whose error is bounded, (1, k, W).
    """

    K: Array
    last: Array
    U: Array
    J: Array
    A: Array
    rows: Array
    known: Array
    zero: Array
    at: Array
    y: Array
    F: Array
    error: Array


def begin(f: RightSide, table: Numbers, t: Any, y: Array, p: Array, run_parameters: Array, work: Linear) -> int:
    """What depends on t and y alone: f and its derivatives."""
    evaluate(f.rate, t, y, p, run_parameters, work.K[0])
    differentiate(f, t, y, p, run_parameters, work)
    return 1


def differentiate(f: RightSide, t: Any, y: Array, p: Array, run_parameters: Array, work: Linear) -> None:
    """The derivatives at t and y."""
    evaluate(f.jacobian, t, y, p, run_parameters, work.J)
    work.at[0] = t
    copy(work.y, y)


def stages(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """The step from there."""
    K, U, h_gamma = work.K, work.U, h * table.gamma
    factor(work.A, work.J, h_gamma, work.rows, lost)
    combination(K[1][: len(y)], work.zero, h, table.last, work.J, len(work.J))
    for i in range(len(table.m)):
        if i > 0:
            combination(after, y, table.one, table.a[i], U, i)
            evaluate(f.rate, t + table.alpha[i] * h, after, p, run_parameters, K[2])
        combination(work.known, work.zero, h_gamma, table.f[i], K, 3 if i > 0 else 2)
        combination(U[i], work.known, table.gamma, table.c[i], U, i)
        solve(work.A, work.rows, U[i])
    combination(after, y, table.one, table.m, U, len(table.m))
    return len(table.m) - 1


def rosenbrock_step(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """A step of a Rosenbrock method; arguments as of `Stepper`."""
    first = begin(f, table, t, y, p, run_parameters, work)
    return first + stages(f, table, t, h, y, p, run_parameters, after, work, lost)


def trial(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear,
    lost: Array,
) -> int:  # fmt: skip
    """A step from `begin`, or from the end of the last one; see `ControlledStepper`."""
    known = work.at[0] == t
    for e in range(len(y)):
        known &= work.y[e, 0] == y[e, 0]
    if not known:
        differentiate(f, t, y, p, run_parameters, work)
    return stages(f, table, t, h, y, p, run_parameters, after, work, lost)


def error(table: Numbers, h: Any, y: Array, after: Array, work: Linear, rtol: float, atol: float) -> float:
    """The norm of the last u_i, which the method of an order less is without; see `ControlledStepper`."""
    k = work.error.shape[1]
    return norm(work.U[len(work.U) - 1][:k], y[:k], after[:k], rtol, atol)


def accept(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear
) -> int:
    """The rate at the end; see `ControlledStepper`."""
    evaluate(f.rate, t + h, after, p, run_parameters, work.last)
    return 1


def dense(
    f: RightSide, table: Numbers, t: Any, h: Any, y: Array, p: Array, run_parameters: Array, after: Array, work: Linear
) -> int:
    """The polynomial between; see `ControlledStepper`."""
    F = work.F
    copy(F[0], after)
    subtract(F[0], y)
    for i in range(len(table.dense)):
        combination(F[i + 1], work.zero, table.one, table.dense[i], work.U, len(work.U))
    return 0


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
        return Stepper(rosenbrock_step, self.table.numbers(kind, m), self._work(kind, m, rows, runs, m))

    def controlled(self, m: int, rows: int, bounded: int) -> ControlledStepper:
        """The method with control of its error, as `dop853.stepper`."""
        table, work = self.table.numbers(FLOAT64, m), self._work(FLOAT64, m, rows, 1, bounded)
        return ControlledStepper(begin, trial, error, accept, dense, table, work, self.order)

    def _work(self, kind: Arithmetic, m: int, rows: int, runs: int, bounded: int) -> Linear:
        s, dtype = len(self.table.m), kind.dtype
        shapes = (3, rows), (s, m), (m + 1, m), (m, m), (4, m), (1, bounded)
        K, U, J, A, F, error = (aligned((*shape, runs), dtype) for shape in shapes)
        known, zero, y = aligned((3, m, runs), dtype)
        exchanged = np.zeros((m, runs), np.int64)
        return Linear(K, K[2], U, J, A, exchanged, known, zero, np.full(1, np.nan), y, F, error)

    def not_found(self, t: Any, h: Any) -> IntegrationError:
        return IntegrationError(
            f"{self.name}: 1 − h γ J is singular for the step {float(h)} at t = {float(t)}: take a smaller step", t
        )


_FIFTH = (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946)

# Rodas5P: eight stages, stiffly accurate, R(∞) = 0, dense output of order 4; stiffness reduces its order less than that
# of its relatives.
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
    dense=(
        (
            25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
            1.1241088310450404, 0.4272876194431874, -0.17202221070155493,
        ),
        (
            -9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044,
            15.98066361424651, -6.789040303419874, -6.710236069923372,
        ),
        (
            11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654,
            -59.78993625266729, -0.15582684282751913, 4.883087185713722,
        ),
    ),
    order=5,
)  # fmt: skip

ROSENBROCK_5 = Rosenbrock("rosenbrock_5", RODAS5P)
