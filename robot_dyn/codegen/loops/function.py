"""One function being translated: its names, its blocks, and the places where it may fail.

It is translated without output until its types no longer change, and then written. A function that may fail returns the
text of its failure, or null, before its result.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import FunctionType
from typing import TYPE_CHECKING, NoReturn, final

from llvmlite import ir

from robot_dyn.codegen.loops import expressions, statements
from robot_dyn.codegen.loops.kinds import F64, TEXT, ArrayKind, Kind, Number, Static, TupleKind
from robot_dyn.codegen.loops.numbers import converted, joined
from robot_dyn.codegen.loops.source import SubsetError, names_of, refused, stores, syntax
from robot_dyn.codegen.loops.values import (
    SILENT,
    UNWRITTEN,
    Builder,
    Scalar,
    StaticValue,
    TupleValue,
    Value,
    Written,
    leaf_types,
    leaves,
    number,
    of_leaves,
)  # fmt: skip

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.program import Program

_PASSES = 8


@final
class Function:
    """A function being translated.

    Args:
        program: Module of the function.
        function: Python function.
        kinds: Types of its arguments.
        checks: Check indices and integers; False in primitives, which check their arguments themselves.

    Attributes:
        builder: LLVM builder, or a substitute that writes nothing.
        assigned: Names that have a value at the current point.
        result: Type of the result, or None if not yet inferred.
        may_fail: True if the function can fail.
        leaving: For each enclosing loop: the block of the next iteration, the block after the loop, and the names
            assigned at breaks.
    """

    def __init__(self, program: Program, function: FunctionType, kinds: Sequence[Kind], checks: bool) -> None:
        self.program, self.function, self.checks = program, function, checks
        self.tree = syntax(function)
        self.builder: Builder = SILENT
        self.arguments = dict(zip(self._parameters(len(kinds)), kinds, strict=True))
        self.globals = names_of(function)
        self._times = Counter(self.arguments.keys()) + stores(self.tree)
        self._kinds: dict[str, Kind] = dict(self.arguments)
        self._values: dict[str, Value] = {}  # values of names assigned at one place
        self._slots: dict[str, list[ir.Value]] = {}  # memory of other names
        self.assigned: set[str] = set()
        self.result: Kind | None = None
        self.may_fail = False
        self.leaving: list[tuple[ir.Block, ir.Block, list[set[str]]]] = []
        self._failure: tuple[ir.Block, ir.PhiInstr] | None = None
        self._settled = True

    @property
    def silent(self) -> bool:
        """True while types are inferred and nothing is written."""
        return self.builder is SILENT

    def _parameters(self, count: int) -> list[str]:
        parameters = self.tree.args
        if parameters.vararg or parameters.kwarg or parameters.kwonlyargs or parameters.defaults:
            raise self.refused(self.tree, "a parameter with a default, * or **", "use plain parameters")
        names = [argument.arg for argument in (*parameters.posonlyargs, *parameters.args)]
        if len(names) != count:
            raise self.refused(
                self.tree, f"a call with {count} arguments of {len(names)}", "pass one for each parameter"
            )
        return names

    def refused(self, node: ast.AST, construct: str, remedy: str) -> SubsetError:
        """Return the error of a construct of this function."""
        return refused(self.function, getattr(node, "lineno", self.tree.lineno), construct, remedy)

    # Translation in two passes

    def written(self) -> Written:
        """Write the function into the module of its program."""
        for _ in range(_PASSES):
            self._settled = True
            self._body([UNWRITTEN] * sum(len(leaf_types(kind)) for kind in self.arguments.values()))
            if self._settled:
                break
        else:
            raise self.refused(self.tree, "a function whose types do not settle", "give each name one type")
        result = _or_none(self.result)
        argument_types = [leaf for kind in self.arguments.values() for leaf in leaf_types(kind)]
        function = ir.Function(
            self.program.module, ir.FunctionType(_llvm_result(result, self.may_fail), argument_types),
            self.program.name(self.function.__name__),
        )  # fmt: skip
        function.linkage = "internal"
        inlined = hasattr(self.function, "inlined")  # inlining more takes LLVM twice as long, for little gain
        function.attributes.add("alwaysinline" if inlined else "noinline")
        function.attributes.add("nounwind")
        self.builder = ir.IRBuilder(function.append_basic_block())
        self._body(list(function.args))
        return Written(function, result, self.may_fail)

    def _body(self, values: list[ir.Value]) -> None:
        self.assigned, self.leaving, self._failure = set(self.arguments), [], None
        if not self.silent:
            self._slots = {
                name: [self.builder.alloca(kind_) for kind_ in leaf_types(kind)]
                for name, kind in self._kinds.items() if self._times[name] > 1
            }  # fmt: skip
        for name, kind in self.arguments.items():
            count = len(leaf_types(kind))
            value, values = of_leaves(kind, values[:count]), values[count:]
            self._bind(name, self.fitted(value, self._kinds[name], self.tree))
        if not statements.block(self, self.tree.body):
            if self.result not in (None, Static.from_value(None)):
                raise self.refused(self.tree, "a function that ends without its result", "end it with a return")
            self.give(StaticValue(None), self.tree)
        self._end_failure()

    def _end_failure(self) -> None:
        """Write the end of the block that failures branch to."""
        if self._failure is not None and not self.silent:
            block, text = self._failure
            self.builder.position_at_end(block)
            self._leave(text, [ir.Constant(kind_, ir.Undefined) for kind_ in leaf_types(_or_none(self.result))])

    # Names

    def assign(self, name: str, value: Value, node: ast.AST) -> None:
        """Assign a value to a name, converted to the type of the name."""
        kind = self._kinds.get(name)
        if kind is None or (self.silent and kind != value.kind):
            self._kinds[name] = value.kind if kind is None else self.common(kind, value.kind, node)
            self._settled &= kind is None  # otherwise types inferred from the first one are outdated
        self._bind(name, self.fitted(value, self._kinds[name], node))
        self.assigned.add(name)

    def _bind(self, name: str, value: Value) -> None:
        if self._times[name] == 1:
            self._values[name] = value
        elif not self.silent:
            for slot, leaf in zip(self._slots[name], leaves(value), strict=True):
                self.builder.store(leaf, slot)

    def common(self, x: Kind, y: Kind, node: ast.AST) -> Kind:
        """Return the type that includes values of two types."""
        kind: Kind | None = None
        if x == y:
            return x
        if isinstance(x, Number) and isinstance(y, Number):
            kind = joined(x, y)
        elif isinstance(x, ArrayKind) and isinstance(y, ArrayKind) and (x.number, x.ndim) == (y.number, y.ndim):
            both = x.contiguous and y.contiguous, x.single and y.single, x.frozen or y.frozen
            kind = ArrayKind(x.number, x.ndim, *both)
        elif isinstance(x, TupleKind) and isinstance(y, TupleKind) and len(x.items) == len(y.items):
            pairs = zip(x.items, y.items, strict=True)
            kind = TupleKind(tuple(self.common(a, b, node) for a, b in pairs))
        if kind is None:
            raise self.refused(node, "a name, or a result, of different types", "use one name for each type")
        return kind

    def fitted(self, value: Value, kind: Kind, node: ast.AST) -> Value:
        """Convert a value to a type that includes it."""
        if value.kind == kind:
            return value
        if isinstance(value, Scalar) and isinstance(kind, Number):
            if kind.name == "float" and value.const is None:
                remedy = "start with a float such as 0.0, or convert it with float"
                raise self.refused(node, "an integer where another branch has a float", remedy)
            return converted(self, value, kind, node)
        if isinstance(value, TupleValue) and isinstance(kind, TupleKind):
            pairs = zip(value.items, kind.items, strict=True)
            return TupleValue(tuple(self.fitted(a, b, node) for a, b in pairs))
        apart = value.strides(self.builder)  # pyright: ignore
        return replace(value, kind=kind, apart=() if kind.contiguous else apart)  # pyright: ignore

    def name(self, node: ast.Name) -> Value:
        """Return the value of a name."""
        if node.id not in self._times:
            if node.id not in self.globals:
                self.refuse(node, f"the undefined name {node.id!r}", "define it before")
            return self.constant(self.globals[node.id], node)
        if node.id not in self.assigned:
            remedy = "assign it before the branch or loop"
            raise self.refused(node, f"{node.id!r}, which may have no value here,", remedy)
        if self._times[node.id] == 1:
            return self._values[node.id]
        kind = self._kinds[node.id]
        parts = (
            [UNWRITTEN] * len(leaf_types(kind)) if self.silent else [self.builder.load(x) for x in self._slots[node.id]]
        )
        return of_leaves(kind, parts)

    def refuse(self, node: ast.AST, construct: str, remedy: str) -> NoReturn:
        """Raise the error of a construct."""
        raise self.refused(node, construct, remedy)

    def constant(self, value: object, node: ast.AST) -> Value:
        """Return a value that is fixed when the function is translated."""
        return self.program.constant(value, partial(self.refuse, node))

    def expression(self, node: ast.expr) -> Value:
        """Return the value of an expression."""
        return expressions.value(self, node)

    # Blocks

    def give(self, value: Value, node: ast.AST) -> None:
        """End the function with a result."""
        before = self.result
        self.result = value.kind if before is None else self.common(before, value.kind, node)
        self._settled &= before is None or before == self.result
        if not self.silent:
            self._leave(ir.Constant(TEXT, None), leaves(self.fitted(value, self.result, node)))

    def _leave(self, text: ir.Value, parts: list[ir.Value]) -> None:
        parts = [text, *parts] if self.may_fail else parts
        if len(parts) < 2:
            self.builder.ret(parts[0]) if parts else self.builder.ret_void()
            return
        returned = ir.Constant(_llvm_result(_or_none(self.result), self.may_fail), ir.Undefined)
        for i, part in enumerate(parts):
            returned = self.builder.insert_value(returned, part, i)
        self.builder.ret(returned)

    def check(self, holds: ir.Value, node: ast.AST, message: str) -> None:
        """Fail unless a condition holds."""
        self.may_fail = True
        if not self.silent:
            where = f"{self.function.__module__}.{self.function.__qualname__}, line {getattr(node, 'lineno', 0)}"
            self.fail_unless(holds, self.program.text(f"{where}: {message}"))

    def fail_unless(self, holds: ir.Value, text: ir.Value) -> None:
        """Fail with a text unless a condition holds."""
        self.may_fail = True
        if self.silent:
            return
        if self._failure is None:
            block = self.builder.append_basic_block("failed")
            self._failure = block, ir.PhiInstr(block, TEXT, "text", ())
            block.instructions.append(self._failure[1])
        block, phi = self._failure
        phi.add_incoming(text, self.builder.block)
        success = self.builder.append_basic_block()
        self.builder.cbranch(holds, success, block)
        self.builder.position_at_end(success)

    def external(self, name: str, result: ir.Type, *arguments: ir.Type) -> ir.Value:
        """Return a function of the C library that LLVM's optimiser does not recognise."""
        return UNWRITTEN if self.silent else self.program.external(name, result, *arguments)

    def intrinsic(self, name: str, *arguments: ir.Value) -> ir.Value:
        """Call an LLVM intrinsic."""
        if self.silent:
            return UNWRITTEN
        shape = ir.FunctionType(F64, [F64] * len(arguments))
        return self.builder.call(self.program.module.declare_intrinsic(f"llvm.{name}", [F64], shape), list(arguments))

    @contextmanager
    def loop(self, count: Scalar) -> Iterator[Scalar]:
        """Write a loop over the indices below a count."""
        with statements.counted(self, number(0), count, 1) as (index, _):
            yield index


def _llvm_result(kind: Kind, may_fail: bool) -> ir.Type:
    parts = [TEXT] * may_fail + leaf_types(kind)
    return ir.LiteralStructType(parts) if len(parts) > 1 else parts[0] if parts else ir.VoidType()


def _or_none(kind: Kind | None) -> Kind:
    return Static.from_value(None) if kind is None else kind
