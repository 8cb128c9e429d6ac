"""Machine code of state equations: cached by structure in this process, from the store, or new.

    code = machine_code(equation, method)

Each run first checks these caches; LLVM and CasADi are imported only to trace or compile.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, cast

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
from robot_dyn.integrate.integrator import Integrator, PlainMethod
from robot_dyn.model.right_angles import robot_of
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.compiled.machine_code import CompiledFunctions, MachineCode
from robot_dyn.simulation.compiled.structure import changeable, of_library, structure
from robot_dyn.simulation.dynamics.state_equation import StateEquation

Method = Integrator | Adaptive
_MOST_INSTRUCTIONS = 100_000  # about ten seconds of compiling

_robots, _symbols, _functions, _interpreted = (LRUByIdentity() for _ in range(4))


class Traces(NamedTuple):
    """Options of a trace; see `trace`."""

    extras: tuple[str, ...] | None
    jacobian: bool
    nonsmooth: bool


class Identified(NamedTuple):
    """A state equation with its structure, which identifies its machine code.

    Attributes:
        equation: The state equation.
        compiled_form: The equation that is compiled: in a mode, and with right angles exact to float64.
        inputs: Parameters of the machine code.
        described: The structure, the places of the parameters, and the options of the trace.
        objects: Objects that are compared by identity.
        lasting: True if `described` also identifies the equation in other processes.
    """

    equation: StateEquation
    compiled_form: StateEquation
    inputs: tuple[Parameter, ...]
    described: tuple[object, tuple[object, ...], Traces]
    objects: tuple[object, ...]
    lasting: bool

    @property
    def key(self) -> str:
        """Key of the programs in a store."""
        return digest(["programs", sources_of_programs(), repr(self.described)], processor=False)


def machine_code(
    equation: StateEquation,
    method: Method | None = None,
    *,
    lanes: int = 1,
    extras: tuple[str, ...] | None = None,
    swept: tuple[str, ...] = (),
    cuts: bool = False,
    detects: bool = False,
) -> MachineCode:
    """Return a state equation as machine code, cached if possible; it is compiled on first use.

    Args:
        equation: The equation to compile.
        method: Method of the run; its time loop is compiled too if its steps can be compiled. None for no loop.
        lanes: Number of runs in lock step.
        extras: See `trace`.
        swept: Names of the parameters that differ from run to run.
        cuts: True if the method chooses its steps, or if steps end at events.
        detects: True if steps in lock step detect which runs may pass a threshold.

    Raises:
        TraceError: If a part of the equation cannot be compiled; the message names it and a remedy.
    """
    identified = identify(equation, method, extras, swept)
    return _with_loop(identified, _functions_of(identified, lanes, swept), method, lanes, cuts, detects, swept)


def existing(identified: Identified, method: Method, cuts: bool) -> MachineCode | None:
    """Return the machine code of a single run if this process or the store has it, otherwise None.

    Args:
        identified: The state equation of the run.
        method: See `machine_code`.
        cuts: See `machine_code`.
    """
    programs = None
    if _functions.cached_value(identified.objects, (identified.described, 1, ())) is None:
        programs = _stored(identified)
        if programs is None:
            return None
    code = _with_loop(identified, _functions_of(identified, programs=programs), method, cuts=cuts)
    return code if code.is_kept() else None


def _functions_of(
    identified: Identified, lanes: int = 1, swept: tuple[str, ...] = (), programs: Programs | None = None
) -> CompiledFunctions:
    """Return the functions of a structure, which are cached; raise TraceError if they have too many instructions."""
    equation, inputs = identified.compiled_form, identified.inputs

    def compute() -> CompiledFunctions:
        shared, name = _shared(equation, inputs, lanes, swept), equation.plant.dynamics.name  # pyright: ignore
        return CompiledFunctions(programs or _programs_of(identified), lanes, name, shared, changeable(equation))

    names = tuple(name for name in dict.fromkeys(x.name for x in inputs) if name in swept)
    functions = _functions.get(identified.objects, (identified.described, lanes, names), compute)
    if (count := functions.programs.instructions) > _MOST_INSTRUCTIONS:
        raise TraceError(
            f"the run takes {count} instructions, more than the {_MOST_INSTRUCTIONS} worth compiling;"
            " simulate it with engine='interpreted'"
        )
    return functions


def _with_loop(
    identified: Identified, functions: CompiledFunctions, method: Method | None, lanes: int = 1, cuts: bool = False,
    detects: bool = False, swept: tuple[str, ...] = (),
) -> MachineCode:  # fmt: skip
    """Return functions with the loop of a method; without a loop if its step cannot be machine code."""
    loop, refused = None, ""
    if isinstance(method, PlainMethod | Adaptive):
        from robot_dyn.simulation.compiled.loop import loop_for

        loop = loop_for(method, identified.compiled_form, cuts, lanes, detects)
        if isinstance(loop, SubsetError):
            loop, refused = None, str(loop)
    equation, compiled_form, inputs, *_ = identified
    return MachineCode(equation, compiled_form, functions, inputs, loop, swept, refused)


def with_numbers(code: MachineCode, equation: StateEquation) -> MachineCode:
    """Return the machine code for an equation that differs only in parameters, including those that are not swept."""
    compiled_form = _compiled_form(equation, nonsmooth="problem" in code.code.programs)
    inputs = _parameters(compiled_form, code.swept)
    return replace(code, equation=equation, compiled_form=compiled_form, inputs=inputs)


def machine_code_of_constants(equation: StateEquation, method: Method) -> MachineCode:
    """Return a state equation as machine code without parameters: all its numbers are constants.

    Args:
        equation: The equation to compile.
        method: Method with plain steps.

    Raises:
        TraceError: If a part of the equation cannot be compiled; the message names it and a remedy.
    """
    options = _traces(method, None)
    compiled_form = _compiled_form(equation, options.nonsmooth)
    programs = _traced(compiled_form, (), options, constants=True)
    functions = CompiledFunctions(programs, 1, compiled_form.plant.dynamics.name)  # pyright: ignore
    identified = Identified(equation, compiled_form, (), ((), (), options), (), False)
    return _with_loop(identified, functions, method)


def _shared(
    equation: StateEquation, inputs: tuple[Parameter, ...], lanes: int, swept: tuple[str, ...]
) -> dict[int, int]:
    """Return the places of the parameters shared by all runs in lock step, by index; they follow those of each run.

    See `MachineCode.run_parameters` for the layout.
    """
    if lanes == 1:
        return {}
    held = equation.plant.dynamics.n * equation.sampled
    is_shared = [x.name not in swept for x in inputs for _ in range(x.size)]
    first = (held + len(is_shared) - sum(is_shared)) * lanes
    numbers = (held + k for k, shared in enumerate(is_shared) if shared)
    return {k: first + i for i, k in enumerate(numbers)}


def identify(
    equation: StateEquation, method: Method | None, extras: tuple[str, ...] | None = None, swept: tuple[str, ...] = ()
) -> Identified:
    """Return a state equation with its structure; see `machine_code` for the arguments.

    Raises:
        TraceError: If the dynamics of the arm cannot be compiled.
    """
    options = _traces(method, extras)
    compiled_form = _compiled_form(equation, options.nonsmooth)
    inputs = _parameters(compiled_form, swept)
    described, objects, lasting = structure(compiled_form)
    places = tuple(x.place for x in inputs)
    return Identified(equation, compiled_form, inputs, (described, places, options), objects, lasting)


def _traces(method: Method | None, extras: tuple[str, ...] | None) -> Traces:
    return Traces(extras, False, False) if method is None else Traces(extras, method.needs_jacobian, method.nonsmooth)


def _compiled_form(equation: StateEquation, nonsmooth: bool) -> StateEquation:
    """Return the equation to compile, in a mode unless the method determines the mode in each step (`nonsmooth`)."""
    equation = equation if nonsmooth else equation.in_a_mode
    plant = equation.plant
    robot = robot_to_compile(plant.dynamics)
    return equation if robot is plant.dynamics else replace(equation, plant=Plant(robot, plant.effects))


def _parameters(compiled_form: StateEquation, swept: tuple[str, ...]) -> tuple[Parameter, ...]:
    plant = compiled_form.plant
    return parameters(plant.dynamics, plant.effects, compiled_form.controller, swept)  # pyright: ignore


def robot_to_compile(dynamics: object) -> Robot:
    """Return the robot to compile, with right angles exact to float64; see `model.right_angles`.

    Raises:
        TraceError: If the dynamics were not loaded from a robot's file, or a joint has no inertia.
    """

    def compute() -> Robot | None:
        robot = robot_of(dynamics)
        if robot is None or not of_library(type(dynamics)):  # another class may have other equations
            raise TraceError(
                f"{type(dynamics).__name__} is not a Robot and cannot be compiled: use a Robot, or engine='interpreted'"
            )
        if robot.joint_without_inertia is not None:
            raise TraceError(f"joint {robot.joint_without_inertia!r} carries no inertia: use engine='interpreted'")
        return None if robot is dynamics else robot

    return _robots.get((dynamics,), (), compute) or cast(Robot, dynamics)


def _stored(identified: Identified) -> Programs | None:
    """Return the programs in the store; None if there are none, or if only this process can identify the structure."""
    store = default_store() if identified.lasting else None
    payload = None if store is None else store.load(identified.key)
    return None if payload is None else Programs.read(payload.decode())


def interpreted_before(identified: Identified) -> list[float]:
    """Return the evaluations spent in interpreted runs of a structure so far, as a list of one number.

    `choice` updates this list.
    """
    return _interpreted.get(identified.objects, (identified.described,), lambda: [0.0])


def _programs_of(identified: Identified) -> Programs:
    """Return the programs of a state equation, from the store or by a trace, which is stored.

    Raises:
        TraceError: If a part of the equation cannot be compiled; the message names it.
    """
    if (programs := _stored(identified)) is not None:
        return programs
    programs = _traced(identified.compiled_form, identified.inputs, identified.described[2])
    store = default_store() if identified.lasting else None
    equation = identified.compiled_form
    if store is not None and structure(equation).described == identified.described[0]:  # a trace may have changed it
        store.save(identified.key, str(programs).encode(), f"the equations of {equation.plant.dynamics.name}")  # pyright: ignore
    return programs


@interrupts_later()
def _traced(
    equation: StateEquation, inputs: tuple[Parameter, ...], options: Traces, constants: bool = False
) -> Programs:  # fmt: skip
    """Return the programs of a state equation by a trace; with `constants`, no number is a parameter."""
    from robot_dyn.codegen.trace.from_casadi import program_of
    from robot_dyn.codegen.trace.symbolic_dynamics import SymbolicDynamics
    from robot_dyn.simulation.compiled.trace import trace

    def symbols_of(dynamics: Dynamics, part: Part) -> SymbolicDynamics:
        """Return the symbolic equations of a robot, cached by its file, edits and parameters."""
        robot, of_robot = robot_to_compile(dynamics), tuple(x for x in inputs if x.part == part)
        if constants:  # cached symbols are valid for other values of the parameters, not for other constants
            return SymbolicDynamics(robot)
        described = structure(StateEquation(Plant(robot), None)).described
        places = tuple(x.place for x in of_robot)
        return _symbols.get((), (described, places), lambda: SymbolicDynamics(robot, of_robot))

    functions = trace(equation, symbols_of, inputs, *options)
    return Programs({name: program_of(function) for name, function in functions.items()})
