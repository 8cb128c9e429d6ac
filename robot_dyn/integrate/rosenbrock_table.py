"""Coefficients of Rosenbrock methods as data, and the coefficients of Rodas5P.

[Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.7, (7.25)]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array

Row = tuple[float, ...]


class Numbers(NamedTuple):
    """The coefficients in one arithmetic.

    Attributes:
        a, c: Weights of earlier stages, (s, s).
        m: Weights, (s,).
        alpha: α_i, (s,).
        f: Weights of f at the start, of h ∂f/∂t, and of the latest f, for each stage, (s, 3).
        dense: Weights of the dense output, (3, s), see `between`.
        gamma, one: γ and 1.
        last: Weights that select ∂f/∂t among the m + 1 derivatives, (m + 1,).
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
    """Coefficients of a Rosenbrock method in the form with u_i instead of k_i, which needs no product with J.

    Attributes:
        gamma: γ = γ_ii.
        a, c: Coefficients of earlier stages, one row per stage.
        m: Weights.
        alpha: α_i, the time of each stage.
        gammas: γ_i = Σ_j γ_ij, the weights of ∂f/∂t.
        dense: h_0, h_1, h_2, weights of the dense output.
        order: Order stated by the source; the tests check its conditions.
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
        """Return the coefficients as arrays, for states of `size` entries."""
        s, dtype = len(self.m), kind.dtype
        a, c = (np.array([[*row, *[0.0] * (s - len(row))] for row in table], dtype) for table in (self.a, self.c))
        m, alpha = np.array(self.m, dtype), np.array(self.alpha, dtype)
        first = np.arange(s) == 0
        f = np.column_stack([first, self.gammas, ~first]).astype(dtype)
        h0, h1, h2 = np.array(self.dense)
        dense = np.stack([h0, h1 + h2, -h2]).astype(dtype)
        last = np.eye(size + 1, dtype=dtype)[-1]
        gamma, one = kind.number(self.gamma), kind.number(1)
        return Numbers(a=a, c=c, m=m, alpha=alpha, f=f, dense=dense, gamma=gamma, one=one, last=last)


_FIFTH = (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946)

# Rodas5P: eight stages, stiffly accurate, R(∞) = 0, dense output of order 4; its order reduction for stiff problems is
# smaller than in related methods.
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
