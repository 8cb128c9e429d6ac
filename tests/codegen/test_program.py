"""Programs of any CasADi Function, their machine code, and the writer of it for any number of states."""

from __future__ import annotations

import ctypes
import re
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from flint import arb, ctx
from llvmlite import ir

from robot_dyn.codegen import Kernel, Kind, Op, Program, Programs, program_of
from robot_dyn.codegen.llvm import machine_code
from robot_dyn.codegen.llvm.elementary import RANGE
from robot_dyn.codegen.llvm.machine_code import addresses
from robot_dyn.codegen.llvm.one_state import Status
from robot_dyn.codegen.llvm.vectors import F32, F64, I64
from robot_dyn.codegen.llvm.writer import Writer
from robot_dyn.codegen.store.keys import digest
from robot_dyn.codegen.trace.from_casadi import OperationError, instructions
from tests.codegen.test_kernel import Memory


def sample() -> ca.Function:
    """Every kind of operation, of two inputs; results that are constant or an input among them."""
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    s = ca.vertcat(ca.sin(x[0] * y[1]), ca.cos(ca.sin(x[1])), ca.tanh(x[2]) / ca.sqrt(1 + x[0] ** 2), 2.5, x[1])
    c = ca.vertcat(
        ca.if_else(x[0] < y[0], x[1], -y[1]), ca.fmax(x[0], y[1]), ca.fabs(x[2]) * ca.sign(x[1]), ca.exp(-(x[0] ** 2))
    )
    return ca.Function("f", [x, y], [ca.vertcat(s, c)])


def test_the_code_computes_the_function() -> None:
    """One state, a batch and the sines of the C library, against CasADi's own virtual machine: 4 ulp of the largest."""
    function = sample()
    kernel = Kernel(program_of(function), (9,))
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(100, 3)), rng.normal(size=(100, 2))
    expected = np.array([function(*row).full().ravel() for row in zip(x, y, strict=True)])
    batch, one, exact = np.empty((100, 9)), np.empty(9), np.empty(9)
    assert kernel.many([x, y], batch) is Status.FINE
    assert kernel.call(x[3], y[3], one) == Status.FINE
    assert kernel.any_angle(x[3], y[3], exact) == Status.FINE
    assert np.allclose(batch, expected, rtol=0, atol=1e-15 * 4)
    assert np.allclose(one, expected[3], rtol=0, atol=1e-15 * 4)
    assert np.allclose(exact, expected[3], rtol=0, atol=1e-15 * 4)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_operation_computes_what_casadi_does(dtype: str) -> None:
    """Each by itself, in a vector and alone, to 4 ulp; what is 1 or 0, and moves of bits, exactly."""
    x = ca.SX.sym("x", 2)
    a, b = x[0], x[1]
    made = {
        Kind.ADD: a + b, Kind.SUBTRACT: a - b, Kind.MULTIPLY: a * b, Kind.DIVIDE: a / b, Kind.NEGATE: -a,
        Kind.SQUARE: a**2, Kind.TWICE: 2 * a, Kind.RECIPROCAL: 1 / b, Kind.ABSOLUTE: ca.fabs(a), Kind.SIGN: ca.sign(a),
        Kind.FLOOR: ca.floor(a), Kind.CEILING: ca.ceil(a), Kind.MINIMUM: ca.fmin(a, b), Kind.MAXIMUM: ca.fmax(a, b),
        Kind.COPY_SIGN: ca.copysign(b, a), Kind.REMAINDER: ca.fmod(a, b), Kind.SQUARE_ROOT: ca.sqrt(b),
        Kind.HYPOTENUSE: ca.hypot(a, b), Kind.POWER: b**a, Kind.EXPONENTIAL: ca.exp(a), Kind.LOGARITHM: ca.log(b),
        Kind.SINE_COSINE: ca.cos(a), Kind.TANGENT: ca.tan(a), Kind.ARC_SINE: ca.asin(a / 3),
        Kind.ARC_COSINE: ca.acos(a / 3), Kind.ARC_TANGENT: ca.atan(a), Kind.ARC_TANGENT_OF_TWO: ca.atan2(a, b),
        Kind.HYPERBOLIC_SINE: ca.sinh(a), Kind.HYPERBOLIC_COSINE: ca.cosh(a), Kind.HYPERBOLIC_TANGENT: ca.tanh(a),
        Kind.LESS: a < b, Kind.LESS_OR_EQUAL: a <= b, Kind.EQUAL: ca.eq(a, b), Kind.NOT_EQUAL: ca.ne(a, b),
        Kind.NOT: ca.logic_not(a < b), Kind.AND: ca.logic_and(a, a < b), Kind.OR: ca.logic_or(a > 0, a < b),
        Kind.WHERE: ca.if_else(a < b, a, 0),
    }  # fmt: skip
    assert set(made) == set(Kind)
    data = np.random.default_rng(1).uniform(-2.5, 2.5, (20, 2))
    data[:, 1] = np.abs(data[:, 1]) + 0.1
    data[3] = data[3, 1]
    data = data.astype(dtype)
    function = ca.Function("f", [x], [ca.vertcat(*made.values())])
    program = program_of(function)
    assert {op.kind for op in program.ops} == set(Kind)
    kernel = Kernel(program, (len(made),), dtype)
    expected = np.array([function(row.astype(float)).full().ravel() for row in data])
    batch, one = np.empty((20, len(made)), dtype), np.empty((20, len(made)), dtype)
    assert kernel.many([data], batch) is Status.FINE
    assert max(kernel.call(row, y) for row, y in zip(data, one, strict=True)) == Status.FINE
    exact = [Kind.SIGN, Kind.FLOOR, Kind.CEILING, Kind.NEGATE, Kind.MINIMUM, Kind.MAXIMUM, Kind.COPY_SIGN]
    exact += [Kind.ABSOLUTE, Kind.LESS, Kind.LESS_OR_EQUAL, Kind.EQUAL, Kind.NOT_EQUAL, Kind.NOT, Kind.AND, Kind.OR]
    of_c = [Kind.EXPONENTIAL, Kind.LOGARITHM, Kind.POWER, Kind.REMAINDER, Kind.ARC_TANGENT_OF_TWO]
    for k, kind in enumerate(made):
        ulps = 0 if kind in exact else 2 if kind in of_c and dtype == "float64" else 4
        for ours in (batch[:, k], one[:, k]):
            assert np.all(np.abs(ours - expected[:, k]) <= ulps * np.finfo(dtype).eps * np.abs(expected[:, k])), kind


