"""A plant as machine code, M(q) a + C(q, v) v + N(t, q, v) = τ, with effects and bounds in the kernel.

Effects are traced from the code of the interpreted plant. Coefficients, gravity and payloads are inputs of the kernel:
plants that differ only in these share compiled code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, overload

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from robot_dyn.codegen.dynamics import CompiledDynamics, name_of_dtype
from robot_dyn.codegen.engine import Engine
from robot_dyn.codegen.parameters import ROBOT, Parameter, joined, parameters, split
from robot_dyn.codegen.self_check import SelfCheck
from robot_dyn.codegen.trace.from_casadi import instructions
from robot_dyn.codegen.trace.symbolic import Symbolic, Symbols, column, inputs
from robot_dyn.codegen.trace.symbolic_dynamics import SymbolicDynamics
from robot_dyn.codegen.trace.symbolic_plant import symbolic_plant
from robot_dyn.codegen.trace.trace import Traced
from robot_dyn.codegen.waiting import interrupts_later
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import MissingTimeError
from robot_dyn.foundations.suggestions import SuggestsNames
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import EQUATION, PLANT, Dynamics
from robot_dyn.queries.quantity import Key, title

_TIMES = (float, int, np.float64)  # types of t that machine code accepts; `Engine.evaluate` handles all others


@dataclass(frozen=True)
class CompiledPlant(SuggestsNames):
    """A plant as machine code; each quantity is compiled on first use and checked against the interpreted plant.

    Attributes:
        plant: Plant passed by the user.
        dynamics: Compiled rigid-body dynamics of the plant.
        is_nan_allowed: True for NaN at states without a result, see `nan_rows`.
    """

    plant: Plant
    dynamics: CompiledDynamics
    is_nan_allowed: bool = False

    def __reduce__(self) -> tuple[object, ...]:
        return CompiledPlant, (self.plant, self.dynamics, self.is_nan_allowed)

    @cached_property
    def nan_rows(self) -> CompiledPlant:
        """The same queries, with NaN instead of an error for each state without a result; see `Dynamics.nan_rows`."""
        other = replace(self, is_nan_allowed=True)
        vars(other)["engine"] = self.engine  # to share the kernels
        return other

    @cached_property
    def interpreted(self) -> Plant:
        """Plant whose equations are compiled: `plant`, with right angles at full precision."""
        return Plant(self.dynamics.robot, self.plant.effects)

    @cached_property
    def engine(self) -> Engine:
        """Kernels of the plant."""

        def truth(key: Key, state: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
            quantity = title(key)
            rows = [[state[name][i] for name in PLANT[quantity].arguments] for i in range(len(state["t"]))]
            times = zip(state["t"], state["q"], state["v"], strict=True)
            effects = np.array(
                [np.broadcast_to(self.interpreted.torque(q, v, t=t), state["q"].shape[1:]) for t, q, v in times]
            )
            method = getattr(self.interpreted, quantity)
            return np.array([np.broadcast_to(method(*row, t=t), state["q"].shape[1:]) for t, *row in rows]), effects

        return Engine(
            self.trace,
            {**PLANT},
            SelfCheck(self.dynamics.robot, "the interpreted plant"),
            truth,
            self.dynamics.dtype,
            self.dynamics.engine.threads,
            self.dynamics.engine.store,
            joined(self.parameters),
        )

    @property
    def instructions(self) -> dict[str, dict[str, int]]:
        """Number of instructions of each quantity used so far, by formulation and with effects; the smallest first."""
        return self.dynamics.instructions | self.engine.instructions

    @property
    def instructions_by_effect(self) -> dict[str, int]:
        """Number of instructions of each effect, compiled separately."""
        (t, ts), (q, qs), (v, vs), _ = self._inputs
        arguments = [t, q, v, *self._numbers[0]]
        counts: dict[str, int] = {}
        torques = self._symbolic.equation_of_motion.torques(ts[0], qs, vs)
        for effect, torque in zip(self.plant.forces, torques, strict=True):
            function = ca.Function("f", arguments, [ca.cse(ca.densify(column(torque)))])
            counts[effect.name] = counts.get(effect.name, 0) + instructions(function)
        return counts

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.dynamics.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        return self.dynamics.joint_names

    def M(self, q: Array, *, t: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """Return the mass matrix, (..., n, n); it does not depend on t."""
        return self._rigid.M(q, out=out)

    def C(self, q: Array, v: Array, *, t: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """Return the Coriolis matrix, (..., n, n); it does not depend on t."""
        return self._rigid.C(q, v, out=out)

    def N(self, q: Array, v: Array, *, t: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """Return gravity minus the torques of the effects, N = ∂V/∂q − Σ τ_effect, (..., n), in [N m] or [N].

        Args:
            q: Position, (..., n).
            v: Velocity, (..., n).
            t: Times in [s], one or with the shape of a batch; required if an effect depends on the time.
            out: Array that receives the result and is returned.

        Raises:
            QueryError: If an argument is wrong; MissingTimeError if t is missing.
        """
        return self._ask("N", (self._any_time if t is None else t, q, v), out)

    def torque(self, q: Array, v: Array, *, t: ArrayLike | None = None, out: np.ndarray | None = None) -> np.ndarray:
        """Return Σ τ_effect, (..., n); for arguments and errors, see `N`."""
        return self._ask("torque", (self._any_time if t is None else t, q, v), out)

    def inverse_dynamics(
        self,
        q: Array,
        v: Array,
        a: Array,
        *,
        t: ArrayLike | None = None,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the actuation τ = M a + C v + N for the acceleration a, (..., n)."""
        return self._ask("inverse_dynamics", (self._any_time if t is None else t, q, v, a), out)

    def forward_dynamics(
        self,
        q: Array,
        v: Array,
        u: Array,
        *,
        t: ArrayLike | None = None,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the acceleration under the actuation u, (..., n)."""
        return self._ask("forward_dynamics", (self._any_time if t is None else t, q, v, u), out)

    def _ask(self, quantity: str, arguments: tuple[Any, ...], out: np.ndarray | None) -> np.ndarray:
        if arguments[0].__class__ in _TIMES:
            y = np.empty(self.n, self.dynamics.dtype) if out is None else out
            if not self.engine.ones[quantity](*arguments, y):
                return y

        def otherwise(t: float, *state: Any) -> Any:
            return getattr(self.interpreted, quantity)(*state, t=t)

        return self.engine.evaluate(quantity, arguments, out, self.is_nan_allowed, otherwise)

    @cached_property
    def _rigid(self) -> Dynamics[np.ndarray]:
        """Rigid bodies; raises a TraceError if a payload is picked up or dropped."""
        _ = self._symbolic
        return self.dynamics.nan_rows if self.is_nan_allowed else self.dynamics

    @cached_property
    def _any_time(self) -> float:
        """A time for queries without t; raises a MissingTimeError if an effect depends on the time."""
        (t, ts), (_, qs), (_, vs), _ = self._inputs
        with Symbolic().scope():
            torques = self._symbolic.equation_of_motion.torques(ts[0], qs, vs)
        for force, torque in zip(self.plant.forces, torques, strict=True):
            if ca.depends_on(ca.densify(column(torque)), t):
                raise MissingTimeError(f"{force.name} depends on the time: pass t=, in [s]")
        return 0.0

    # --- the trace

    @cached_property
    def _inputs(self) -> tuple[Any, ...]:
        """t, q, v, u as CasADi vectors and arrays of symbols."""
        pairs = (inputs(name, 1 if name == "t" else self.n) for name in ("t", "q", "v", "u"))
        return tuple((vector, array.view(Symbols)) for vector, array in pairs)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Coefficients of the effects, gravity and payloads, as inputs: changing one requires no compilation."""
        return parameters(self.dynamics.robot, self.plant.effects, None)

    @cached_property
    def _numbers(self) -> tuple[tuple[Any, ...], Any]:
        """Parameters as a CasADi vector, if there are any, and as an array of symbols."""
        vector, array = inputs("p", sum(parameter.size for parameter in self.parameters))
        return (vector,) if len(array) else (), array.view(Symbols)

    @cached_property
    def _bodies(self) -> SymbolicDynamics:
        """Rigid bodies with symbolic parameters."""
        own = [parameter for parameter in self.parameters if parameter.part == ROBOT]
        return SymbolicDynamics(self.dynamics.robot, own).with_parameters(
            split(self.parameters, self._numbers[1]).get(ROBOT, {})
        )

    @cached_property
    def _symbolic(self) -> Plant:
        """Plant with symbolic parameters."""
        return symbolic_plant(self.plant, self._bodies, split(self.parameters, self._numbers[1]))

    @interrupts_later()
    def trace(self, key: Key) -> Traced:
        """Return a query of a plant, or M or C, as a Function of its arguments and of the parameters, if any."""
        quantity, ((t, ts), (q, qs), (v, vs), (u, us)) = title(key), self._inputs
        with Symbolic().scope():
            equation = self._symbolic.equation_of_motion
            torque = sum(equation.torques(ts[0], qs, vs), start=0 * vs)
            formulas: dict[str, Callable[[], Any]] = {
                "M": lambda: equation.dynamics.M(qs),
                "C": lambda: equation.dynamics.C(qs, vs),
                "torque": lambda: torque,
                "N": lambda: equation.dynamics.N(qs) - torque,
                "inverse_dynamics": lambda: equation.dynamics.inverse_dynamics(qs, vs, us) - torque,
                "forward_dynamics": lambda: equation.acceleration(
                    qs, vs, equation.on_joints(equation.actuation(us, vs)) + torque
                ),
            }
            answer = column(formulas[quantity]())
        symbols = {"t": t, "q": q, "v": v, "a": u, "u": u}
        arguments = [*(symbols[name] for name in (EQUATION | PLANT)[quantity].arguments), *self._numbers[0]]
        function = ca.Function("f", arguments, [ca.cse(ca.densify(answer))])
        formulation = "effects" if quantity == "torque" else self._bodies.formulation(quantity)
        return Traced(function, formulation, {formulation: instructions(function)})


@overload
def compiled(
    robot_or_plant: Robot, *, dtype: DTypeLike = ..., threads: int | None = ..., cache: bool = ...
) -> CompiledDynamics: ...
@overload
def compiled(
    robot_or_plant: Plant, *, dtype: DTypeLike = ..., threads: int | None = ..., cache: bool = ...
) -> CompiledPlant: ...
def compiled(
    robot_or_plant: Robot | Plant, *, dtype: DTypeLike = "float64", threads: int | None = 1, cache: bool = True
) -> CompiledDynamics | CompiledPlant:
    """Compile a robot or a plant to machine code, for one state (n,) and batches (..., n).

    Args:
        robot_or_plant: A Robot, or a Plant whose dynamics is a Robot (or the Lagrangian of one).
        dtype: np.float64 or np.float32, or its name.
        threads: Number of threads for batches; None for all processors.
        cache: Store compiled code on disk.

    Returns:
        An object with the same queries: a `CompiledDynamics` for a robot, a `CompiledPlant` for a plant.

    Raises:
        QueryError: If `robot_or_plant` is neither, or an option is not allowed.
    """
    name = name_of_dtype(dtype)
    if not isinstance(robot_or_plant, Plant):
        return CompiledDynamics(robot_or_plant, name, threads, cache)
    robot: Any = getattr(robot_or_plant.dynamics, "robot", robot_or_plant.dynamics)
    return CompiledPlant(robot_or_plant, CompiledDynamics(robot, name, threads, cache))
