"""What is stored of a proven step: balls at its end, and polynomial and tube on the way, as whole numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, final

from flint import arb, ctx

from robot_dyn.tools.proof.enclosure.balls import Ball, horner
from robot_dyn.tools.proof.enclosure.polynomial import derivatives
from robot_dyn.tools.proof.enclosure.step import State, Step

Packed = tuple[int, int, int, int]


def packed(x: Ball) -> Packed:
    """The numbers of a ball, exactly."""
    (m, e), (r, s) = x.mid().man_exp(), x.rad().man_exp()
    return int(m), int(e), int(r), int(s)


def unpacked(x: Packed) -> Ball:
    """The ball of these numbers; its midpoint exactly, its radius rounded up."""
    m, e, r, s = x
    with ctx.workprec(max(m.bit_length(), r.bit_length(), 2)):
        return arb(arb(m) * arb(2) ** e, arb(r) * arb(2) ** s)


def of_joints(balls: Sequence[Ball]) -> tuple[Packed, ...]:
    """One for each joint."""
    return tuple(map(packed, balls))


@final
@dataclass(frozen=True)
class Node:
    """What is known at the end of a step, and of the step before it.

    Attributes:
        t: Time in [s], exact.
        q, v: Balls that hold the state at t.
        polynomial: Of q on the step that ends there, by powers of the time since its start; none at the start.
        tube_q, tube_v: Balls about 0: the state is off the polynomial by no more, anywhere on the step.
    """

    t: float
    q: tuple[Packed, ...]
    v: tuple[Packed, ...]
    polynomial: tuple[tuple[Packed, ...], ...] = field(default=(), repr=False)
    tube_q: tuple[Packed, ...] = field(default=(), repr=False)
    tube_v: tuple[Packed, ...] = field(default=(), repr=False)


def node_of(state: State, step: Step | None = None) -> Node:
    """Return what is stored of a state, and of the step before it."""
    n = len(state.q)
    wide = [arb(0, bound) for bound in state.error.bounds]
    q, v = (
        [x + e for x, e in zip(known, own, strict=True)] for known, own in ((state.q, wide[:n]), (state.v, wide[n:]))
    )
    t = float(state.t)
    assert t == state.t
    if step is None:
        return Node(t, of_joints(q), of_joints(v))
    polynomial = tuple(map(of_joints, step.p.q))
    return Node(t, of_joints(q), of_joints(v), polynomial, of_joints(step.tube.B[:n]), of_joints(step.tube.B[n:]))


def on_the_way(start: float, node: Node) -> Callable[[float], tuple[list[Any], list[Any]]]:
    """Balls that hold q and v at a time of the step from `start` to the node; in the precision of the calls."""
    q = tuple(tuple(map(unpacked, each)) for each in node.polynomial)
    v, wide_q, wide_v = derivatives(q), [*map(unpacked, node.tube_q)], [*map(unpacked, node.tube_v)]

    def at(t: float) -> tuple[list[Any], list[Any]]:
        tau = arb(t) - arb(start)
        return (
            [horner(each, tau) + b for each, b in zip(q, wide_q, strict=True)],
            [horner(each, tau) + b for each, b in zip(v, wide_v, strict=True)],
        )

    return at
