"""A theorem about the motion of an arm: existence, uniqueness, and balls that contain q(t) and v(t)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import inf, log10, nextafter
from typing import Any, final

import numpy as np
from flint import arb
from numpy.typing import ArrayLike

from robot_dyn.foundations import (
    UNREPORTED,
    Answer,
    Array,
    Ball,
    Block,
    QueryError,
    Table,
    Value,
    number,
    numbers,
    reported,
)
from robot_dyn.queries import joint_units
from robot_dyn.tools.proof.hypotheses import numbers_of
from robot_dyn.tools.proof.node import Node, Packed, on_the_way, unpacked

TRUSTED = (
    "the ball arithmetic of Arb (python-flint)",
    "the derivatives and common subexpressions of CasADi",
    "CPython, and this library's equations, which tests compare with a second formulation",
)


@final
@dataclass(frozen=True, eq=False, repr=False)
class Proof(Answer, Value):
    """A theorem about the flow, for the numbers stated by a file and a setup; result of `rd.tools.proof.prove`.

    Attributes:
        robot: Name of the arm.
        joint_names: Names of the n joints.
        joint_types: Types of the joints, such as "revolute".
        requested_s: Requested end time, in [s].
        until_s: Time up to which the theorem is proven, in [s].
        why_not: Reason why the proof ended early; empty if it reached `requested_s`.
        bits: Precision of the balls.
        assumed: Exact numbers assumed, in sentences.
        nodes: Start, and ends of all steps.
    """

    robot: str
    joint_names: tuple[str, ...] = field(metadata=UNREPORTED)
    joint_types: tuple[str, ...] = field(metadata=UNREPORTED)
    requested_s: float
    until_s: float
    why_not: str
    bits: int
    assumed: tuple[str, ...]
    nodes: tuple[Node, ...] = field(repr=False, metadata=UNREPORTED)

    @reported
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of `q` and `v`."""
        return self.joint_names

    @reported
    def proven(self) -> bool:
        """True if the proof reaches the requested time."""
        return not self.why_not

    @reported
    def radius_q(self) -> np.ndarray:
        """Upper bounds of the radii of q at the end, (n,), in [rad] or [m]."""
        return _radii(self.nodes[-1].q)

    @reported
    def radius_v(self) -> np.ndarray:
        """Upper bounds of the radii of v at the end, (n,), in [rad/s] or [m/s]."""
        return _radii(self.nodes[-1].v)

    @property
    def radii(self) -> tuple[np.ndarray, np.ndarray]:
        """Times of the nodes, (k,), and upper bounds of the largest radius of q there, (k,)."""
        return np.array([node.t for node in self.nodes]), np.array([_radii(node.q).max() for node in self.nodes])

    @property
    def digits(self) -> float:
        """−log₁₀ of the largest radius of q at the end; inf if the radius is 0."""
        return _digits(float(self.radius_q.max()))

    def at(self, t: float) -> tuple[Array, Array]:
        """Return balls that contain q(t) and v(t), (n,) each, from a node at t or from polynomial and tube of the step.

        Args:
            t: Time in [s] from 0 to `until_s`, taken exactly.

        Raises:
            QueryError: If t is outside this range.
        """
        t = number("t", t)
        if not 0 <= t <= self.until_s:
            raise QueryError(f"t must be between 0 and {self.until_s!r} s, the end of the proof, got {t!r}")
        k = bisect_right(self.nodes, t, key=lambda node: node.t) - 1
        with Ball(self.bits).scope():
            if self.nodes[k].t == t:
                q, v = ([unpacked(x) for x in balls] for balls in (self.nodes[k].q, self.nodes[k].v))
            else:
                q, v = on_the_way(self.nodes[k].t, self.nodes[k + 1])(t)
        return _array(q), _array(v)

    def contains(self, t: float, q: ArrayLike | Sequence[arb], v: ArrayLike | Sequence[arb] | None = None) -> bool:
        """Return True if a state, or all of a state of balls, is in the balls at t; without v, only q is compared.

        Args:
            t: Time in [s].
            q: Position, (n,), numbers, text or balls.
            v: Velocity, (n,), numbers, text or balls.

        Raises:
            QueryError: If a shape is wrong, or t is outside the proven range.
        """
        balls = dict(zip("qv", self.at(t), strict=True))
        with Ball(self.bits).scope():
            state = {"q": numbers_of("q", q, self.joint_names)}
            if v is not None:
                state["v"] = numbers_of("v", v, self.joint_names)
            return all(
                bool(ball.contains(x)) for name in state for x, ball in zip(state[name], balls[name], strict=True)
            )

    def digits_of(self, t: ArrayLike, q: ArrayLike) -> float:
        """Return the decimal digits of positions that the theorem confirms: −log₁₀ of the largest possible error.

        Args:
            t: Times in [s], (m,); times after `until_s` are ignored.
            q: Positions, (m, n), floats.

        Raises:
            QueryError: If they are not finite numbers of these shapes, or no time is in the proven range.
        """
        t, q = numbers("t", t, ("m",)), numbers("q", q, ("m", "n"))
        if q.shape != (len(t), len(self.joint_names)):
            raise QueryError(f"q must have shape ({len(t)}, {len(self.joint_names)}), got {q.shape}")
        within = (t >= 0) & (t <= self.until_s)
        if not within.any():
            raise QueryError(f"no sample is in the proven range of {self.until_s!r} s; give one that is")
        ends, most = np.array([node.t for node in self.nodes]), 0.0
        steps = np.clip(np.searchsorted(ends, t[within], side="left"), 1, None)
        with Ball(self.bits).scope():
            for k in np.unique(steps).tolist() if len(ends) > 1 else ():
                at = on_the_way(self.nodes[k - 1].t, self.nodes[k])
                for time, row in zip(t[within][steps == k].tolist(), q[within][steps == k].tolist(), strict=True):
                    most = max(most, *(_far(ball, x) for ball, x in zip(at(time)[0], row, strict=True)))
        return _digits(most)

    @reported
    def q(self) -> tuple[str, ...]:
        """Balls of q at the end, as decimals with a radius that contain them."""
        return tuple(map(_decimals, self.nodes[-1].q))

    @reported
    def v(self) -> tuple[str, ...]:
        """Balls of v at the end, as decimals with a radius that contain them."""
        return tuple(map(_decimals, self.nodes[-1].v))

    @reported
    def steps(self) -> int:
        """Number of proven steps."""
        return len(self.nodes) - 1

    @reported
    def trusted(self) -> tuple[str, ...]:
        """Software that the theorem relies on."""
        return TRUSTED

    def blocks(self) -> Iterator[Block]:
        yield f"{self.robot}: " + self._claim
        heading = ("joint", *(f"{name} [{joint_units(name, self.joint_types)}]" for name in "qv"))
        yield Table(heading, tuple(zip(self.joint_names, self.q, self.v, strict=True)), right=heading[1:])
        if self.why_not:
            yield f"Not proven beyond t = {self.until_s!r} s, because {self.why_not}."
        yield "Numbers assumed:"
        yield from (f"  {sentence}" for sentence in self.assumed)
        yield f"Trusted: {'; '.join(self.trusted)}."
        yield f"{self.steps} steps, balls of {self.bits} bits"

    @property
    def drawing(self) -> str:
        from robot_dyn.foundations import plot

        t, radius = self.radii
        if self.steps < 2:
            return ""
        with np.errstate(divide="ignore"):  # the start may be a point
            return plot("log₁₀ of the largest radius of q", t, {"radius": np.log10(radius)})

    @property
    def summary(self) -> str:
        """Theorem as text."""
        return repr(self)

    @property
    def _claim(self) -> str:
        if not self.until_s:
            return "nothing is proven."
        return f"the motion exists and is unique for 0 ≤ t ≤ {self.until_s!r} s, and its final state lies within"


def _far(ball: Any, x: float) -> float:
    """Return the largest distance of a number from a ball, rounded up; inf if it is not finite."""
    far = float((ball - x).abs_upper())
    return nextafter(far, inf) if far < inf else inf


def _array(balls: list[Any]) -> Array:
    array = np.empty(len(balls), dtype=object)
    array[:] = balls
    return array


def _radii(balls: tuple[Packed, ...]) -> np.ndarray:
    with Ball().scope():
        return np.array([float(unpacked(x).rad().upper()) for x in balls])


def _digits(error: float) -> float:
    return -log10(error) if error > 0 else inf


def _decimals(x: Packed) -> str:
    with Ball(max(64, x[0].bit_length() + 8)).scope():
        ball = unpacked(x)
        accuracy = ball.rel_accuracy_bits()
        return ball.str(max(2, min(int(accuracy * 0.30103) + 2, 60)) if accuracy < 10**6 else 20)
