"""C source of an arm, a plant or the tick of a controller: a header, a source file, a self-test and CMakeLists.txt."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from string import Template
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import DTypeLike

import robot_dyn as rd
from robot_dyn.codegen import Parameter, Program, name_of_dtype, program_of
from robot_dyn.control import Controller
from robot_dyn.foundations import (
    UNREPORTED,
    Answer,
    Block,
    ExportError,
    QueryError,
    Table,
    Value,
    check_folder,
    file_path,
    save,
    shown,
    truth,
)
from robot_dyn.queries import coefficient_unit, joint_units
from robot_dyn.tools.export.equations import Equations, chosen, equations_of
from robot_dyn.tools.export.exported import values_of
from robot_dyn.tools.export.operations import literal, math_functions, statements
from robot_dyn.tools.export.rounding import UNITS, StatesOfArm, bound, box_of
from robot_dyn.tools.export.tick import Tick, TickStates, tick_of

_OF_TEST = 20  # states of the self-test
_LONGEST = 20_000  # instructions; compilers take minutes for longer functions
_STATED = 1e4  # rounding units, about 1e-12 in double: larger bounds are not stated
_MARGIN, _LEAST = 16, 8  # tolerance of the self-test, in largest differences or in rounding units


@final
@dataclass(frozen=True)
class CFunction:
    """One exported function.

    Attributes:
        quantity: Name of the quantity, or "tick".
        arguments: Names of its arguments; the arrays of results are the last ones.
        instructions: Number of operations.
        difference: Largest difference from Pinocchio (and the interpreted effects) at 10 000 random states within the
            limits, or from the controller's own code at 1000, divided by the scale of the entry.
        bound: Proven bound of the rounding error of M or N at all states within the limits, divided by the same scale;
            None if it is not below 10⁴ rounding units.
    """

    quantity: str
    arguments: tuple[str, ...]
    instructions: int
    difference: float
    bound: float | None


@final
@dataclass(frozen=True, eq=False, repr=False)
class CSource(Answer, Value):
    """C source of an arm, a plant or a controller.

    Attributes:
        name: Prefix of all names in C.
        dtype: "float64" for double or "float32" for float.
        functions: The exported functions.
        math: Functions of <math.h> that they call, without the suffix of float.
        renamed: Names that C does not allow, and the identifiers used instead.
        files: Texts by file name.
    """

    name: str
    dtype: str
    functions: tuple[CFunction, ...]
    math: tuple[str, ...]
    renamed: Mapping[str, str]
    files: Mapping[str, str] = field(metadata=UNREPORTED)

    def write(self, folder: str | Path, *, force: bool = False) -> tuple[Path, ...]:
        """Write the files into a folder, which is created if missing; return their paths.

        Args:
            folder: Path of the folder.
            force: True to replace existing files.

        Raises:
            ExportError: If a file exists and `force` is False, or the folder cannot be written.
        """
        truth("force", force)
        folder = file_path(folder, ExportError)
        check_folder(folder, ExportError)
        paths = tuple(folder / name for name in self.files)
        if existing := [str(path) for path in paths if path.exists() and not force]:
            raise ExportError(
                f"{', '.join(existing)}: exists; add --force to replace it (in Python force=True), or give another"
                " folder"
            )
        folder.mkdir(parents=True, exist_ok=True)
        for path, text in zip(paths, self.files.values(), strict=True):
            save(path, lambda stream, text=text: stream.write(text.encode()), ExportError)
        return paths

    def blocks(self) -> Iterator[Block]:
        head = "function", "arguments", "instructions", "difference", "bound"
        rows = [
            (x.quantity, ", ".join(x.arguments), x.instructions, f"{x.difference:.1e}", _bound(x.bound))
            for x in self.functions
        ]
        tick = self.functions[0].quantity == "tick"
        of = f"the controller in Python at {Tick.states}" if tick else f"Pinocchio at {Equations.states}"
        yield f"{self.name}, {_real(self.dtype)}: differences from {of} states{'' if tick else ', and proven bounds'}"
        yield Table(head, tuple(rows), right=head[3:])
        yield f"functions of <math.h>: {', '.join(self.math) or 'none'}"
        if self.renamed:
            yield Table(("name", "in C"), tuple(self.renamed.items()))


def c_source(
    system: rd.Robot | rd.Plant | Controller,
    quantities: Iterable[str] | None = None,
    *,
    dtype: DTypeLike = "float64",
    name: str | None = None,
) -> CSource:
    """Return C source of M, C, N, inverse and forward dynamics, or of a controller's tick; no heap, no static data.

    Coefficients of effects and controllers, gravity and payloads are entries of an array p; other numbers of a robot
    are constants. Right angles that the file states with few digits are exact, as in `rd.compiled`.

    The tick maps the measured q, v, the reference q_d, v_d, a_d at that time, and the states z to torques u and the
    next states; inputs that a law does not use are left out. The period is a constant; bounds of a plant are not in it.

    Args:
        system: A robot, a plant with smooth or piecewise effects without states, or a controller.
        quantities: Some of "M", "C", "N", "inverse_dynamics", "forward_dynamics"; by default all of up to eight
            joints, N and inverse dynamics of more. None for a controller.
        dtype: np.float64 for double or np.float32 for float, or its name.
        name: Prefix of all names in C; by default the name of the robot, or the kind of controller.

    Returns:
        The files, with the errors of each function.

    Raises:
        ExportError: If an effect switches, holds joints or has states, a function would be too long, or a controller
            is continuous with states, has delays or noise, or cannot be traced.
        QueryError: If an argument is not allowed.
        SelfCheckError: If the equations differ from an independent implementation.
    """
    if name is not None and not (isinstance(name, str) and name.strip()):
        raise QueryError(f"name must be a text, such as 'ur5', got {shown(name)}")
    dtype = name_of_dtype(dtype)
    if isinstance(system, Controller):
        if quantities is not None:
            raise QueryError(f"quantities must be None for a controller, got {shown(quantities)}")
        exported, names = tick_of(system), ("tick",)
    else:
        exported = equations_of(system)
        names = chosen(exported, quantities)
    traced = {x: exported.function(x) for x in names}
    programs = {x: program_of(function) for x, function in traced.items()}
    for quantity, program in programs.items():
        if len(program) > _LONGEST:
            raise ExportError(f"{quantity} has {len(program)} instructions, more than {_LONGEST}; leave it out")
        if isinstance(exported, Equations):
            exported.check(quantity, traced[quantity], program, dtype)
    states = _states(exported, dtype, exported.states)
    functions = tuple(_function(states, x, programs[x], tuple(traced[x].name_in())) for x in names)
    renamed: dict[str, str] = {}
    prefix = _identifier(name or exported.name, renamed, "arm_")
    math = tuple(sorted(set().union(*map(math_functions, programs.values()))))
    text = _Text(exported, prefix, dtype, functions, math, traced)
    files = {
        f"{prefix}_{exported.kind}.h": text.header(renamed),
        f"{prefix}_{exported.kind}.c": text.source(programs),
        f"{prefix}_self_test.c": text.self_test(states),
        "CMakeLists.txt": _filled("CMakeLists.txt.in", library=f"{prefix}_{exported.kind}", name=prefix),
    }
    return CSource(prefix, dtype, functions, math, renamed, files)


def _states(exported: Equations | Tick, dtype: str, count: int, seed: int = 0) -> StatesOfArm | TickStates:
    of_kind = TickStates if isinstance(exported, Tick) else StatesOfArm
    return of_kind(dtype, count, exported, seed=seed)  # pyright: ignore[reportArgumentType]  of that kind


def _function(
    states: StatesOfArm | TickStates, quantity: str, program: Program, arguments: tuple[str, ...]
) -> CFunction:
    unit, largest = UNITS[states.dtype], None
    if isinstance(states, StatesOfArm) and quantity in ("M", "N") and "t" not in arguments:
        boxes = [box_of(states.equations, x) for x in arguments]
        if (errors := bound(program, boxes, unit)) is not None:
            largest = float(np.max(errors / states.scale(quantity).ravel()))
    is_stated = largest is not None and largest < _STATED * unit
    difference = states.largest_error(quantity, program, arguments)
    return CFunction(quantity, arguments, len(program), difference, largest if is_stated else None)


def _identifier(name: str, renamed: dict[str, str], before: str = "") -> str:
    """Return a C identifier for a name, and note it in `renamed` if it differs."""
    text = re.sub(r"[^0-9A-Za-z_]", "_", name)
    text = text if re.match("[A-Za-z]", text) or not before else before + text
    while text != name and text in renamed.values():
        text += "_"
    if text != name:
        renamed[name] = text
    return text


def _real(dtype: str) -> str:
    return "float" if dtype == "float32" else "double"


def _bound(x: float | None) -> str:
    return "-" if x is None else f"{x:.1e}"


def _comment(text: str) -> str:
    """Return text of a file for a comment: ASCII, without the end of a comment; a dot over a letter is ' after it."""
    for symbol, plain in {"²": "^2", "³": "^3", "−": "-", "·": " ", "*/": "* /", "/*": "/ *"}.items():
        text = text.replace(symbol, plain)
    letters = unicodedata.normalize("NFD", text).replace("\u0307", "'").replace("\u0302", "")
    return "".join(x if x.isascii() and x.isprintable() else "?" for x in letters)


