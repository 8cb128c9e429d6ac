"""Stored data of a proven step: balls at its end, and polynomial and tube during the step, as integers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import final

from flint import arb, ctx

from robot_dyn.tools.proof.enclosure.balls import Ball, horner
from robot_dyn.tools.proof.enclosure.polynomial import derivatives
from robot_dyn.tools.proof.enclosure.step import State, Step

Packed = tuple[int, int, int, int]


def packed(x: Ball) -> Packed:
    """Return the numbers of a ball, exactly."""
    (m, e), (r, s) = x.mid().man_exp(), x.rad().man_exp()
    return int(m), int(e), int(r), int(s)


def unpacked(x: Packed) -> Ball:
    """Return the ball of these numbers, with its exact midpoint and its radius rounded up."""
    m, e, r, s = x
    with ctx.workprec(max(m.bit_length(), r.bit_length(), 2)):
        return arb(arb(m) * arb(2) ** e, arb(r) * arb(2) ** s)


def of_joints(balls: Sequence[Ball]) -> tuple[Packed, ...]:
    """Return the numbers of balls, one for each joint."""
    return tuple(map(packed, balls))


@final
@dataclass(frozen=True)
class Node:
    """Proven data at the end of a step and for the step before it.

    Attributes:
        t: Time in [s], exact.
        q, v: Balls that contain the state at t.
        polynomial: Polynomial of q on the step that ends at t, in powers of the time since its start; empty at the
            start.
        tube_q, tube_v: Balls around 0 that contain the deviation from the polynomial during the step.
    """

    t: float
    q: tuple[Packed, ...]
    v: tuple[Packed, ...]
    polynomial: tuple[tuple[Packed, ...], ...] = field(default=(), repr=False)
    tube_q: tuple[Packed, ...] = field(default=(), repr=False)
    tube_v: tuple[Packed, ...] = field(default=(), repr=False)


def node_of(state: State, step: Step | None = None) -> Node:
    """Return the stored data of a state and of the step before it."""
    n = len(state.q)
    wide = [arb(0, bound) for bound in state.error.bounds]
    q, v = (
        [x + e for x, e in zip(centre, error, strict=True)]
        for centre, error in ((state.q, wide[:n]), (state.v, wide[n:]))
    )
    t = float(state.t)
    assert t == state.t
    if step is None:
        return Node(t, of_joints(q), of_joints(v))
    polynomial = tuple(map(of_joints, step.p.q))
    return Node(t, of_joints(q), of_joints(v), polynomial, of_joints(step.tube.B[:n]), of_joints(step.tube.B[n:]))


def on_the_way(start: float, node: Node) -> Callable[[float], tuple[list[arb], list[arb]]]:
    """Return a function of time whose balls contain q and v on the step from `start` to the node, in its precision."""
    q = tuple(tuple(map(unpacked, coefficients)) for coefficients in node.polynomial)
    v, wide_q, wide_v = derivatives(q), [*map(unpacked, node.tube_q)], [*map(unpacked, node.tube_v)]

    def at(t: float) -> tuple[list[arb], list[arb]]:
        tau = arb(t) - arb(start)
        return (
            [horner(c, tau) + b for c, b in zip(q, wide_q, strict=True)],
            [horner(c, tau) + b for c, b in zip(v, wide_v, strict=True)],
        )

    return at
