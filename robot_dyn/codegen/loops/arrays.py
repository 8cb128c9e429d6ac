"""Entries and views of arrays. An index out of range ends the call with an error; slices are clipped, as in Python."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from llvmlite import ir

from robot_dyn.codegen.loops.kinds import BOOL, I8, I64, INT
from robot_dyn.codegen.loops.numbers import converted, scalar
from robot_dyn.codegen.loops.values import ONE, ArrayValue, Scalar, Value, number, times

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.function import Function

Place = Scalar | tuple[Scalar, Scalar, bool]  # an index; or a slice: start, stop, and True for a full axis


def subscript(f: Function, x: ArrayValue, node: ast.Subscript) -> Value:
    """Return an entry or a view."""
    places = _places(f, x, node)
    if all(isinstance(place, Scalar) for place in places):
        return load(f, x, [place for place in places if isinstance(place, Scalar)])
    return _view(f, x, places)


def store_at(f: Function, x: ArrayValue, node: ast.Subscript, value: Value) -> None:
    """Write an entry, or one number into all entries of a view."""
    if x.kind.frozen:
        raise f.refused(node, "a write into a read-only array", "pass a writable one")
    places, converted_value = _places(f, x, node), converted(f, scalar(f, value, node), x.kind.number, node)
    if all(isinstance(place, Scalar) for place in places):
        store(f, x, [place for place in places if isinstance(place, Scalar)], converted_value)
    else:
        fill(f, _view(f, x, places), converted_value)


def indices(f: Function, x: ArrayValue, node: ast.Subscript) -> list[Scalar]:
    """Return the indices of an entry."""
    places = _places(f, x, node)
    if not all(isinstance(place, Scalar) for place in places):
        raise f.refused(node, "an operation on a part of an array", "write a loop over its entries")
    return [place for place in places if isinstance(place, Scalar)]


def load(f: Function, x: ArrayValue, indices: list[Scalar]) -> Scalar:
    """Load an entry."""
    value = f.builder.load(address(f, x, indices))
    return Scalar(
        x.kind.number, f.builder.icmp_unsigned("!=", value, ir.Constant(I8, 0)) if x.kind.number == BOOL else value
    )


def store(f: Function, x: ArrayValue, indices: list[Scalar], value: Scalar) -> None:
    """Write an entry."""
    stored = f.builder.zext(value.ir, I8) if value.kind == BOOL else value.ir
    f.builder.store(stored, address(f, x, indices))


def address(f: Function, x: ArrayValue, indices: list[Scalar]) -> ir.Value:
    """Return the address of an entry, or of the first entry of a view, from its leading indices."""
    at, b = number(0), f.builder
    for index, stride in zip(indices, x.strides(b), strict=False):
        term = times(index, stride, b)
        if at.const == 0:
            at = term
        elif term.const != 0:
            at = Scalar(INT, b.add(at.ir, term.ir, flags=("nsw",)))
    return x.data if at.const == 0 else b.gep(x.data, [at.ir], inbounds=True)


def fill(f: Function, x: ArrayValue, value: Scalar, indices: list[Scalar] | None = None) -> None:
    """Write a number into all entries."""
    leading = indices or []
    if len(leading) == x.kind.ndim:
        store(f, x, leading, value)
        return
    with f.loop(x.shape[len(leading)]) as index:
        fill(f, x, value, [*leading, index])


def _places(f: Function, x: ArrayValue, node: ast.Subscript) -> list[Place]:
    """Return an index or a slice for each axis."""
    parts = list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]
    if any(isinstance(item, ast.Constant) and item.value is ... for item in parts):
        if len(parts) > 1:
            raise f.refused(node, "an ellipsis among indices", "write a colon for each axis")
        parts = []
    if len(parts) > x.kind.ndim:
        raise f.refused(
            node, f"{len(parts)} indices of an array with {x.kind.ndim} axes", "give at most one for each axis"
        )
    places: list[Place] = [_place(f, item, length) for item, length in zip(parts, x.shape, strict=False)]
    return places + [(number(0), length, True) for length in x.shape[len(parts) :]]


def _place(f: Function, node: ast.expr, length: Scalar) -> Place:
    if not isinstance(node, ast.Slice):
        return index_within(f, scalar(f, f.expression(node), node), length, node)
    if node.step is not None:
        raise f.refused(node, "a slice with a step", "write a loop")
    low = number(0) if node.lower is None else _bound(f, node.lower, length)
    high = length if node.upper is None else _bound(f, node.upper, length)
    return low, high, node.lower is None and node.upper is None


def index_within(f: Function, index: Scalar, length: Scalar, node: ast.AST) -> Scalar:
    """Return an index that is checked against the length of an axis; a negative one counts from the end."""
    index, b = converted(f, index, INT, node), f.builder
    if index.const is not None and length.const is not None and -length.const <= index.const < length.const:
        return number(int(index.const % length.const))
    if index.const is not None and index.const < 0:
        index = Scalar(INT, b.add(index.ir, length.ir))
    elif f.checks and index.const is None:
        below = b.icmp_signed("<", index.ir, ir.Constant(I64, 0))
        index = Scalar(INT, b.select(below, b.add(index.ir, length.ir), index.ir))
    if f.checks:
        f.check(b.icmp_unsigned("<", index.ir, length.ir), node, "an index is out of range")
    return index


def _bound(f: Function, node: ast.expr, length: Scalar) -> Scalar:
    """Return a bound of a slice, clipped to the axis."""
    bound, b, zero = converted(f, scalar(f, f.expression(node), node), INT, node), f.builder, ir.Constant(I64, 0)
    if bound.const == 0 or (not f.checks and (bound.const is None or bound.const > 0)):
        return bound
    value = bound.ir
    if bound.const is None or bound.const < 0:
        below = b.icmp_signed("<", value, zero)
        value = b.select(below, b.add(value, length.ir), value)
        value = b.select(b.icmp_signed("<", value, zero), zero, value)
    return Scalar(INT, b.select(b.icmp_signed("<", value, length.ir), value, length.ir))


def _view(f: Function, x: ArrayValue, places: list[Place]) -> ArrayValue:
    """Return a view of an array."""
    strides, starts, shape, apart, remaining = x.strides(f.builder), [], [], [], []
    for axis, (place, stride) in enumerate(zip(places, strides, strict=True)):
        if isinstance(place, Scalar):
            starts.append(place)
            continue
        low, high, whole = place
        starts.append(low)
        shape.append(high if low.const == 0 else _length(f, low, high))
        apart.append(stride)
        remaining.append((axis, whole))
    single = x.kind.single and len(remaining) > 1 and remaining[-1] == (x.kind.ndim - 1, True)
    contiguous = x.kind.contiguous and _is_contiguous(x, remaining)
    kind = replace(x.kind, ndim=len(remaining), contiguous=contiguous, single=single)
    return ArrayValue(kind, address(f, x, starts), tuple(shape), () if contiguous else tuple(apart))


def _length(f: Function, low: Scalar, high: Scalar) -> Scalar:
    b = f.builder
    length = b.sub(high.ir, low.ir)
    return Scalar(INT, b.select(b.icmp_signed(">", length, ir.Constant(I64, 0)), length, ir.Constant(I64, 0)))


def _is_contiguous(x: ArrayValue, remaining: list[tuple[int, bool]]) -> bool:
    """Return True if the remaining axes follow all others, and all but the first of them are full."""
    axes = [axis for axis in range(x.kind.ndim) if not (x.kind.single and axis == x.kind.ndim - 1)]
    leading = [(axis, whole) for axis, whole in remaining if axis in axes]
    return [axis for axis, _ in leading] == axes[len(axes) - len(leading) :] and all(whole for _, whole in leading[1:])


def reshaped(f: Function, x: ArrayValue, shape: list[Scalar], node: ast.AST) -> ArrayValue:
    """Return a contiguous array in another shape."""
    if not x.kind.contiguous:
        raise f.refused(node, "the reshape of an array that is not contiguous", "copy it first")
    shape, b = [converted(f, length, INT, node) for length in shape], f.builder
    single = len(shape) > 1 and shape[-1].const == 1
    f.check(
        b.icmp_signed("==", size(f, x).ir, _product(f, shape).ir), node, "a shape has a different number of entries"
    )
    return ArrayValue(replace(x.kind, ndim=len(shape), single=single), x.data, tuple(shape))


def part(f: Function, x: ArrayValue, first: Scalar, count: Scalar, node: ast.AST) -> ArrayValue:
    """Return a one-dimensional view of `count` entries of a contiguous array."""
    if not x.kind.contiguous:
        raise f.refused(node, "a primitive of an array that is not contiguous", "copy it first")
    kind = replace(x.kind, ndim=1, single=False)
    return ArrayValue(kind, f.builder.gep(x.data, [first.ir], inbounds=True), (count,))


def size(f: Function, x: ArrayValue) -> Scalar:
    """Return the number of entries."""
    return _product(f, x.shape)


def _product(f: Function, lengths: Iterable[Scalar]) -> Scalar:
    product = ONE
    for length in lengths:
        product = times(product, length, f.builder)
    return product