@final
@dataclass(frozen=True)
class _Text:
    """Texts of the files."""

    exported: Equations | Tick
    prefix: str
    dtype: str
    functions: tuple[CFunction, ...]
    math: tuple[str, ...]
    traced: Mapping[str, ca.Function]

    def header(self, renamed: dict[str, str]) -> str:
        exported, upper, kind = self.exported, self.prefix.upper(), self.exported.kind
        rows = [("function", "instructions", "difference", "bound")]
        rows += [(x.quantity, str(x.instructions), f"{x.difference:.1e}", _bound(x.bound)) for x in self.functions]
        sizes = {name: size for function in self.traced.values() for name, size in _sizes(function)[0].items()}
        joint_types = exported.robot.joint_types if exported.robot else (None,) * sizes["q"]
        constants = [(f"{upper}_SIZE_Q", sizes["q"], "number of joints")]
        for i, joint in enumerate(exported.robot.joint_names if exported.robot else ()):
            unit = joint_units("q", [joint_types[i]])
            constants.append((f"{upper}_Q_{_identifier(joint, renamed).upper()}", i, f"{joint}, {unit}"))
        if "z" in sizes:
            constants.append((f"{upper}_SIZE_Z", sizes["z"], "number of states"))
        start = 0
        for parameter in exported.parameters:
            text = _value(parameter, joint_types)
            constants.append((f"{upper}_P_{_identifier(parameter.name, renamed).upper()}", start, text))
            start += parameter.size
        if start:
            constants.append((f"{upper}_SIZE_P", start, "number of parameters"))
        numbers = ", ".join(literal(x, self.dtype) for x in exported.p.tolist())
        initialiser = f"\n/* Initialiser of p, with these values. */\n#define {upper}_P_VALUES {{{numbers}}}\n"
        period = f"\n/* Period of the tick, in s: a constant of the code. */\n#define {upper}_PERIOD_S "
        values = initialiser if start else ""
        values += f"{period}{literal(exported.period_s, self.dtype)}\n" if exported.period_s else ""
        table = (" *   {:20}{:16}{:14}{}".format(*row).rstrip() for row in rows)
        notes = [*_edits(exported.robot)] if exported.robot else []
        notes += [f"Right angle at full precision: {x}" for x in exported.right_angles]
        notes += [f"Constant of the code: {_value(x, joint_types)}" for x in exported.constants]
        prototypes = "".join(f"\n/* {_DESCRIPTIONS[x.quantity]} */\n{self.prototype(x)};\n" for x in self.functions)
        return _filled(
            "header.h.in",
            title=_comment(exported.title),
            guard=f"{upper}_{kind.upper()}_H",
            version=_comment(rd.__version__),
            real=_real(self.dtype),
            errors=_ERRORS[kind].format(states=exported.states),
            notes="".join(f" * {_comment(x)}.\n" for x in notes),
            math=(", ".join(x + "f" * (self.dtype == "float32") for x in self.math) or "none")
            + " (GCC may join sine and cosine to sincos)" * ("sin" in self.math),
            table="\n".join(table),
            constants="\n".join(f"    {key} = {value}, /* {_comment(text)} */" for key, value, text in constants),
            values=values,
            prototypes=prototypes,
        )  # fmt: skip

    def prototype(self, function: CFunction) -> str:
        """Return the declaration of a function."""
        real, (inputs, results) = _real(self.dtype), _sizes(self.traced[function.quantity])
        arguments = [f"{real} t" if x == "t" else f"const {real} {x}[{size}]" for x, size in inputs.items()]
        arguments += [f"{real} {x}[{size}]" for x, size in results.items()]
        return f"void {self.prefix}_{function.quantity}({', '.join(arguments)})"

    def source(self, programs: Mapping[str, Program]) -> str:
        parts = [f'#include "{self.prefix}_{self.exported.kind}.h"\n\n#include <math.h>\n']
        for function in self.functions:
            results = _sizes(self.traced[function.quantity])[1]
            lines = statements(programs[function.quantity], function.arguments, results, self.dtype)
            parts.append("\n".join([f"\n{self.prototype(function)}\n{{", *(f"    {line}" for line in lines), "}\n"]))
        return "".join(parts)

    def self_test(self, drawn: StatesOfArm | TickStates) -> str:
        """Return a program that compares each function with the reference at random states."""
        states, real = _states(self.exported, self.dtype, _OF_TEST, seed=1), _real(self.dtype)
        used = dict.fromkeys(x for function in self.functions for x in function.arguments)
        parts = [_of_array(real, f"in_{x}", states.inputs[x], self.dtype) for x in used]
        calls = []
        for function in self.functions:
            name, results = function.quantity, _sizes(self.traced[function.quantity])[1]
            tolerance = max(_MARGIN * function.difference, _LEAST * UNITS[self.dtype]) * drawn.scale(name)
            parts.append(_of_array(real, f"expected_{name}", states.results(name).reshape(_OF_TEST, -1), self.dtype))
            parts.append(_of_array(real, f"tolerance_{name}", tolerance.reshape(1, -1), self.dtype))
            arguments = [f"in_{x}[k][0]" if x == "t" else f"in_{x}[k]" for x in function.arguments]
            starts = accumulate(results.values(), initial=0)
            arguments += ["result" + f" + {start}" * bool(start) for start, _ in zip(starts, results, strict=False)]
            calls.append(
                _CALL.format(
                    name=name,
                    function=f"{self.prefix}_{name}",
                    entries=sum(results.values()),
                    arguments=", ".join(arguments),
                    real=real,
                )
            )
        f = "f" if self.dtype == "float32" else ""
        return _filled(
            "self_test.c.in",
            name=f"{self.prefix}_{self.exported.kind}",
            states=_OF_TEST,
            arrays="\n".join(parts),
            calls="".join(calls),
            real=real,
            f=f,
        )


