"""Polynomials as SymPy expressions, with cos(q1 + q2) of joints with parallel axes where that is shorter.

cos K cos q = ½ (cos(K + q) + cos(K − q)),   sin K cos q = ½ (sin(K + q) + sin(K − q)), …
"""

from __future__ import annotations

from collections import defaultdict
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from robot_dyn.tools.symbols.polynomials import ROOTS, Polynomial

if TYPE_CHECKING:
    import sympy as sp

_LONG = 1000  # with a larger denominator, the numbers of an expression are decimals
Exponents = tuple[int, ...]
Harmonic = tuple[bool, tuple[int, ...]]  # True for a cosine; multiples of the angles of a group
Term = tuple[Exponents, tuple[Harmonic, ...]]
Terms = dict[Term, Fraction]


def shortest(polynomial: Polynomial, groups: tuple[tuple[str, ...], ...]) -> Terms:
    """Return the terms of a polynomial: powers of sines and cosines, or harmonics of groups, whichever are fewer.

    Args:
        polynomial: Reduced polynomial.
        groups: Names of angles of joints with parallel axes, in the order of the chain.
    """
    powers: Terms = {(key, ()): x for key, x in polynomial.terms().items()}
    harmonics = powers
    for group in groups:
        harmonics = _expanded(harmonics, [polynomial.ring.names.index(f"s_{name}") for name in group])
    return min(harmonics, powers, key=len)


def _expanded(terms: Terms, sines: list[int]) -> Terms:
    """Replace the powers of a group by harmonics; the cosine of an angle follows its sine in the exponents."""
    result: Terms = defaultdict(Fraction)
    for (key, others), x in terms.items():
        sums: dict[Harmonic, Fraction] = {(True, (0,) * len(sines)): x}
        for k, index in enumerate(sines):
            for is_cosine, power in ((False, key[index]), (True, key[index + 1])):
                for _ in range(power):
                    sums = _times(sums, is_cosine, k)
        rest = tuple(0 if i in sines or i - 1 in sines else power for i, power in enumerate(key))
        for harmonic, value in sums.items():
            result[rest, (*others, harmonic)] += value
    return {term: x for term, x in result.items() if x}


def _times(sums: dict[Harmonic, Fraction], is_cosine: bool, k: int) -> dict[Harmonic, Fraction]:
    """Multiply a sum of harmonics by the cosine or sine of the k-th angle."""
    result: dict[Harmonic, Fraction] = defaultdict(Fraction)
    for (cosine, multiples), x in sums.items():
        for step in (1, -1):
            shifted = tuple(m + step * (i == k) for i, m in enumerate(multiples))
            # sin K sin q = ½ (cos(K − q) − cos(K + q)),  cos K sin q = ½ (sin(K + q) − sin(K − q))
            sign = 1 if is_cosine else -step if not cosine else step
            kind = cosine if is_cosine else not cosine
            if next((m for m in shifted if m), 1) < 0:
                shifted, sign = tuple(-m for m in shifted), sign if kind else -sign
            if kind or any(shifted):
                result[kind, shifted] += sign * x / 2
    return {harmonic: x for harmonic, x in result.items() if x}


def expression(terms: Terms, names: tuple[str, ...], groups: tuple[tuple[str, ...], ...]) -> sp.Expr:
    """Return a SymPy expression, with the terms of each mass collected."""
    import sympy as sp

    letter = {name: _generator(name) for name in names}
    decimal = any(x.denominator > _LONG for x in terms.values())
    masses: dict[str, list[Any]] = defaultdict(list)
    for (key, harmonics), x in sorted(terms.items(), reverse=True):
        factors = [letter[name] ** power for name, power in zip(names, key, strict=True) if power]
        for group, (is_cosine, multiples) in zip(groups, harmonics, strict=len(harmonics) > 0):
            angle = sp.Add(*(m * sp.Symbol(name, real=True) for m, name in zip(multiples, group, strict=True)))
            factors.append(sp.cos(angle) if is_cosine else sp.sin(angle))
        mass = next((name for name, p in zip(names, key, strict=True) if p == 1 and name[0] == "m" and name[1:]), "")
        if mass:
            factors.remove(letter[mass])
        number = sp.Float(float(x), 15) if decimal and x.denominator > 1 else sp.Rational(x.numerator, x.denominator)
        masses[mass].append(sp.Mul(number, *factors))
    sums = {mass: sp.Add(*parts) for mass, parts in masses.items()}
    if not decimal:
        sums = {mass: sp.factor_terms(total) for mass, total in sums.items()}  # common factors, no more
    return sp.Add(*(sp.Mul(letter[mass], total) if mass else total for mass, total in sums.items()))


def _generator(name: str) -> Any:
    import sympy as sp

    if name in ROOTS:
        return sp.sqrt(ROOTS[name])
    kind, _, angle = name.partition("_")
    if kind in ("s", "c") and angle:
        return (sp.sin if kind == "s" else sp.cos)(sp.Symbol(angle, real=True))
    return sp.Symbol(name, real=True)
