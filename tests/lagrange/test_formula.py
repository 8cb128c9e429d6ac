"""Printed formulas of `euler_lagrange`: read back by Python they are the numbers of the kernels."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

from robot_dyn import euler_lagrange

MASS, LENGTH = 1.5, 0.5


def arm(t: Any, q: Any, v: Any) -> Any:
    return 0.75 * v[0] ** 2 + MASS * LENGTH * ca.cos(q[1]) * v[0] * (v[0] + v[1]) + (v[0] + v[1]) ** 2


def moving(t: Any, q: Any, v: Any) -> Any:
    return -4.0 * ca.sqrt(1 - (v[0] ** 2 + v[1] ** 2) / 9) - ca.exp(-t) * v[0] * q[1] / (2 - q[0]) ** 3


@pytest.mark.parametrize("kinetic", [arm, moving])
def test_printed_formulas_are_the_kernels(kinetic: Any) -> None:
    """Numbers are printed with six digits, so that entries of some ten terms agree to 1e-4."""
    system = euler_lagrange(kinetic, lambda t, q: 9.81 * ca.sin(q[0] + q[1]) - (q[0] - 2.0 * q[1]) ** 2, 2)
    q, v, t = [0.3, -0.7], [0.4, 0.9], 0.2
    names: dict[str, Any] = {"t": t, "sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "exp": math.exp}
    names |= {f"q{k + 1}": x for k, x in enumerate(q)} | {f"v{k + 1}": x for k, x in enumerate(v)}
    first, *lines = str(system).splitlines()
    assert first == "M a + b = Q"
    values = {name: eval(text, names) for name, text in (line.split(" = ") for line in lines)}
    M, b = system.M(q, v, t=t), system.bias(q, v, t=t)
    expected = {"M11": M[0, 0], "M12": M[0, 1], "M22": M[1, 1], "b1": b[0], "b2": b[1]}
    assert values == pytest.approx(expected, rel=1e-4)


def test_entries_that_are_too_long_are_counted() -> None:
    n = 40
    system = euler_lagrange(
        lambda t, q, v: sum(ca.cos(q[i] - q[j]) * v[i] * v[j] for i in range(n) for j in range(n)), None, n
    )
    lines = str(system).splitlines()
    assert "M1,1 = " in lines[1] and "operations" in lines[-1]
    assert max(map(len, lines)) < 2100
    assert np.isfinite(system.M(np.zeros(n), np.zeros(n))).all()
