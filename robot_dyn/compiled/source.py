"""Straight-line code as text, for one state: what `simulation.machine` puts into the Numba functions of a march."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numba as nb
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from robot_dyn.compiled.llvm.lanes import F32, F64, Lanes, wide
from robot_dyn.compiled.llvm.sincos import RANGE, sincos_lanes
from robot_dyn.compiled.llvm.sine_groups import GROUP
from robot_dyn.compiled.llvm.tanh import tanh_lanes

_MATH = ("sqrt", "exp", "log", "tan", "asin", "acos", "atan", "sinh", "cosh", "floor", "ceil", "atan2")
LIBRARY: dict[str, Any] = {name: getattr(math, name) for name in (*_MATH, "copysign", "hypot")}
LIBRARY |= {"fmod": np.fmod}  # Numba has no math.fmod
FASTMATH = {"contract", "nsz", "reassoc", "arcp", "afn"}  # not nnan, ninf: NaN and inf must come through


@final
@dataclass(frozen=True)
class Line:
    """One instruction.

    Attributes:
        made: Names it makes: one, or the sine and the cosine of an angle.
        text: The expression.
        read: Names it is made of.
    """

    made: tuple[str, ...]
    text: str
    read: tuple[str, ...]

    @property
    def trigonometric(self) -> bool:
        """Whether it is the sine and cosine of `read`."""
        return len(self.made) == 2

    def __str__(self) -> str:
        return f"{', '.join(self.made)} = {self.text}"


@final
@dataclass(frozen=True)
class Source:
    """The code of a Function.

    Attributes:
        inputs: Length of each input.
        outputs: Number of results: those of all outputs, one after the other.
        instructions: Operations, loads and stores apart.
        lines: One for each operation, a pair of sine and cosine counted as one.
        loads: (name, input, index) of what is read.
        results: The name or constant of each result.
        constants: The numbers k0, k1, … of the lines.
    """

    inputs: tuple[int, ...]
    outputs: int
    instructions: int
    lines: tuple[Line, ...]
    loads: tuple[tuple[str, int, int], ...]
    results: tuple[str, ...]
    constants: tuple[float, ...]

    def scalar_lines(self, load: Callable[[int, int], str], result: str) -> list[str]:
        """The code for one state, to be put into a function: all is read before anything is written.

        The sines and cosines that depend on no others come first, side by side in vectors.

        Args:
            load: What reads number k of input i, from (i, k).
            result: Name of the array (m,) that takes the results.
        """
        first, trigonometric, rest = trigonometric_first(self.lines)
        groups = [trigonometric[i : i + GROUP] for i in range(0, len(trigonometric), GROUP)]
        code = [f"{name} = {load(i, k)}" for name, i, k in self.loads]
        code += [*map(str, first), *(line for group in groups for line in _group(group))]
        for line in rest:
            code += _group([line]) if line.trigonometric else [str(line)]
        return [*code, *(f"{result}[{k}] = {name}" for k, name in enumerate(self.results))]

    def namespace(self, dtype: str) -> dict[str, Any]:
        """What the names in the lines mean; numbers in the precision of the kernel, lest it compute in another."""
        number = np.dtype(dtype).type
        library = library_sincos if np.dtype(dtype) == np.float64 else library_sincos32
        numbers = {f"k{i}": number(x) for i, x in enumerate(self.constants)}
        trigonometry = {"sincos": sincos, "library_sincos": library, "limit": number(RANGE), "tanh": tanh}
        home = {"__name__": __name__}  # Numba keeps a function's module by name, and looks for it when code is restored
        return LIBRARY | numbers | trigonometry | {"zero": number(0), "one": number(1)} | home


def trigonometric_first(lines: tuple[Line, ...]) -> tuple[list[Line], list[Line], list[Line]]:
    """The lines that make angles, the sines and cosines of these, and the rest in order."""
    by_name = {name: line for line in lines for name in line.made}
    after: set[str] = set()  # names that depend on a sine or cosine
    trigonometric, needed = [], []
    for line in lines:
        if line.trigonometric and after.isdisjoint(line.read):
            trigonometric.append(line)
            needed += line.read
        if line.trigonometric or not after.isdisjoint(line.read):
            after.update(line.made)
    cone: set[str] = set()
    while needed:
        if (name := needed.pop()) in by_name and name not in cone:
            cone.add(name)
            needed += by_name[name].read
    first = [line for line in lines if not cone.isdisjoint(line.made)]
    apart = {line.made for line in (*first, *trigonometric)}
    return first, trigonometric, [line for line in lines if line.made not in apart]


def _group(lines: list[Line]) -> list[str]:
    """Sines and cosines in one vector, and by the C library where an angle is out of its range."""
    angles = [line.read[0] for line in lines]
    beyond = " | ".join(f"(abs({angle}) > limit)" for angle in angles)
    exact = [f"    {', '.join(line.made)} = library_sincos({line.read[0]})" for line in lines]
    return [
        f"{', '.join(name for line in lines for name in line.made)} = sincos({', '.join(angles)})",
        f"if {beyond}:",
        *exact,
    ]


@intrinsic
def _sincos_of(typingctx: Any, angles: Any) -> Any:
    """(sin x₁, cos x₁, sin x₂, …) of a tuple of angles."""
    if not isinstance(angles, types.UniTuple):
        raise TypingError("the angles must be of one type")

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind, count = (F64 if angles.dtype == types.float64 else F32), len(angles)
        each = [builder.extract_value(args[0], i) for i in range(count)]
        if count == 1:
            sine, cosine = sincos_lanes(Lanes(builder, each[0], kind, 1))
            return context.make_tuple(builder, signature.return_type, (sine.value, cosine.value))
        vector = _undefined(wide(kind, count))
        for i, angle in enumerate(each):
            vector = builder.insert_element(vector, angle, _index(i))
        both = sincos_lanes(Lanes(builder, vector, kind, count))
        values = [builder.extract_element(half.value, _index(i)) for i in range(count) for half in both]
        return context.make_tuple(builder, signature.return_type, values)

    return types.UniTuple(angles.dtype, 2 * len(angles))(angles), code


def _undefined(type_: Any) -> Any:
    """A value of a type before its lanes are set."""
    return ir.Constant(type_, ir.Undefined)


def _index(i: int) -> Any:
    return ir.Constant(ir.IntType(32), i)


# A function of its own, so that the fast-math flags of what calls it do not reach its lines.
@nb.njit(error_model="numpy")
def sincos(*angles: Any) -> Any:
    """(sin x₁, cos x₁, sin x₂, …) of angles of one float type with |x| ≤ RANGE, without a branch."""
    return _sincos_of(angles)  # pyright: ignore[reportCallIssue] — Numba gives the context


@nb.njit(error_model="numpy")
def library_sincos(x: Any) -> Any:
    """(sin x, cos x) of any float64 by the C library, for angles beyond RANGE."""
    return math.sin(x), math.cos(x)


@nb.njit(error_model="numpy")
def library_sincos32(x: Any) -> Any:
    """The same of a float32, rounded once."""
    return np.float32(math.sin(np.float64(x))), np.float32(math.cos(np.float64(x)))


def _tanh_typed(typingctx: Any, x: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return tanh_lanes(Lanes(builder, args[0], F64 if signature.args[0] == types.float64 else F32, 1)).value

    return x(x), code


_tanh_of: Any = intrinsic(_tanh_typed)


@nb.njit(error_model="numpy")
def tanh(x: Any) -> Any:
    """The hyperbolic tangent of a float64 or float32."""
    return _tanh_of(x)
