"""Machine code of state equations: from this process by structure, from the store, or new.

code = machine_code(equation, method)

Neither LLVM nor CasADi is imported before something is traced or compiled: what exists is looked up before each run.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.codegen.parameters import Parameter, Part, parameters
from robot_dyn.codegen.program import Programs
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.codegen.store.keys import digest, sources_of_programs
from robot_dyn.codegen.waiting import interrupts_later
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import TraceError
from robot_dyn.foundations.values import LRUByIdentity
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.model.right_angles import robot_of
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.compiled.machine_code import CompiledFunctions, MachineCode
from robot_dyn.simulation.compiled.structure import changeable, of_library, structure
from robot_dyn.simulation.dynamics.state_equation import StateEquation

Method = Integrator | Adaptive
_MOST_INSTRUCTIONS = 100_000  # some ten seconds of compiling

_robots, _symbols, _functions, _interpreted = (LRUByIdentity() for _ in range(4))


class Traces(NamedTuple):
    """Options of a trace: `extras` in a sample, see `trace`; the Jacobian; steps in which velocities may jump."""

    extras: tuple[str, ...] | None
    jacobian: bool
    nonsmooth: bool


class Identified(NamedTuple):
    """A state equation whose structure is known.

    Attributes:
        equation: The equation itself.
        compiled_form: The equation that is compiled: in a mode, of a robot with right angles written out in full.
        known: Its parameters.
        described: Its structure, the places of its parameters, and the options of its trace.
        objects: Objects in it that are described by identity.
        lasting: True if `described` identifies all of it, in another process too.
    """

    equation: StateEquation
    compiled_form: StateEquation
    known: tuple[Parameter, ...]
    described: tuple[object, tuple[object, ...], Traces]
    objects: tuple[object, ...]
    lasting: bool

    @property
    def key(self) -> str:
        """Key of its programs in a store."""
        return digest(["programs", sources_of_programs(), repr(self.described)], processor=False)


def machine_code(
    equation: StateEquation,
    method: Method | None = None,
    *,
    lanes: int = 1,
    extras: tuple[str, ...] | None = None,
    swept: tuple[str, ...] = (),
    jacobian: bool = False,
    cuts: bool = False,
    detects: bool = False,
) -> MachineCode:
    """Return a state equation as machine code, from the cache if it is there; not compiled yet.

    Args:
        equation: The equation to compile.
        method: The method of the run, whose time loop is machine code if its steps can be; None for no loop.
        lanes: Number of runs in lock step.
        extras: See `trace`.
        swept: Names of the parameters that differ from run to run.
        jacobian: True for the Jacobian of the rate, even if the method does not need it.
        cuts: True if steps are chosen, or cut at events.
        detects: True if steps in lock step detect which runs may pass a threshold.

    Raises:
        TraceError: If a part of the equation cannot be compiled; names it, with the remedy.
    """
    identified = identify(equation, method, extras, swept, jacobian)
    return _with_loop(identified, _functions_of(identified, lanes, swept), method, lanes, cuts, detects, swept)


def existing(identified: Identified, method: Method, cuts: bool) -> MachineCode | None:
    """Return the machine code of a single run if it is in this process or in the store; or None.

    Args:
        identified: Its state equation.
        method: As in `machine_code`.
        cuts: As in `machine_code`.
    """
    programs = None
    if _functions.known(identified.objects, (identified.described, 1, ())) is None:
        programs = _stored(identified)
        if programs is None:
            return None
    code = _with_loop(identified, _functions_of(identified, programs=programs), method, cuts=cuts)
    return code if code.is_kept() else None


def _functions_of(
    identified: Identified, lanes: int = 1, swept: tuple[str, ...] = (), programs: Programs | None = None
) -> CompiledFunctions:
    """The functions of a structure, cached."""
    equation, known = identified.compiled_form, identified.known

    def compute() -> CompiledFunctions:
        shared, name = _shared(equation, known, lanes, swept), equation.plant.dynamics.name  # pyright: ignore
        return CompiledFunctions(programs or _programs_of(identified), lanes, name, shared, changeable(equation))

    names = tuple(name for name in dict.fromkeys(each.name for each in known) if name in swept)
    functions = _functions.get(identified.objects, (identified.described, lanes, names), compute)
    if (count := functions.programs.instructions) > _MOST_INSTRUCTIONS:
        raise TraceError(
            f"the run takes {count} instructions, more than the {_MOST_INSTRUCTIONS} worth compiling;"
            " simulate it with engine='interpreted'"
        )
    return functions


def _with_loop(
    identified: Identified, functions: CompiledFunctions, method: Any, lanes: int = 1, cuts: bool = False,
    detects: bool = False, swept: tuple[str, ...] = (),
) -> MachineCode:  # fmt: skip
    """These functions with the loop of a method; without one where its step cannot be machine code."""
    loop, refused = None, ""
    if method is not None and method.plain:
        from robot_dyn.simulation.compiled.loop import loop_for

        loop = loop_for(method, identified.compiled_form, cuts, lanes, detects)
        if isinstance(loop, SubsetError):
            loop, refused = None, str(loop)
    equation, compiled_form, known, *_ = identified
    return MachineCode(equation, compiled_form, functions, known, loop, swept, refused)


def with_numbers(code: MachineCode, equation: StateEquation) -> MachineCode:
    """Return the machine code for an equation that differs in parameters alone, swept ones included."""
    compiled_form = _compiled_form(equation, nonsmooth="problem" in code.code.programs)
    known = _parameters(compiled_form, code.swept)
    return replace(code, equation=equation, compiled_form=compiled_form, known=known)


def machine_code_of_constants(equation: StateEquation, method: Method, *, lanes: int = 1) -> MachineCode:
    """Return a state equation as machine code whose numbers are constants: none of them can be changed.

    Args:
        equation: As in `machine_code`.
        method: A method whose steps are machine code too.
        lanes: Number of runs in lock step, of which no sample is recorded.

    Raises:
        TraceError: As in `machine_code`.
    """
    what = _traces(method, None if lanes == 1 else ())
    compiled_form = _compiled_form(equation, what.nonsmooth)
    programs = _traced(compiled_form, (), what, constants=True)
    functions = CompiledFunctions(programs, lanes, compiled_form.plant.dynamics.name)  # pyright: ignore
    identified = Identified(equation, compiled_form, (), ((), (), what), (), False)
    return _with_loop(identified, functions, method, lanes)


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


def identify(
    equation: StateEquation, method: Method | None, extras: tuple[str, ...] | None = None, swept: tuple[str, ...] = (),
    jacobian: bool = False,
) -> Identified:  # fmt: skip
    """Return a state equation with its structure; arguments as in `machine_code`.

    Raises:
        TraceError: If its bodies cannot be compiled.
    """
    what = _traces(method, extras, jacobian)
    compiled_form = _compiled_form(equation, what.nonsmooth)
    known = _parameters(compiled_form, swept)
    described, objects, lasting = structure(compiled_form)
    places = tuple(each.place for each in known)
    return Identified(equation, compiled_form, known, (described, places, what), objects, lasting)


def _traces(method: Method | None, extras: tuple[str, ...] | None, jacobian: bool = False) -> Traces:
    if method is None:
        return Traces(extras, jacobian, False)
    return Traces(extras, jacobian or method.needs_jacobian, method.nonsmooth)


def _compiled_form(equation: StateEquation, nonsmooth: bool) -> StateEquation:
    """The equation that is compiled: a method with steps in which velocities may jump finds the mode by itself."""
    equation = equation if nonsmooth else equation.in_a_mode
    plant = equation.plant
    robot = robot_to_compile(plant.dynamics)
    return equation if robot is plant.dynamics else replace(equation, plant=Plant(robot, plant.effects))


def _parameters(compiled_form: StateEquation, swept: tuple[str, ...]) -> tuple[Parameter, ...]:
    plant = compiled_form.plant
    return parameters(plant.dynamics, plant.effects, compiled_form.controller, swept)  # pyright: ignore


def robot_to_compile(dynamics: Any) -> Robot:
    """Return the robot whose equations are compiled, its right angles written out in full.

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


