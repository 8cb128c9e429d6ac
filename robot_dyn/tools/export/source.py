"""C source of the equations of an arm or a plant: a header, a source file, a self-test and CMakeLists.txt."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import DTypeLike

import robot_dyn as rd
from robot_dyn.codegen import Program, name_of_dtype, program_of
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
from robot_dyn.tools.export.equations import Equations, chosen, equations_of, result_name
from robot_dyn.tools.export.operations import evaluated, literal, math_functions, statements
from robot_dyn.tools.export.rounding import UNITS, States, bound, box_of

_STATES, _OF_TEST = 10_000, 20
_LONGEST = 20_000  # instructions; compilers take minutes for longer functions
_STATED = 1e4  # rounding units, about 1e-12 in double: larger bounds are not stated
_MARGIN, _LEAST = 16, 8  # tolerance of the self-test, in largest differences or in rounding units


@final
@dataclass(frozen=True)
class CFunction:
    """One exported function.

    Attributes:
        quantity: Name of the quantity.
        arguments: Names of its arguments; the array of results is the last one.
        instructions: Number of operations.
        difference: Largest difference from Pinocchio (and the interpreted effects) at 10 000 random states within the
            limits, divided by the scale of the entry.
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
    """C source of an arm or a plant.

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
        yield f"{self.name}, {_real(self.dtype)}: differences from Pinocchio at {_STATES} states, and proven bounds"
        yield Table(head, tuple(rows), right=head[3:])
        yield f"functions of <math.h>: {', '.join(self.math) or 'none'}"
        if self.renamed:
            yield Table(("name", "in C"), tuple(self.renamed.items()))


def c_source(
    arm_or_plant: rd.Robot | rd.Plant,
    quantities: Iterable[str] | None = None,
    *,
    dtype: DTypeLike = "float64",
    name: str | None = None,
) -> CSource:
    """Return C source of M, C, N, inverse and forward dynamics, without heap and without static data.

    Parameters of a plant (coefficients of effects, gravity, payloads) are entries of an array p; those of a robot are
    constants. Right angles that the file states with few digits are exact, as in `rd.compiled`.

    Args:
        arm_or_plant: A robot, or a plant with smooth or piecewise effects without states.
        quantities: Some of "M", "C", "N", "inverse_dynamics", "forward_dynamics"; by default all of up to eight
            joints, N and inverse dynamics of more.
        dtype: np.float64 for double or np.float32 for float, or its name.
        name: Prefix of all names in C; by default the name of the robot.

    Returns:
        The files, with the errors of each function.

    Raises:
        ExportError: If an effect switches, holds joints or has states, or a function would be too long.
        QueryError: If an argument is not allowed.
        SelfCheckError: If the equations differ from an independent implementation.
    """
    if name is not None and not (isinstance(name, str) and name.strip()):
        raise QueryError(f"name must be a text, such as 'ur5', got {shown(name)}")
    dtype, equations = name_of_dtype(dtype), equations_of(arm_or_plant)
    names = chosen(equations, quantities)
    traced = {x: equations.function(x) for x in names}
    programs = {x: (program_of(function), tuple(function.name_in())) for x, function in traced.items()}
    for quantity, (program, _) in programs.items():
        if len(program) > _LONGEST:
            raise ExportError(f"{quantity} has {len(program)} instructions, more than {_LONGEST}; leave it out")
        _check(equations, quantity, *programs[quantity], dtype)
    states = States(equations, dtype, _STATES)
    functions = tuple(_function(states, x, *programs[x]) for x in names)
    renamed: dict[str, str] = {}
    prefix = _identifier(name or equations.robot.name, renamed, "arm_")
    math = tuple(sorted(set().union(*(math_functions(program) for program, _ in programs.values()))))
    text = _Text(equations, prefix, dtype, functions, math)
    files = {
        f"{prefix}_dynamics.h": text.header(renamed),
        f"{prefix}_dynamics.c": text.source(programs),
        f"{prefix}_self_test.c": text.self_test(states),
        "CMakeLists.txt": _CMAKE.replace("@", prefix),
    }
    return CSource(prefix, dtype, functions, math, renamed, files)


def _check(equations: Equations, quantity: str, program: Program, arguments: Sequence[str], dtype: str) -> None:
    """Compare a program with the independent implementation that kernels are checked with."""
    engine = equations.engine(quantity)
    state = {key: x.astype(dtype).astype(float) for key, x in engine.self_check.states().items()}
    theirs, effects = engine.truth(quantity, state)
    p = np.tile(equations.p, (len(state["q"]), 1))
    inputs = [x[:, None] if x.ndim == 1 else x for x in (({**state, "p": p})[key] for key in arguments)]
    ours = evaluated(program, inputs, dtype).reshape(theirs.shape)
    engine.self_check.check(engine.quantities[quantity], ours, theirs, dtype, effects)


def _function(states: States, quantity: str, program: Program, arguments: tuple[str, ...]) -> CFunction:
    unit, largest = UNITS[states.dtype], None
    if quantity in ("M", "N") and "t" not in arguments:
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
    """Return text of a file for a comment: ASCII, on one line, without the end of a comment."""
    plain = text.replace("²", "^2").replace("³", "^3").replace("*/", "* /").replace("/*", "/ *")
    return "".join(x if x.isascii() and x.isprintable() else "?" for x in plain)


@final
@dataclass(frozen=True)
class _Text:
    """Texts of the files of one arm."""

    equations: Equations
    prefix: str
    dtype: str
    functions: tuple[CFunction, ...]
    math: tuple[str, ...]

    def header(self, renamed: dict[str, str]) -> str:
        robot, upper = self.equations.robot, self.prefix.upper()
        rows = [("function", "instructions", "difference", "bound")]
        rows += [(x.quantity, str(x.instructions), f"{x.difference:.1e}", _bound(x.bound)) for x in self.functions]
        constants = [(f"{upper}_SIZE_Q", robot.n, "number of joints")]
        for i, joint in enumerate(robot.joint_names):
            unit = joint_units("q", [robot.joint_types[i]])
            constants.append((f"{upper}_Q_{_identifier(joint, renamed).upper()}", i, f"{joint}, {unit}"))
        start, values = 0, []
        for parameter in self.equations.parameters:
            entries = parameter.value.ravel()[list(parameter.entries)].tolist()
            unit = coefficient_unit(parameter.declared, robot.joint_types)
            of = "" if parameter.size == parameter.value.size else f" {list(parameter.entries)}"
            text = f"{parameter.name}{of}: {', '.join(f'{x:g}' for x in entries)} {unit}"
            constants.append((f"{upper}_P_{_identifier(parameter.name, renamed).upper()}", start, text))
            start, values = start + parameter.size, [*values, *entries]
        if values:
            constants.append((f"{upper}_SIZE_P", start, "number of parameters"))
        numbers = ", ".join(literal(x, self.dtype) for x in values)
        table = (" *   {:20}{:16}{:14}{}".format(*row) for row in rows)
        initialiser = f"\n/* Initialiser of p, with these values. */\n#define {upper}_P_VALUES {{{numbers}}}\n"
        prototypes = "".join(f"\n/* {_DESCRIPTIONS[x.quantity]} */\n{self.prototype(x)};\n" for x in self.functions)
        return _HEADER.format(
            name=self.prefix,
            upper=upper,
            version=_comment(rd.__version__),
            robot=_comment(robot.name),
            real=_real(self.dtype),
            angles="".join(f" * Right angle at full precision: {_comment(x)}.\n" for x in self.equations.right_angles),
            math=", ".join(x + "f" * (self.dtype == "float32") for x in self.math) or "none",
            states=_STATES,
            table="\n".join(table),
            constants="\n".join(f"    {key} = {value}, /* {_comment(text)} */" for key, value, text in constants),
            values=initialiser if values else "",
            prototypes=prototypes,
        )  # fmt: skip

    def prototype(self, function: CFunction) -> str:
        """Return the declaration of a function."""
        real, n = _real(self.dtype), self.equations.robot.n
        sizes = {"p": len(self.equations.p)}
        arguments = [f"{real} t" if x == "t" else f"const {real} {x}[{sizes.get(x, n)}]" for x in function.arguments]
        result = f"{real} {result_name(function.quantity)}[{self._entries(function)}]"
        return f"void {self.prefix}_{function.quantity}({', '.join([*arguments, result])})"

    def _entries(self, function: CFunction) -> int:
        n = self.equations.robot.n
        return n * n if function.quantity in ("M", "C") else n

    def source(self, programs: Mapping[str, tuple[Program, tuple[str, ...]]]) -> str:
        parts = [f'#include "{self.prefix}_dynamics.h"\n\n#include <math.h>\n']
        for function in self.functions:
            program, arguments = programs[function.quantity]
            lines = statements(program, arguments, result_name(function.quantity), self.dtype)
            parts.append("\n".join([f"\n{self.prototype(function)}\n{{", *(f"    {line}" for line in lines), "}\n"]))
        return "".join(parts)

    def self_test(self, drawn: States) -> str:
        """Return a program that compares each function with the reference at random states."""
        states, real = States(self.equations, self.dtype, _OF_TEST, seed=1), _real(self.dtype)
        used = [x for x in ("t", "q", "v", "a", "tau", "u", "p") if any(x in f.arguments for f in self.functions)]
        parts = [_of_array(real, f"in_{x}", states.inputs[x], self.dtype) for x in used]
        calls = []
        for function in self.functions:
            name, entries = function.quantity, self._entries(function)
            tolerance = max(_MARGIN * function.difference, _LEAST * UNITS[self.dtype]) * drawn.scale(name)
            parts.append(_of_array(real, f"expected_{name}", states.results(name).reshape(_OF_TEST, -1), self.dtype))
            parts.append(_of_array(real, f"tolerance_{name}", tolerance.reshape(1, -1), self.dtype))
            inputs = ", ".join(f"in_{x}[k][0]" if x == "t" else f"in_{x}[k]" for x in function.arguments)
            calls.append(
                _CALL.format(name=name, function=f"{self.prefix}_{name}", entries=entries, inputs=inputs, real=real)
            )
        f = "f" if self.dtype == "float32" else ""
        return _TEST.format(
            name=self.prefix, states=_OF_TEST, arrays="\n".join(parts), calls="".join(calls), real=real, f=f
        )


def _of_array(real: str, name: str, values: np.ndarray, dtype: str) -> str:
    rows = ",\n".join("    {" + ", ".join(literal(x, dtype) for x in row) + "}" for row in values.tolist())
    return f"static const {real} {name}[{len(values)}][{values.shape[1]}] = {{\n{rows}}};"


_DESCRIPTIONS = {
    "M": "Mass matrix M(q), row by row.",
    "C": "Coriolis matrix C(q, v), by Christoffel symbols, row by row.",
    "N": "Gravity minus the torques of the effects, N.",
    "inverse_dynamics": "Torques tau = M a + C v + N.",
    "forward_dynamics": "Accelerations a = (torques - C v - N) / M.",
}

_HEADER = """\
/* {robot}: tau = M(q) a + C(q, v) v + N in {real}, written by robot_dyn {version}.
 *
 * No heap, no static data: functions may run in any thread or interrupt. Results may overlap arguments. Arguments are
 * not checked; they must be finite. Functions of <math.h>: {math}.
 *
{table}
 *
 * difference: largest difference from Pinocchio at {states} random states within the limits.
 * bound: proven bound of the rounding error at all states within the limits, for constants rounded once, and a sine
 *     and cosine within one unit in the last place; "-" if there is none, or a large one. It holds without -ffast-math.
 * Both are divided by a scale: d_i d_j of M_ij with d_i = sqrt(max M_ii); s_i = d_i max_j(|tau_j| / d_j) of
 * a torque; s_i / max|v_j| of C_ij; max_j(|a_j| d_j) / d_i of an acceleration.
 *
{angles} * Units are SI: q in rad or m, v in rad/s or m/s, a in rad/s^2 or m/s^2, torques in N m or N, t in s.
 */
