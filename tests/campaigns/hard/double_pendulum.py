"""The double pendulum of urdf/planar_2r.urdf as a Taylor series in 160 bits; its numbers are written out here.

    M q'' = −h (v₂(2v₁ + v₂), −v₁²) − N,    h = −a sin q₂,    a = m₂ l₁ c₂

[Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, sec. 7.4.3; Hairer, Nørsett, Wanner, Solving Ordinary
Differential Equations I, 2nd ed., 1993, I.8]
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from flint import arb, arb_series, ctx

ORDER, BITS = 28, 160
TOLERANCE = 1e-28  # of the last term of a step
M1, C1, I1, L1 = (Fraction(x) for x in ("2", "0.5", "0.16708333333333333333", "1"))
M2, C2, I2 = (Fraction(x) for x in ("1.5", "0.4", "0.0803125"))
G = Fraction("9.80665")


def positions(q0: np.ndarray, v0: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Positions at ascending times, (k, 2); balls are cut to their midpoints after each step."""
    precision, cap, ctx.prec = ctx.prec, ctx.cap, BITS
    try:
        state, t, found = [arb(float(x)) for x in (*q0, *v0)], arb(0), []
        while len(found) < len(times):
            terms = _series(state)
            size = max(abs(float(each[-1].mid())) for each in terms)
            h = arb((TOLERANCE / size) ** (1 / ORDER))
            while len(found) < len(times) and float(times[len(found)]) <= t + h:
                found.append([float(_sum(each, arb(float(times[len(found)])) - t).mid()) for each in terms[:2]])
            state, t = [_sum(each, h).mid() for each in terms], (t + h).mid()
        return np.array(found)
    finally:
        ctx.prec, ctx.cap = precision, cap


def _series(state: list[arb]) -> list[list[arb]]:
    """Taylor coefficients of (q, v) about a time: each round gives one more of each."""
    inertia, a = _ball(I1 + I2 + M1 * C1**2 + M2 * (L1**2 + C2**2)), _ball(M2 * L1 * C2)
    own, first, second = _ball(I2 + M2 * C2**2), _ball(G * (M1 * C1 + M2 * L1)), _ball(G * M2 * C2)
    terms = [[x] for x in state]
    for k in range(ORDER):
        ctx.cap = k + 1
        q1, q2, v1, v2 = (arb_series(x) for x in terms)
        sine, cosine, n2 = a * q2.sin(), a * q2.cos(), second * (q1 + q2).cos()
        f1 = sine * v2 * (2 * v1 + v2) - first * q1.cos() - n2
        f2 = -sine * v1 * v1 - n2
        m11, m12 = inertia + 2 * cosine, own + cosine
        scale = 1 / (m11 * own - m12 * m12)
        rates = v1, v2, (own * f1 - m12 * f2) * scale, (m11 * f2 - m12 * f1) * scale
        for each, rate in zip(terms, rates, strict=True):
            each.append(rate[k] / (k + 1))
    return terms


def _ball(x: Fraction) -> arb:
    return arb(x.numerator) / x.denominator


def _sum(terms: list[arb], t: arb) -> arb:
    total = arb(0)
    for each in reversed(terms):
        total = total * t + each
    return total
