"""The engine of machine code: the functions of a state equation, their parameters, and the time loop.

LLVM is imported when machine code is compiled or loaded.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.codegen.parameters import CONTROLLER, ROBOT, Parameter, Part, joined, parameters
from robot_dyn.codegen.program import Programs
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.codegen.store.keys import digest, sources_of_the_writer
from robot_dyn.codegen.waiting import COMPILING
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.set_valued import SetValued
from robot_dyn.foundations.coefficients import value_at
from robot_dyn.foundations.convex import PASSES
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.engine import Advance, Evaluated, Watched
from robot_dyn.simulation.events.contact_mode import Places

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.call import MachineFunction

_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 4)
_MODE = "held", "_direction", "_contact"  # coefficients of set-valued effects
STEP = "problem", "newton", "after_step"  # programs of the function `step`; the last is also a function alone


class States(NamedTuple):
    """Times (k,), in [s], and states (k, m)."""

    t: np.ndarray
    y: np.ndarray


@final
@dataclass(frozen=True, eq=False)
class CompiledFunctions:
    """The functions of a state equation, as programs and machine code.

    Attributes:
        programs: Programs of the functions by name; see `trace`.
        runs: Number W of runs in lock step.
        name: Name of the arm, for messages.
        shared: See `write_function`.
        changeable: Names of the parts whose code may change between runs, or do more than a trace contains.
        checked: States at which the functions were compared with the interpreted equation, by the loop that ran them.
    """

    programs: Programs
    runs: int
    name: str
    shared: Mapping[int, int] = field(default_factory=dict)
    changeable: tuple[str, ...] = ()
    checked: dict[MachineFunction | None, States] = field(default_factory=dict, repr=False)

    @cached_property
    def _key(self) -> str:
        return digest([sources_of_the_writer(), str(self.runs), str(sorted(self.shared.items())), str(self.programs)])

    def is_kept(self) -> bool:
        """Return True if the machine code is in the store."""
        store = default_store()
        return store is not None and store.load(self._key) is not None

    @cached_property
    def addresses(self) -> Functions:
        """The addresses of the functions, which are compiled unless they are in the store."""
        from robot_dyn.codegen.llvm import machine_code
        from robot_dyn.codegen.llvm.lock_step import write_function, write_step

        def write(module: Any, prefix: str) -> None:
            for name, program in self.programs.items():
                if name == "problem":
                    step: Any = tuple(self.programs[part] for part in STEP)
                    write_step(module, f"{prefix}step", step, self.runs, self.shared, PASSES)
                elif name != "newton":
                    shared = {} if name == "after_step" else self.shared
                    write_function(module, f"{prefix}{name}", program, self.runs, shared)

        written = {*self.programs, *(["step"] if "problem" in self.programs else [])}
        names = [name for name in Functions._fields if name in written]
        about = f"the state equation of {self.name}"
        addresses = machine_code.addresses(names, self._key, write, default_store(), about)
        return Functions(**dict.fromkeys(Functions._fields, 0) | dict(zip(names, addresses, strict=True)))


@final
@dataclass(frozen=True, eq=False)
class MachineCode:
    """The engine that evaluates a state equation by machine code; see `Engine` for the other attributes.

    Attributes:
        equation: The state equation of the setup.
        compiled_form: The equation that was compiled: in a mode, with right angles to all digits of float64.
        code: The functions as machine code.
        inputs: Parameters of the functions, with the values of the setup.
        machine_loop: The time loop as machine code; None if steps are taken in Python.
        swept: Names of the parameters that differ from run to run.
        refused: Reason why a user-defined method takes its steps in Python; empty without one.
    """

    equation: StateEquation
    compiled_form: StateEquation
    code: CompiledFunctions
    inputs: tuple[Parameter, ...]
    machine_loop: MachineFunction | None
    swept: tuple[str, ...] = ()
    refused: str = ""
    is_compiled: ClassVar[bool] = True
    most_evaluations: float = field(default=inf, init=False)

    @property
    def label(self) -> str:
        """Name of the engine in the summary of a run; see `Engine`."""
        if self.machine_loop is not None:
            return "compiled"
        reason = f": {self.refused}" if self.refused else ""
        return f"compiled (the equation of motion; steps in Python{reason})"

    @property
    def most_steps(self) -> float:
        """Number of steps after which the loop returns; see `Engine`."""
        return 1 if self.machine_loop is None else inf

    def evaluated(self, equation: StateEquation, watch: Watched) -> Evaluated:
        """Return the functions with the numbers of an equation; see `Engine`."""
        functions = self.in_python if self.machine_loop is None else self.code.addresses
        numbers = self.parameters if equation is self.equation else self._numbers(equation)
        return Evaluated(functions, self.in_python, numbers)

    def _numbers(self, equation: StateEquation) -> np.ndarray:
        """Return the values of the parameters in an equation with other numbers, cached for the latest machine code."""
        latest = equation.cache.get(MachineCode)
        if latest is None or latest[0] is not self:
            latest = equation.cache[MachineCode] = self, self.parameters_of(equation)
        return latest[1]

    def places(self) -> Places:
        """Return the places of the mode among the parameters of effects; see `Engine`."""
        plant = self.equation.plant
        return _places(self.inputs, plant.effects, plant.dynamics.n * self.equation.sampled)

    def loop(self) -> Advance | None:
        """Return the time loop, which stores the addresses of its arrays; None if it is not compiled."""
        return None if self.machine_loop is None else self.machine_loop.calls()

    def compiling_s(self) -> float:
        """Return the time that this thread has spent on loading and compiling loops; see `Engine`."""
        return COMPILING.seconds

    @cached_property
    def parameters(self) -> np.ndarray:
        """The values of the parameters, (P,)."""
        return joined(self.inputs)

    def parameters_of(self, equation: StateEquation) -> np.ndarray:
        """Return the values of the parameters in an equation with other coefficients or payloads, (P,)."""
        plant = equation.plant
        parts: dict[Part, Any] = {("effect", i): effect for i, effect in enumerate(plant.effects)}
        parts[CONTROLLER] = equation.controller
        inputs = [
            replace(x, value=np.broadcast_to(value, x.value.shape))
            if x.part in parts and (value := value_at(parts[x.part], x.key)) is not None  # None: no mode is chosen yet
            else x
            for x in self.inputs
        ]
        if plant.equation_of_motion.payloads:
            bodies = {x.key: x.value for x in parameters(plant.dynamics, (), None, self.swept)}
            inputs = [replace(x, value=bodies[x.key]) if x.part == ROBOT else x for x in inputs]
        return joined(inputs)

    def run_parameters(self, swept: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the run parameters of W runs, (O, W): the zero-order hold, then the swept parameters, then the others.

        A swept parameter has a row for each of its numbers. The others are shared by all runs and fill further rows in
        their order. For a single run, all parameters are in their order.

        Args:
            swept: Values of the swept parameters by name, (W, size) each.
        """
        held, W = self.equation.plant.dynamics.n * self.equation.sampled, self.code.runs
        if W == 1:
            return np.concatenate([np.zeros(held), self.parameters])[:, None]
        shared = joined([x for x in self.inputs if x.name not in swept])
        names = [x.name for x in self.inputs if x.name in swept]
        rows = np.vstack([np.zeros((held, W)), *(swept[name].T for name in names)])
        block = np.zeros((-(-len(shared) // W), W))
        block.ravel()[: len(shared)] = shared
        return np.vstack([rows, block])

    @cached_property
    def in_python(self) -> Functions:
        """The functions as Python functions."""
        return Functions(
            *(_callable(address) if isinstance(address, int) and address else 0 for address in self.code.addresses)
        )

    def is_kept(self) -> bool:
        """Return True if the machine code and its loop are in this process or in the store."""
        checked, loop = self.code.checked, self.machine_loop
        if loop in checked:
            return True
        return (bool(checked) or self.code.is_kept()) and (loop is None or loop.is_kept())


def _callable(address: int) -> Callable[..., None]:
    function = _FUNCTION(address)

    def call(t: float, y: np.ndarray, p: np.ndarray, run_parameters: np.ndarray, out: np.ndarray) -> None:
        function(t, y.ctypes.data, p.ctypes.data, run_parameters.ctypes.data, out.ctypes.data)

    return call


def _places(inputs: Sequence[Parameter], effects: Sequence[Effect], first: int) -> Places:
    """Return the places of the mode among the run parameters; the first parameter is at place `first`."""
    places: dict[str, list[int]] = {name: [] for name in _MODE}
    for x in inputs:
        if x.part[0] == "effect" and isinstance(effects[int(x.part[1])], SetValued) and x.key in places:
            places[x.key].append(first)
        first += x.size
    return Places(*(np.array(rows, np.int64) for rows in places.values()))
