"""Evaluate Pinocchio's kernels: single states directly, coupled joints by virtual work, lists and batches row by row.

    x = reduce(kernel(S q + s₀, S v, …))  for each state

Any input other than a single state of moderate float64 values is checked, converted and evaluated by `queries.batch`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.couplings import Couplings
from robot_dyn.foundations.errors import PrecisionWarning
from robot_dyn.foundations.validate import is_moderate, is_plain, shaped
from robot_dyn.model.conditioning import Regularity, regularity
from robot_dyn.model.kernels import Kernel, Scratch
from robot_dyn.queries.batch import answered
from robot_dyn.queries.dynamics import Array, acceleration
from robot_dyn.queries.quantity import ALL, DOUBTFUL

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot

Reduction = Callable[[Couplings, Any], Any]  # maps the result for all joints to the result for q


@final
@dataclass(frozen=True, eq=False)
class Evaluation:
    """Evaluates kernels for one robot.

    Attributes:
        model: The `pinocchio.Model`.
        couplings: How the joints of `model` follow q.
        joint_names: Names of the n joints.
        sizes: The numbers that letters in the shapes of quantities stand for.
        scratch: Memory that the algorithms of `model` write to.
    """

    model: Any
    couplings: Couplings
    joint_names: tuple[str, ...]
    sizes: Mapping[str, int]
    scratch: Scratch

    @cached_property
    def _shape(self) -> tuple[int]:
        return (len(self.joint_names),)

    @cached_property
    def regularity(self) -> Regularity:
        """Whether M is invertible, judged at a configuration without symmetries."""
        M = self._equation(pin.crba, Couplings.matrix, self.model)(np.linspace(0.3, 0.9, *self._shape))
        return regularity(M, self.joint_names)

    def answer(
        self, quantity: str, errors: str, kernel: Kernel, reduce: Reduction | None, model: Any, *state: Array
    ) -> Any:
        """Return the result of a kernel at one state or a batch.

        Args:
            quantity: Name of the quantity.
            errors: "raise", or "nan" for NaN at the states of a batch that cannot be evaluated.
            kernel: Function that calls Pinocchio for one state of all joints.
            reduce: Function that reduces the result to q, or None if the result has no joint axis.
            model: Model passed to the kernel.
            *state: Arguments of the quantity, (..., n) each.
        """
        if errors.__class__ is str and errors == "raise":
            shape, couplings = self._shape, self.couplings
            for x in state:
                if not is_plain(x, shape):
                    break
            else:
                if couplings.trivial:
                    return kernel(model, self.scratch.data, *state)
                return self._coupled(kernel, reduce, model, *state)
        return self._answered(quantity, errors, self._equation(kernel, reduce, model), state)

    def forward_dynamics(self, errors: str, q: Array, v: Array, tau: Array) -> ndarray:
        """M⁻¹ (τ − C v − N), by ABA, or by factorising M if joints are coupled; raises where M is singular."""
        if self.regularity.singular is not None:
            raise self.regularity.singular()
        model, names, trivial = self.model, self.joint_names, self.couplings.trivial
        if not trivial and all(is_plain(x, self._shape) for x in (q, v, tau)):
            inertia = self._coupled(pin.crba, Couplings.matrix, model, q)
            bias = self._coupled(pin.nonLinearEffects, Couplings.torque, model, q, v)
            a = acceleration(inertia, tau - bias, names)
            if is_moderate(a, DOUBTFUL):
                return a
        M = self._equation(pin.crba, Couplings.matrix, model)
        bias_of = self._equation(pin.nonLinearEffects, Couplings.torque, model)
        solved = self._equation(pin.aba, None, model)

        def equation(q: ndarray, v: ndarray, tau: ndarray) -> ndarray:
            a = solved(q, v, tau) if trivial else acceleration(M(q), tau - bias_of(q, v), names)
            if not np.all(np.abs(a) <= DOUBTFUL) and np.isfinite(here := M(q)).all():
                acceleration(here, tau, names)  # raises if M is singular at this q
            return a

        return self._answered("forward_dynamics", errors, equation, (q, v, tau))

    def _coupled(self, kernel: Kernel, reduce: Reduction | None, model: Any, q: ndarray, *rates: ndarray) -> Any:
        """Evaluate a kernel at one state of a mechanism with coupled joints."""
        couplings = self.couplings
        answer = kernel(model, self.scratch.data, couplings.position(q), *map(couplings.velocity, rates))
        return answer if reduce is None else reduce(couplings, answer)

    def _equation(self, kernel: Kernel, reduce: Reduction | None, model: Any) -> Callable[..., ndarray]:
        """Return the function (q, …) → result of a kernel, which evaluates a batch one state at a time."""
        couplings, data = self.couplings, self.scratch.data

        def equation(q: ndarray, *rates: ndarray) -> ndarray:
            full = [couplings.position(q), *(couplings.velocity(x) for x in rates)]
            batch = np.broadcast_shapes(*(x.shape[:-1] for x in full))
            rows = [np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in full]
            answers = np.array([kernel(model, data, *row) for row in zip(*rows, strict=True)])
            answers = answers.reshape(batch + answers.shape[1:])
            return answers if reduce is None else reduce(couplings, answers)

        return equation

    def _answered(self, quantity: str, errors: str, equation: Callable[..., ndarray], state: tuple[Array, ...]) -> Any:
        names, requested = self.joint_names, ALL[quantity]
        arrays = {name: shaped(name, x, names) for name, x in zip(requested.arguments, state, strict=True)}
        answer = answered(equation, arrays, requested.shape(self.sizes), names, errors)
        return answer if answer.ndim else float(answer)


def warning_answer(robot: Robot, answer: Callable[..., Any]) -> Callable[..., Any]:
    """`Evaluation.answer`, followed by `warn_of_digits`."""

    def warned(quantity: str, errors: str, kernel: Kernel, reduce: Reduction | None, model: Any, *state: Array) -> Any:
        result = answer(quantity, errors, kernel, reduce, model, *state)
        return warn_of_digits(robot, quantity, result, *state, stacklevel=4)

    return warned


def warn_of_digits(robot: Robot, quantity: str, answer: Any, *state: Array, stacklevel: int = 3) -> Any:
    """Return the result, with a warning if it has fewer correct digits than `Robot.warn_below` requests."""
    from robot_dyn.lagrange.digits import doubt  # late: it builds a Lagrangian

    if message := doubt(robot, quantity, state, answer, robot.least_digits):
        warnings.warn(message, PrecisionWarning, stacklevel=stacklevel)
    return answer