def test_a_program_is_a_value() -> None:
    """Made twice it is equal, of one hash and one text; another constant makes another."""
    x = ca.SX.sym("x", 2)
    one, same, other = (program_of(ca.Function("f", [x], [ca.sin(x[0]) * k + x[1]])) for k in (0.3, 0.3, 0.4))
    assert one == same != other
    assert hash(one) == hash(same)
    assert str(one) == str(same) != str(other)
    assert str(one).splitlines() == [
        "inputs 2", "v2 = 0.3", "v3 v4 = sine_cosine v0", "v5 = multiply v2 v3", "v6 = add v5 v1", "outputs v6",
    ]  # fmt: skip


def test_programs_that_are_read_are_those_that_were_written_and_their_sizes_need_no_parse(monkeypatch) -> None:
    """With constants that are negative, infinite and tiny; without any; without results."""
    x = ca.SX.sym("x", 2)
    results = {
        "sample": None,
        "sum": x[0] + x[1],
        "constants": ca.vertcat(-0.5, x[0] * 1e-300, ca.inf),
        "none": ca.SX(),
    }
    made = {name: program_of(sample() if y is None else ca.Function("f", [x], [y])) for name, y in results.items()}
    written = Programs(made)
    read = Programs.read(str(written))
    monkeypatch.setattr(Program, "read", None)
    assert {name: read.results(name) for name in read} == {name: len(each.outputs) for name, each in made.items()}
    assert read.instructions == sum(map(len, made.values())) == written.instructions
    assert "sum" in read and "rate" not in read
    monkeypatch.undo()
    assert dict(read) == made == dict(written)


def test_sine_and_cosine_of_one_angle_are_one_instruction() -> None:
    """Two of CasADi's, which `instructions` counts."""
    x = ca.SX.sym("x", 1)
    function = ca.Function("f", [x], [ca.sin(x) * ca.cos(x)])
    assert program_of(function).ops == (Op(Kind.SINE_COSINE, (1, 2), (0,)), Op(Kind.MULTIPLY, (3,), (1, 2)))
    assert instructions(function) == 3


