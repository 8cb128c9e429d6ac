"""The state equation of a setup as machine code, with its parameters and its time loop."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.codegen.loops.call import MachineFunction
from robot_dyn.codegen.parameters import CONTROLLER, ROBOT, Parameter, Part, joined, parameters
from robot_dyn.foundations.coefficients import value_at
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.functions import CompiledFunctions

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 4)


@final
@dataclass(frozen=True, eq=False)
class CompiledStateEquation:
    """A state equation as machine code.

    Attributes:
        equation: The interpreted state equation: that of the setup, with right angles written out in full.
        functions: Its machine code.
        known: Its parameters, with the values of the setup.
        loop: The time loop as machine code; None if steps are taken in Python.
        swept: Names of the parameters that differ from run to run.
        refused: Why steps are taken in Python although those of the method might be machine code.
    """

    equation: StateEquation
    functions: CompiledFunctions
    known: tuple[Parameter, ...]
    loop: MachineFunction | None
    swept: tuple[str, ...] = ()
    refused: str = ""

    @cached_property
    def parameters(self) -> np.ndarray:
        """The values of the parameters, one row after the other."""
        return joined(self.known)

    def advance(self) -> Callable[..., int] | None:
        """The loop for one run, which stores the addresses of its arrays."""
        return None if self.loop is None else self.loop.calls()

    def parameters_of(self, equation: StateEquation) -> np.ndarray:
        """The values of the parameters of a state equation with other coefficients of its parts, or other payloads."""
        plant = equation.plant
        of: dict[Part, Any] = {("effect", i): effect for i, effect in enumerate(plant.effects)}
        of[CONTROLLER] = equation.controller
        known = [
            replace(each, value=np.broadcast_to(value_at(of[each.part], each.key), each.value.shape))
            if each.part in of and value_at(of[each.part], each.key) is not None  # no mode is chosen yet
            else each
            for each in self.known
        ]
        if plant.equation_of_motion.payloads:
            bodies = {each.key: each.value for each in parameters(plant.dynamics, (), None, self.swept)}
            known = [replace(each, value=bodies[each.key]) if each.part == ROBOT else each for each in known]
        return joined(known)

    def run_parameters(self, swept: Mapping[str, np.ndarray]) -> np.ndarray:
        """The numbers of W runs, (O, W): what is held, then row by row what is swept, (W, size) each, then the others.

        A single run has all of them row by row.
        """
        held, W = self.equation.plant.dynamics.n * self.equation.sampled, self.functions.runs
        if W == 1:
            return np.concatenate([np.zeros(held), self.parameters])[:, None]
        shared = [each for each in self.known if each.name not in swept]
        names = [each.name for each in self.known if each.name in swept]
        rows = np.vstack([np.zeros((held, W)), *(swept[name].T for name in names)])
        block = np.zeros((-(-sum(each.size for each in shared) // W), W))
        block.ravel()[: sum(each.size for each in shared)] = joined(shared)
        return np.vstack([rows, block])

    @cached_property
    def in_python(self) -> Functions:
        """The functions as Python calls them."""
        return Functions(*(_callable(address) if address else 0 for address in self.functions.addresses))

    def is_kept(self) -> bool:
        """Whether its machine code is in this process or in the store, with its loop."""
        if self.loop in self.functions.checked:
            return True
        kept = bool(self.functions.checked) or self.functions.is_kept()
        return kept and (self.loop is None or self.loop.is_kept())


def _callable(address: int) -> Callable[..., None]:
    function = _FUNCTION(address)

    def call(t: float, y: np.ndarray, p: np.ndarray, run_parameters: np.ndarray, out: np.ndarray) -> None:
        function(t, y.ctypes.data, p.ctypes.data, run_parameters.ctypes.data, out.ctypes.data)

    return call
