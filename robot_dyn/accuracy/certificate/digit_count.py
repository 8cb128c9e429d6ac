"""Count of digits: errors of an implementation against finer numbers at many states, and against balls at the worst."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import final

import numpy as np

from robot_dyn.accuracy.certificate.certificate import Held
from robot_dyn.accuracy.certificate.implementation import Implementation, evaluate
from robot_dyn.accuracy.certificate.worst_case_search import Batch, row, worst_state
from robot_dyn.accuracy.correct_digits import digits_of
from robot_dyn.foundations.errors import QueryError
from robot_dyn.lagrange.exact import NOTHING, Exact, Scale, Truth, entry_units, in_joint_units
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.scale import diagonal_scale, floored, solved_norm
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import CORIOLIS_TORQUE, M, N
from robot_dyn.queries.quantity import Quantity

FEWER = 250  # random states for each one that balls judge, where no other numbers are fine enough; 8 at least
_SIDE_BY_SIDE = 8  # states that machine code answers side by side, in the search and in the judgement


@final
class DigitCount:
    """Counts the digits of the implementations of one robot.

    Args:
        robot: The robot.
        states: Random ones.
        given: A state to look at, or None.
        rng: Of the search.
    """

    def __init__(self, robot: Robot, states: Batch, given: dict[str, np.ndarray] | None, rng: np.random.Generator):
        self.robot, self.states, self.given, self._rng = robot, states, given, rng
        self.decimals: dict[str, float] = {}
        self.right_angles: dict[str, float] = {}
        self.bits = 0
        self._exact, self._rounded, self._own = cache(Exact), Exact(robot, rounded=True), Lagrangian(robot)
        self._fine = cache(lambda engine, quantity: evaluate(engine, quantity, states))
        self._typical = cache(partial(_typical, self._own, states))

    def count(
        self, implementation: Implementation, quantity: Quantity, check: Callable[[], object] = lambda: None
    ) -> Held:
        """Count the digits of one implementation; its time is not measured.

        Args:
            implementation: The implementation.
            quantity: Of which they are counted.
            check: Called before each batch of states; what it raises ends the count.

        Raises:
            QueryError: If the implementation has no finite answer.
        """

        def errors(states: Batch) -> np.ndarray:
            check()
            return self._errors(implementation, quantity, states)

        states, sizes = self.states, dict[str, int]()
        if implementation.fine is None:
            states = {name: x[: max(len(x) // FEWER, 8)] for name, x in states.items()}
            sizes = {"parents": 4, "children": 4, "generations": 3}
        known = errors(states)
        if np.isnan(known).all():
            raise QueryError(f"{quantity.name} by {implementation.name}: no random state has a finite answer")
        at = row(states, int(np.nanargmax(known)))
        worst, _ = worst_state(states, self._rng, errors, known, quantity.arguments, **sizes)
        check()
        judged = [(self.judged(implementation, quantity, state), state) for state in (at, row(worst, 0))]
        searched, state = max(judged, key=lambda each: each[0])
        given = None if self.given is None else digits_of(self.judged(implementation, quantity, self.given))
        typical = digits_of(float(np.nanmedian(known)))
        self._of_file(implementation, quantity, state)
        random, searched = digits_of(judged[0][0]), digits_of(searched)
        at = {name: state[name].tolist() for name in quantity.arguments}
        return Held(quantity.name, implementation.name, given, typical, random, searched, len(known), state=at)

    def truth(self, robot: Robot, quantity: Quantity, state: dict[str, np.ndarray]) -> Truth:
        """True values at a state."""
        truth = self._exact(robot).at(quantity, state, self._typical(quantity))
        self.bits = max(self.bits, truth.bits)
        return truth

    def judged(self, implementation: Implementation, quantity: Quantity, state: dict[str, np.ndarray]) -> float:
        """The error at a state, by balls."""
        several = {name: np.tile(x, (_SIDE_BY_SIDE, 1)) for name, x in state.items()}
        answer = evaluate(implementation.engine, quantity, several)[0]
        return self.truth(implementation.robot, quantity, state).error(answer)

    def _errors(self, implementation: Implementation, quantity: Quantity, states: Batch) -> np.ndarray:
        """Errors at states (S, n); NaN where there is no answer."""
        answers = evaluate(implementation.engine, quantity, states)
        if (engine := implementation.fine) is None:
            truths = (self.truth(implementation.robot, quantity, row(states, k)) for k in range(len(answers)))
            return np.array([truth.error(answer) for truth, answer in zip(truths, answers, strict=True)])
        fine = self._fine(engine, quantity) if states is self.states else evaluate(engine, quantity, states)
        relative = self._scale(quantity, states, fine).relative((answers - fine).astype(float))
        return relative.reshape(len(answers), -1).max(axis=1)

    def _scale(self, quantity: Quantity, states: Batch, fine: np.ndarray) -> Scale:
        """Of errors at states, from fine answers; that of `truth`, but for rounding."""
        inertia = evaluate(self._own, M, states)
        if not (quantity.definite or quantity.solves):
            return Scale(in_joint_units(quantity, fine.astype(float), inertia, self._typical(quantity)))
        if quantity.definite:
            return Scale(np.array([floored(each) for each in diagonal_scale(inertia)]))
        inertia[~np.all(np.isfinite(fine), axis=-1)] = np.eye(self.robot.n)  # where there is no answer
        torques = (states["tau"], evaluate(self._own, CORIOLIS_TORQUE, states), evaluate(self._own, N, states))
        return Scale(solved_norm(inertia, torques), inertia)

    def _of_file(self, implementation: Implementation, quantity: Quantity, state: dict[str, np.ndarray]) -> None:
        """What the float64 of the file's decimals leaves at a state, and what right angles do."""
        truth = self.truth(self.robot, quantity, state)
        both = [(self.decimals, self._rounded.at(quantity, state, self._typical(quantity)))]
        if implementation.robot is not self.robot:
            both.append((self.right_angles, self.truth(implementation.robot, quantity, state)))
        for table, other in both:
            table[quantity.name] = min(digits_of(truth.error(other.values)), table.get(quantity.name, np.inf))


def _typical(own: Lagrangian, states: Batch, quantity: Quantity) -> float:
    """The largest root mean square of an entry at random states, in the units of the joints; 1 if it is zero."""
    if quantity.definite or quantity.solves:
        return 0.0
    ratios = evaluate(own, quantity, states) / entry_units(quantity, evaluate(own, M, states))
    largest = float(np.nanmax(np.abs(ratios))) or 1.0  # by which they are divided: squares may overflow
    size = largest * float(np.sqrt(np.nanmean((ratios / largest) ** 2, axis=0)).max())
    return size if size > NOTHING else 1.0
