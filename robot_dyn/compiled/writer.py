"""From straight-line code to LLVM: each line an instruction on one number or on a vector, one for each state."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from typing import Any, final

from llvmlite import ir
from numba.core import types

from robot_dyn.compiled.lanes import F64, Lanes, wide
from robot_dyn.compiled.sincos import sincos_lanes
from robot_dyn.compiled.source import FASTMATH, LIBRARY, Line, Source
from robot_dyn.compiled.tanh import tanh_lanes

FLAGS = tuple(sorted(FASTMATH))
_ARITHMETIC = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "=="}
_INTRINSICS = {"abs": "fabs", "sqrt": "sqrt", "floor": "floor", "ceil": "ceil", "copysign": "copysign"}


@final
@dataclass(frozen=True)
class Writer:
    """Writes lines as vector instructions.

    Attributes:
        context: Numba's, for functions that have no vector instruction.
        builder: Where they go.
        kind: Type of a number.
        count: Numbers of a vector.
        values: The vectors by name.
    """

    context: Any
    builder: Any
    kind: Any
    count: int
    values: dict[str, Any] = field(default_factory=dict)

    def constant(self, x: float) -> Any:
        """A vector of equal numbers."""
        return ir.Constant(wide(self.kind, self.count), float(x) if self.count == 1 else [float(x)] * self.count)

    def start(self, source: Source, columns: list[list[Any]]) -> None:
        """Give the constants of the code and its inputs their names."""
        numbers = {"zero": 0.0, "one": 1.0} | {f"k{i}": x for i, x in enumerate(source.constants)}
        self.values.clear()
        self.values.update({name: self.constant(x) for name, x in numbers.items()})
        self.values.update({name: columns[i][k] for name, i, k in source.loads})

    def line(self, line: Line) -> None:
        """An instruction; its results have names."""
        result = self._value(ast.parse(line.text, mode="eval").body)
        self.values.update(zip(line.made, result if isinstance(result, tuple) else (result,), strict=True))

    def size(self, vectors: list[Any], total: Any) -> Any:
        """Add Σ |x| to a total."""
        for x in vectors:
            total = self.builder.fadd(total, self.intrinsic("fabs", x), flags=FLAGS)
        return total

    def _value(self, node: Any) -> Any:
        """The value of an expression, by what `emit` writes."""
        builder = self.builder
        match node:
            case ast.Name(id=name):
                return self.values[name]
            case ast.BinOp(left=left, op=operation, right=right):
                return self._binary(operation, self._value(left), self._value(right))
            case ast.UnaryOp(operand=operand):
                return builder.fneg(self._value(operand), flags=FLAGS)
            case ast.Compare(left=left, ops=[ast.NotEq()], comparators=[right]):
                return builder.fcmp_unordered("!=", self._value(left), self._value(right))
            case ast.Compare(left=left, ops=[operation], comparators=[right]):
                return builder.fcmp_ordered(_COMPARISONS[type(operation)], self._value(left), self._value(right))
            case ast.IfExp(test=test, body=yes, orelse=no):
                return builder.select(self._value(test), self._value(yes), self._value(no))
        return self._call(node.func.id, [self._value(each) for each in node.args])

    def _binary(self, operation: Any, left: Any, right: Any) -> Any:
        match operation:
            case ast.BitAnd():
                return self.builder.and_(left, right)
            case ast.BitOr():
                return self.builder.or_(left, right)
            case ast.Pow():
                return self._each(lambda x, y: x**y, left, right)
        return getattr(self.builder, _ARITHMETIC[type(operation)])(left, right, flags=FLAGS)

    def _call(self, name: str, of: list[Any]) -> Any:
        own = Lanes(self.builder, of[0], self.kind, self.count)
        if name == "sincos":
            return tuple(half.value for half in sincos_lanes(own))
        if name == "tanh":
            return tanh_lanes(own).value
        if name in _INTRINSICS:
            return self.intrinsic(_INTRINSICS[name], *of)
        library = LIBRARY[name]
        return self._each((lambda x: library(x)) if len(of) == 1 else (lambda x, y: library(x, y)), *of)

    def intrinsic(self, name: str, *of: Any) -> Any:
        """One of LLVM's own functions, of vectors."""
        lanes = "" if self.count == 1 else f"v{self.count}"
        made = self.builder.module.declare_intrinsic(
            f"llvm.{name}.{lanes}f{64 if self.kind is F64 else 32}",
            fnty=ir.FunctionType(of[0].type, [x.type for x in of]),
        )
        return self.builder.call(made, of)

    def _each(self, function: Any, *of: Any) -> Any:
        """A function of numbers, lane by lane."""
        number = types.float64 if self.kind is F64 else types.float32
        signature = number(*[number] * len(of))

        def code(numbers: list[Any]) -> Any:
            return self.context.compile_internal(self.builder, function, signature, numbers)

        if self.count == 1:
            return code(list(of))
        result = ir.Constant(of[0].type, ir.Undefined)
        for i in range(self.count):
            at = ir.Constant(ir.IntType(32), i)
            y = code([self.builder.extract_element(x, at) for x in of])
            result = self.builder.insert_element(result, y, at)
        return result
