"""Straight-line code: a list of instructions as text, for one state and for a tile of W states side by side.

    scalar(x0, x1, …, y)    one state: each input an array (nᵢ,), y (m,)
    tile(x, y)              W states side by side: number k of state b is x[k W + b], inputs one after the other;
                            y likewise, and one row more, in which the largest |angle| is left

One flat array in, one out and constant offsets let LLVM vectorise the loop over b: it need not ask whether many rows
overlap. Both are plain Numba functions that other compiled code may call: a rollout is a loop around them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.compiled.sincos import GROUP

_MATH = ("sqrt", "exp", "log", "tan", "asin", "acos", "atan", "sinh", "cosh", "floor", "ceil", "atan2")
LIBRARY: dict[str, Any] = {name: getattr(math, name) for name in (*_MATH, "copysign", "hypot")}
LIBRARY |= {"fmod": np.fmod}  # Numba has no math.fmod
WIDTH = 64  # states in a tile: 8 vectors of 8 numbers, and the rows of a 7-joint arm stay in the first-level cache
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

    def tile_lines(self, x: str = "x", y: str = "y") -> list[str]:
        """The loop over a tile x, y."""
        start = np.concatenate([[0], np.cumsum(self.inputs)]).tolist()
        code = [f"{name} = {x}[{WIDTH * (start[i] + k)} + b]" for name, i, k in self.loads]
        code += [*map(str, self.lines), "far = zero"]
        for line in self.lines:
            if line.trigonometric:
                code += [f"turn = abs({line.read[0]})", "far = turn if turn > far else far"]
        code += [f"{y}[{WIDTH * k} + b] = {name}" for k, name in enumerate((*self.results, "far"))]
        return [f"for b in range({WIDTH}):", *(f"    {line}" for line in code)]

    @cached_property
    def scalar(self) -> str:
        """Text of `scalar(x0, …, y)`; y may be an input."""
        arguments = ", ".join(f"x{i}" for i in range(len(self.inputs)))
        return _function(f"scalar({arguments}, y)", self.scalar_lines(lambda i, k: f"x{i}[{k}]", "y"))

    @cached_property
    def tile(self) -> str:
        """Text of `tile(x, y)`."""
        return _function("tile(x, y)", self.tile_lines())

    def functions(self, dtype: str = "float64") -> tuple[Callable[..., None], Callable[..., None]]:
        """`scalar` and `tile` as Numba functions, not yet compiled. Only `scalar` takes angles beyond RANGE."""
        import numba as nb

        made = []
        for text, name in ((self.scalar, "scalar"), (self.tile, "tile")):
            namespace = self.namespace(dtype)
            exec(compile(text, f"<robot_dyn {name}>", "exec"), namespace)
            made.append(nb.njit(fastmath=FASTMATH, error_model="numpy", nogil=True)(namespace[name]))
        return made[0], made[1]

    def namespace(self, dtype: str) -> dict[str, Any]:
        """What the names in the lines mean; numbers in the precision of the kernel, lest it compute in another."""
        from robot_dyn.compiled import sincos
        from robot_dyn.compiled.tanh import tanh

        number = np.dtype(dtype).type
        library = sincos.library_sincos if np.dtype(dtype) == np.float64 else sincos.library_sincos32
        numbers = {f"k{i}": number(x) for i, x in enumerate(self.constants)}
        trigonometry = {"sincos": sincos.sincos, "library_sincos": library, "limit": number(sincos.RANGE), "tanh": tanh}
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


def _function(head: str, body: list[str]) -> str:
    return "\n".join([f"def {head}:", *(f"    {line}" for line in body), ""])
