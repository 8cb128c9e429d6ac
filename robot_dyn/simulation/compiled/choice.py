"""The choice of the engine for a setup or a batch: machine code, or Python if compiling takes longer or is impossible.

The criterion is the approximate number of evaluations of the equation of motion, so that it is the same on every
machine. Machine code that is in this process or in the store is always used.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.values import cached
from robot_dyn.foundations.waiting import log_if_slow
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import PlainMethod
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

# Interpreted evaluations, of about 0.1 ms, that take as long as imports, trace and LLVM, 1 to 2 s; half as many if the
# time loop is in the store. The loop is compiled once for a version of this library.
_COMPILED = 20_000
_WITHOUT_LOOP = _COMPILED / 2
_GUESSED = 10  # evaluations in a step of an implicit method, without those of its Jacobian
_PER_SECOND, _PER_SEGMENT = 1000, 17  # evaluations of an adaptive method: per second, and at least per segment


def choose(setup: Setup, min_evaluations: float) -> Engine:
    """Return the engine of a setup, as `engine.choice`; machine code with events is checked for each run."""
    return cached(
        setup, engine_of, min_evaluations, lasts=lambda engine: isinstance(engine, MachineCode) and not setup.events
    )


def engine_of(setup: Setup, min_evaluations: float) -> Engine:
    """Return the engine of a setup, for `choose`, which caches it."""
    required = setup.engine == "compiled"
    try:
        identified = identify(setup.equation, setup.method)
        code = existing(identified, setup.method, setup.finds_events)
        if code is not None:
            check(code, setup)
            return code
        if not required and not _is_worthwhile(setup, interpreted_before(identified), min_evaluations):
            most = _COMPILED / _in_all(setup, setup.equation.size) if setup.method.controls_error else inf
            return interpreted_engine(setup, "the run is too short to compile", most)
        return checked(setup, lambda: _of_one_run(setup))
    except (ImportError, RobotDynError) as error:
        if required:
            raise
        return interpreted_engine(setup, str(error))


def choose_for_batch(setup: Setup, swept: tuple[str, ...]) -> Engine:
    """Return the engine for runs one after the other on each thread: machine code unless engine="interpreted".

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
    with log_if_slow("compiling the equations of this run (cached for runs of the same structure)"):
        code = build()
        check(code, setup)
    return code


def _of_one_run(setup: Setup, swept: tuple[str, ...] = ()) -> MachineCode:
    return machine_code(setup.equation, setup.method, swept=swept, cuts=setup.finds_events)


def _is_worthwhile(setup: Setup, before: list[float], min_evaluations: float) -> bool:
    """Return True if compiling takes less time than this run and the earlier interpreted runs of its structure.

    Otherwise, the evaluations of the run are added to `before`, those of the earlier runs.
    """
    size = setup.equation.size
    count = before[0] + max(min_evaluations * _in_all(setup, size), _evaluations(setup, size))
    if count >= _COMPILED or (count >= _WITHOUT_LOOP and _has_loop(setup)):
        return True
    before[0] = count
    return False


def _has_loop(setup: Setup) -> bool:
    """Return True if the time loop is in the store."""
    from robot_dyn.simulation.compiled.loop import loop_of

    method, holds = setup.method, bool(setup.plant.equation_of_motion.set_valued)
    return isinstance(method, PlainMethod | Adaptive) and loop_of(method, setup.finds_events, holds=holds).is_kept()


def _evaluations(setup: Setup, size: int) -> float:
    """Return about the number of evaluations of a run with its companions, for an equation with `size` entries of y."""
    if isinstance(setup.method, Adaptive):
        count = max(_PER_SECOND * setup.duration_s, _PER_SEGMENT * segments(setup))
    else:
        count = setup.steps * (setup.method.evaluations_per_step or _GUESSED)
    return count * _in_all(setup, size)


def _in_all(setup: Setup, size: int) -> float:
    """Return the total number of evaluations per evaluation of a run: with its Jacobians and its companion runs."""
    companions = (2 if setup.method.controls_error else 1) if setup.estimate_error else 0
    return (1 + companions) * _with_jacobians(setup, size)


def _with_jacobians(setup: Setup, size: int) -> float:
    """Return the number of evaluations per evaluation of a step, with a Jacobian by differences in each step."""
    if not setup.method.needs_jacobian:
        return 1
    return 1 + 2 * size / (setup.method.evaluations_per_step or _GUESSED)
