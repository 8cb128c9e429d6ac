"""Polynomials with rational coefficients in letters, sines and cosines, as numbers of the equations.

    s² = 1 − c²,   √2² = 2,   √3² = 3

Every product is reduced by these relations, so that equal functions have equal polynomials and zero has none. The
relations are a Gröbner basis, because their leading terms are coprime. [Cox, Little, O'Shea, Ideals, Varieties, and
Algorithms, 4th ed., 2015, ch. 2 §9]
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Any, SupportsFloat, final

import numpy as np

from robot_dyn.foundations import Arithmetic, Numeral

if TYPE_CHECKING:
    from flint import fmpq_mpoly

MAX_TERMS = 2000  # of one polynomial; those of the arms that are printed have 150 at most
ROOTS = {"sqrt2": 2, "sqrt3": 3}


@final
@dataclass(frozen=True)
class Letter:
    """A letter for a number: its name, its value, and -1 if it stands for the negative of that number."""

    name: str
    value: float = 0.0
    sign: int = 1

    def __float__(self) -> float:
        return self.sign * self.value


@final
@dataclass(frozen=True)
class Angle:
    """An angle: `twelfths` of π, or a letter with a value if `name` is not empty."""

    twelfths: int = 0
    name: str = ""
    value: float = 0.0

    def __float__(self) -> float:
        return self.value if self.name else self.twelfths * math.pi / 12


@final
@dataclass(frozen=True)
class Component:
    """A component of the unit vector (cos β cos α, cos β sin α, sin β): k is 0, 1 or 2."""

    azimuth: Angle
    elevation: Angle
    k: int

    def _of(self, azimuth: Any, elevation: Any) -> Any:
        """Return the component from the angles as numbers of an arithmetic."""
        across = np.cos(elevation)
        return (across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation))[self.k]

    def __float__(self) -> float:
        return float(self._of(float(self.azimuth), float(self.elevation)))


@final
class Polynomial:
    """A polynomial of a `Polynomials`, with the operators of NumPy's object arrays."""

    __slots__ = ("ring", "value")

    def __init__(self, ring: Polynomials, value: fmpq_mpoly) -> None:
        self.ring, self.value = ring, value

    def _by(self, operation: Callable[[Any, Any], Any], other: object) -> Polynomial:
        value = other.value if isinstance(other, Polynomial) else other
        if not isinstance(value, type(self.value) | int):
            return NotImplemented
        return Polynomial(self.ring, operation(self.value, value))

    def __add__(self, other: object) -> Polynomial:
        return self._by(operator.add, other)

    def __sub__(self, other: object) -> Polynomial:
        return self._by(operator.sub, other)

    def __rsub__(self, other: object) -> Polynomial:
        return -self + other

    def __mul__(self, other: object) -> Polynomial:
        return self._by(self.ring.product, other)

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: object) -> Polynomial:
        return self._by(operator.truediv, other)

    def __neg__(self) -> Polynomial:
        return Polynomial(self.ring, -self.value)

    def __abs__(self) -> Polynomial:
        if not self.value.is_constant():
            raise ValueError("the absolute value of a polynomial")
        return -self if any(x < 0 for x in self.value.coeffs()) else self

    def __bool__(self) -> bool:
        return bool(self.value)

    def __eq__(self, other: object) -> bool:
        return bool(self.value == (other.value if isinstance(other, Polynomial) else other))

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def sqrt(self) -> Polynomial:
        """Return the root of 1; axes are built as unit vectors, so that no other root is taken."""
        if self != 1:
            raise ValueError("a root of a polynomial")
        return self

    def terms(self) -> dict[tuple[int, ...], Fraction]:
        """Return the coefficient of each monomial, by the exponents of the ring's generators."""
        return {key: Fraction(int(x.p), int(x.q)) for key, x in self.value.to_dict().items()}

    def derivative(self, name: str) -> Polynomial:
        """Return the partial derivative by a generator."""
        return Polynomial(self.ring, self.value.derivative(name))


@final
@dataclass(frozen=True, eq=False)
class Turn:
    """An angle by its sine and cosine, which NumPy's `sin` and `cos` return.

    Attributes:
        s: Sine.
        c: Cosine.
    """

    s: Polynomial
    c: Polynomial

    def sin(self) -> Polynomial:
        """Return the sine."""
        return self.s

    def cos(self) -> Polynomial:
        """Return the cosine."""
        return self.c

    def __add__(self, other: Turn | Polynomial | int) -> Turn:
        if isinstance(other, Turn):
            return Turn(self.s * other.c + self.c * other.s, self.c * other.c - self.s * other.s)
        return self  # NumPy adds angles to 0

    __radd__ = __add__

    def __rmul__(self, multiple: Polynomial) -> Turn:
        """Return a multiple of the angle; the factor is a whole number and not 0."""
        (k,) = map(int, multiple.value.coeffs())
        angle = self if k > 0 else Turn(-self.s, self.c)
        return reduce(Turn.__add__, [angle] * abs(k))