#ifndef {upper}_DYNAMICS_H
#define {upper}_DYNAMICS_H

#ifdef __cplusplus
extern "C" {{
#endif

/* Sizes, and places of entries in q and p; coefficients of joints have one entry for each joint. */
enum {{
{constants}
}};
{values}{prototypes}
#ifdef __cplusplus
}}
#endif

#endif
"""

_CALL = """
    worst = 0;
    for (k = 0; k < {states}; k++) {{
        {real} result[{entries}];
        {function}({inputs}, result);
        worst = larger(worst, result, expected_{name}[k], tolerance_{name}[0], {entries});
    }}
    printf("%-18s %.3f of the tolerance\\n", "{name}", (double)worst);
    failed |= !(worst <= 1);
""".replace("{states}", str(_OF_TEST))

_TEST = """\
/* Compares {name}_dynamics with results of an independent implementation at {states} random states. */
#include "{name}_dynamics.h"

#include <math.h>
#include <stdio.h>

{arrays}

static {real} larger({real} worst, const {real} *x, const {real} *expected, const {real} *tolerance, int n)
{{
    int i;
    for (i = 0; i < n; i++) {{
        const {real} error = fabs{f}(x[i] - expected[i]) / tolerance[i];
        if (!(error <= worst)) {{
            worst = error;
        }}
    }}
    return worst;
}}

int main(void)
{{
    {real} worst;
    int k, failed = 0;
{calls}
    printf(failed ? "FAILED\\n" : "passed\\n");
    return failed;
}}
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.10)
project(@_dynamics C)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
add_library(@_dynamics STATIC @_dynamics.c)
set_target_properties(@_dynamics PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
target_include_directories(@_dynamics PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
find_library(MATH_LIBRARY m)
if(MATH_LIBRARY)
  target_link_libraries(@_dynamics PUBLIC ${MATH_LIBRARY})
endif()

include(CTest)
if(BUILD_TESTING)
  add_executable(@_self_test @_self_test.c)
  target_link_libraries(@_self_test @_dynamics)
  add_test(NAME @_self_test COMMAND @_self_test)
endif()
"""
