"""From a CasADi Function to a program. Values are numbered, so no text of a file can reach the code."""

from __future__ import annotations

from itertools import accumulate

import casadi as ca

from robot_dyn.codegen.program import Kind, Op, Program
from robot_dyn.errors import RobotDynError

_MOVES = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
_KINDS = {
    ca.OP_ADD: Kind.ADD,
    ca.OP_SUB: Kind.SUBTRACT,
    ca.OP_MUL: Kind.MULTIPLY,
    ca.OP_DIV: Kind.DIVIDE,
    ca.OP_NEG: Kind.NEGATE,
    ca.OP_SQ: Kind.SQUARE,
    ca.OP_TWICE: Kind.TWICE,
    ca.OP_INV: Kind.RECIPROCAL,
    ca.OP_FABS: Kind.ABSOLUTE,
    ca.OP_SIGN: Kind.SIGN,
    ca.OP_FLOOR: Kind.FLOOR,
    ca.OP_CEIL: Kind.CEILING,
    ca.OP_FMIN: Kind.MINIMUM,
    ca.OP_FMAX: Kind.MAXIMUM,
    ca.OP_COPYSIGN: Kind.COPY_SIGN,
    ca.OP_FMOD: Kind.REMAINDER,
    ca.OP_SQRT: Kind.SQUARE_ROOT,
    ca.OP_HYPOT: Kind.HYPOTENUSE,
    ca.OP_POW: Kind.POWER,
    ca.OP_CONSTPOW: Kind.POWER,
    ca.OP_EXP: Kind.EXPONENTIAL,
    ca.OP_LOG: Kind.LOGARITHM,
    ca.OP_TAN: Kind.TANGENT,
    ca.OP_ASIN: Kind.ARC_SINE,
    ca.OP_ACOS: Kind.ARC_COSINE,
    ca.OP_ATAN: Kind.ARC_TANGENT,
    ca.OP_ATAN2: Kind.ARC_TANGENT_OF_TWO,
    ca.OP_SINH: Kind.HYPERBOLIC_SINE,
    ca.OP_COSH: Kind.HYPERBOLIC_COSINE,
    ca.OP_TANH: Kind.HYPERBOLIC_TANGENT,
    ca.OP_LT: Kind.LESS,
    ca.OP_LE: Kind.LESS_OR_EQUAL,
    ca.OP_EQ: Kind.EQUAL,
    ca.OP_NE: Kind.NOT_EQUAL,
    ca.OP_NOT: Kind.NOT,
    ca.OP_AND: Kind.AND,
    ca.OP_OR: Kind.OR,
    ca.OP_IF_ELSE_ZERO: Kind.WHERE,
}


class OperationError(RobotDynError):
    """A CasADi Function that has no machine code."""


def program_of(function: ca.Function) -> Program:
    """The program of a Function of dense vectors.

    Args:
        function: Of SX; each input and output a dense column.

    Raises:
        OperationError: If an operation has no machine code, or a result is sparse.
    """
    if not all(function.sparsity_out(i).is_dense() for i in range(function.n_out())):
        raise OperationError("a result is sparse: its instructions would number what is stored; densify it")
    inputs = tuple(function.numel_in(i) for i in range(function.n_in()))
    starts = [0, *accumulate(inputs)]
    firsts = [0, *accumulate(function.numel_out(i) for i in range(function.n_out()))]
    constants = _constants(function, starts[-1])
    made = starts[-1] + len(constants)  # the number of the next value
    ops: list[Op] = []
    outputs = [0] * firsts[-1]
    sines: dict[int, tuple[int, int]] = {}  # sine and cosine by angle
    at: dict[int, int] = {}  # what each place of CasADi's work vector holds now
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
                sines[angle] = made, made + 1
                ops.append(Op(Kind.SINE_COSINE, sines[angle], (angle,)))
                made += 2
            at[written[0]] = sines[angle][operation == ca.OP_COS]
        else:
            ops.append(Op(_kind(operation), (made,), tuple(at[place] for place in read)))
            at[written[0]] = made
            made += 1
    return Program(inputs, tuple(map(float, constants)), tuple(ops), tuple(outputs))


def _constants(function: ca.Function, first: int) -> dict[str, int]:
    """The numbers of the constants by their digits, which tell −0 from 0 and are equal for NaN."""
    indices = (i for i in range(function.n_instructions()) if function.instruction_id(i) == ca.OP_CONST)
    texts = dict.fromkeys(repr(function.instruction_constant(i)) for i in indices)
    return {text: first + k for k, text in enumerate(texts)}


def _kind(operation: int) -> Kind:
    try:
        return _KINDS[operation]
    except KeyError:
        raise OperationError(
            f"CasADi operation {operation} has no machine code here; write the function without it"
        ) from None


def instructions(function: ca.Function) -> int:
    """Number of operations of a Function, loads and stores apart."""
    return sum(function.instruction_id(i) not in _MOVES for i in range(function.n_instructions()))