@final
@dataclass(frozen=True, eq=False)
class Polynomials(Arithmetic):
    """The ring of rational polynomials in letters, c, s, √2 and √3, modulo the relations of this module.

    Attributes:
        letters: Names of letters, rates and sliding coordinates.
        angles: Names of angles; generators are the sine "s_name" and the cosine "c_name" of each.
    """

    letters: tuple[str, ...]
    angles: tuple[str, ...]

    @property
    def dtype(self) -> np.dtype:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Type of entries: Python objects."""
        return np.dtype(object)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the generators. A sine precedes its cosine: s² is then the leading term of s² + c² − 1."""
        trigonometric = (f"{function}_{name}" for name in self.angles for function in "sc")
        return (*trigonometric, *ROOTS, *self.letters)

    @cached_property
    def _context(self) -> Any:
        from flint import fmpq_mpoly_ctx

        return fmpq_mpoly_ctx.get(self.names, "degrevlex")

    @cached_property
    def _generators(self) -> dict[str, Any]:
        return dict(zip(self.names, self._context.gens(), strict=True))

    @cached_property
    def _relations(self) -> list[tuple[int, Any]]:
        x, at = self._generators, self.names.index
        circles = [(at(f"s_{name}"), x[f"s_{name}"] ** 2 + x[f"c_{name}"] ** 2 - 1) for name in self.angles]
        return circles + [(at(name), x[name] ** 2 - square) for name, square in ROOTS.items()]

    def product(self, x: fmpq_mpoly, y: fmpq_mpoly | int) -> fmpq_mpoly:
        """Return the remainder of x y by the relations; raise OverflowError for a polynomial of too many terms."""
        value = x * y
        if len(value) > MAX_TERMS:
            raise OverflowError(f"more than {MAX_TERMS} terms")
        if value:
            degrees = value.degrees()
            for index, relation in self._relations:
                if degrees[index] > 1:
                    value = value % relation
        return value

    def generator(self, name: str) -> Polynomial:
        """Return a generator by its name."""
        return Polynomial(self, self._generators[name])

    def number(self, literal: Numeral | Letter | Angle | Component | Polynomial | Turn) -> Polynomial | Turn:  # pyright: ignore[reportIncompatibleMethodOverride]
        if isinstance(literal, Letter):
            return literal.sign * self.generator(literal.name)
        if isinstance(literal, Angle):
            return self._turn(literal)
        if isinstance(literal, Component):
            return literal._of(self._turn(literal.azimuth), self._turn(literal.elevation))
        return literal if isinstance(literal, Polynomial | Turn) else self._constant(literal)

    def _constant(self, x: str | SupportsFloat) -> Polynomial:
        from flint import fmpq

        exact = Fraction(x) if isinstance(x, str | int | Fraction) else Fraction(float(x))
        return Polynomial(self, self._context.constant(fmpq(exact.numerator, exact.denominator)))

    def _turn(self, angle: Angle) -> Turn:
        if angle.name:
            return Turn(self.generator(f"s_{angle.name}"), self.generator(f"c_{angle.name}"))
        return Turn(self._sine(angle.twelfths), self._sine(angle.twelfths + 6))

    def _sine(self, twelfths: int) -> Polynomial:
        """Return sin(k π/12) in √2 and √3."""
        k = twelfths % 24
        if k > 12:
            return -self._sine(k - 12)
        k = min(k, 12 - k)
        if k in (0, 6):
            return self._constant(k // 6)
        one, two, three = self._constant(1), self.generator("sqrt2"), self.generator("sqrt3")
        return (two * (three - 1) / 4, one / 2, two / 2, three / 2, two * (three + 1) / 4)[k - 1]

    def scope(self) -> AbstractContextManager[None]:
        return nullcontext()

    def asarray(self, values: object) -> np.ndarray:
        return self.array(values)

    def finite(self, x: np.ndarray) -> np.ndarray:
        return np.ones(x.shape, dtype=bool)


def twelfths_of(angle: float, tolerance: float) -> int | None:
    """Return k if an angle is within a tolerance of k π/12, or None."""
    k = round(angle * 12 / math.pi)
    return k if abs(angle - k * math.pi / 12) <= tolerance else None
