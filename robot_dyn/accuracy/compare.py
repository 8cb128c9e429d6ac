"""The cross-check: the same robot by Pinocchio and by the library's own Lagrangian, quantity by quantity.

    |x_Pinocchio − x_own| ≤ 1e-12 · (Σ of the absolute values of the terms added into x)

M_ij is held to √(M_ii M_jj), and forward dynamics to max(1e-12, 8 n u κ) of its terms M⁻¹τ, M⁻¹C v, M⁻¹N in the norm of
M, or of the terms of τ, C v and N if these are more, with κ the condition number of M scaled to a unit diagonal. An
entry that has no terms is held to the largest scale in its row and column.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from robot_dyn.errors import SingularError
from robot_dyn.lagrange.articulated_body import articulated_body
from robot_dyn.lagrange.magnitude import Magnitudes, floored, magnitudes, mass_norm, scaled
from robot_dyn.lagrange.manipulator import Lagrangian
from robot_dyn.model.dynamics import Axes
from robot_dyn.model.robot import Robot
from robot_dyn.validate import function, instance, integer, number

TOLERANCE = 1e-12
_U = np.finfo(float).eps / 2


@final
@dataclass(frozen=True)
class Agreement:
    """How well Pinocchio and the own Lagrangian agree on one quantity, at the worst of all states and entries.

    Attributes:
        quantity: Its name in the `Dynamics` protocol, or the identity that was checked.
        error: Difference on its scale.
        tolerance: What is allowed.
        entry: Joints or frame of the entry.
        pinocchio, own: The two values.
        state: q, v, a, tau, by name.
    """

    quantity: str
    error: float
    tolerance: float
    entry: str
    pinocchio: float
    own: float
    state: dict[str, list[float]] = field(hash=False)

    @property
    def ok(self) -> bool:
        """Whether the error is within the tolerance."""
        return bool(self.error <= self.tolerance)


@final
@dataclass(frozen=True)
class Comparison:
    """The outcome of `compare`.

    Attributes:
        robot: Its name.
        samples: Number of random states.
        agreements: One for each quantity.
        notes: What could not be compared, and why.
    """

    robot: str
    samples: int
    agreements: tuple[Agreement, ...]
    notes: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether both agree on every quantity."""
        return all(agreement.ok for agreement in self.agreements)

    @property
    def worst(self) -> Agreement:
        """The quantity nearest to its tolerance, or farthest beyond it."""
        return max(self.agreements, key=lambda agreement: agreement.error / agreement.tolerance)


@dataclass(frozen=True)
class _Pair:
    """One quantity by both roads at one state; `scale` of the shape of the values."""

    quantity: str
    pinocchio: Any
    own: Any
    scale: Any
    tolerance: float
    axes: tuple[tuple[str, ...], ...] = ()
    frame: str = ""

    def worst(self, state: dict[str, np.ndarray]) -> Agreement:
        errors = scaled(np.asarray(self.pinocchio) - self.own, floored(np.asarray(self.scale)))
        errors = np.where(np.isnan(errors), np.inf, errors)
        index = np.unravel_index(np.argmax(errors), errors.shape)
        names = [axis[i] for axis, i in zip(self.axes, index, strict=False)]
        return Agreement(
            self.quantity,
            float(errors[index]),
            self.tolerance,
            ", ".join([self.frame] * bool(self.frame) + names),
            float(np.broadcast_to(self.pinocchio, errors.shape)[index]),
            float(np.broadcast_to(self.own, errors.shape)[index]),
            {name: x.tolist() for name, x in state.items()},
        )


