"""Instructions of a program as C text, and evaluated by NumPy in the same order and precision.

Conditions are 1 or 0, as in `Kind`. A compiler that contracts x y + z to one operation rounds less often.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from robot_dyn.codegen import Kind, Program

_NUMPY = {"pow": "power", "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}  # other names
_ONE_OPERAND = (
    Kind.ABSOLUTE, Kind.FLOOR, Kind.CEILING, Kind.SQUARE_ROOT, Kind.EXPONENTIAL, Kind.LOGARITHM, Kind.TANGENT,
    Kind.ARC_SINE, Kind.ARC_COSINE, Kind.ARC_TANGENT, Kind.HYPERBOLIC_SINE, Kind.HYPERBOLIC_COSINE,
    Kind.HYPERBOLIC_TANGENT,
)  # fmt: skip
_TWO_OPERANDS = Kind.COPY_SIGN, Kind.REMAINDER, Kind.HYPOTENUSE, Kind.POWER, Kind.ARC_TANGENT_OF_TWO


def _truth(condition: np.ndarray) -> np.ndarray:
    return condition.astype(np.float32)  # 1 and 0 do not widen an operand


# C text of {0} and {1}, with {f} after a function, and NumPy's function; c is a condition.
_OPERATIONS: dict[Kind, tuple[str, Callable[..., Any]]] = {
    Kind.ADD: ("{0} + {1}", np.add),
    Kind.SUBTRACT: ("{0} - {1}", np.subtract),
    Kind.MULTIPLY: ("{0} * {1}", np.multiply),
    Kind.DIVIDE: ("{0} / {1}", np.divide),
    Kind.NEGATE: ("-{0}", np.negative),
    Kind.SQUARE: ("{0} * {0}", np.square),
    Kind.TWICE: ("{0} + {0}", lambda x: x + x),
    Kind.RECIPROCAL: ("{one} / {0}", lambda x: np.divide(np.ones_like(x), x)),
    Kind.SIGN: ("{0} > {zero} ? {one} : {0} < {zero} ? -{one} : {0}", np.sign),
    Kind.MINIMUM: ("{0} < {1} ? {0} : {1}", lambda x, y: np.where(x < y, x, y)),
    Kind.MAXIMUM: ("{0} > {1} ? {0} : {1}", lambda x, y: np.where(x > y, x, y)),
    Kind.LESS: ("{0} < {1} ? {one} : {zero}", lambda x, y: _truth(x < y)),
    Kind.LESS_OR_EQUAL: ("{0} <= {1} ? {one} : {zero}", lambda x, y: _truth(x <= y)),
    Kind.EQUAL: ("{0} == {1} ? {one} : {zero}", lambda x, y: _truth(x == y)),
    Kind.NOT_EQUAL: ("{0} != {1} ? {one} : {zero}", lambda x, y: _truth(x != y)),
    Kind.NOT: ("{0} == {zero} ? {one} : {zero}", lambda c: _truth(c == 0)),
    Kind.AND: ("{0} != {zero} && {1} != {zero} ? {one} : {zero}", lambda c, d: _truth((c != 0) & (d != 0))),
    Kind.OR: ("{0} != {zero} || {1} != {zero} ? {one} : {zero}", lambda c, d: _truth((c != 0) | (d != 0))),
    Kind.WHERE: ("{0} != {zero} ? {1} : {zero}", lambda c, y: np.where(c != 0, y, np.zeros_like(y))),
    **{kind: (f"{kind.value}{{f}}({{0}})", getattr(np, _NUMPY.get(kind.value, kind.value))) for kind in _ONE_OPERAND},
    **{
        kind: (f"{kind.value}{{f}}({{0}}, {{1}})", getattr(np, _NUMPY.get(kind.value, kind.value)))
        for kind in _TWO_OPERANDS
    },
}


def literal(x: float, dtype: str) -> str:
    """Return a number as a C literal of its type, negative ones in brackets."""
    if not math.isfinite(x):
        return "NAN" if math.isnan(x) else "INFINITY" if x > 0 else "(-INFINITY)"
    text = str(np.float32(x)) + "f" if dtype == "float32" else repr(float(x))
    return f"({text})" if text.startswith("-") else text


def math_functions(program: Program) -> set[str]:
    """Return the functions of <math.h> that a program calls, without the suffix of float."""
    used = {"sin", "cos"} if any(op.kind is Kind.SINE_COSINE for op in program.ops) else set()
    texts = (_OPERATIONS[op.kind][0] for op in program.ops if op.kind is not Kind.SINE_COSINE)
    return used.union(*(re.findall(r"(\w+)\{f\}", text) for text in texts))


def statements(program: Program, arguments: Sequence[str], results: Mapping[str, int], dtype: str) -> Iterator[str]:
    """Yield the body of a C function: arguments are read first and results written last, so that they may overlap.

    Args:
        program: The program.
        arguments: Names of its inputs; one named t is a number, the others are arrays.
        results: Lengths of the arrays of results by name, in the order of the program's outputs.
        dtype: "float64" or "float32".
    """
    real, f = ("float", "f") if dtype == "float32" else ("double", "")
    own = {"f": f, "one": literal(1.0, dtype), "zero": literal(0.0, dtype)}
    used = set(program.outputs).union(*(op.operands for op in program.ops))
    names: dict[int, str] = {}
    for argument, n in zip(arguments, program.inputs, strict=True):
        entries = range(len(names), len(names) + n)
        names |= {k: argument if argument == "t" else f"{argument}{k - entries.start}" for k in entries}
        reads = [] if argument == "t" else [k for k in entries if k in used]
        yield from (f"const {real} {names[k]} = {argument}[{k - entries.start}];" for k in reads)
        if not used.intersection(entries):
            yield f"(void){argument};"
    names |= {len(names) + k: literal(x, dtype) for k, x in enumerate(program.constants)}
    for op in program.ops:
        names |= {k: f"x{k}" for k in op.results}
        operands = [names[k] for k in op.operands]
        texts = [_OPERATIONS[op.kind][0]] if op.kind is not Kind.SINE_COSINE else ["sin{f}({0})", "cos{f}({0})"]
        for k, text in zip(op.results, texts, strict=True):
            if k in used:
                yield f"const {real} {names[k]} = {text.format(*operands, **own)};"
    places = (f"{result}[{k}]" for result, size in results.items() for k in range(size))
    yield from (f"{place} = {names[value]};" for place, value in zip(places, program.outputs, strict=True))


def evaluated(program: Program, inputs: Sequence[np.ndarray], dtype: str) -> np.ndarray:
    """Return the results of a program at B states, (B, m), for inputs (B, nᵢ); computed in `dtype`."""
    columns = chain(*(np.asarray(x, dtype).T for x in inputs))
    states = len(inputs[0])
    values: dict[int, np.ndarray] = dict(enumerate(columns))
    values |= {len(values) + k: np.full(states, x, dtype) for k, x in enumerate(program.constants)}
    with np.errstate(all="ignore"):
        for op in program.ops:
            operands = [values[k] for k in op.operands]
            functions = [np.sin, np.cos] if op.kind is Kind.SINE_COSINE else [_OPERATIONS[op.kind][1]]
            values |= {k: function(*operands) for k, function in zip(op.results, functions, strict=True)}
    return np.stack([values[k] for k in program.outputs], axis=1)
