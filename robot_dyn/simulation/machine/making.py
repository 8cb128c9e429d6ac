"""The making of machines: state equations traced and compiled, once for all runs of one structure.

machine(equation, method) → Machine
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import replace
from threading import RLock
from typing import Any, NamedTuple, final

from robot_dyn.arithmetic import FLOAT64
from robot_dyn.compiled.cache import default_store
from robot_dyn.compiled.identity import digest, sources_of_programs
from robot_dyn.compiled.interrupts import interrupts_later
from robot_dyn.compiled.loops.call import MachineFunction
from robot_dyn.compiled.loops.source import SubsetError
from robot_dyn.compiled.parameters import Parameter, Part, parameters
from robot_dyn.compiled.program import Program
from robot_dyn.compiled.right_angles import robot_of
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import TraceError
from robot_dyn.integrate import hermite
from robot_dyn.integrate.adaptive import STEPPERS
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.detection import detecting
from robot_dyn.simulation.event_loop import event_loop
from robot_dyn.simulation.machine.machine import Equations, Machine
from robot_dyn.simulation.machine.structure import changeable, of_library, structure
from robot_dyn.simulation.mode_change import end_mode, without_modes
from robot_dyn.simulation.state_equation import StateEquation
from robot_dyn.simulation.time_loop import time_loop

_MOST_INSTRUCTIONS = 100_000  # some ten seconds of compiling
_MOST = 64  # values that are kept


@final
class Recent:
    """Values by hashable keys and by the identity of objects, for as long as all of these live; the latest ones."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], tuple[list[weakref.ref[Any]], Any]] = {}
        self._lock = RLock()  # runs may start in several threads

    def get(self, objects: tuple[Any, ...], more: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """The value of objects and of further, hashable values; it must not hold on to the objects."""
        key = (*map(id, objects), *more)
        with self._lock:
            found = self._kept.pop(key, None)
            if found is None or any(ref() is not each for ref, each in zip(found[0], objects, strict=True)):
                found = [weakref.ref(each) for each in objects], make()
            self._kept[key] = found
            while len(self._kept) > _MOST or any(ref() is None for ref in next(iter(self._kept.values()))[0]):
                del self._kept[next(iter(self._kept))]
            return found[1]

    def known(self, objects: tuple[Any, ...], more: tuple[Any, ...]) -> Any:
        """The value that `get` would give without making it, or None."""
        with self._lock:
            found = self._kept.get((*map(id, objects), *more))
            same = found is not None and all(ref() is each for ref, each in zip(found[0], objects, strict=True))
            return found[1] if found is not None and same else None


_robots, _symbols, _equations = Recent(), Recent(), Recent()


def _robot(dynamics: Any) -> Robot:
    """The robot whose equations are compiled, its right angles written out in full."""

    def make() -> Robot | None:
        robot = robot_of(dynamics)
        if robot is None or not of_library(type(dynamics)):  # another class may have equations of its own
            raise TraceError(
                f"{type(dynamics).__name__} comes from no robot's file and cannot be compiled: take a Robot, "
                "or engine='interpreted'"
            )
        if robot.joint_without_inertia is not None:
            raise TraceError(f"joint {robot.joint_without_inertia!r} carries no inertia: take engine='interpreted'")
        return None if robot is dynamics else robot

    return _robots.get((dynamics,), (), make) or dynamics


def machine(
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
) -> Machine:
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
    made = _identified(equation, swept)

    def make() -> Equations:
        described = None if made.objects else made.described
        programs = _programs(made.equation, made.known, kept, jacobian, nonsmooth, described)
        shared = _shared(made.equation, made.known, lanes, swept)
        return Equations(programs, lanes, made.equation.plant.dynamics.name, shared, changeable(made.equation))  # pyright: ignore

    names = tuple(name for name in dict.fromkeys(each.name for each in made.known) if name in swept)
    equations = _equations.get(made.objects, (made.described, lanes, kept, names, jacobian, nonsmooth), make)
    if equations.instructions > _MOST_INSTRUCTIONS:
        raise TraceError(
            f"the run takes {equations.instructions} instructions, more than the {_MOST_INSTRUCTIONS} worth compiling;"
            " simulate it with engine='interpreted'"
        )
    return _with_loop(made, equations, method, lanes, cuts, detects, swept)


def existing(
    equation: StateEquation, method: Integrator | None, *, jacobian: bool, cuts: bool, nonsmooth: bool
) -> Machine | None:
    """The machine of a single run, arguments as of `machine`, if it has been compiled in this process; or None."""
    made = _identified(equation, ())
    equations = _equations.known(made.objects, (made.described, 1, None, (), jacobian, nonsmooth))
    if equations is None:
        return None
    found = _with_loop(made, equations, method, cuts=cuts)
    return found if found.ready else None


class _Identified(NamedTuple):
    """A state equation, of the robot whose equations are compiled, with its parameters and its structure."""

    equation: StateEquation
    known: tuple[Parameter, ...]
    described: tuple[Any, ...]
    objects: tuple[Any, ...]


def _identified(equation: StateEquation, swept: tuple[str, ...]) -> _Identified:
    plant = equation.plant
    robot = _robot(plant.dynamics)
    own = equation if robot is plant.dynamics else replace(equation, plant=Plant(robot, plant.effects))
    known = parameters(robot, plant.effects, equation.controller, swept)
    described, objects = structure(own)
    return _Identified(own, known, (described, tuple(each.place for each in known)), objects)


def _with_loop(
    made: _Identified, equations: Equations, method: Any, lanes: int = 1, cuts: bool = False, detects: bool = False,
    swept: tuple[str, ...] = (),
) -> Machine:  # fmt: skip
    """The machine of these equations with the loop of a method; without one where its step cannot be machine code."""
    found = None if method is None else _loop(method, made.equation, cuts, lanes, detects)
    if isinstance(found, SubsetError):
        return Machine(made.equation, equations, made.known, None, swept, str(found))
    return Machine(made.equation, equations, made.known, found, swept)


def with_numbers(made: Machine, equation: StateEquation) -> Machine:
    """The machine of an equation that differs from the compiled one in parameters alone, swept ones among them."""
    robot, plant = _robot(equation.plant.dynamics), equation.plant
    own = equation if robot is plant.dynamics else replace(equation, plant=Plant(robot, plant.effects))
    return replace(made, equation=own, known=parameters(robot, plant.effects, equation.controller, made.swept))


def machine_of_constants(equation: StateEquation, method: Integrator, *, lanes: int = 1) -> Machine:
    """The machine of a state equation whose numbers are constants of the code: none of them can be changed.

    Args:
        equation: As of `machine`.
        method: One whose steps are machine code too.
        lanes: Runs in lock step, of which no sample is kept.

    Raises:
        TraceError: As of `machine`.
    """
    robot = _robot(equation.plant.dynamics)
    own = replace(equation, plant=Plant(robot, equation.plant.effects))
    programs = _traced(own, (), None if lanes == 1 else (), method.needs_jacobian, method.nonsmooth, constants=True)
    made = _loop(method, own, False, lanes)
    if isinstance(made, SubsetError):
        raise made
    return Machine(own, Equations(programs, lanes, robot.name), (), made)


def _shared(
    equation: StateEquation, known: tuple[Parameter, ...], lanes: int, swept: tuple[str, ...]
) -> dict[int, int]:
    """Where the numbers stand that all runs in lock step share: behind those of each run, as `Machine.own` has them."""
    if lanes == 1:
        return {}
    held = equation.plant.dynamics.n * equation.sampled
    once = [each.name not in swept for each in known for _ in range(each.size)]
    first = (held + len(once) - sum(once)) * lanes
    numbers = (held + k for k, shared in enumerate(once) if shared)
    return {k: first + i for i, k in enumerate(numbers)}


def _programs(
    equation: StateEquation, known: tuple[Parameter, ...], kept: tuple[str, ...] | None, jacobian: bool,
    nonsmooth: bool, described: Any,
) -> dict[str, Program]:  # fmt: skip
    """The programs of a state equation, from the store if the structure of all its parts is known."""
    store = None if described is None else default_store()
    key = digest(["programs", sources_of_programs(), repr(described), repr(kept), repr(jacobian), repr(nonsmooth)])
    if store is not None and (payload := store.load(key)) is not None:
        texts = payload.decode().split("\n\n")
        return {name: Program.read(text) for name, _, text in (each.partition("\n") for each in texts)}
    programs = _traced(equation, known, kept, jacobian, nonsmooth)
    if store is not None:
        text = "\n\n".join(f"{name}\n{program}" for name, program in programs.items())
        store.save(key, text.encode(), f"the equations of {equation.plant.dynamics.name}")  # pyright: ignore
    return programs


@interrupts_later()
def _traced(
    equation: StateEquation, known: tuple[Parameter, ...], kept: tuple[str, ...] | None, jacobian: bool,
    nonsmooth: bool = False, constants: bool = False,
) -> dict[str, Program]:  # fmt: skip
    from robot_dyn.compiled.from_casadi import program_of
    from robot_dyn.compiled.symbolic_dynamics import SymbolicDynamics
    from robot_dyn.simulation.machine.traced import trace

    def bodies(dynamics: Any, part: Part) -> SymbolicDynamics:
        """Its equations in symbols, traced once for a file and its edits."""
        robot, own = _robot(dynamics), tuple(each for each in known if each.part == part)
        if constants:  # what is kept tells robots apart but for the numbers that are inputs
            return SymbolicDynamics(robot)
        (described, *_), _ = structure(StateEquation(Plant(robot), None))
        inputs = tuple(each.place for each in own)
        return _symbols.get((), (described, inputs), lambda: SymbolicDynamics(robot, own))

    traced = trace(equation, bodies, known, kept, jacobian, nonsmooth)
    return {name: program_of(each) for name, each in traced.items()}


def _loop(
    method: Any, equation: StateEquation, cuts: bool, lanes: int, detects: bool = False
) -> MachineFunction | SubsetError:
    """The loop of a method; or why its step, written elsewhere, cannot be machine code. Runs in lock step need it."""
    from robot_dyn.simulation.machine.loop import refusal

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
        detects: As of `machine`.
        holds: Whether something may hold joints.
    """
    from robot_dyn.simulation.machine.loop import loop

    if not cuts:
        step = method.stepper(FLOAT64, 1, 0, 1).step
        return loop(time_loop, detecting(step) if detects else step, works=method.nonsmooth)
    made = STEPPERS[method.method](1, 1, 1) if method.controls_error else hermite.stepper(method, 1, 0, 1, None)
    of_modes = end_mode if holds else without_modes
    return loop(event_loop, made.begin, made.step, made.error, made.accept, made.dense, of_modes)
