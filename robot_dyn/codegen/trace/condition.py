"""Conditions: comparisons of symbols, c ∈ {0, 1}, whose truth depends on the state and is decided by the trace."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import final

import casadi as ca

from robot_dyn.foundations.linear_algebra import in_regularity_check

Node = ca.SX  # 1 × 1


def _undecided(condition: Node) -> bool:
    raise TypeError("the truth of this comparison depends on the state")


_decision: ContextVar[Callable[[Node], bool]] = ContextVar("decision", default=_undecided)


@contextmanager
def deciding(decision: Callable[[Node], bool]) -> Iterator[None]:
    """Let a function decide the truth of conditions in this context."""
    token = _decision.set(decision)
    try:
        yield
    finally:
        _decision.reset(token)


@final
class Condition:
    """A comparison whose outcome depends on the state; the current decision determines its truth."""

    __slots__ = ("node",)

    def __init__(self, node: Node) -> None:
        self.node = node

    def __bool__(self) -> bool:
        return in_regularity_check.get() or _decision.get()(self.node)

    def __and__(self, other: Condition | bool) -> Condition:
        return Condition(ca.logic_and(self.node, truth(other)))

    def __or__(self, other: Condition | bool) -> Condition:
        return Condition(ca.logic_or(self.node, truth(other)))

    def __invert__(self) -> Condition:
        return Condition(ca.logic_not(self.node))

    __rand__, __ror__ = __and__, __or__


def truth(condition: Condition | bool) -> Node:
    """Return the node of a condition, or 0 or 1 for a plain truth value."""
    return condition.node if isinstance(condition, Condition) else ca.SX(bool(condition))
