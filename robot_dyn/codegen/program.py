"""Programs: y = f(x₁, x₂, …) as a list of typed instructions without branches, each value computed once.

Values are numbered: inputs in sequence, then constants, then the results of the instructions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import chain, takewhile
from typing import final


class Kind(Enum):
    """Kinds of instructions with one operand x or two, x and y; conditions are 1 or 0.

    The values are the names in the C library and CasADi.
    """

    ADD = "add"
    SUBTRACT = "sub"
    MULTIPLY = "mul"
    DIVIDE = "div"
    NEGATE = "neg"
    SQUARE = "sq"
    TWICE = "twice"
    RECIPROCAL = "inv"
    ABSOLUTE = "fabs"
    SIGN = "sign"  # x itself if it is 0 or NaN
    FLOOR = "floor"
    CEILING = "ceil"
    MINIMUM = "fmin"
    MAXIMUM = "fmax"
    COPY_SIGN = "copysign"
    REMAINDER = "fmod"  # remainder of x / y, with the sign of x
    SQUARE_ROOT = "sqrt"
    HYPOTENUSE = "hypot"
    POWER = "pow"
    EXPONENTIAL = "exp"
    LOGARITHM = "log"
    SINE_COSINE = "sincos"  # two values
    TANGENT = "tan"
    ARC_SINE = "asin"
    ARC_COSINE = "acos"
    ARC_TANGENT = "atan"
    ARC_TANGENT_OF_TWO = "atan2"  # angle of (x, y); x is the second argument
    HYPERBOLIC_SINE = "sinh"
    HYPERBOLIC_COSINE = "cosh"
    HYPERBOLIC_TANGENT = "tanh"
    LESS = "lt"
    LESS_OR_EQUAL = "le"
    EQUAL = "eq"
    NOT_EQUAL = "ne"
    NOT = "not"
    AND = "and"
    OR = "or"
    WHERE = "if_else_zero"  # y where the condition x holds, else 0


@final
@dataclass(frozen=True, slots=True)
class Op:
    """One instruction.

    Attributes:
        kind: Kind of instruction.
        results: Numbers of its results: one value, or the sine and the cosine of an angle.
        operands: Numbers of its operands.
    """

    kind: Kind
    results: tuple[int, ...]
    operands: tuple[int, ...]

    def __str__(self) -> str:
        return f"{_list(self.results)} = {self.kind.name.lower()} {_list(self.operands)}"


@final
@dataclass(frozen=True)
class Program:
    """Instructions of a function.

    Attributes:
        inputs: Length of each input.
        constants: Values of the constants.
        ops: Instructions, each after those that compute its operands.
        outputs: Numbers of the values that are results of the program.
    """

    inputs: tuple[int, ...]
    constants: tuple[float, ...]
    ops: tuple[Op, ...]
    outputs: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.ops)

    def __str__(self) -> str:
        first = sum(self.inputs)
        constants = (f"v{first + i} = {x!r}" for i, x in enumerate(self.constants))
        head, end = f"inputs {' '.join(map(str, self.inputs))}", f"outputs {_list(self.outputs)}"
        return "\n".join(chain([head], constants, map(str, self.ops), [end]))

    @classmethod
    def read(cls, text: str) -> Program:
        """Parse the text of a program."""
        head, *lines = text.split("\n")
        constants: list[float] = []
        ops: list[Op] = []
        for line in lines[:-1]:
            results, _, rest = line.partition(" = ")
            kind, _, operands = rest.partition(" ")
            if operands:
                ops.append(Op(_KINDS[kind], _numbers(results), _numbers(operands)))
            else:
                constants.append(float(rest))
        inputs = tuple(map(int, head.split(" ")[1:]))
        return cls(inputs, tuple(constants), tuple(ops), _numbers(lines[-1].partition(" ")[2]))


@final
class Programs(Mapping[str, Program]):
    """Programs by name; those read from text are parsed on first use."""

    def __init__(self, programs: Mapping[str, Program]) -> None:
        self._programs = dict(programs)
        self._texts = {name: str(program) for name, program in programs.items()}

    @classmethod
    def read(cls, text: str) -> Programs:
        """Return the programs of a text that `str` returned."""
        programs = cls({})
        programs._texts = {name: program for name, _, program in (part.partition("\n") for part in text.split("\n\n"))}
        return programs

    def __str__(self) -> str:
        return "\n\n".join(f"{name}\n{text}" for name, text in self._texts.items())

    def __getitem__(self, name: str) -> Program:
        if name not in self._programs:
            self._programs[name] = Program.read(self._texts[name])
        return self._programs[name]

    def __contains__(self, name: object) -> bool:
        return name in self._texts

    def __iter__(self) -> Iterator[str]:
        return iter(self._texts)

    def __len__(self) -> int:
        return len(self._texts)

    def results(self, name: str) -> int:
        """Return the number of results of a program."""
        return self._texts[name].rpartition("\noutputs")[2].count(" v")

    @cached_property
    def instructions(self) -> int:
        """Number of operations of all programs."""
        return sum(map(_instructions, self._texts.values()))


_KINDS = {kind.name.lower(): kind for kind in Kind}


def _instructions(text: str) -> int:
    """Return the number of operations of a program: the lines between its constants and its outputs."""
    lines = text.split("\n")[1:-1]
    return len(lines) - sum(1 for _ in takewhile(lambda line: " " not in line.partition(" = ")[2], lines))


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(word[1:]) for word in text.split(" ") if word)


def _list(values: tuple[int, ...]) -> str:
    return " ".join(f"v{i}" for i in values)
