"""Evaluation of Pinocchio's calls: coupled joints by virtual work, lists and batches row by row.

    x = reduced(call(S q + s₀, S v, …))  for each state

Any input other than a single state of moderate float64 values is checked, converted and evaluated by `queries.batch`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.foundations.validate import is_moderate, shaped
from robot_dyn.foundations.values import OnFirstUse
from robot_dyn.model.calls import PINOCCHIO, Call, Scratch
from robot_dyn.model.conditioning import Regularity, regularity
from robot_dyn.model.pinocchio_model import Built
from robot_dyn.queries.batch import answered
from robot_dyn.queries.dynamics import QUANTITIES, acceleration
from robot_dyn.queries.quantity import DOUBTFUL


@final
@dataclass(frozen=True, eq=False)
class Evaluation:
    """Evaluates Pinocchio's calls for one robot.

    Attributes:
        built: Model of the robot.
        scratch: Working memory of Pinocchio's algorithms.
    """

    built: Built
    scratch: Scratch

    @cached_property
    def regularity(self) -> Regularity:
        """Regularity of M, checked at a configuration without symmetries."""
        names = self.built.joint_names
        return regularity(self._batched("M")(np.linspace(0.3, 0.9, len(names))), names)

    @cached_property
    def one_state(self) -> OnFirstUse[str | tuple[str, ...], Call]:
        """Queries at one state as functions (data, q, …), by name or (name, frame, axes), with coupled joints."""
        return OnFirstUse(self._one_state)

    def _one_state(self, query: str | tuple[str, ...]) -> Call:
        """Return the function of one query at one state."""
        name, *frame = (query,) if isinstance(query, str) else query
        couplings, quantity = self.built.couplings, QUANTITIES[name]
        if quantity.solves:
            return self._solved
        call = self._calls[name, *frame]
        if couplings.trivial:
            return call

        def coupled(data: pin.Data, q: ndarray, *rates: ndarray) -> Any:
            full = call(data, couplings.position(q), *map(couplings.velocity, rates))
            return couplings.reduced(full, quantity.axes)

        return coupled

    @cached_property
    def _calls(self) -> OnFirstUse[tuple[str, ...], Call]:
        """Pinocchio's calls by (name, frame, axes)."""
        return OnFirstUse(lambda query: PINOCCHIO[query[0]](self.built, *query[1:]))

    def answer(self, name: str, state: tuple[Any, ...], nan: bool, *frame: str) -> Any:
        """Return the result of a query at one state or a batch; with `nan`, NaN for states without a result."""
        if QUANTITIES[name].solves:
            return self._forward_dynamics(state, nan)
        return self._answered(name, state, nan, self._batched(name, *frame))

    def _solved(self, data: pin.Data, q: ndarray, v: ndarray, tau: ndarray) -> ndarray:
        """Return forward dynamics at one state; by a shorter path if joints are coupled and M is regular."""
        built, couplings = self.built, self.built.couplings
        if self.regularity.singular is None and not couplings.trivial:
            M = self.one_state["M"](data, q)
            bias = pin.nonLinearEffects(built.model, data, couplings.position(q), couplings.velocity(v))
            a = acceleration(M, tau - couplings.torque(bias), built.joint_names)
            if is_moderate(a, DOUBTFUL):
                return a
        return self._forward_dynamics((q, v, tau), nan=False)

    def _forward_dynamics(self, state: tuple[Any, ...], nan: bool) -> ndarray:
        """Return M⁻¹ (τ − C v − N), by ABA or, for coupled joints, a Cholesky factor of M; raise if M is singular."""
        if self.regularity.singular is not None:
            raise self.regularity.singular()
        names, trivial = self.built.joint_names, self.built.couplings.trivial
        M, inverse, solved = (self._batched(name) for name in ("M", "inverse_dynamics", "forward_dynamics"))

        def equation(q: ndarray, v: ndarray, tau: ndarray) -> ndarray:
            a = solved(q, v, tau) if trivial else acceleration(M(q), tau - inverse(q, v, 0 * v), names)
            if not np.all(np.abs(a) <= DOUBTFUL) and np.isfinite(here := M(q)).all():
                acceleration(here, tau, names)  # raises if M is singular at this q
            return a

        return self._answered("forward_dynamics", state, nan, equation)

    def _batched(self, name: str, *frame: str) -> Callable[..., ndarray]:
        """Return a query as a function (q, …) of arrays (..., n), which evaluates one state after another."""
        try:
            call = self._calls[name, *frame]
        except TypeError:  # an unhashable frame: the call raises the proper error
            call = PINOCCHIO[name](self.built, *frame)
        couplings, data = self.built.couplings, self.scratch.data
        axes = QUANTITIES[name].axes

        def equation(q: ndarray, *rates: ndarray) -> ndarray:
            full = [couplings.position(q), *(couplings.velocity(x) for x in rates)]
            batch = np.broadcast_shapes(*(x.shape[:-1] for x in full))
            rows = [np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in full]
            answers = np.array([call(data, *row) for row in zip(*rows, strict=True)])
            return couplings.reduced(answers.reshape(batch + answers.shape[1:]), axes)

        return equation

    def _answered(self, name: str, state: tuple[Any, ...], nan: bool, equation: Callable[..., ndarray]) -> Any:
        names, quantity = self.built.joint_names, QUANTITIES[name]
        arrays = {key: shaped(key, x, names) for key, x in zip(quantity.arguments, state, strict=True)}
        answer = answered(equation, arrays, quantity.shape(self.built.sizes), names, nan)
        return answer if answer.ndim else float(answer)
