"""Count of digits: errors of implementations against finer arithmetic at many states, against balls at the worst."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from types import SimpleNamespace
from typing import final

import numpy as np

from robot_dyn.accuracy.certificate.worst_case_search import Batch, row, worst_state
from robot_dyn.accuracy.correct_digits import QUANTITIES, digits_of
from robot_dyn.codegen.dynamics import CompiledDynamics
from robot_dyn.foundations.arithmetic import FLOAT64, Array
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.lagrange.exact import NEGLIGIBLE, Exact, Scale, Truth, entry_units, in_joint_units
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.recursions.articulated_body import articulated_body
from robot_dyn.lagrange.scale import diagonal_scale, floored, solved_norm
from robot_dyn.model.robot import Robot
from robot_dyn.queries.batch import answered
from robot_dyn.queries.dynamics import CORIOLIS_TORQUE, FORWARD_DYNAMICS, M, N
from robot_dyn.queries.quantity import Quantity
from robot_dyn.report.timing import Repeated

FEWER = 250  # random states for each state judged by balls, if no other arithmetic is fine enough; at least 8 states
_SIDE_BY_SIDE = 8  # states that machine code evaluates together, in the search and in the count
LONGDOUBLE = "Lagrangian, longdouble"
Engine = Robot | Lagrangian | CompiledDynamics | SimpleNamespace  # with a method for each quantity it answers


@final
@dataclass(frozen=True, eq=False)
class Implementation:
    """One implementation of the equations.

    Attributes:
        name: Name of the program or formulation, and of its arithmetic.
        robot: Robot whose equations it evaluates.
        engine: Object with a method for each quantity, of the same name.
        quantities: The quantities that it answers.
    """

    name: str
    robot: Robot
    engine: Engine
    quantities: tuple[Quantity, ...]

    @cached_property
    def fine(self) -> Lagrangian | None:
        """The same equations in longdouble, if it is much finer; None if only balls are finer."""
        longdouble = np.finfo(np.longdouble).eps < np.finfo(np.float64).eps / 100
        return Lagrangian(self.robot, np.longdouble) if longdouble and self.name != LONGDOUBLE else None


def evaluate(engine: Engine, quantity: Quantity, states: dict[str, np.ndarray]) -> np.ndarray:
    """Return results at states (S, n), 512 states at a time; nan for states without a result."""
    rows = [states[name] for name in quantity.arguments]
    parts = [slice(k, k + 512) for k in range(0, len(rows[0]), 512)]
    answer = getattr(engine.nan_rows, quantity.name)
    return np.concatenate([answer(*(x[part] for x in rows)) for part in parts])


def implementations(robot: Robot) -> tuple[list[Implementation], list[str]]:
    """Return the implementations for a robot, and notes on omitted ones, with reasons."""
    left_out, quantities = list[str](), tuple(QUANTITIES.values())
    if robot.joint_without_inertia is not None:
        left_out.append(f"forward dynamics: joint {robot.joint_without_inertia!r} carries no inertia")
        quantities = tuple(quantity for quantity in quantities if not quantity.solves)
    options = [Implementation("Pinocchio", robot, robot, quantities)]
    for name in ("float32", "float64", "longdouble"):
        engine = Lagrangian(robot, getattr(np, name))
        options.append(Implementation(f"Lagrangian, {name}", robot, engine, quantities))
    if not robot.couplings.trivial:
        left_out.append("articulated bodies: coupled joints are not supported")
    elif FORWARD_DYNAMICS in quantities:
        options.append(Implementation("articulated body", robot, _articulated_body(robot), (FORWARD_DYNAMICS,)))
    try:
        compiled = CompiledDynamics(robot)
        for quantity in quantities:
            quantity.evaluate(compiled, {name: np.full(robot.n, 0.3) for name in ("q", "v", "a", "tau")})
        served = tuple(quantity for quantity in quantities if compiled.served_by(quantity.name) != "Pinocchio")
        options.append(Implementation("machine code", compiled.robot, compiled, served))
    except (ImportError, RobotDynError) as error:
        left_out.append(f"machine code: {error}")
    return options, left_out


def _articulated_body(robot: Robot) -> SimpleNamespace:
    """Return an object that computes `forward_dynamics` by articulated bodies, with the signature of `Dynamics`."""
    lagrangian = Lagrangian(robot)
    equation = partial(articulated_body, lagrangian.linkage)

    def forward_dynamics(q: Array, v: Array, tau: Array, *, nan: bool = False) -> Array:
        arguments, n, names = {"q": q, "v": v, "tau": tau}, lagrangian.n, lagrangian.joint_names
        return answered(equation, arguments, (n,), names, nan, FLOAT64)

    with_nan = SimpleNamespace(forward_dynamics=partial(forward_dynamics, nan=True))
    return SimpleNamespace(forward_dynamics=forward_dynamics, nan_rows=with_nan)


@final
@dataclass(frozen=True)
class CountedDigits(Repeated):
    """Correct digits of one quantity by one implementation, from 0 to 20, and times of one query from Python.

    Attributes:
        quantity: Name of the quantity.
        implementation: Name of the implementation, with its arithmetic.
        at_state: Digits at the additional state of the user; None without one.
        typical: Median over the random states.
        random: Digits at the worst random state.
        searched: Digits at the worst state found.
        samples: Number of random states; 1 for balls, whose digits are proven.
        state: The worst state, with q, v, a, tau by name.
    """

    quantity: str
    implementation: str
    at_state: float | None
    typical: float
    random: float
    searched: float
    samples: int
    state: dict[str, list[float]] = field(default_factory=dict, hash=False, repr=False)


@final
class DigitCount:
    """A count of the digits of the implementations of one robot.

    Args:
        robot: The robot.
        states: The random states.
        state: An additional state, or None.
        rng: Random generator of the search.

    Attributes:
        decimals: By quantity, fewest digits left after rounding the decimals of the file to float64.
        right_angles: By quantity, fewest digits left after completing the rounded right angles of the file.
        bits: Highest precision of the balls so far.
    """

    def __init__(self, robot: Robot, states: Batch, state: dict[str, np.ndarray] | None, rng: np.random.Generator):
        self.robot, self.states, self.state, self._rng = robot, states, state, rng
        self.decimals: dict[str, float] = {}
        self.right_angles: dict[str, float] = {}
        self.bits = 0
        self._exact, self._rounded, self._lagrangian = cache(Exact), Exact(robot, rounded=True), Lagrangian(robot)
        self._fine = cache(lambda engine, quantity: evaluate(engine, quantity, states))
        self._typical = cache(partial(_typical, self._lagrangian, states))

    def count(
        self, implementation: Implementation, quantity: Quantity, check: Callable[[], object] = lambda: None
    ) -> CountedDigits:
        """Count the digits of one implementation without timing it.

        Args:
            implementation: The implementation.
            quantity: The quantity.
            check: Called before each batch of states; an exception that it raises ends the count.

        Raises:
            QueryError: If the implementation has no finite result.
        """

        def errors(states: Batch) -> np.ndarray:
            check()
            return self._errors(implementation, quantity, states)

        states, sizes = self.states, dict[str, int]()
        if implementation.fine is None:
            states = {name: x[: max(len(x) // FEWER, 8)] for name, x in states.items()}
            sizes = {"parents": 4, "children": 4, "generations": 3}
        sampled = errors(states)
        if np.isnan(sampled).all():
            raise QueryError(f"{quantity.name} by {implementation.name}: no finite result at any random state")
        worst_random = row(states, int(np.nanargmax(sampled)))
        worst, _ = worst_state(states, self._rng, errors, sampled, quantity.arguments, **sizes)
        check()
        worst_errors = [
            (self.error_at(implementation, quantity, state), state) for state in (worst_random, row(worst, 0))
        ]
        largest, state = max(worst_errors, key=lambda pair: pair[0])
        at_state = None if self.state is None else digits_of(self.error_at(implementation, quantity, self.state))
        self._count_file(implementation, quantity, state)
        return CountedDigits(
            quantity=quantity.name,
            implementation=implementation.name,
            at_state=at_state,
            typical=digits_of(float(np.nanmedian(sampled))),
            random=digits_of(worst_errors[0][0]),
            searched=digits_of(largest),
            samples=len(sampled),
            state={name: state[name].tolist() for name in quantity.arguments},
        )

    def truth(self, robot: Robot, quantity: Quantity, state: dict[str, np.ndarray]) -> Truth:
        """Return the true values at a state."""
        truth = self._exact(robot).at(quantity, state, self._typical(quantity))
        self.bits = max(self.bits, truth.bits)
        return truth

    def error_at(self, implementation: Implementation, quantity: Quantity, state: dict[str, np.ndarray]) -> float:
        """Return the error at a state, against balls."""
        copies = {name: np.tile(x, (_SIDE_BY_SIDE, 1)) for name, x in state.items()}
        answer = evaluate(implementation.engine, quantity, copies)[0]
        return self.truth(implementation.robot, quantity, state).error(answer)

    def _errors(self, implementation: Implementation, quantity: Quantity, states: Batch) -> np.ndarray:
        """Return the errors at states (S, n); nan for states without a result."""
        answers = evaluate(implementation.engine, quantity, states)
        if (engine := implementation.fine) is None:
            truths = (self.truth(implementation.robot, quantity, row(states, k)) for k in range(len(answers)))
            return np.array([truth.error(answer) for truth, answer in zip(truths, answers, strict=True)])
        fine = self._fine(engine, quantity) if states is self.states else evaluate(engine, quantity, states)
        relative = self._scale(quantity, states, fine).relative((answers - fine).astype(float))
        return relative.reshape(len(answers), -1).max(axis=1)

    def _scale(self, quantity: Quantity, states: Batch, fine: np.ndarray) -> Scale:
        """Return the scale of errors at states from fine answers; equal to that of `truth` up to rounding."""
        inertia = evaluate(self._lagrangian, M, states)
        if not (quantity.definite or quantity.solves):
            return Scale(in_joint_units(quantity, fine.astype(float), inertia, self._typical(quantity)))
        if quantity.definite:
            return Scale(np.array([floored(row) for row in diagonal_scale(inertia)]))
        inertia[~np.all(np.isfinite(fine), axis=-1)] = np.eye(self.robot.n)  # where there is no answer
        torques = (
            states["tau"],
            evaluate(self._lagrangian, CORIOLIS_TORQUE, states),
            evaluate(self._lagrangian, N, states),
        )
        return Scale(solved_norm(inertia, torques), inertia)

    def _count_file(self, implementation: Implementation, quantity: Quantity, state: dict[str, np.ndarray]) -> None:
        """Count the digits left by rounding the file's decimals to float64, and by exact right angles."""
        truth = self.truth(self.robot, quantity, state)
        both = [(self.decimals, self._rounded.at(quantity, state, self._typical(quantity)))]
        if implementation.robot is not self.robot:
            both.append((self.right_angles, self.truth(implementation.robot, quantity, state)))
        for table, other in both:
            table[quantity.name] = min(digits_of(truth.error(other.values)), table.get(quantity.name, np.inf))


def _typical(lagrangian: Lagrangian, states: Batch, quantity: Quantity) -> float:
    """Return the largest root mean square of an entry at random states, in units of the joints; 1 if it is zero."""
    if quantity.definite or quantity.solves:
        return 0.0
    ratios = evaluate(lagrangian, quantity, states) / entry_units(quantity, evaluate(lagrangian, M, states))
    largest = float(np.nanmax(np.abs(ratios))) or 1.0  # divisor: squares may overflow
    size = largest * float(np.sqrt(np.nanmean((ratios / largest) ** 2, axis=0)).max())
    return size if size > NEGLIGIBLE else 1.0
