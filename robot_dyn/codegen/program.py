"""Programs: y = f(x₁, x₂, …) as a list of typed instructions without branches, each value made once.

Values are numbered: those of the inputs one after the other, then the constants, then what the instructions make.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from functools import cached_property
from itertools import chain, takewhile
from typing import final


class Kind(Enum):
    """What an instruction computes of one value x or two, x and y; conditions are 1 or 0."""

    ADD = auto()
    SUBTRACT = auto()
    MULTIPLY = auto()
    DIVIDE = auto()
    NEGATE = auto()
    SQUARE = auto()
    TWICE = auto()
    RECIPROCAL = auto()
    ABSOLUTE = auto()
    SIGN = auto()  # x itself where it is 0 or NaN
    FLOOR = auto()
    CEILING = auto()
    MINIMUM = auto()
    MAXIMUM = auto()
    COPY_SIGN = auto()
    REMAINDER = auto()  # of x / y, with the sign of x
    SQUARE_ROOT = auto()
    HYPOTENUSE = auto()
    POWER = auto()
    EXPONENTIAL = auto()
    LOGARITHM = auto()
    SINE_COSINE = auto()  # two values
    TANGENT = auto()
    ARC_SINE = auto()
    ARC_COSINE = auto()
    ARC_TANGENT = auto()
    ARC_TANGENT_OF_TWO = auto()  # of y / x, x the second
    HYPERBOLIC_SINE = auto()
    HYPERBOLIC_COSINE = auto()
    HYPERBOLIC_TANGENT = auto()
    LESS = auto()
    LESS_OR_EQUAL = auto()
    EQUAL = auto()
    NOT_EQUAL = auto()
    NOT = auto()
    AND = auto()
    OR = auto()
    WHERE = auto()  # y where the condition x holds, else 0


@final
@dataclass(frozen=True, slots=True)
class Op:
    """One instruction.

    Attributes:
        kind: What it computes.
        made: Numbers of the values it makes: one, or the sine and the cosine of an angle.
        of: Numbers of the values it is made of.
    """

    kind: Kind
    made: tuple[int, ...]
    of: tuple[int, ...]

    def __str__(self) -> str:
        return f"{_list(self.made)} = {self.kind.name.lower()} {_list(self.of)}"


@final
@dataclass(frozen=True)
class Program:
    """The instructions of a function.

    Attributes:
        inputs: Length of each input.
        constants: Numbers that are known.
        ops: The instructions, each after those that it needs.
        outputs: Numbers of the values that are the results.
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
        """The program of its text."""
        head, *lines = text.split("\n")
        constants: list[float] = []
        ops: list[Op] = []
        for line in lines[:-1]:
            made, _, rest = line.partition(" = ")
            kind, _, of = rest.partition(" ")
            if of:
                ops.append(Op(_KINDS[kind], _numbers(made), _numbers(of)))
            else:
                constants.append(float(rest))
        inputs = tuple(map(int, head.split(" ")[1:]))
        return cls(inputs, tuple(constants), tuple(ops), _numbers(lines[-1].partition(" ")[2]))


@final
class Programs(Mapping[str, Program]):
    """Programs by name; those that are read from a text are parsed when they are looked up."""

    def __init__(self, programs: Mapping[str, Program]) -> None:
        self._programs = dict(programs)
        self._texts = {name: str(program) for name, program in programs.items()}

    @classmethod
    def read(cls, text: str) -> Programs:
        """The programs of a text, as `str` gives it."""
        made = cls({})
        made._texts = {name: program for name, _, program in (each.partition("\n") for each in text.split("\n\n"))}
        return made

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
        """Number of results of a program."""
        return self._texts[name].rpartition("\noutputs")[2].count(" v")

    @cached_property
    def instructions(self) -> int:
        """Operations in all."""
        return sum(map(_instructions, self._texts.values()))


_KINDS = {kind.name.lower(): kind for kind in Kind}


def _instructions(text: str) -> int:
    """Operations of a program: the lines between its constants, each a number alone, and its outputs."""
    lines = text.split("\n")[1:-1]
    return len(lines) - sum(1 for _ in takewhile(lambda line: " " not in line.partition(" = ")[2], lines))


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(each[1:]) for each in text.split(" ") if each)


def _list(values: tuple[int, ...]) -> str:
    return " ".join(f"v{i}" for i in values)
