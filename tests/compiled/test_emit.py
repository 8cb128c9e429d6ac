"""Straight-line code of any CasADi Function."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from robot_dyn.compiled import overload
from robot_dyn.compiled.emit import EmitError, emit
from robot_dyn.compiled.kernel import Kernel, Status
from robot_dyn.compiled.source import WIDTH


def sample() -> ca.Function:
    """Every kind of operation, of two inputs; results that are constant or an input among them."""
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    s = ca.vertcat(ca.sin(x[0] * y[1]), ca.cos(ca.sin(x[1])), ca.tanh(x[2]) / ca.sqrt(1 + x[0] ** 2), 2.5, x[1])
    c = ca.vertcat(
        ca.if_else(x[0] < y[0], x[1], -y[1]), ca.fmax(x[0], y[1]), ca.fabs(x[2]) * ca.sign(x[1]), ca.exp(-(x[0] ** 2))
    )
    return ca.Function("f", [x, y], [ca.vertcat(s, c)])


def test_the_code_computes_the_function() -> None:
    """One state, a batch and the tile by itself, against CasADi's own virtual machine: 4 ulp of the largest."""
    function = sample()
    source = emit(function)
    kernel = Kernel(source, (9,))
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(100, 3)), rng.normal(size=(100, 2))
    expected = np.array([function(*row).full().ravel() for row in zip(x, y, strict=True)])
    batch, one = np.empty((100, 9)), np.empty(9)
    assert kernel.many([x, y], batch) is Status.FINE
    assert kernel.one(x[3], y[3], one) == Status.FINE
    assert np.allclose(batch, expected, rtol=0, atol=1e-15 * 4)
    assert np.allclose(one, expected[3], rtol=0, atol=1e-15 * 4)
    _, tile = source.functions()
    flat, result = np.vstack([x[:WIDTH].T, y[:WIDTH].T]).ravel(), np.empty(10 * WIDTH)
    tile(flat, result)
    assert np.allclose(result[: 9 * WIDTH].reshape(9, WIDTH).T, expected[:WIDTH], rtol=0, atol=1e-15 * 4)


def test_no_name_of_the_function_is_in_the_code() -> None:
    """Names of inputs are a file's text: only indices are written."""
    x = ca.SX.sym("__import__('os')", 2)
    source = emit(ca.Function("danger", [x], [ca.sin(x)], ["import_os"], ["y"]))
    assert "import" not in source.scalar + source.tile
    assert "danger" not in source.scalar + source.tile


def test_an_operation_without_code_is_refused() -> None:
    """By number; erf has none."""
    x = ca.SX.sym("x", 1)
    with pytest.raises(EmitError, match="no machine code"):
        emit(ca.Function("f", [x], [ca.erf(x)]))


def test_machine_code_is_restored_from_a_store(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second kernel compiles nothing and gives the same bits; a damaged payload is compiled anew."""

    class Memory(dict[str, bytes]):
        def load(self, key: str) -> bytes | None:
            return self.get(key)

        def save(self, key: str, payload: bytes, about: str = "") -> None:
            self[key] = payload

    memory, source = Memory(), emit(sample())
    first, y = np.empty((100, 9)), np.empty((100, 9))
    arguments = [np.ones((100, 3)), np.ones((100, 2))]
    Kernel(source, (9,), store=memory).many(arguments, first)
    (key,) = memory
    monkeypatch.setattr(overload, "_loaded", {})  # as in another process
    Kernel(source, (9,), store=memory).many(arguments, y)
    assert np.array_equal(first, y)
    assert len(memory) == 1
    memory[key] = b"damaged"
    monkeypatch.setattr(overload, "_loaded", {})
    Kernel(source, (9,), store=memory).many(arguments, y)
    assert np.array_equal(first, y)
    assert len(memory[key]) > 1000