class _Template(Template):
    """Text with names such as @{title}, which neither C nor CMake has."""

    delimiter = "@"


def _filled(template: str, **values: object) -> str:
    """Return the text of a file of this folder with values for its names."""
    return _Template((Path(__file__).parent / template).read_text(encoding="utf-8")).substitute(values)


def _sizes(function: ca.Function) -> tuple[dict[str, int], dict[str, int]]:
    """Return the lengths of the inputs and of the results of a function by name."""
    inputs = {name: function.numel_in(name) for name in function.name_in()}
    return inputs, {name: function.numel_out(name) for name in function.name_out()}


def _value(parameter: Parameter, joint_types: Sequence[str | None]) -> str:
    """Return a parameter with its value and unit as text."""
    of = "" if parameter.size == parameter.value.size else f" {list(parameter.entries)}"
    unit = coefficient_unit(parameter.declared, joint_types)
    return f"{parameter.name}{of}: {', '.join(f'{x:g}' for x in values_of(parameter))} {unit}"


def _edits(robot: rd.Robot) -> Iterator[str]:
    """Yield gravity, locked joints and payloads of a robot as text."""
    edits = robot.edits
    yield f"Gravity in base axes: {_vector(edits.gravity)} m/s^2"
    yield from (f"Locked joint: {joint} = {x:.9g}" for joint, x in edits.lock)
    yield from (f"Payload: {x.mass:.9g} kg on {x.frame} at {_vector(x.com)} m" for x in edits.payloads)


