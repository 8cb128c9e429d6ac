"""Conversion of a CasADi Function to a program. Values are numbered, so no text from a file can reach the code."""

from __future__ import annotations

from itertools import accumulate

import casadi as ca

from robot_dyn.codegen.program import Kind, Op, Program
from robot_dyn.foundations.errors import RobotDynError

_MOVES = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
_KINDS = {getattr(ca, f"OP_{kind.value.upper()}"): kind for kind in Kind if kind is not Kind.SINE_COSINE}
_KINDS[ca.OP_CONSTPOW] = Kind.POWER


class OperationError(RobotDynError):
    """A CasADi Function cannot be translated to machine code."""


def program_of(function: ca.Function) -> Program:
    """Return the program of a Function of dense vectors.

    Args:
        function: A Function of SX; each input and output is a dense column.

    Raises:
        OperationError: If an operation has no machine code, or a result is sparse.
    """
    if not all(function.sparsity_out(i).is_dense() for i in range(function.n_out())):
        raise OperationError("a result is sparse: its instructions would number only the stored entries; densify it")
    inputs = tuple(function.numel_in(i) for i in range(function.n_in()))
    starts = [0, *accumulate(inputs)]
    firsts = [0, *accumulate(function.numel_out(i) for i in range(function.n_out()))]
    constants = _constants(function, starts[-1])
    count = starts[-1] + len(constants)  # the number of the next value
    ops: list[Op] = []
    outputs = [0] * firsts[-1]
    sines: dict[int, tuple[int, int]] = {}  # sine and cosine by angle
    at: dict[int, int] = {}  # value in each element of CasADi's work vector
    for index in range(function.n_instructions()):
        operation = function.instruction_id(index)
        read, written = function.instruction_input(index), function.instruction_output(index)
        if operation == ca.OP_OUTPUT:
            outputs[firsts[written[0]] + written[1]] = at[read[0]]
        elif operation == ca.OP_INPUT:
            at[written[0]] = starts[read[0]] + read[1]
        elif operation == ca.OP_CONST:
            at[written[0]] = constants[repr(function.instruction_constant(index))]
        elif operation == ca.OP_ASSIGN:
            at[written[0]] = at[read[0]]
        elif operation in (ca.OP_SIN, ca.OP_COS):
            angle = at[read[0]]
            if angle not in sines:
                sines[angle] = count, count + 1
                ops.append(Op(Kind.SINE_COSINE, sines[angle], (angle,)))
                count += 2
            at[written[0]] = sines[angle][operation == ca.OP_COS]
        else:
            ops.append(Op(_kind(operation), (count,), tuple(at[place] for place in read)))
            at[written[0]] = count
            count += 1
    return Program(inputs, tuple(map(float, constants)), tuple(ops), tuple(outputs))


def _constants(function: ca.Function, first: int) -> dict[str, int]:
    """Return the index of each constant by its text, which distinguishes −0 from 0 and is equal for every NaN."""
    indices = (i for i in range(function.n_instructions()) if function.instruction_id(i) == ca.OP_CONST)
    texts = dict.fromkeys(repr(function.instruction_constant(i)) for i in indices)
    return {text: first + k for k, text in enumerate(texts)}


def _kind(operation: int) -> Kind:
    try:
        return _KINDS[operation]
    except KeyError:
        raise OperationError(
            f"CasADi operation {operation} cannot be translated to machine code; write the function without it"
        ) from None


def instructions(function: ca.Function) -> int:
    """Return the number of operations of a Function, excluding loads and stores."""
    return sum(function.instruction_id(i) not in _MOVES for i in range(function.n_instructions()))
