"""Quantities of M(q) a + C(q, v) v + N(q) = τ as values: its arguments, its shape, and the terms whose rounding it has.

Engines, machine code, self check, cross-check, command line and tests iterate these values; each engine answers a
quantity by the method of its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array

DOUBTFUL = 1e10  # of ‖a‖: M may be singular at this q, which rounding hides
MOST_DIGITS = 20  # of an answer that are counted

State = Mapping[str, Array]


def _no_terms(size: Any, x: State) -> Any:
    """The terms of a quantity without contributions of rigid bodies."""
    return 0.0


@final
@dataclass(frozen=True)
class Quantity:
    """A quantity, which an engine answers by the method of that name.

    Attributes:
        name: Of the method.
        arguments: Names of its arguments, each of shape (..., n); "t" is a time.
        axes: Its shape for one state: numbers, or letters for those of a robot (`sizes`), "n" its degrees of freedom,
            "p" its inertial parameters.
        terms: Sum of the absolute values of the terms added into each entry, of `lagrange.magnitude.Magnitudes` at q
            and the absolute values of the arguments by name. Where M a = τ is solved, of the entries of that τ.
        framed: Whether it is a quantity of a frame.
        definite: Whether it is a symmetric positive definite matrix, so that |x_ij| ≤ √(x_ii x_jj).
        solves: Whether M a = τ is solved for it: no answer where M is singular, an error that grows as M's condition.
        doubtful: Size of a result above which M may be singular.
    """

    name: str
    arguments: tuple[str, ...]
    axes: tuple[int | str, ...] = ()
    terms: Callable[[Any, State], Any] = _no_terms
    framed: bool = False
    definite: bool = False
    solves: bool = False
    doubtful: float = inf

    def shape(self, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """Its shape for one state of a robot of those sizes."""
        return tuple(axis if isinstance(axis, int) else sizes[axis] for axis in self.axes)

    def ask(self, engine: Any, state: State, *frame: str) -> Any:
        """The answer of an engine at a state, arguments by name."""
        return getattr(engine, self.name)(*(state[name] for name in self.arguments), *frame)


def _solved_torque(size: Any, x: State) -> Any:
    """Of τ − C v − N."""
    return size.inverse_dynamics(x["v"], np.zeros_like(x["v"])) + x["tau"]


M = Quantity("M", ("q",), ("n", "n"), lambda size, x: size.M, definite=True)
C = Quantity("C", ("q", "v"), ("n", "n"), lambda size, x: size.C(x["v"]))
N = Quantity("N", ("q",), ("n",), lambda size, x: size.N)
CORIOLIS_TORQUE = Quantity("coriolis_torque", ("q", "v"), ("n",), lambda size, x: size.C(x["v"]) @ x["v"])
CORIOLIS_TRANSPOSE = Quantity("coriolis_transpose", ("q", "v"), ("n",), lambda size, x: size.C(x["v"]).T @ x["v"])
INVERSE_DYNAMICS = Quantity(
    "inverse_dynamics", ("q", "v", "a"), ("n",), lambda size, x: size.inverse_dynamics(x["v"], x["a"])
)
FORWARD_DYNAMICS = Quantity(
    "forward_dynamics", ("q", "v", "tau"), ("n",), _solved_torque, solves=True, doubtful=DOUBTFUL
)
KINETIC_ENERGY = Quantity("kinetic_energy", ("q", "v"), (), lambda size, x: x["v"] @ size.M @ x["v"] / 2)
POTENTIAL_ENERGY = Quantity("potential_energy", ("q",), (), lambda size, x: size.V)
MOMENTUM = Quantity("momentum", ("q", "v"), ("n",), lambda size, x: size.M @ x["v"])
REGRESSOR = Quantity("regressor", ("q", "v", "a"), ("n", "p"), lambda size, x: size.regressor(x["v"], x["a"]))
PLACEMENT = Quantity("placement", ("q",), (4, 4), framed=True)
JACOBIAN = Quantity("jacobian", ("q",), (6, "n"), framed=True)
JACOBIAN_RATE = Quantity("jacobian_rate", ("q", "v"), (6, "n"), framed=True)
MASS_MATRIX_DERIVATIVE = Quantity("mass_matrix_derivative", ("q",), ("n", "n", "n"), lambda size, x: size.dM)
FORWARD_DYNAMICS_DERIVATIVES = Quantity(
    "forward_dynamics_derivatives", ("q", "v", "tau"), (3, "n", "n"), _solved_torque, solves=True
)


def by_name(*quantities: Quantity) -> dict[str, Quantity]:
    """Quantities by their names."""
    return {each.name: each for each in quantities}


# what every Robot, Lagrangian and CompiledDynamics answers
EQUATION = by_name(
    M,
    C,
    N,
    CORIOLIS_TORQUE,
    CORIOLIS_TRANSPOSE,
    INVERSE_DYNAMICS,
    FORWARD_DYNAMICS,
    KINETIC_ENERGY,
    POTENTIAL_ENERGY,
    MOMENTUM,
    REGRESSOR,
)
# what a Plant answers; its effects are terms beside those of the rigid bodies
PLANT = by_name(
    replace(N, arguments=("t", "q", "v")),
    Quantity("torque", ("t", "q", "v"), ("n",)),
    replace(INVERSE_DYNAMICS, arguments=("t", "q", "v", "a")),
    replace(FORWARD_DYNAMICS, arguments=("t", "q", "v", "u")),
)
FRAMES = by_name(PLACEMENT, JACOBIAN, JACOBIAN_RATE)
ALL = EQUATION | FRAMES | by_name(MASS_MATRIX_DERIVATIVE, FORWARD_DYNAMICS_DERIVATIVES)
