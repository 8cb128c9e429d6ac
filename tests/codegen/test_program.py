"""Programs of any CasADi Function, and their machine code."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from robot_dyn.codegen import Kernel, program_of
from robot_dyn.codegen.llvm import machine_code
from robot_dyn.codegen.llvm.one_state import Status
from robot_dyn.codegen.program import Kind, Op, Program, Programs
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
    for k, kind in enumerate(made):
        ulps = 0 if kind in exact else 4
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