def compare(
    robot: Robot,
    *,
    samples: int = 20,
    seed: int = 0,
    tolerance: float = TOLERANCE,
    on_sample: Callable[[], object] | None = None,
) -> Comparison:
    """Cross-check a robot at random states within its joint limits.

    Args:
        robot: The robot; its joints are matched by name.
        samples: Number of states.
        seed: Seed of the random generator.
        tolerance: Allowed error on each quantity's scale.
        on_sample: Called after each state.

    Raises:
        QueryError: If samples is not positive.
    """
    instance("robot", robot, Robot, "give one of rd.load")
    samples, seed = integer("samples", samples, least=1, most=10**6), integer("seed", seed, most=2**128 - 1)
    function("on_sample", on_sample, "no argument")
    tolerance = number("tolerance", tolerance, above=0)
    own, rng = Lagrangian(robot), np.random.default_rng(seed)
    worst: dict[str, Agreement] = {}
    unsolved = 0
    for sample in range(samples):
        state = random_state(robot, rng)
        frames = robot.frame_names[sample % len(robot.frame_names) :: samples] or robot.frame_names[:1]
        pairs = list(_pairs(robot, own, state, frames, tolerance))
        if robot.joint_without_inertia is None:
            forward = _forward_pairs(robot, own, state, tolerance)
            unsolved += not forward
            pairs += forward
        for pair in pairs:
            found = pair.worst(state)
            known = worst.get(pair.quantity)
            if known is None or found.error / found.tolerance > known.error / known.tolerance:
                worst[pair.quantity] = found
        if on_sample is not None:
            on_sample()
    return Comparison(robot.name, samples, tuple(worst.values()), _notes(robot, unsolved, samples))