def _vector(x: Iterable[float]) -> str:
    return f"({', '.join(f'{entry:.9g}' for entry in x)})"


def _of_array(real: str, name: str, values: np.ndarray, dtype: str) -> str:
    rows = ",\n".join("    {" + ", ".join(literal(x, dtype) for x in row) + "}" for row in values.tolist())
    return f"static const {real} {name}[{len(values)}][{values.shape[1]}] = {{\n{rows}}};"


_DESCRIPTIONS = {
    "M": "Mass matrix M(q), row by row.",
    "C": "Coriolis matrix C(q, v), by Christoffel symbols, row by row.",
    "N": "Gravity minus the torques of the effects, N.",
    "inverse_dynamics": "Torques tau = M a + C v + N.",
    "forward_dynamics": "Accelerations a = (torques - C v - N) / M.",
    "tick": "Torques u; next states z_next of z, if there are any: z is 0 at the start.",
}

_ERRORS = {
    "dynamics": """\
 * difference: largest difference from Pinocchio at {states} random states within the limits.
 * bound: proven bound of the rounding error at all states within the limits, for constants rounded once, and a sine
 *     and cosine within one unit in the last place; "-" if there is none, or a large one. It holds without -ffast-math.
 * Both are divided by a scale: d_i d_j of M_ij with d_i = sqrt(max M_ii); s_i = d_i max_j(|tau_j| / d_j) of
 * a torque; s_i / max|v_j| of C_ij; max_j(|a_j| d_j) / d_i of an acceleration.
""",
    "controller": """\
 * difference: largest difference from the controller in Python at {states} random states, each divided by the largest
 *     value of its entry, or by 1e-4 of the largest of all if that is more.
""",
}


_CALL = """
    worst = 0;
    for (k = 0; k < {states}; k++) {{
        {real} result[{entries}];
        {function}({arguments});
        worst = larger(worst, result, expected_{name}[k], tolerance_{name}[0], {entries});
    }}
    printf("%-18s %.3f of the tolerance\\n", "{name}", (double)worst);
    failed |= !(worst <= 1);
""".replace("{states}", str(_OF_TEST))