def test_no_name_of_the_function_is_in_the_program() -> None:
    """Names of inputs are a file's text: values have numbers only."""
    x = ca.SX.sym("__import__('os')", 2)
    program = program_of(ca.Function("danger", [x], [ca.sin(x)], ["import_os"], ["y"]))
    assert "import" not in repr(program)
    assert "danger" not in repr(program)


def test_an_operation_without_code_is_refused() -> None:
    """By number; erf has none."""
    x = ca.SX.sym("x", 1)
    with pytest.raises(OperationError, match="cannot be translated"):
        program_of(ca.Function("f", [x], [ca.erf(x)]))


@pytest.mark.parametrize("way", ["one state", "a batch"])
def test_machine_code_is_restored_from_a_store(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second kernel compiles nothing and gives the same bits; a damaged payload is compiled anew."""
    memory, program = Memory(), program_of(sample())

    def answer() -> np.ndarray:
        monkeypatch.setattr(machine_code, "_loaded", {})  # as in another process
        kernel, y = Kernel(program, (9,), store=memory), np.empty((100, 9) if way == "a batch" else 9)
        if way == "a batch":
            assert kernel.many([np.ones((100, 3)), np.ones((100, 2))], y) is Status.FINE
        else:
            assert kernel.call(np.ones(3), np.ones(2), y) == Status.FINE
        return y

    first = answer()
    (key,) = memory
    assert np.array_equal(first, answer())
    assert len(memory) == 1
    payload = memory[key]
    for damaged in (b"damaged", payload[:-1], payload[:900] + bytes([payload[900] ^ 1]) + payload[901:]):
        memory[key] = damaged
        assert np.array_equal(first, answer())
        assert memory[key] == payload


THREE = ca.SX.sym("x", 3)
TWO = ca.SX.sym("z", 2)
FIRST = ca.Function("f", [THREE], [ca.vertcat(ca.sin(THREE[0]) * THREE[1], ca.cos(THREE[0] + ca.exp(THREE[2])))])
SECOND = ca.Function(
    "g", [TWO, THREE], [ca.vertcat(ca.tanh(TWO[0]) / THREE[1], ca.if_else(TWO[1] < 0, TWO[1], THREE[2]), 1.5)]
)


def both_programs(kind: Any, count: int, any_angle: bool) -> Any:
    """Writes g(f(x), x) of `count` states: number k of state b at x[k · count + b]; returns the states beyond RANGE."""

    def body(module: Any, name: str) -> None:
        function = ir.Function(module, ir.FunctionType(I64, [kind.as_pointer()] * 2), name + "both")
        builder = ir.IRBuilder(function.append_basic_block())
        writer = Writer(builder, kind, count, any_angle)
        wide = writer.vectors.type.as_pointer()
        x, y = (builder.bitcast(pointer, wide) for pointer in function.args)

        def place(array: Any, k: int) -> Any:
            return builder.gep(array, [ir.Constant(I64, k)])

        inputs = [builder.load(place(x, k), align=writer.vectors.size) for k in range(3)]
        first = writer.write(program_of(FIRST), [inputs])
        second = writer.write(program_of(SECOND), [first.results, inputs])
        for k, value in enumerate(second.results):
            builder.store(value, place(y, k), align=writer.vectors.size)
        builder.ret(builder.zext(writer.vectors.any(first.out_of_range), I64))

    return body


@pytest.mark.parametrize("count", [1, 2, 4, 8, 16])
@pytest.mark.parametrize(("kind", "dtype"), [(F64, "float64"), (F32, "float32")])
@pytest.mark.parametrize("any_angle", [False, True])
def test_programs_are_written_for_any_number_of_states(kind: Any, dtype: str, count: int, any_angle: bool) -> None:
    """Against CasADi's own virtual machine: 8 ulp of numbers of size 1."""
    key = digest([str(program_of(FIRST)), str(program_of(SECOND)), dtype, str(count), str(any_angle)])
    place = addresses(("both",), key, both_programs(kind, count, any_angle), None)[0]
    both = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)(place)
    x = np.random.default_rng(count).uniform(0.3, 1.2, (3, count)).astype(dtype)
    y = np.empty((3, count), dtype)
    assert both(x.ctypes.data, y.ctypes.data) == 0
    expected = np.array([SECOND(FIRST(column), column).full().ravel() for column in x.T.astype(float)]).T
    assert np.max(np.abs(y - expected)) < 8 * np.finfo(dtype).eps
    x[0, -1] = 2 * RANGE
    assert both(x.ctypes.data, y.ctypes.data) == (not any_angle)


