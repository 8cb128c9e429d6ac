"""Equations to export: the quantities of an arm or a plant as CasADi Functions, with open or bound parameters."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

import robot_dyn as rd
from robot_dyn.codegen import CompiledDynamics, CompiledPlant, Engine, Parameter, Program
from robot_dyn.effects import SetValued, Stateful
from robot_dyn.foundations import ExportError, QueryError, choice, shown
from robot_dyn.queries import Quantity
from robot_dyn.tools.export.exported import Exported
from robot_dyn.tools.export.operations import evaluated

QUANTITIES = ("M", "C", "N", "inverse_dynamics", "forward_dynamics")


@final
@dataclass(frozen=True)
class Equations(Exported):
    """The traced equations of an arm or a plant.

    Attributes:
        compiled: The arm or the plant as machine code, whose traces are exported.
    """

    compiled: CompiledDynamics | CompiledPlant

    kind, states = "dynamics", 10_000

    @property
    def name(self) -> str:
        return self.robot.name

    @property
    def title(self) -> str:
        return f"{self.name}: tau = M(q) a + C(q, v) v + N"

    @property
    def robot(self) -> rd.Robot:
        """The robot, with right angles at full precision."""
        return self._rigid.robot

    @property
    def right_angles(self) -> tuple[str, ...]:
        return self._rigid.right_angles

    @property
    def declared(self) -> tuple[Parameter, ...]:
        return self.compiled.parameters if isinstance(self.compiled, CompiledPlant) else ()

    @property
    def _rigid(self) -> CompiledDynamics:
        return self.compiled.dynamics if isinstance(self.compiled, CompiledPlant) else self.compiled

    def engine(self, name: str) -> Engine:
        """Return the engine with the row, the check and the reference of a quantity; see `Engine`."""
        return (self._rigid if name in ("M", "C") else self.compiled).engine

    def row(self, name: str) -> Quantity:
        """Return the row of a quantity: arguments, shape and scale."""
        return self.engine(name).quantities[name]

    def function(self, name: str, *, is_open: bool = True) -> ca.Function:
        """Return a quantity as a Function of its arguments, t and p included where the result depends on them.

        The result is a column, in row order.
        """
        compiled = self.compiled
        trace = compiled.trace(name) if isinstance(compiled, CompiledPlant) else compiled.engine.traces[name]
        names = (*self.row(name).arguments, *(["p"] if self.declared else []))
        return self.bound(name, trace.function, names, [result_name(name)], ("t", "p"), is_open=is_open)

    def check(self, name: str, function: ca.Function, program: Program, dtype: str) -> None:
        """Compare a program with the independent implementation that kernels are checked with."""
        engine, arguments = self.engine(name), function.name_in()
        state = {key: x.astype(dtype).astype(float) for key, x in engine.self_check.states().items()}
        theirs, effects = engine.truth(name, state)
        p = np.tile(self.p, (len(state["q"]), 1))
        inputs = [x[:, None] if x.ndim == 1 else x for x in (({**state, "p": p})[key] for key in arguments)]
        ours = evaluated(program, inputs, dtype).reshape(theirs.shape)
        engine.self_check.check(engine.quantities[name], ours, theirs, dtype, effects)


def equations_of(arm_or_plant: rd.Robot | rd.Plant) -> Equations:
    """Return the equations of an arm or a plant.

    Raises:
        ExportError: If an effect switches, holds joints or has states; the message names it, with a remedy.
        QueryError: If it is neither a robot nor a plant.
    """
    for effect in arm_or_plant.effects if isinstance(arm_or_plant, rd.Plant) else ():
        if effect.switches:
            times = " and ".join(f"{t:g} s" for t in effect.switches)
            raise ExportError(f"{effect.name} switches at {times}; export the plant without it, or rd.Plant.at(t)")
        if isinstance(effect, SetValued):
            raise ExportError(
                f"{effect.name} is set-valued: at rest, only a run determines its torque; use a smooth effect, such as"
                " rd.effects.RegularisedCoulombFriction or joint_stops"
            )
        if isinstance(effect, Stateful):
            raise ExportError(f"{effect.name} has states, which a query does not; export the plant without it")
    return Equations(rd.compiled(arm_or_plant))


def chosen(equations: Equations, quantities: Iterable[str] | None) -> tuple[str, ...]:
    """Return the quantities to export; by default all of up to eight joints, N and inverse dynamics of more.

    Raises:
        QueryError: If a name is unknown.
        ExportError: If forward dynamics has no solution, because a joint carries no inertia.
    """
    singular, n = equations.robot.joint_without_inertia, equations.robot.n
    if quantities is None:
        few = QUANTITIES if n <= 8 else ("N", "inverse_dynamics")
        return tuple(name for name in few if name != "forward_dynamics" or singular is None)
    try:
        names = [quantities] if isinstance(quantities, str) else list(quantities)
    except TypeError:
        raise QueryError(f"quantities must be names, such as ['M', 'N'], got {shown(quantities)}") from None
    for name in names:
        choice("quantities", name, QUANTITIES)
        if name == "forward_dynamics" and singular is not None:
            raise ExportError(f"forward_dynamics: {singular!r} carries no inertia; give it armature, or lock it")
    return tuple(dict.fromkeys(names))


def result_name(name: str) -> str:
    """Return the letter of a result."""
    return {"inverse_dynamics": "tau", "forward_dynamics": "a"}.get(name, name)
