"""From a CasADi Function to straight-line code: y = f(x₁, x₂, …), one line an instruction.

Names are made of indices, so no text of a file can reach the code.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from robot_dyn.compiled.from_casadi import OperationError
from robot_dyn.compiled.source import Line, Source

_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_UNARY = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "one / {0}",
    ca.OP_FABS: "abs({0})",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_TAN: "tan({0})",
    ca.OP_ASIN: "asin({0})",
    ca.OP_ACOS: "acos({0})",
    ca.OP_ATAN: "atan({0})",
    ca.OP_SINH: "sinh({0})",
    ca.OP_COSH: "cosh({0})",
    ca.OP_FLOOR: "floor({0})",
    ca.OP_CEIL: "ceil({0})",
    ca.OP_NOT: "(one if {0} == zero else zero)",
    ca.OP_SIGN: "(one if {0} > zero else (-one if {0} < zero else {0}))",
}
_OF_TWO = {
    ca.OP_FMIN: "({0} if {0} < {1} else {1})",
    ca.OP_FMAX: "({0} if {0} > {1} else {1})",
    ca.OP_AND: "(one if ({0} != zero) & ({1} != zero) else zero)",
    ca.OP_OR: "(one if ({0} != zero) | ({1} != zero) else zero)",
    ca.OP_IF_ELSE_ZERO: "({1} if {0} != zero else zero)",
    ca.OP_POW: "{0} ** {1}",
    ca.OP_CONSTPOW: "{0} ** {1}",
    ca.OP_ATAN2: "atan2({0}, {1})",
    ca.OP_COPYSIGN: "copysign({0}, {1})",
    ca.OP_FMOD: "fmod({0}, {1})",
    ca.OP_HYPOT: "hypot({0}, {1})",
}
_MOVES = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}


def emit(function: ca.Function) -> Source:
    """The straight-line code of a Function of dense vectors.

    Args:
        function: Of SX; each input and output a dense column.

    Raises:
        OperationError: If an operation has no code here, or a result is sparse.
    """
    if not all(function.sparsity_out(i).is_dense() for i in range(function.n_out())):
        raise OperationError("a result is sparse: its instructions would number what is stored; densify it")
    inputs = tuple(function.numel_in(i) for i in range(function.n_in()))
    starts = np.concatenate([[0], np.cumsum([function.numel_out(i) for i in range(function.n_out())])]).tolist()
    names: dict[int, str] = {}  # of what each place of CasADi's work vector holds now
    lines: list[Line] = []
    loads: list[tuple[str, int, int]] = []
    results = ["zero"] * starts[-1]
    pairs: dict[str, tuple[str, ...]] = {}
    constants: dict[float, str] = {}
    count = 0
    for index in range(function.n_instructions()):
        operation, made = function.instruction_id(index), f"t{index}"
        read, written = function.instruction_input(index), function.instruction_output(index)
        count += operation not in _MOVES
        if operation == ca.OP_OUTPUT:
            results[starts[written[0]] + written[1]] = names[read[0]]
            continue
        if operation == ca.OP_INPUT:
            loads.append((made, read[0], read[1]))
        elif operation == ca.OP_CONST:
            made = constants.setdefault(function.instruction_constant(index), f"k{len(constants)}")
        elif operation in (ca.OP_SIN, ca.OP_COS):
            angle = names[read[0]]
            if angle not in pairs:
                pairs[angle] = f"s{index}", f"c{index}"
                lines.append(Line(pairs[angle], f"sincos({angle})", (angle,)))
            made = pairs[angle][operation == ca.OP_COS]
        else:
            of = tuple(names[place] for place in read)
            lines.append(Line((made,), _expression(operation, of), of))
        names[written[0]] = made
    return Source(inputs, starts[-1], count, tuple(lines), tuple(loads), tuple(results), tuple(constants))


def _expression(operation: int, names: tuple[str, ...]) -> str:
    if operation in _BINARY:
        return f"{names[0]} {_BINARY[operation]} {names[1]}"
    if operation in _COMPARE:
        return f"(one if {names[0]} {_COMPARE[operation]} {names[1]} else zero)"
    template = _UNARY.get(operation) or _OF_TWO.get(operation)
    if template is None:
        raise OperationError(f"CasADi operation {operation} has no machine code here; write the function without it")
    return template.format(*names)
