"""Building of machine code: state equations are traced and compiled, once for all runs of one structure.

compiled_equation(equation, method) → CompiledStateEquation
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.codegen.parameters import Parameter, parameters
from robot_dyn.codegen.program import Programs
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import TraceError
from robot_dyn.foundations.values import LRUByIdentity
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.functions import CompiledFunctions
from robot_dyn.simulation.engine.loop import loop_for
from robot_dyn.simulation.engine.machine_code import CompiledStateEquation
from robot_dyn.simulation.engine.programs import (
    Identified,
    Traces,
    identify,
    programs_of,
    robot_to_compile,
    stored,
    traced,
)
from robot_dyn.simulation.engine.structure import changeable

_MOST_INSTRUCTIONS = 100_000  # some ten seconds of compiling

_functions = LRUByIdentity()


def compiled_equation(
    equation: StateEquation,
    method: Integrator | None,
    *,
    lanes: int = 1,
    extras: tuple[str, ...] | None = None,
    swept: tuple[str, ...] = (),
    jacobian: bool = False,
    cuts: bool = False,
    detects: bool = False,
    nonsmooth: bool = False,
) -> CompiledStateEquation:
    """Return a state equation as machine code, from the cache if it is there; not compiled yet.

    Args:
        equation: What to compile.
        method: One whose steps are machine code too; None for the state equation alone.
        lanes: Runs in lock step.
        extras: As of `trace`.
        swept: Names of the parameters that differ from run to run.
        jacobian: Whether the method needs that of the rate.
        cuts: Whether steps are chosen, or cut at events.
        detects: Whether steps in lock step tell which runs may pass a threshold.
        nonsmooth: Whether velocities may jump within steps.

    Raises:
        TraceError: If a part of the equation cannot be compiled; names it, with the remedy.
    """
    identified, what = identify(equation, swept), Traces(extras, jacobian, nonsmooth)
    return _with_loop(identified, _functions_of(identified, what, lanes, swept), method, lanes, cuts, detects, swept)


def existing(
    identified: Identified, what: Traces, method: Integrator | None, cuts: bool, programs: Programs | None = None
) -> CompiledStateEquation | None:
    """Return the machine code of a single run if it is in this process or in the store; or None.

    Args:
        identified: Its state equation.
        what: What is traced of it.
        method: As of `compiled_equation`.
        cuts: As of `compiled_equation`.
        programs: Those in the store, if they are known.
    """
    if _functions.known(identified.objects, (identified.described, 1, (), what)) is None:
        programs = programs or stored(identified, what)
        if programs is None:
            return None
    compiled = _with_loop(identified, _functions_of(identified, what, programs=programs), method, cuts=cuts)
    return compiled if compiled.is_kept() else None


def _functions_of(
    identified: Identified, what: Traces, lanes: int = 1, swept: tuple[str, ...] = (), programs: Programs | None = None
) -> CompiledFunctions:
    """The functions of a structure, cached."""
    equation, known = identified.equation, identified.known

    def compute() -> CompiledFunctions:
        shared, name = _shared(equation, known, lanes, swept), equation.plant.dynamics.name  # pyright: ignore
        return CompiledFunctions(programs or programs_of(identified, what), lanes, name, shared, changeable(equation))

    names = tuple(name for name in dict.fromkeys(each.name for each in known) if name in swept)
    functions = _functions.get(identified.objects, (identified.described, lanes, names, what), compute)
    if (count := functions.programs.instructions) > _MOST_INSTRUCTIONS:
        raise TraceError(
            f"the run takes {count} instructions, more than the {_MOST_INSTRUCTIONS} worth compiling;"
            " simulate it with engine='interpreted'"
        )
    return functions


def _with_loop(
    identified: Identified, functions: CompiledFunctions, method: Any, lanes: int = 1, cuts: bool = False,
    detects: bool = False, swept: tuple[str, ...] = (),
) -> CompiledStateEquation:  # fmt: skip
    """These functions with the loop of a method; without one where its step cannot be machine code."""
    loop = None if method is None else loop_for(method, identified.equation, cuts, lanes, detects)
    refused = str(loop) if isinstance(loop, SubsetError) else ""
    loop = None if isinstance(loop, SubsetError) else loop
    return CompiledStateEquation(identified.equation, functions, identified.known, loop, swept, refused)


def with_numbers(compiled: CompiledStateEquation, equation: StateEquation) -> CompiledStateEquation:
    """The machine code for an equation that differs from the compiled one in parameters alone, swept ones included."""
    robot, plant = robot_to_compile(equation.plant.dynamics), equation.plant
    compiled_form = equation if robot is plant.dynamics else replace(equation, plant=Plant(robot, plant.effects))
    known = parameters(robot, plant.effects, equation.controller, compiled.swept)
    return replace(compiled, equation=compiled_form, known=known)


def compiled_with_constants(equation: StateEquation, method: Integrator, *, lanes: int = 1) -> CompiledStateEquation:
    """Return a state equation as machine code whose numbers are constants: none of them can be changed.

    Args:
        equation: As of `compiled_equation`.
        method: One whose steps are machine code too.
        lanes: Runs in lock step, of which no sample is recorded.

    Raises:
        TraceError: As of `compiled_equation`.
    """
    robot = robot_to_compile(equation.plant.dynamics)
    equation = replace(equation, plant=Plant(robot, equation.plant.effects))
    what = Traces(None if lanes == 1 else (), method.needs_jacobian, method.nonsmooth)
    loop = loop_for(method, equation, False, lanes)
    if isinstance(loop, SubsetError):
        raise loop
    programs = traced(equation, (), what, constants=True)
    return CompiledStateEquation(equation, CompiledFunctions(programs, lanes, robot.name), (), loop)


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
