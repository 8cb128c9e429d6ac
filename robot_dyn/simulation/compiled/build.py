"""The making of machines: state equations traced and compiled, once for all runs of one structure.

machine(equation, method) → Machine
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from robot_dyn.arithmetic import FLOAT64
from robot_dyn.codegen.loops.call import MachineFunction
from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.codegen.parameters import Parameter, parameters
from robot_dyn.codegen.program import Programs
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import TraceError
from robot_dyn.integrate import hermite
from robot_dyn.integrate.adaptive import STEPPERS
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.compiled.compiled_state_equation import CompiledStateEquation
from robot_dyn.simulation.compiled.functions import Equations
from robot_dyn.simulation.compiled.lru_by_identity import LRUByIdentity
from robot_dyn.simulation.compiled.programs import (
    Identified,
    Traces,
    identified,
    programs_of,
    robot_to_compile,
    stored,
    traced,
)
from robot_dyn.simulation.compiled.structure import changeable
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.detection import detecting
from robot_dyn.simulation.events.mode_change import end_mode, without_modes
from robot_dyn.simulation.run.event_loop import event_loop
from robot_dyn.simulation.run.time_loop import time_loop

_MOST_INSTRUCTIONS = 100_000  # some ten seconds of compiling

_equations = LRUByIdentity()


def compiled_equation(
    equation: StateEquation,
    method: Integrator | None,
    *,
    lanes: int = 1,
    kept: tuple[str, ...] | None = None,
    swept: tuple[str, ...] = (),
    jacobian: bool = False,
    cuts: bool = False,
    detects: bool = False,
    nonsmooth: bool = False,
) -> CompiledStateEquation:
    """The machine of a state equation, from the latest ones if it is among them; not compiled yet.

    Args:
        equation: What to compile.
        method: One whose steps are machine code too; None for the state equation alone.
        lanes: Runs in lock step.
        kept: As of `trace`.
        swept: Names of the parameters that differ from run to run.
        jacobian: Whether the method needs that of the rate.
        cuts: Whether steps are chosen, or cut at events.
        detects: Whether steps in lock step tell which runs may pass a threshold.
        nonsmooth: Whether velocities may jump within steps.

    Raises:
        TraceError: If a part of the equation cannot be compiled; names it, with the remedy.
    """
    made, what = identified(equation, swept), Traces(kept, jacobian, nonsmooth)
    return _with_loop(made, _equations_of(made, what, lanes, swept), method, lanes, cuts, detects, swept)


def existing(
    made: Identified, what: Traces, method: Integrator | None, cuts: bool, programs: Programs | None = None
) -> CompiledStateEquation | None:
    """The machine of a single run if its code is in this process or in the store; or None.

    Args:
        made: Its state equation.
        what: What is traced of it.
        method: As of `compiled_equation`.
        cuts: As of `compiled_equation`.
        programs: Those in the store, if they are known.
    """
    if _equations.known(made.objects, (made.described, 1, (), what)) is None:
        programs = programs or stored(made, what)
        if programs is None:
            return None
    found = _with_loop(made, _equations_of(made, what, programs=programs), method, cuts=cuts)
    return found if found.is_kept() else None


def _equations_of(
    made: Identified, what: Traces, lanes: int = 1, swept: tuple[str, ...] = (), programs: Programs | None = None
) -> Equations:
    """The equations of a structure, from the latest ones if they are among them."""

    def make() -> Equations:
        shared, name = _shared(made.equation, made.known, lanes, swept), made.equation.plant.dynamics.name  # pyright: ignore
        return Equations(programs or programs_of(made, what), lanes, name, shared, changeable(made.equation))

    names = tuple(name for name in dict.fromkeys(each.name for each in made.known) if name in swept)
    equations = _equations.get(made.objects, (made.described, lanes, names, what), make)
    if equations.instructions > _MOST_INSTRUCTIONS:
        raise TraceError(
            f"the run takes {equations.instructions} instructions, more than the {_MOST_INSTRUCTIONS} worth compiling;"
            " simulate it with engine='interpreted'"
        )
    return equations


def _with_loop(
    made: Identified, equations: Equations, method: Any, lanes: int = 1, cuts: bool = False, detects: bool = False,
    swept: tuple[str, ...] = (),
) -> CompiledStateEquation:  # fmt: skip
    """The machine of these equations with the loop of a method; without one where its step cannot be machine code."""
    found = None if method is None else _loop(method, made.equation, cuts, lanes, detects)
    if isinstance(found, SubsetError):
        return CompiledStateEquation(made.equation, equations, made.known, None, swept, str(found))
    return CompiledStateEquation(made.equation, equations, made.known, found, swept)


def with_numbers(made: CompiledStateEquation, equation: StateEquation) -> CompiledStateEquation:
    """The machine of an equation that differs from the compiled one in parameters alone, swept ones among them."""
    robot, plant = robot_to_compile(equation.plant.dynamics), equation.plant
    own = equation if robot is plant.dynamics else replace(equation, plant=Plant(robot, plant.effects))
    return replace(made, equation=own, known=parameters(robot, plant.effects, equation.controller, made.swept))


def machine_of_constants(equation: StateEquation, method: Integrator, *, lanes: int = 1) -> CompiledStateEquation:
    """The machine of a state equation whose numbers are constants of the code: none of them can be changed.

    Args:
        equation: As of `compiled_equation`.
        method: One whose steps are machine code too.
        lanes: Runs in lock step, of which no sample is kept.

    Raises:
        TraceError: As of `compiled_equation`.
    """
    robot = robot_to_compile(equation.plant.dynamics)
    own = replace(equation, plant=Plant(robot, equation.plant.effects))
    what = Traces(None if lanes == 1 else (), method.needs_jacobian, method.nonsmooth)
    programs = traced(own, (), what, constants=True)
    made = _loop(method, own, False, lanes)
    if isinstance(made, SubsetError):
        raise made
    return CompiledStateEquation(own, Equations(programs, lanes, robot.name), (), made)


def _shared(
    equation: StateEquation, known: tuple[Parameter, ...], lanes: int, swept: tuple[str, ...]
) -> dict[int, int]:
    """Where the numbers stand that all runs in lock step share: behind those of each run."""
    if lanes == 1:
        return {}
    held = equation.plant.dynamics.n * equation.sampled
    once = [each.name not in swept for each in known for _ in range(each.size)]
    first = (held + len(once) - sum(once)) * lanes
    numbers = (held + k for k, shared in enumerate(once) if shared)
    return {k: first + i for i, k in enumerate(numbers)}


def _loop(
    method: Any, equation: StateEquation, cuts: bool, lanes: int, detects: bool = False
) -> MachineFunction | SubsetError:
    """The loop of a method; or why its step, written elsewhere, cannot be machine code. Runs in lock step need it."""
    from robot_dyn.simulation.compiled.loop import refusal

    if not method.controls_error and (refused := refusal(method, equation, lanes)) is not None:
        if lanes > 1:
            raise refused
        return refused
    return loop_of(method, cuts, detects, bool(equation.impulses))


def loop_of(method: Any, cuts: bool, detects: bool = False, holds: bool = False) -> MachineFunction:
    """The time loop of a method whose steps are plain; its `is_kept` tells whether it costs milliseconds or a second.

    Args:
        method: An `Integrator` or `Adaptive`.
        cuts: Whether steps are chosen, or cut at events.
        detects: As of `compiled_equation`.
        holds: Whether something may hold joints.
    """
    from robot_dyn.simulation.compiled.loop import loop

    if not cuts:
        step = method.stepper(FLOAT64, 1, 0, 1).step
        return loop(time_loop, detecting(step) if detects else step, works=method.nonsmooth)
    made = STEPPERS[method.method](1, 1, 1) if method.controls_error else hermite.stepper(method, 1, 0, 1, None)
    of_modes = end_mode if holds else without_modes
    return loop(event_loop, made.begin, made.step, made.error, made.accept, made.dense, of_modes)