@cache
def kernel(dtype: str) -> Kernel:
    """The sine and cosine of one angle, in a kernel of all fast-math flags."""
    x = ca.SX.sym("x", 1)
    return Kernel(program_of(ca.Function("f", [x], [ca.vertcat(ca.sin(x), ca.cos(x))])), (2,), dtype)


def angles(size: float) -> np.ndarray:
    """General angles, and those nearest to multiples of π/2, where the reduction cancels most."""
    rng = np.random.default_rng(4)
    general = rng.uniform(-size, size, 1500)
    return np.concatenate([general, np.round(general[:500] / (np.pi / 2)) * (np.pi / 2)])


def ulps(x: np.ndarray, values: np.ndarray, *functions: Any) -> float:
    """The largest error of values of functions, a column each, in units of the last place of the value."""
    last = np.spacing(np.abs(values)).astype(float)
    with ctx.workprec(160):
        exact = [[function(arb(at)) for function in functions] for at in x.astype(float).tolist()]
        errors = [[abs(float(arb(a) - b)) for a, b in zip(*row, strict=True)]
                  for row in zip(values.astype(float).tolist(), exact, strict=True)]  # fmt: skip
    return float(np.max(np.array(errors) / last))


SINE_AND_COSINE = arb.sin, arb.cos


@pytest.mark.parametrize("size", [1.0, 1e3, RANGE])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_sine_and_cosine_in_a_batch_kernel_err_by_less_than_two_ulp(size: float, dtype: str) -> None:
    """Half an ulp of the last rounding, half of r, and the polynomial: 1.5 measured, 2 allowed."""
    x = angles(size).astype(dtype)[:, None]
    x = x[np.abs(x[:, 0]) <= RANGE]
    y = np.empty((len(x), 2), dtype)
    assert kernel(dtype).many([x], y) is Status.FINE
    assert ulps(x[:, 0], y, *SINE_AND_COSINE) < 2


@pytest.mark.parametrize("size", [3e5, 1e9, 1e15])
def test_beyond_the_range_an_exact_path_serves(size: float) -> None:
    """The C library is right to 1 ulp at any size; one angle beyond the range sends its batch there."""
    x = angles(size)[:, None]
    y = np.empty((len(x), 2))
    assert kernel("float64").many([x], y) is Status.FINE
    assert ulps(x[:, 0], y, *SINE_AND_COSINE) < 2
    one = np.empty(2)
    assert kernel("float64").call(x[7], one) == Status.FAR
    assert kernel("float64").any_angle(x[7], one) == Status.FINE
    assert ulps(x[7], one[None], *SINE_AND_COSINE) < 2


@pytest.mark.parametrize(("dtype", "allowed"), [("float64", 2.0), ("float32", 1.0)])
def test_tanh_in_a_batch_kernel_errs_by_less_than_two_ulp(dtype: str, allowed: float) -> None:
    """Both branches and their seam at 0.625, tiny and saturated arguments, NaN and infinities."""
    x = ca.SX.sym("x", 1)
    made = Kernel(program_of(ca.Function("f", [x], [ca.tanh(x)])), (1,), dtype)
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.normal(size=1500), rng.uniform(0.6, 0.65, 200), 10.0 ** rng.uniform(-8, 3, 300)])
    values = values.astype(dtype)[:, None]
    y = np.empty_like(values)
    assert made.many([values], y) is Status.FINE
    assert not re.search(r"\b_?tanhf?\b", made.assembly())  # no call of the C library
    assert ulps(values[:, 0], y, arb.tanh) < allowed
    odd = np.resize(np.array([np.nan, np.inf, -np.inf], dtype), (18, 1))
    result = np.empty_like(odd)
    assert made.many([odd], result) is Status.ARGUMENT
    assert np.isnan(result[0])
    assert np.array_equal(result[1:3, 0], [1.0, -1.0])
