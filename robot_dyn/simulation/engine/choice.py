"""The choice of the engine that runs a setup: machine code, or Python where compiling is not worthwhile or impossible.

It is made by a count, about how often the equation of motion is evaluated: the same for a setup on every machine.
Machine code that this process already has, or the store, is used in any case.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING, Any

from robot_dyn.codegen.waiting import announced
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.simulation.dynamics.declarations import named, undeclared
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.programs import Identified, Traces, identify, interpreted, stored
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.setup.size import segments

if TYPE_CHECKING:
    from robot_dyn.simulation.engine.machine_code import CompiledStateEquation

# Interpreted, an evaluation takes some 0.1 ms: these take about as long as imports, trace and LLVM, 1 to 2 s; half of
# it without the time loop, which is compiled once for a version of this library.
_COMPILED = 20_000
_WITHOUT_LOOP = _COMPILED / 2
_GUESSED = 10  # evaluations in a step of an implicit method, beside those of its Jacobian
_PER_SECOND, _PER_SEGMENT = 1000, 17  # evaluations of an adaptive method: for each second, at least for each segment


def choose(setup: Setup, equation: StateEquation, seen: float = 0) -> tuple[CompiledStateEquation | None, str]:
    """Return the machine code that runs a setup, None for the interpreted engine, and a text for the summary.

    Args:
        setup: What to run.
        equation: Its state equation.
        seen: A lower bound of its evaluations, without its companions.

    Raises:
        TraceError: If engine is "compiled" and a part cannot be; names it.
        MachineError: If the machine code does not agree with the interpreted engine.
    """
    if setup.engine == "interpreted":
        return None, _interpreted(setup)
    required = setup.engine == "compiled"
    if not required and (parts := undeclared(setup.plant, setup.controller)):  # they may do what a trace would lose
        return None, _interpreted(setup, " ".join((named(parts[0][0]), parts[0][1])))
    try:
        identified, what = identify(_code(setup, equation)), _traces(setup)
        found = _existing(setup, identified, what)
        if found is None and not required and not _is_worthwhile(setup, identified, what, seen):
            return None, _interpreted(setup, "short: compiling is not worthwhile")
        compiled_equation = _checked(setup, equation, found)
        return compiled_equation, _label(compiled_equation)
    except (ImportError, RobotDynError) as error:
        if required:
            raise
        return None, _interpreted(setup, str(error))


def most_interpreted(setup: Setup, equation: StateEquation, compiled_equation: CompiledStateEquation | None) -> float:
    """Evaluations after which a run starts again in machine code: a count that was guessed too low."""
    guessed = setup.engine == "auto" and compiled_equation is None and setup.integrator.controls_error
    if not guessed or undeclared(setup.plant, setup.controller):  # what is not compiled would never end
        return inf
    return _COMPILED / _in_all(setup, equation.size)


def _checked(setup: Setup, equation: StateEquation, found: CompiledStateEquation | None) -> CompiledStateEquation:
    """The machine code that exists, or new code, after its self-check."""
    from robot_dyn.simulation.engine.self_check import check

    if found is None:
        return checked(setup, lambda: compiled_for(setup, equation))
    check(found, setup)
    return found


def checked(setup: Setup, build: Callable[[], CompiledStateEquation]) -> CompiledStateEquation:
    """The machine code that `build` returns, after its self-check, which compiles it; says so if that takes long.

    Raises:
        TraceError: If a part cannot be compiled; names it.
        MachineError: If the machine code does not agree with the interpreted engine.
    """
    from robot_dyn.simulation.engine.self_check import check

    with announced("compiling the equations of this run, once for its structure"):
        compiled = build()
        check(compiled, setup)
    return compiled


def compiled_for(setup: Setup, equation: StateEquation, swept: tuple[str, ...] = ()) -> CompiledStateEquation:
    """The machine code of a run by itself, not checked yet; `swept` as of `compiled_equation`.

    Raises:
        TraceError: If a part cannot be compiled; names it.
    """
    from robot_dyn.simulation.engine.cache import compiled_equation

    code, (_, jacobian, nonsmooth) = _code(setup, equation), _traces(setup)
    return compiled_equation(
        code, _plain(setup), swept=swept, jacobian=jacobian, cuts=setup.finds_events, nonsmooth=nonsmooth
    )


def _existing(setup: Setup, identified: Identified, what: Traces) -> CompiledStateEquation | None:
    """The machine code in this process or in the store; None if there is none."""
    programs = None
    if "robot_dyn.simulation.engine.cache" not in sys.modules:  # to import it takes ten times as long as the look-up
        programs = stored(identified, what)
        if programs is None:
            return None
    from robot_dyn.simulation.engine.cache import existing

    return existing(identified, what, _plain(setup), setup.finds_events, programs)


def _is_worthwhile(setup: Setup, identified: Identified, what: Traces, seen: float) -> bool:
    """Whether compiling takes less time than this run and those of its structure that were interpreted before it."""
    before, size = interpreted(identified, what), identified.equation.size
    count = before[0] + max(seen * _in_all(setup, size), _evaluations(setup, size))
    if count >= _COMPILED or (count >= _WITHOUT_LOOP and _has_loop(setup)):
        return True
    before[0] = count
    return False


def _has_loop(setup: Setup) -> bool:
    """Whether the time loop is in the store."""
    from robot_dyn.simulation.engine.loop import loop_of

    method = _plain(setup)
    return (
        method is not None
        and loop_of(method, setup.finds_events, holds=bool(setup.plant.equation_of_motion.set_valued)).is_kept()
    )


def _code(setup: Setup, equation: StateEquation) -> StateEquation:
    """The equation that is compiled."""
    return equation if _traces(setup).nonsmooth else equation.in_a_mode


def _traces(setup: Setup) -> Traces:
    method: Any = setup.integrator
    return Traces(None, method.needs_jacobian, method.nonsmooth)


def _plain(setup: Setup) -> Any:
    """The method, if its steps are compiled."""
    method: Any = setup.integrator
    return method if method.plain else None


def _interpreted(setup: Setup, why: str = "") -> str:
    reasons = [why] * bool(why) + ["Jacobian by differences"] * setup.integrator.needs_jacobian
    return f"interpreted ({'; '.join(reasons)})" if reasons else "interpreted"


def _label(compiled_equation: CompiledStateEquation) -> str:
    if compiled_equation.loop is not None:
        return "compiled"
    why = f": {compiled_equation.refused}" if compiled_equation.refused else ""
    return f"compiled (the equation of motion; steps in Python{why})"


def _evaluations(setup: Setup, size: int) -> float:
    """About how many evaluations of an equation of motion of that size a run takes, with its companions."""
    method: Any = setup.integrator
    if method.controls_error:
        of_run = max(_PER_SECOND * setup.duration_s, _PER_SEGMENT * segments(setup))
    else:
        of_run = setup.steps * (method.evaluations_per_step or _GUESSED)
    return of_run * _in_all(setup, size)


def _in_all(setup: Setup, size: int) -> float:
    """Evaluations for each one of a run: those of its Jacobians, and of its companions by halved and by other steps."""
    companions = (2 if setup.integrator.controls_error else 1) if setup.estimate_error else 0
    return (1 + companions) * _with_jacobians(setup, size)


def _with_jacobians(setup: Setup, size: int) -> float:
    """Evaluations for each one of a step, those for a Jacobian by differences in each step included."""
    method: Any = setup.integrator
    return 1 + 2 * size / (method.evaluations_per_step or _GUESSED) if method.needs_jacobian else 1
