"""Trace: the library's formulations run on symbols, giving CasADi Functions; the shortest of each quantity is used.

closed form        M = Σ Jᵢᵀ 𝓜ᵢ Jᵢ and the Christoffel symbols, as in `Lagrangian`
recursion          Newton–Euler, composite body, articulated body
energies           p = ∂K/∂v, M = ∂p/∂v, C v = ṗ − ∂K/∂q, N = ∂V/∂q by algorithmic differentiation of K and V
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import casadi as ca
import numpy as np

from robot_dyn.codegen.trace.base_parameters import regrouped
from robot_dyn.codegen.trace.condition import Node
from robot_dyn.codegen.trace.from_casadi import instructions
from robot_dyn.codegen.trace.origins import slid
from robot_dyn.codegen.trace.symbol import symbol
from robot_dyn.codegen.trace.symbolic import Symbolic, array_of, column, inputs
from robot_dyn.codegen.waiting import interrupts_later
from robot_dyn.foundations.arithmetic import Array, in_arithmetic
from robot_dyn.lagrange.christoffel import christoffel
from robot_dyn.lagrange.formulas import FORMULAS
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.linkage import Linkage
from robot_dyn.lagrange.recursions.articulated_body import articulated_body
from robot_dyn.lagrange.recursions.composite_body import composite_body
from robot_dyn.lagrange.recursions.kinetic_energy import kinetic_energy
from robot_dyn.lagrange.recursions.newton_euler import newton_euler
from robot_dyn.lagrange.recursions.regressor import regressor
from robot_dyn.lagrange.tree import Described
from robot_dyn.queries.dynamics import EQUATION, FORWARD_DYNAMICS_DERIVATIVES, acceleration
from robot_dyn.queries.dynamics import QUANTITIES as QUERIES
from robot_dyn.queries.quantity import Key, Quantity, of_frame

QUANTITIES = EQUATION | {"forward_dynamics_derivatives": FORWARD_DYNAMICS_DERIVATIVES}  # quantities with formulations
_MAX_SOLVED = 8  # joints in series; beyond, solving M a = τ − … is longer than the articulated-body algorithm
_MAX_DERIVED = 6  # joints; beyond, C v derived from K is longer, and takes as long to trace as all others together
_MAX_CLOSED_FORM = 4  # joints; beyond, its O(n³) terms make it the longest formulation, except of C


def keyed(key: Key) -> Quantity:
    """Return the quantity of a key."""
    return of_frame(QUERIES[key[0]], key[1]) if isinstance(key, tuple) else QUANTITIES[key]


@final
@dataclass(frozen=True)
class Traced:
    """A quantity as a CasADi Function.

    Attributes:
        function: Function of the quantity's arguments, each (n,); its result is in row order.
        formulation: Name of the shortest formulation, used by the function.
        counts: Number of instructions by formulation.
    """

    function: ca.Function
    formulation: str
    counts: dict[str, int]


@final
@dataclass(frozen=True)
class Trace:
    """A robot's dynamics in symbols.

    Attributes:
        robot: Robot whose file, edits and order of joints are used.
        parameters: CasADi symbols in its numbers: one vector, the last argument of each function.
    """

    robot: Described
    parameters: tuple[Node, ...] = ()

    @cached_property
    def lagrangian(self) -> Lagrangian:
        """Closed form, a `Dynamics` of symbols, with which effects are traced."""
        return Lagrangian(self.robot, Symbolic())

    @cached_property
    @in_arithmetic
    def linkage(self) -> Linkage:
        """Bodies for the recursions: other frames and fewer numbers, but the same M, C and N."""
        return regrouped(slid(self.lagrangian.linkage))

    @property
    def arithmetic(self) -> Symbolic:
        """Arithmetic of all numbers."""
        return Symbolic()

    @property
    def given(self) -> tuple[Node, ...]:
        """Vector of the parameters, if there are any."""
        return (ca.vertcat(*self.parameters),) if self.parameters else ()

    @cached_property
    def symbols(self) -> dict[str, tuple[Node, Array]]:
        """q, v, a, tau as CasADi vectors and as arrays of symbols."""
        return {name: inputs(name, self.lagrangian.n) for name in ("q", "v", "a", "tau")}

    def shape(self, quantity: str) -> tuple[int, ...]:
        """Return the shape of a quantity for one state, (1,) for a number."""
        return QUANTITIES[quantity].shape(self.lagrangian.sizes) or (1,)

    @interrupts_later()
    @in_arithmetic
    def formulations(self, name: Key) -> dict[str, ca.Function]:
        """Return a quantity by each formulation that is worth tracing."""
        arguments = [*(self.symbols[argument][0] for argument in keyed(name).arguments), *self.given]
        return {
            formulation: ca.Function("f", arguments, [ca.cse(ca.densify(formula()))])
            for formulation, formula in self._formulations(name)
        }

    def quantity(self, name: Key) -> Traced:
        """Return the trace of a query of `Dynamics`, or of "forward_dynamics_derivatives": ∂a/∂q, ∂a/∂v, ∂a/∂τ."""
        functions = self.formulations(name)
        counts = {formulation: instructions(function) for formulation, function in functions.items()}
        least = min(counts, key=counts.__getitem__)
        return Traced(functions[least], least, counts)

    def _formulations(self, name: Key) -> Iterator[tuple[str, Callable[[], Node]]]:
        """Return the formulations of a quantity; the closed form if there is no other."""
        if isinstance(name, tuple):  # queries of frames do not need inertias
            query, *frame = name
            arrays = [self.symbols[argument][1] for argument in keyed(name).arguments]
            yield "closed form", lambda: column(self.lagrangian._answer(query, tuple(arrays), None, tuple(frame)))
            return
        own, coupled = self.lagrangian, self.lagrangian.linkage.couplings.S.shape[0] != self.lagrangian.n
        articulated = name == "forward_dynamics" and not coupled
        depth = max(len(body.path) for body in own.linkage.bodies) if articulated else 0
        others = [*(self._of_recursion(name) if depth <= _MAX_SOLVED else ())]
        others += self._of_energies(name) if depth <= _MAX_DERIVED else ()
        if name in FORMULAS and (own.n <= _MAX_CLOSED_FORM or name == "C" or not (others or articulated)):
            arrays = [self.symbols[argument][1] for argument in QUANTITIES[name].arguments]
            yield "closed form", lambda: column(getattr(own, name)(*arrays))
        if articulated:
            yield "articulated body", lambda: self._forward
        yield from others

    def _of_recursion(self, name: str) -> Iterator[tuple[str, Callable[[], Node]]]:
        (_, q), (_, v), (_, a), (_, tau) = self.symbols.values()
        linkage = self.linkage
        zero = self.arithmetic.array(np.zeros(len(q)))
        formulas: dict[str, Callable[[], Any]] = {
            "M": lambda: self._mass,
            "inverse_dynamics": lambda: newton_euler(linkage, q, v, a),
            "coriolis_torque": lambda: newton_euler(linkage, q, v, zero, gravity=False),
            "momentum": lambda: newton_euler(linkage, q, zero, v, gravity=False),
            "N": lambda: newton_euler(linkage, q, zero, zero),
            "kinetic_energy": lambda: self._kinetic,
            "potential_energy": lambda: self._potential,
            "forward_dynamics": lambda: acceleration(
                self._mass, tau - newton_euler(linkage, q, v, zero), self.lagrangian.joint_names
            ),
            "C": lambda: christoffel(self._mass_derivative, v),
            "inverse_dynamics_derivatives": self._inverse_derivatives,
            "regressor": lambda: regressor(self.lagrangian.linkage, q, v, a),  # for the bodies of the file
        }
        if name in formulas:
            yield "recursion", lambda: column(formulas[name]())
        if name == "forward_dynamics_derivatives":
            yield "recursion", self._derivatives

    def _of_energies(self, name: str) -> Iterator[tuple[str, Callable[[], Node]]]:
        (q, _), (v, _), (a, _), (_, tau) = self.symbols.values()
        K, V = symbol(self._kinetic).expression, symbol(self._potential).expression
        p = ca.gradient(K, v)
        formulas = {
            "M": lambda: ca.vec(ca.jacobian(p, v)),  # symmetric: columns equal rows
            "N": lambda: ca.gradient(V, q),
            "momentum": lambda: p,
            "coriolis_torque": lambda: ca.jtimes(p, q, v) - ca.gradient(K, q),
            "coriolis_transpose": lambda: ca.gradient(K, q),
            "inverse_dynamics": lambda: (
                ca.jtimes(p, ca.vertcat(q, v), ca.vertcat(v, a)) - ca.gradient(K, q) + ca.gradient(V, q)
            ),
            "forward_dynamics": lambda: column(
                acceleration(
                    array_of(ca.jacobian(p, v)),
                    tau - array_of(ca.jtimes(p, q, v) - ca.gradient(K - V, q))[:, 0],
                    self.lagrangian.joint_names,
                )
            ),
        }
        if name in formulas:
            yield "energies", formulas[name]

    @cached_property
    def _mass(self) -> Array:
        return composite_body(self.linkage, self.symbols["q"][1])

    @cached_property
    def _mass_derivative(self) -> Array:
        """∂M_ij/∂q_k."""
        n = self.lagrangian.n
        return array_of(ca.jacobian(column(self._mass), self.symbols["q"][0])).reshape(n, n, n)

    @cached_property
    def _kinetic(self) -> Any:
        return kinetic_energy(self.linkage, self.symbols["q"][1], self.symbols["v"][1])

    @cached_property
    def _potential(self) -> Any:
        return self.lagrangian.potential_energy(self.symbols["q"][1])

    @cached_property
    def _forward(self) -> Node:
        (_, q), (_, v), _, (_, tau) = self.symbols.values()
        return column(articulated_body(self.linkage, q, v, tau))

    def _inverse_derivatives(self) -> Array:
        """Return ∂ID/∂q, ∂ID/∂v, M."""
        (q, qs), (v, vs), (_, a), _ = self.symbols.values()
        ID = column(newton_euler(self.linkage, qs, vs, a))
        return np.stack([array_of(ca.densify(ca.jacobian(ID, x))) for x in (q, v)] + [self._mass])

    def _derivatives(self) -> Node:
        """Return ∂a/∂x = −M⁻¹ ∂ID/∂x at a = FD(q, v, τ), and ∂a/∂τ = M⁻¹."""
        (q, qs), (v, vs), (a, as_), _ = self.symbols.values()
        n, names = len(qs), self.lagrangian.joint_names
        forward = self.quantity("forward_dynamics").function
        ID = column(newton_euler(self.linkage, qs, vs, as_))
        columns = ca.horzcat(-ca.jacobian(ID, q), -ca.jacobian(ID, v), ca.DM.eye(n))
        solved = acceleration(self._mass, array_of(ca.densify(columns).T), names)  # row i: the derivative by xᵢ
        answer = column(np.stack([solved[i * n : (i + 1) * n].T for i in range(3)]))
        return ca.substitute(answer, a, forward(q, v, self.symbols["tau"][0], *self.given))
