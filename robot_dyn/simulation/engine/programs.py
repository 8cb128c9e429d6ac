"""The programs of a state equation: by its structure from the store, or traced.

Neither LLVM nor CasADi is imported before something is traced: whether programs are stored is checked before each run.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from robot_dyn.codegen.parameters import Parameter, Part, parameters
from robot_dyn.codegen.program import Programs
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.codegen.store.keys import digest, sources_of_programs
from robot_dyn.codegen.trace.right_angles import robot_of
from robot_dyn.codegen.waiting import interrupts_later
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import TraceError
from robot_dyn.foundations.values import LRUByIdentity
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.structure import of_library, structure

_robots, _symbols, _interpreted = LRUByIdentity(), LRUByIdentity(), LRUByIdentity()


class Traces(NamedTuple):
    """What is traced of a state equation.

    Attributes:
        extras: As of `trace`.
        jacobian: Whether the method needs that of the rate.
        nonsmooth: Whether velocities may jump within steps.
    """

    extras: tuple[str, ...] | None = None
    jacobian: bool = False
    nonsmooth: bool = False


class Identified(NamedTuple):
    """A state equation whose structure is known.

    Attributes:
        equation: That of the robot whose equations are compiled.
        known: Its parameters.
        described: Its structure, and where the parameters stand.
        objects: What stands in it by identity.
        lasting: Whether `described` identifies all of it, in another process too.
    """

    equation: StateEquation
    known: tuple[Parameter, ...]
    described: tuple[Any, ...]
    objects: tuple[Any, ...]
    lasting: bool

    def key(self, what: Traces) -> str:
        """Of its programs in a store."""
        return digest(["programs", sources_of_programs(), repr(self.described), repr(what)], processor=False)


def identify(equation: StateEquation, swept: tuple[str, ...] = ()) -> Identified:
    """A state equation with its structure.

    Args:
        equation: Any.
        swept: Names of the parameters that differ from run to run.

    Raises:
        TraceError: If its bodies cannot be compiled.
    """
    plant = equation.plant
    robot = robot_to_compile(plant.dynamics)
    compiled_form = equation if robot is plant.dynamics else replace(equation, plant=Plant(robot, plant.effects))
    known = parameters(robot, plant.effects, equation.controller, swept)
    described, objects, lasting = structure(compiled_form)
    return Identified(compiled_form, known, (described, tuple(each.place for each in known)), objects, lasting)


def robot_to_compile(dynamics: Any) -> Robot:
    """The robot whose equations are compiled, its right angles written out in full.

    Raises:
        TraceError: If there is none, or it has no answer.
    """

    def compute() -> Robot | None:
        robot = robot_of(dynamics)
        if robot is None or not of_library(type(dynamics)):  # another class may have equations of its own
            raise TraceError(
                f"{type(dynamics).__name__} comes from no robot's file and cannot be compiled: take a Robot, "
                "or engine='interpreted'"
            )
        if robot.joint_without_inertia is not None:
            raise TraceError(f"joint {robot.joint_without_inertia!r} carries no inertia: take engine='interpreted'")
        return None if robot is dynamics else robot

    return _robots.get((dynamics,), (), compute) or dynamics


def stored(identified: Identified, what: Traces) -> Programs | None:
    """The programs in the store; None if they are not there, or the structure is known in this process alone."""
    store = default_store() if identified.lasting else None
    payload = None if store is None else store.load(identified.key(what))
    return None if payload is None else Programs.read(payload.decode())


def interpreted(identified: Identified, what: Traces) -> list[float]:
    """The count of evaluations that runs of a structure have taken without machine code."""
    return _interpreted.get(identified.objects, (identified.described, what), lambda: [0.0])


def programs_of(identified: Identified, what: Traces) -> Programs:
    """The programs of a state equation.

    Raises:
        TraceError: If a part of it cannot be compiled; names it.
    """
    if (programs := stored(identified, what)) is not None:
        return programs
    programs = traced(identified.equation, identified.known, what)
    store = default_store() if identified.lasting else None
    equation = identified.equation
    if store is not None and structure(equation).described == identified.described[0]:  # a trace may have changed it
        store.save(identified.key(what), str(programs).encode(), f"the equations of {equation.plant.dynamics.name}")  # pyright: ignore
    return programs


@interrupts_later()
def traced(equation: StateEquation, known: tuple[Parameter, ...], what: Traces, constants: bool = False) -> Programs:
    """The programs of a state equation by a trace; arguments as of `Identified`, and whether numbers are constants."""
    from robot_dyn.codegen.trace.from_casadi import program_of
    from robot_dyn.codegen.trace.symbolic_dynamics import SymbolicDynamics
    from robot_dyn.simulation.engine.trace import trace

    def bodies(dynamics: Any, part: Part) -> SymbolicDynamics:
        """Its equations in symbols, traced once for a file and its edits."""
        robot, inputs = robot_to_compile(dynamics), tuple(each for each in known if each.part == part)
        if constants:  # cached symbols are of one robot but for the numbers that are inputs
            return SymbolicDynamics(robot)
        described = structure(StateEquation(Plant(robot), None)).described
        places = tuple(each.place for each in inputs)
        return _symbols.get((), (described, places), lambda: SymbolicDynamics(robot, inputs))

    return Programs({name: program_of(each) for name, each in trace(equation, bodies, known, *what).items()})
