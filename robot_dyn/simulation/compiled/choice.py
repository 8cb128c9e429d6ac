"""The engine of machine code for a setup or a batch, or Python where compiling is not worthwhile or impossible.

The choice is made by a count, about how often the equation of motion is evaluated: the same on every machine.
Machine code that this process already has, or the store, is used in any case.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.values import cached
from robot_dyn.foundations.waiting import log_if_slow
from robot_dyn.simulation.compiled.cache import (
    existing,
    identify,
    interpreted_before,
    machine_code,
    with_numbers,
)
from robot_dyn.simulation.compiled.machine_code import MachineCode
from robot_dyn.simulation.compiled.self_check import check
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.engine.interpreted import Interpreted, interpreted_engine
from robot_dyn.simulation.setup.setup import Setup, segments

# Interpreted, an evaluation takes some 0.1 ms: these take about as long as imports, trace and LLVM, 1 to 2 s; half of
# it without the time loop, which is compiled once for a version of this library.
_COMPILED = 20_000
_WITHOUT_LOOP = _COMPILED / 2
_GUESSED = 10  # evaluations in a step of an implicit method, beside those of its Jacobian
_PER_SECOND, _PER_SEGMENT = 1000, 17  # evaluations of an adaptive method: for each second, at least for each segment


def choose(setup: Setup, seen: float) -> Engine:
    """Return the engine of a setup, as `engine.choice`; machine code with events is checked for each run."""
    return cached(setup, engine_of, seen, lasts=lambda engine: isinstance(engine, MachineCode) and not setup.events)


def engine_of(setup: Setup, seen: float) -> Engine:
    """Return the engine of a setup, for `choose`, which caches it."""
    required = setup.engine == "compiled"
    try:
        identified = identify(setup.equation, setup.method)
        code = existing(identified, setup.method, setup.finds_events)
        if code is not None:
            check(code, setup)
            return code
        if not required and not _is_worthwhile(setup, interpreted_before(identified), seen):
            most = _COMPILED / _in_all(setup, setup.equation.size) if setup.method.controls_error else inf
            return interpreted_engine(setup, "short: compiling is not worthwhile", most)
        return checked(setup, lambda: _of_one_run(setup))
    except (ImportError, RobotDynError) as error:
        if required:
            raise
        return interpreted_engine(setup, str(error))


def choose_for_batch(setup: Setup, swept: tuple[str, ...]) -> Engine:
    """Return the engine of runs that go one after the other on each thread: machine code, unless it is not wanted.

    Args:
        setup: The setup of all runs.
        swept: Names of the parameters that differ from run to run.

    Raises:
        TraceError: If a part cannot be compiled; names it.
        MachineError: If the machine code does not agree with the interpreted engine.
    """
    if setup.engine == "interpreted":
        return interpreted_engine(setup)
    return checked(setup, lambda: _of_one_run(setup, swept))


def for_run(engine: Engine, batch: Setup, setup: Setup) -> Engine:
    """Return the engine of a run of a batch.

    Args:
        engine: The engine of the batch.
        batch: The setup of the batch.
        setup: The setup of the run, which differs in parameters, start and noise.
    """
    if not isinstance(engine, MachineCode):
        return Interpreted(setup.equation)
    if engine.compiled_form.limited != setup.equation.limited or setup.finds_events != batch.finds_events:
        return _of_one_run(setup, engine.swept)
    return with_numbers(engine, setup.equation)


def checked(setup: Setup, build: Callable[[], MachineCode]) -> MachineCode:
    """Return the machine code that `build` returns, after its self-check, which compiles it; log a long wait.

    Raises:
        TraceError: If a part cannot be compiled; names it.
        MachineError: If the machine code does not agree with the interpreted engine.
    """
    with log_if_slow("compiling the equations of this run, once for its structure"):
        code = build()
        check(code, setup)
    return code


def _of_one_run(setup: Setup, swept: tuple[str, ...] = ()) -> MachineCode:
    return machine_code(setup.equation, setup.method, swept=swept, cuts=setup.finds_events)


def _is_worthwhile(setup: Setup, before: list[float], seen: float) -> bool:
    """Whether compiling takes less time than this run and those of its structure that were interpreted before it."""
    size = setup.equation.size
    count = before[0] + max(seen * _in_all(setup, size), _evaluations(setup, size))
    if count >= _COMPILED or (count >= _WITHOUT_LOOP and _has_loop(setup)):
        return True
    before[0] = count
    return False


def _has_loop(setup: Setup) -> bool:
    """Whether the time loop is in the store."""
    from robot_dyn.simulation.compiled.loop import loop_of

    method, holds = setup.method, bool(setup.plant.equation_of_motion.set_valued)
    return method.plain and loop_of(method, setup.finds_events, holds=holds).is_kept()


def _evaluations(setup: Setup, size: int) -> float:
    """About how many evaluations of an equation of motion of that size a run takes, with its companions."""
    method: Any = setup.method
    if method.controls_error:
        of_run = max(_PER_SECOND * setup.duration_s, _PER_SEGMENT * segments(setup))
    else:
        of_run = setup.steps * (method.evaluations_per_step or _GUESSED)
    return of_run * _in_all(setup, size)


def _in_all(setup: Setup, size: int) -> float:
    """Evaluations for each one of a run: those of its Jacobians, and of its companions by halved and by other steps."""
    companions = (2 if setup.method.controls_error else 1) if setup.estimate_error else 0
    return (1 + companions) * _with_jacobians(setup, size)


def _with_jacobians(setup: Setup, size: int) -> float:
    """Evaluations for each one of a step, those for a Jacobian by differences in each step included."""
    method: Any = setup.method
    return 1 + 2 * size / (method.evaluations_per_step or _GUESSED) if method.needs_jacobian else 1