def random_state(robot: Robot, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """A general state: q of `random_configuration`; v, a and tau without zeros."""
    q = robot.random_configuration(rng)
    v, a, tau = rng.normal(size=(3, robot.n))
    return {"q": q, "v": v, "a": a, "tau": tau * (1 + np.abs(robot.N(q)))}


def _pairs(
    robot: Robot, own: Lagrangian, state: dict[str, np.ndarray], frames: tuple[str, ...], tolerance: float
) -> Iterator[_Pair]:
    q, v, a = (state[name] for name in ("q", "v", "a"))
    one, two = (robot.joint_names,), (robot.joint_names,) * 2
    size = magnitudes(own.linkage, q)
    M, C, N, dM = own.M(q), own.C(q, v), own.N(q), own.mass_matrix_derivative(q)
    diagonal = np.sqrt(np.abs(np.diagonal(M)))
    Cv, Mv = size.C(v) @ np.abs(v), size.M @ np.abs(v)
    pin_C = robot.C(q, v)
    ID = robot.inverse_dynamics(q, v, a)

    yield _Pair("M", robot.M(q), M, np.outer(diagonal, diagonal), tolerance, two)
    yield _Pair("C", pin_C, C, size.C(v), tolerance, two)
    yield _Pair("N", robot.N(q), N, size.N, tolerance, one)
    yield _Pair("coriolis_torque", robot.coriolis_torque(q, v), C @ v, Cv, tolerance, one)
    transposed = size.C(v).T @ np.abs(v)
    yield _Pair("coriolis_transpose", robot.coriolis_transpose(q, v), C.T @ v, transposed, tolerance, one)
    yield _Pair("inverse_dynamics", ID, own.inverse_dynamics(q, v, a), size.inverse_dynamics(v, a), tolerance, one)
    yield _Pair("kinetic_energy", robot.kinetic_energy(q, v), own.kinetic_energy(q, v), np.abs(v) @ Mv / 2, tolerance)
    yield _Pair("potential_energy", robot.potential_energy(q), own.potential_energy(q), size.V, tolerance)
    yield _Pair("momentum", robot.momentum(q, v), own.momentum(q, v), Mv, tolerance, one)
    yield _Pair("Ṁ = C + Cᵀ", pin_C + pin_C.T, dM @ v, size.C(v) + size.C(v).T, tolerance, two)
    yield _Pair("M a + C v + N = ID", ID, M @ a + C @ v + N, size.inverse_dynamics(v, a), tolerance, one)
    for frame in frames:
        yield from _frame_pairs(robot, own, q, v, frame, size, tolerance)


def _frame_pairs(
    robot: Robot, own: Lagrangian, q: np.ndarray, v: np.ndarray, frame: str, size: Magnitudes, tolerance: float
) -> Iterator[_Pair]:
    """Placement and Jacobians of one link. A lever is a difference of positions, so its scale is their size."""
    g, reach = robot.placement(q, frame), size.reach[frame]
    arm = size.lever[frame] + reach
    turn, swing = np.abs(v).sum(), arm @ np.abs(v)
    rows = ("x", "y", "z", "rx", "ry", "rz")
    unit = np.ones((3, 3))
    yield _Pair("placement", g[:3, :3], own.placement(q, frame)[:3, :3], unit, tolerance, (rows[3:], rows[:3]), frame)
    position = own.placement(q, frame)[:3, 3]
    yield _Pair("placement", g[:3, 3], position, np.full(3, reach), tolerance, (rows[:3],), frame)
    for axes in Axes:
        J = np.vstack([np.tile(arm, (3, 1)), np.ones((3, robot.n))])
        rate = np.vstack([np.tile(arm * turn + swing, (3, 1)), np.full((3, robot.n), turn)])
        names, where = (rows, robot.joint_names), f"{frame} ({axes})"
        one, two = (each.jacobian(q, frame, expressed_in=axes) for each in (robot, own))
        yield _Pair("jacobian", one, two, J, tolerance, names, where)
        one, two = (each.jacobian_rate(q, v, frame, expressed_in=axes) for each in (robot, own))
        yield _Pair("jacobian_rate", one, two, rate, tolerance, names, where)


def _forward_pairs(robot: Robot, own: Lagrangian, state: dict[str, np.ndarray], tolerance: float) -> list[_Pair]:
    """Forward dynamics by three algorithms, and there and back; nothing where M is not positive definite."""
    q, v, tau = (state[name] for name in ("q", "v", "tau"))
    size, pairs = magnitudes(own.linkage, q), []
    try:
        roads = {"forward_dynamics": own.forward_dynamics(q, v, tau)}
        if robot.ties.trivial:
            roads["forward_dynamics (articulated body)"] = articulated_body(own.linkage, q, v, tau)
    except SingularError:
        return []
    M = own.M(q)
    tolerance = max(tolerance, 8 * robot.n * _U * unit_diagonal_condition(M))
    a, C, N = robot.forward_dynamics(q, v, tau), own.C(q, v), own.N(q)
    terms = sum(mass_norm(M, np.linalg.solve(M, term)) for term in (tau, C @ v, N))
    # of the sums C v and N only their terms keep the digits
    rounded = (size.inverse_dynamics(v, np.zeros(robot.n)) + np.abs(tau)) / np.sqrt(np.diagonal(M))
    terms = max(terms, float(np.linalg.norm(rounded)))
    for quantity, b in roads.items():
        weight = np.abs(a - b) * np.sqrt(np.diagonal(M))
        joint = int(np.argmax(weight))  # names the joint; the error is that of the whole vector, in the norm of M
        error = mass_norm(M, a - b)
        scale = terms * np.abs(a - b)[joint] / error if error else 1.0
        where = ((robot.joint_names[joint],),)
        pairs.append(_Pair(quantity, a[joint : joint + 1], b[joint : joint + 1], scale, tolerance, where))
    there_and_back = robot.inverse_dynamics(q, v, a)
    scale = size.inverse_dynamics(v, a) + np.abs(tau)
    return [*pairs, _Pair("ID(FD(τ)) = τ", there_and_back, tau, scale, tolerance, (robot.joint_names,))]


def unit_diagonal_condition(M: np.ndarray) -> float:
    """κ(D M D), D scaling the diagonal of M to 1."""
    scale = 1 / np.sqrt(np.diagonal(M))
    return float(np.linalg.cond(M * np.outer(scale, scale)))


def _notes(robot: Robot, unsolved: int, samples: int) -> tuple[str, ...]:
    notes = []
    if unsolved:
        notes.append(
            f"forward dynamics not compared at {unsolved} of {samples} states: M is not positive definite there"
        )
    if robot.joint_without_inertia is not None:
        notes.append(f"no forward dynamics: joint {robot.joint_without_inertia!r} carries no inertia")
    return (*notes, *robot.findings)
