"""Normal deviates of a counter: Philox4x64-10, ten rounds of multiplication, and the inverse normal distribution.

    ξ = Φ⁻¹((⌊x/2¹¹⌋ + ½) / 2⁵³),   x a word of Philox at (tick, ⌊channel/4⌋, 0, 0) of the key (seed, run)

A number does not depend on earlier ones, so that a run has the same noise alone, in a batch and in any thread. Plain
functions without allocation, with integers and the operations that IEEE 754 defines exactly: interpreted and as machine
code they return the same bits.

[Salmon, Moraes, Dror, Shaw, Parallel Random Numbers: As Easy as 1, 2, 3, 2011; Wichura, Algorithm AS 241: The
Percentage Points of the Normal Distribution, 1988]
"""

from __future__ import annotations

from math import frexp

import numpy as np

from robot_dyn.foundations.arithmetic import Array

_WORD = Word = np.uint64
_ROUNDS = 10
_LOW, _HALF, _ZERO = _WORD(0xFFFFFFFF), _WORD(32), _WORD(0)
_TIMES = _WORD(0xD2E7470EE14C6C93), _WORD(0xCA5A826395121157)
_PLUS = _WORD(0x9E3779B97F4A7C15), _WORD(0xBB67AE8584CAA73B)
_DROPPED = _WORD(11)  # bits beyond those of a float64

# numerators and denominators of the rational functions of AS 241, from the constant on
_MIDDLE = (
    (3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4,
     4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3),
    (1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3,
     2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3),
)  # fmt: skip
_SIDE = (
    (1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0, 3.64784832476320460504e0,
     1.27045825245236838258e0, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4),
    (1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1,
     1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9),
)  # fmt: skip
_TAIL = (
    (6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0, 2.96560571828504891230e-1,
     2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7),
    (1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
     7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15),
)  # fmt: skip
_LN_2 = 0.6931471805599453


def draw(y: Array, first: int, count: int, keys: Array, tick: int) -> None:
    """Write the normal deviates of a tick into `count` rows of the states of W runs.

    Args:
        y: States, (m, W).
        first: The first of these rows.
        count: Number of channels.
        keys: Seed and number of each run, and number of its first tick, (3, W), as uint64.
        tick: Number of the tick after the first one.
    """
    for b in range(y.shape[1]):
        for k in range(0, count, 4):
            words = philox(_WORD(tick) + keys[2, b], _WORD(k // 4), keys[0, b], keys[1, b])
            for i in range(min(4, count - k)):
                y[first + k + i, b] = normal(words[i])


def philox(tick: Word, block: Word, seed: Word, run: Word) -> tuple[Word, Word, Word, Word]:
    """Return the four words of Philox4x64-10 at the counter (tick, block, 0, 0) of the key (seed, run)."""
    a, b, c, d = tick, block, _ZERO, _ZERO
    for _ in range(_ROUNDS):
        a, b, c, d = _high(_TIMES[1], c) ^ b ^ seed, _TIMES[1] * c, _high(_TIMES[0], a) ^ d ^ run, _TIMES[0] * a
        seed, run = seed + _PLUS[0], run + _PLUS[1]
    return a, b, c, d


def _high(x: Word, y: Word) -> Word:
    """Return the high word of a product."""
    x1, x0, y1, y0 = x >> _HALF, x & _LOW, y >> _HALF, y & _LOW
    middle = x1 * y0 + (x0 * y0 >> _HALF)
    carried = (middle & _LOW) + x0 * y1
    return x1 * y1 + (middle >> _HALF) + (carried >> _HALF)


def normal(word: Word) -> float:
    """Return the normal deviate of a word: Φ⁻¹ of the middle of one of 2⁵³ equal parts of (0, 1), to 1e-15."""
    q = (float(word >> _DROPPED) - 2.0**52 + 0.5) * 2.0**-53  # exact, and so is the distance to the nearer end
    if abs(q) <= 0.425:
        return q * _ratio(_MIDDLE, 0.180625 - q * q)
    r = np.sqrt(-_logarithm(0.5 - abs(q)))
    x = _ratio(_SIDE, r - 1.6) if r <= 5.0 else _ratio(_TAIL, r - 5.0)
    return -x if q < 0.0 else x


def _ratio(table: tuple[tuple[float, ...], tuple[float, ...]], x: float) -> float:
    """Return the ratio of two polynomials of degree 7 at x."""
    above, below = table[0][7], table[1][7]
    for i in range(6, -1, -1):
        above, below = above * x + table[0][i], below * x + table[1][i]
    return above / below


def _logarithm(x: float) -> float:
    """Return ln x = 2 artanh((m − 1)/(m + 1)) + e ln 2 with x = 2ᵉ m; libraries round it in different ways."""
    m, e = frexp(x)
    if m < 0.7071067811865476:
        m, e = 2.0 * m, e - 1
    s = (m - 1.0) / (m + 1.0)
    total = 0.0
    for k in range(23, 0, -2):
        total = total * (s * s) + 2.0 / k
    return s * total + e * _LN_2
