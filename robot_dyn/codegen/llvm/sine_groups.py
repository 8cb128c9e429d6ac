"""Vectorised sines and cosines of one state: angles that do not depend on another sine share a vector."""

from __future__ import annotations

from collections.abc import Iterator

from robot_dyn.codegen.program import Kind, Op, Program

GROUP = 8  # angles of one state per vector: one 512-bit register, or two or four smaller ones


def in_groups(program: Program) -> Iterator[tuple[Op, ...]]:
    """Reorder the instructions: up to GROUP sines and cosines form one tuple, all others a tuple each."""
    sines = _independent_sines(program)
    first = _needed(program, [op.operands[0] for op in sines])
    yield from ((op,) for op in program.ops if not first.isdisjoint(op.results))
    for i in range(0, len(sines), GROUP):
        yield tuple(sines[i : i + GROUP])
    done = first.union(*(op.results for op in sines))
    yield from ((op,) for op in program.ops if done.isdisjoint(op.results))


def _independent_sines(program: Program) -> list[Op]:
    """Return the sines of angles that do not depend on another sine or cosine."""
    dependent: set[int] = set()
    sines = []
    for op in program.ops:
        free = dependent.isdisjoint(op.operands)
        if op.kind is Kind.SINE_COSINE and free:
            sines.append(op)
        if op.kind is Kind.SINE_COSINE or not free:
            dependent.update(op.results)
    return sines


def _needed(program: Program, values: list[int]) -> set[int]:
    """Return these values and all they depend on, except inputs and constants."""
    needed = set(values)
    for op in reversed(program.ops):
        if not needed.isdisjoint(op.results):
            needed.update(op.operands)
    return needed.intersection(value for op in program.ops for value in op.results)
