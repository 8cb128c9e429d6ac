"""Functions to export, of an arm, a plant or a controller, and their parameters p."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from functools import cached_property
from typing import ClassVar

import casadi as ca
import numpy as np

import robot_dyn as rd
from robot_dyn.codegen import Parameter


class Exported(ABC):
    """Functions to export.

    Attributes:
        kind: Noun in the names of the files.
        states: Number of random states at which differences are measured.
        period_s: Period of a tick, in [s]; 0 without one.
    """

    kind: ClassVar[str]
    states: ClassVar[int]
    period_s: float = 0.0

    @property
    @abstractmethod
    def name(self) -> str:
        """Prefix of the names in C, unless another is chosen."""

    @property
    @abstractmethod
    def title(self) -> str:
        """Name and equation, for the header."""

    @property
    @abstractmethod
    def robot(self) -> rd.Robot | None:
        """The robot of the equations, or the first model of a controller; None if it has none."""

    @property
    @abstractmethod
    def right_angles(self) -> tuple[str, ...]:
        """Angles that the file states with too few digits, and that are right angles here, as text."""

    @property
    @abstractmethod
    def declared(self) -> tuple[Parameter, ...]:
        """Parameters of the traced functions."""

    @abstractmethod
    def function(self, name: str, *, is_open: bool = True) -> ca.Function:
        """Return a function by name, with the inputs and results of the C function; p is bound unless `is_open`."""

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the vector p: finite coefficients, gravity and payloads; () of an arm."""
        return tuple(x for x in self.declared if x.size and x.declared.can_vary and np.isfinite(x.value).all())

    @property
    def constants(self) -> tuple[Parameter, ...]:
        """The other parameters, with public names, which are constants of the code."""
        return tuple(x for x in self.declared if x.size and x not in self.parameters and x.key[0] != "_")

    @cached_property
    def p(self) -> np.ndarray:
        """Values of the parameters, (P,)."""
        return np.concatenate([np.zeros(0), *map(values_of, self.parameters)])

    def bound(
        self, name: str, trace: ca.Function, arguments: Sequence[str], results: Sequence[str],
        optional: Collection[str], *, is_open: bool,
    ) -> ca.Function:  # fmt: skip
        """Return a trace, whose last argument are all parameters, as a Function of p and of the arguments in use.

        Args:
            name: Name of the function.
            trace: The trace.
            arguments: Names of its arguments; "p" is the last one if there are parameters.
            results: Names of its results.
            optional: Arguments to leave out if the results do not depend on them.
            is_open: False to bind p.
        """
        inputs = dict(zip(arguments, trace.sx_in(), strict=False))
        values = [*inputs.values()]
        if "p" in inputs:
            inputs["p"] = ca.SX.sym("p", len(self.p))
            values[-1] = self._filled(inputs["p"] if is_open else ca.DM(self.p))
        outputs = trace.call(values)
        uses = {key: x for key, x in inputs.items() if key not in optional or ca.depends_on(ca.vertcat(*outputs), x)}
        return ca.Function(name, [*uses.values()], ca.cse(outputs), [*uses], [*results])

    def _filled(self, p: ca.SX | ca.DM) -> ca.SX:
        """Return the parameters of the trace, for those that are open."""
        parts, start = [], 0
        for parameter in self.declared:
            if parameter in self.parameters:
                parts.append(p[start : start + parameter.size])
                start += parameter.size
            else:
                parts.append(ca.DM(values_of(parameter)))
        return ca.vertcat(*parts)


def values_of(parameter: Parameter) -> np.ndarray:
    """Return the entries of a parameter that are inputs."""
    return parameter.value.ravel()[list(parameter.entries)]
