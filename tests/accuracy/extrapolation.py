"""Motions to many digits, not as proofs find them: the closed form in balls, extrapolated midpoint steps.

Gragg, Bulirsch and Stoer: y(h; n) by the modified midpoint rule has an error in powers of (h/n)², which Neville's
scheme takes away, order by order. [Hairer, Nørsett, Wanner 1993, II.9]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import robot_dyn as rd

BITS = 240


def motion(
    plant: rd.Plant, q: Any, v: Any, until_s: float, steps: int, columns: int = 20,
    control: Callable[[Any, Any, Any], Any] | None = None,
) -> tuple[np.ndarray, np.ndarray, float]:  # fmt: skip
    """Midpoints of q and v at the end, and how far the last two columns are apart, the sum over the steps.

    Args:
        plant: Of `rd.Lagrangian(robot, rd.accuracy.Ball(BITS))`.
        q: Start, decimals as text, or floats.
        v: Velocity.
        until_s: End, in [s].
        steps: So many of equal length.
        columns: Of the extrapolation.
        control: The torque (t, q, v) → (n,), t a ball.
    """
    from flint import arb

    n, doubt = plant.dynamics.n, 0.0
    with rd.accuracy.Ball(BITS).scope():

        def rate(t: Any, y: np.ndarray) -> np.ndarray:
            u = np.zeros(n) if control is None else control(t, y[:n], y[n:])
            return middle(np.concatenate([y[n:], plant.forward_dynamics(y[:n], y[n:], u, t=float(t))]))

        y, h = middle(np.array([arb(x) for x in (*q, *v)], dtype=object)), arb(until_s) / steps
        for k in range(steps):
            table: list[list[np.ndarray]] = []
            for i in range(columns):
                parts = 2 * (i + 1)
                row = [_midpoint_rule(rate, h * k, y, h, parts)]
                for j in range(i):
                    ratio = arb(parts) ** 2 / arb(2 * (i - j)) ** 2
                    row.append(middle(row[j] + (row[j] - table[i - 1][j]) / (ratio - 1)))
                table.append(row)
            doubt += max(abs(float(x)) for x in table[-1][-1] - table[-2][-1])
            y = table[-1][-1]
    return y[:n], y[n:], doubt


def middle(x: np.ndarray) -> np.ndarray:
    """Midpoints of balls: nothing here is proven, and the columns tell how much is right."""
    return np.array([each.mid() for each in x], dtype=object)


def _midpoint_rule(rate: Any, t: Any, y: np.ndarray, h: Any, parts: int) -> np.ndarray:
    step = (h / parts).mid()
    before, now = y, middle(y + step * rate(t, y))
    for i in range(1, parts):
        before, now = now, middle(before + 2 * step * rate(t + i * step, now))
    return middle((before + now + step * rate(t + h, now)) / 2)
