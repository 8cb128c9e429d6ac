"""Hyperbolic tangent without branches, so that dry friction vectorises: a rational function near 0, else by exp 2|x|.

    tanh x ≈ x + x³ P(x²) / Q(x²) for |x| < 0.625,   else ± (1 − 2 / (e^{2|x|} + 1)),   e^u = 2ᵏ e^r

The rational functions are those of Cephes, tanh.c and exp.c [Moshier 1984]; measured error below 2 ulp.
"""

from __future__ import annotations

from robot_dyn.codegen.llvm.lanes import F32, Lanes, polynomial

_SMALL, _LARGE = 0.625, 22.0  # below, 1 − 2/(…) would cancel; beyond, the result is 1
_P = (-1.61468768441708447952e3, -9.92877231001918586564e1, -9.64399179425052238628e-1)
_Q = (4.84406305325125486048e3, 2.23548839060100448583e3, 1.12811678491632931402e2, 1.0)
_MAGIC = 1.5 * 2.0**52
_LOG2E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93145751953125e-1, 1.42860682030941723212e-6
_EP = (9.99999999999999999910e-1, 3.02994407707441961300e-2, 1.26177193074810590878e-4)
_EQ = (2.00000000000000000009e0, 2.27265548208155028766e-1, 2.52448340349684104192e-3, 3.00198505138664455042e-6)


def _exp(u: Lanes) -> Lanes:
    """e^u of 0 ≤ u ≤ 50."""
    shifted = u * _LOG2E + _MAGIC
    k = shifted - _MAGIC
    r = (u - k * _LN2_HIGH) - k * _LN2_LOW
    z = r * r
    p = r * polynomial(z, _EP)
    power = ((shifted.bits() << 52) + (1023 << 52)).number()  # the low bits of `shifted` are k
    return (1.0 + 2.0 * p / (polynomial(z, _EQ) - p)) * power


def tanh_lanes(x: Lanes) -> Lanes:
    """The instructions; x float64 or float32. A float32 is computed in float64."""
    narrow = x.kind is F32
    x = x.double() if narrow else x
    negative = x.below(0.0)
    size = (x * -1.0).choose(negative, x)
    top = Lanes(x.builder, x.of(_LARGE), x.kind, x.count)
    size = top.choose(top.below(size), size)  # a NaN stays
    z = size * size
    near = size + size * z * (polynomial(z, _P) / polynomial(z, _Q))
    result = near.choose(size.below(_SMALL), 1.0 - 2.0 * (1.0 / (_exp(size * 2.0) + 1.0)))
    result = (result * -1.0).choose(negative, result)
    return result.single() if narrow else result
