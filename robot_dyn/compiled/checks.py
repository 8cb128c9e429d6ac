"""What surrounds the straight-line code: the checks of arguments and results, in machine code as well.

They only report, by a Status; the words are found on the slow path.
"""

from __future__ import annotations

from enum import IntEnum

from robot_dyn.compiled.source import Source


class Status(IntEnum):
    """What a kernel reports."""

    FINE = 0
    FAR = 1  # an angle beyond the range of the tile's sine and cosine
    SHAPE = 2
    ARGUMENT = 3  # not finite, or large
    RESULT = 4  # not finite, or doubtfully large


def one_text(source: Source, shape: tuple[int, ...], times: bool, name: str = "state") -> str:
    """Of what compiled code calls for one state; named "call", of what Python calls."""
    arguments, called = "".join(f"x{i}, " for i in range(len(source.inputs))), name == "call"

    def fits(array: str, shape: tuple[int, ...], written: bool) -> str:
        if not called:
            return f"{array}.shape == {shape}"
        return f"is_array({array}, like) and has_form({array}, like, {shape}, {written})"

    right = [fits(f"x{i}", (n,), False) for i, n in enumerate(source.inputs) if i or not times]
    right.append(fits("y", shape, True))
    body = [
        f"if not ({' and '.join(right)}):",
        f"    return {Status.SHAPE:d}",
        f"arguments, results, far = single(({arguments}), y)",
        "if not arguments < most:",
        f"    return {Status.ARGUMENT:d}",
        "if far:",
        f"    return {Status.FAR:d}",
        f"return {Status.FINE:d} if results < doubtful else {Status.RESULT:d}",
    ]
    head = f"def {name}({arguments}y{', like' if called else ''}):"
    return "\n".join([head, *(f"    {line}" for line in body)])


def exact_text(source: Source, shape: tuple[int, ...], times: bool) -> str:
    """Of what computes one state whose angles are beyond the range of the vectors' sine and cosine."""
    arguments = ", ".join(f"x{i}" for i in range(len(source.inputs)))
    body = [
        "flat = y" if len(shape) == 1 else f"flat = y.reshape({source.outputs})",
        *source.scalar_lines(lambda i, k: "number(x0)" if times and i == 0 else f"x{i}[{k}]", "flat"),
        "size = zero",
        f"for k in range({source.outputs}):",
        "    size += abs(flat[k])",
        f"return {Status.FINE:d} if size < doubtful else {Status.RESULT:d}",
    ]
    return "\n".join([f"def exact({arguments}, y):", *(f"    {line}" for line in body)])


def batch_text(source: Source) -> str:
    """Of states start … stop − 1 of arrays (B, nᵢ) and (B, m)."""
    arguments, lengths = "".join(f"x{i}, " for i in range(len(source.inputs))), source.inputs
    wrong = [f"x{i}.shape != (len(y), {n})" for i, n in enumerate(lengths)]
    # results that are written over arguments would be read as such
    wrong += [f"begin < x{i}.ctypes.data + x{i}.nbytes and x{i}.ctypes.data < end" for i in range(len(lengths))]
    body = [
        "begin = y.ctypes.data",
        "end = begin + y.nbytes",
        f"if y.shape[1] != {source.outputs} or {' or '.join(wrong)}:",
        f"    return {Status.SHAPE:d}",
        f"arguments, results, farthest = vectors(({arguments}), y, start, stop)",
        "if not arguments < most:",
        f"    return {Status.ARGUMENT:d}",
        "if farthest > limit:",
        f"    return {Status.FAR:d}",
        f"return {Status.FINE:d} if results < doubtful * (stop - start) else {Status.RESULT:d}",
    ]
    return "\n".join([f"def batch({arguments}y, start, stop):", *(f"    {line}" for line in body)])
