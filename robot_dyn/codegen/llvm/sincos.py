"""Sine and cosine without branches, so that they vectorise: x = k π/2 + r, then a polynomial each on |r| ≤ π/4.

    sin r ≈ r + r³ (S₁ + S₂ r² + …),   cos r ≈ 1 − r²/2 + r⁴ (C₁ + C₂ r² + …)

π/2 is taken in three parts; k times the first two is exact up to |x| = RANGE [Cody, Waite 1980]. The polynomials are
those of fdlibm, k_sin.c and k_cos.c [Sun Microsystems 1993]. Within RANGE the error is below 1.5 ulp, measured against
balls; beyond it the C library serves. `reassoc` must not reach these lines: it would add up the parts of π/2.
"""

from __future__ import annotations

import math

from robot_dyn.codegen.llvm.lanes import F32, Lanes, polynomial

RANGE = 1e5  # [rad]: k has 16 bits there, and 33 bits of π/2 times 16 bits are exact in 53
_TURN = 2 / math.pi
_MAGIC = 1.5 * 2.0**52  # added to |x| < 2⁵¹, it leaves the nearest integer in the low bits
_P1, _P2 = 1.57079632673412561417e00, 6.07710050630396597660e-11  # 33 bits of π/2 each
_P3 = 2.02226624879595063154e-21  # the rest
_S = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_C = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
# The same for float32: Cephes, sinf.c [Moshier 1992], rounded to float32.
_S32 = (-1.66666552424430847168e-1, 8.33216123282909393311e-3, -1.95152956992387771606e-4)
_C32 = (4.16666455566883087158e-2, -1.38873164542019367218e-3, 2.44331568944575637579e-5)


def sincos_lanes(x: Lanes) -> tuple[Lanes, Lanes]:
    """The instructions; x float64 or float32. A float32 is reduced in float64."""
    narrow = x.kind is F32
    x = x.double() if narrow else x
    shifted = x * _TURN + _MAGIC
    k, turns = shifted - _MAGIC, shifted.bits()
    a = (x - k * _P1) - k * _P2
    r = a - k * _P3
    error = (a - r) - k * _P3
    if narrow:
        r = r.single()
    z = r * r
    half = 0.5 * z
    if narrow:
        s = r + r * z * polynomial(z, _S32)
        c = (1.0 - half) + z * z * polynomial(z, _C32)
    else:
        w = 1.0 - half
        s = r + (r * z * polynomial(z, _S) + error)
        c = w + (((1.0 - w) - half) + (z * z * polynomial(z, _C) - r * error))
    swap = turns.odd()
    sine, cosine = _signed(c.choose(swap, s), turns, narrow), _signed(s.choose(swap, c), turns + 1, narrow)
    return sine, cosine


def _signed(x: Lanes, turns: Lanes, narrow: bool) -> Lanes:
    """x, or −x where the second bit of the turns is set."""
    if narrow:
        zero = Lanes(x.builder, turns.of(0), turns.kind, turns.count)
        return (x * -1.0).choose(x.builder.icmp_signed("!=", (turns & 2).value, zero.value), x)
    return (x.bits() ^ ((turns & 2) << 62)).number()