def _stored(identified: Identified) -> Programs | None:
    """The programs in the store; None if they are not there, or the structure is known in this process alone."""
    store = default_store() if identified.lasting else None
    payload = None if store is None else store.load(identified.key)
    return None if payload is None else Programs.read(payload.decode())


def interpreted_before(identified: Identified) -> list[float]:
    """The count of evaluations that runs of a structure have taken without machine code."""
    return _interpreted.get(identified.objects, (identified.described,), lambda: [0.0])


def _programs_of(identified: Identified) -> Programs:
    """The programs of a state equation.

    Raises:
        TraceError: If a part of it cannot be compiled; names it.
    """
    if (programs := _stored(identified)) is not None:
        return programs
    programs = _traced(identified.compiled_form, identified.known, identified.described[2])
    store = default_store() if identified.lasting else None
    equation = identified.compiled_form
    if store is not None and structure(equation).described == identified.described[0]:  # a trace may have changed it
        store.save(identified.key, str(programs).encode(), f"the equations of {equation.plant.dynamics.name}")  # pyright: ignore
    return programs


@interrupts_later()
def _traced(equation: StateEquation, known: tuple[Parameter, ...], what: Traces, constants: bool = False) -> Programs:
    """The programs of a state equation by a trace; arguments as of `Identified`, and whether numbers are constants."""
    from robot_dyn.codegen.trace.from_casadi import program_of
    from robot_dyn.codegen.trace.symbolic_dynamics import SymbolicDynamics
    from robot_dyn.simulation.compiled.trace import trace

    def bodies(dynamics: Any, part: Part) -> SymbolicDynamics:
        """Its equations in symbols, traced once for a file and its edits."""
        robot, inputs = robot_to_compile(dynamics), tuple(each for each in known if each.part == part)
        if constants:  # cached symbols are of one robot but for the numbers that are inputs
            return SymbolicDynamics(robot)
        described = structure(StateEquation(Plant(robot), None)).described
        places = tuple(each.place for each in inputs)
        return _symbols.get((), (described, places), lambda: SymbolicDynamics(robot, inputs))

    return Programs({name: program_of(each) for name, each in trace(equation, bodies, known, *what).items()})
