"""Branch-free sine, cosine and hyperbolic tangent, which vectorise, by polynomials and rational functions.

    x = k π/2 + r:   sin r ≈ r + r³ (S₁ + S₂ r² + …),   cos r ≈ 1 − r²/2 + r⁴ (C₁ + C₂ r² + …) on |r| ≤ π/4
    tanh x ≈ x + x³ P(x²) / Q(x²) for |x| < 0.625,   else ± (1 − 2 / (e^{2|x|} + 1)),   e^u = 2ᵏ e^r

π/2 is split into three parts; k times each of the first two is exact up to |x| = RANGE [Cody, Waite 1980]. The
polynomials are those of fdlibm, k_sin.c and k_cos.c [Sun Microsystems 1993]; the rational functions are those of
Cephes, tanh.c and exp.c [Moshier 1984]. Compared with ball arithmetic, sine and cosine are within 1.5 ulp up to RANGE
(larger angles use the C library) and tanh within 2 ulp. The `reassoc` flag must not be set here: it would let LLVM
combine the parts of π/2.
"""

from __future__ import annotations

import math

from robot_dyn.codegen.llvm.vectors import F32, F64, I1, I64, Lanes, polynomial, wide

_MAGIC = 1.5 * 2.0**52  # adding it to |x| < 2⁵¹ leaves the nearest integer in the low bits
RANGE = 1e5  # [rad]: k has up to 16 bits, so its product with 33 bits of π/2 is exact in 53
_TURN = 2 / math.pi
_P1, _P2 = 1.57079632673412561417e00, 6.07710050630396597660e-11  # 33 bits of π/2 each
_P3 = 2.02226624879595063154e-21  # remainder of π/2
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
# Coefficients for float32: Cephes, sinf.c [Moshier 1992], rounded to float32.
_S32 = (-1.66666552424430847168e-1, 8.33216123282909393311e-3, -1.95152956992387771606e-4)
_C32 = (4.16666455566883087158e-2, -1.38873164542019367218e-3, 2.44331568944575637579e-5)
# tanh: below _SMALL it uses P / Q, because 1 − 2/(…) would lose digits to cancellation; above _LARGE the result is 1
_SMALL, _LARGE = 0.625, 22.0
_P = (-1.61468768441708447952e3, -9.92877231001918586564e1, -9.64399179425052238628e-1)
_Q = (4.84406305325125486048e3, 2.23548839060100448583e3, 1.12811678491632931402e2, 1.0)
_LOG2E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93145751953125e-1, 1.42860682030941723212e-6
_EP = (9.99999999999999999910e-1, 3.02994407707441961300e-2, 1.26177193074810590878e-4)
_EQ = (2.00000000000000000009e0, 2.27265548208155028766e-1, 2.52448340349684104192e-3, 3.00198505138664455042e-6)


def sincos(x: Lanes) -> tuple[Lanes, Lanes]:
    """Return the sine and cosine of float64 or float32 lanes; the range reduction runs in float64."""
    narrow = x.vectors.kind is F32
    x = x.cast("fpext", F64) if narrow else x
    shifted = x * _TURN + _MAGIC
    k, turns = shifted - _MAGIC, shifted.cast("bitcast", I64)
    a = (x - k * _P1) - k * _P2
    r = a - k * _P3
    error = (a - r) - k * _P3
    if narrow:
        r = r.cast("fptrunc", F32)
    z = r * r
    half = 0.5 * z
    if narrow:
        s = r + r * z * polynomial(z, _S32)
        c = (1.0 - half) + z * z * polynomial(z, _C32)
    else:
        w = 1.0 - half
        s = r + (r * z * polynomial(z, _S) + error)
        c = w + (((1.0 - w) - half) + (z * z * polynomial(z, _C) - r * error))
    odd = turns.vectors.builder.trunc(turns.value, wide(I1, turns.vectors.count))
    return _signed(c.choose(odd, s), turns, narrow), _signed(s.choose(odd, c), turns.plus(1), narrow)


def _signed(x: Lanes, turns: Lanes, narrow: bool) -> Lanes:
    """Return x, or −x where the second bit of `turns` is set."""
    if narrow:
        builder = turns.vectors.builder
        return (x * -1.0).choose(builder.icmp_signed("!=", (turns & 2).value, turns.operand(0)), x)
    return (x.cast("bitcast", I64) ^ ((turns & 2) << 62)).cast("bitcast", F64)


def _exp(u: Lanes) -> Lanes:
    """Return e^u for 0 ≤ u ≤ 50."""
    shifted = u * _LOG2E + _MAGIC
    k = shifted - _MAGIC
    r = (u - k * _LN2_HIGH) - k * _LN2_LOW
    z = r * r
    p = r * polynomial(z, _EP)
    power = (shifted.cast("bitcast", I64) << 52).plus(1023 << 52).cast("bitcast", F64)  # low bits of `shifted`: k
    return (1.0 + 2.0 * p / (polynomial(z, _EQ) - p)) * power


def tanh(x: Lanes) -> Lanes:
    """Return the hyperbolic tangent of float64 or float32 lanes, computed in float64."""
    narrow = x.vectors.kind is F32
    x = x.cast("fpext", F64) if narrow else x
    negative = x.below(0.0)
    size = (x * -1.0).choose(negative, x)
    top = x.like(x.operand(_LARGE))
    size = top.choose(top.below(size), size)  # NaN is preserved
    z = size * size
    near = size + size * z * (polynomial(z, _P) / polynomial(z, _Q))
    result = near.choose(size.below(_SMALL), 1.0 - 2.0 * (1.0 / (_exp(size * 2.0) + 1.0)))
    result = (result * -1.0).choose(negative, result)
    return result.cast("fptrunc", F32) if narrow else result
