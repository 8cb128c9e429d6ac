"""Literals: an arithmetic whose constants are balls of the decimals of a file, for traces that round nothing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, final

import casadi as ca
import numpy as np

from robot_dyn.arithmetic import Arithmetic, Array
from robot_dyn.codegen.trace.condition import Node
from robot_dyn.studies.proof.tape.term import BALLS, CONSTANTS, Constants, Term


@final
@dataclass(frozen=True, eq=False)
class Literals(Arithmetic):
    """Numbers of a trace, constants in balls of 400 bits.

    Attributes:
        constants: Those that became inputs.
    """

    constants: Constants = field(default_factory=Constants, repr=False)
    dtype: np.dtype = field(default_factory=lambda: np.dtype(object), init=False, repr=False)

    def number(self, literal: Any) -> Term:
        return literal if isinstance(literal, Term) else Term(BALLS.number(literal))

    @contextmanager
    def scope(self) -> Iterator[None]:
        token = CONSTANTS.set(self.constants)
        try:
            with BALLS.scope():
                yield
        finally:
            CONSTANTS.reset(token)

    def asarray(self, values: Any) -> Array:
        return self.array(values)

    def finite(self, x: Array) -> np.ndarray:
        return np.ones(np.shape(x), dtype=bool)

    def inputs(self, name: str, n: int) -> tuple[Node, Array]:
        """A CasADi vector of n inputs, and the same as an array of numbers."""
        vector = ca.SX.sym(name, n)
        return vector, self.array([Term(BALLS.number(0), vector[i]) for i in range(n)])
