"""The cross-check: a robot computed by Pinocchio and by the library's Lagrangian, and its file read by a second reader.

    |x_Pinocchio − x_own| ≤ 1e-12 · (Σ of the absolute values of the terms added into x)

The scale of M_ij is √(M_ii M_jj). Forward dynamics must agree to max(1e-12, 8 n u κ) of its terms M⁻¹τ, M⁻¹C v, M⁻¹N in
the norm of M, or of the terms of τ, C v and N if these are larger, with κ the condition number of M scaled to a unit
diagonal. An entry without terms uses the largest scale in its row and column. The numbers that both implementations
take from the file are compared with those that yourdfpy reads there (`second_reading`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robot_dyn.cross_check.agreement import Agreement, Comparison, Pair, worst_by_quantity
from robot_dyn.cross_check.second_reading import second_reading
from robot_dyn.description.inertial_parameters import parameter_names
from robot_dyn.foundations.errors import SingularError
from robot_dyn.foundations.validate import function, instance, integer, number
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.magnitude import magnitudes
from robot_dyn.lagrange.recursions.articulated_body import articulated_body
from robot_dyn.lagrange.scale import acceleration_norm, diagonal_scale, mass_norm, solved_tolerance
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import FORWARD_DYNAMICS, INVERSE_DYNAMICS, QUANTITIES, Axes
from robot_dyn.queries.quantity import Quantity

TOLERANCE = 1e-12
_TWIST: dict[int | str, tuple[str, ...]] = {
    3: ("x", "y", "z"),
    4: ("x", "y", "z", "1"),
    6: ("x", "y", "z", "rx", "ry", "rz"),
}


def compare(
    robot: Robot,
    *,
    samples: int = 20,
    seed: int = 0,
    tolerance: float = TOLERANCE,
    on_sample: Callable[[], object] | None = None,
) -> Comparison:
    """Cross-check a robot at random states within its joint limits, and the numbers in its file against yourdfpy.

    Args:
        robot: Robot to check.
        samples: Number of states.
        seed: Seed of the random generator.
        tolerance: Allowed error relative to the scale of each quantity.
        on_sample: Function called after each state, for example to show progress.

    Raises:
        QueryError: If an argument has the wrong type, or `samples` or `tolerance` is not positive.
    """
    instance("robot", robot, Robot, "give a robot, for example rd.load('ur5')")
    samples, seed = integer("samples", samples, least=1, most=10**6), integer("seed", seed, most=2**128 - 1)
    function("on_sample", on_sample, "no argument")
    tolerance = number("tolerance", tolerance, above=0)
    own, rng = Lagrangian(robot), np.random.default_rng(seed)
    worst: tuple[Agreement, ...] = ()
    unsolved = 0
    for sample in range(samples):
        state = random_state(robot, rng)
        frames = robot.frame_names[sample % len(robot.frame_names) :: samples] or robot.frame_names[:1]
        pairs = list(_pairs(robot, own, state, frames, tolerance))
        if robot.joint_without_inertia is None:
            forward = _forward_pairs(robot, own, state, tolerance)
            unsolved += not forward
            pairs += forward
        worst = worst_by_quantity((*worst, *(pair.worst(state) for pair in pairs)))
        if on_sample is not None:
            on_sample()
    file_pairs, unread = second_reading(robot.description, tolerance)
    worst = worst_by_quantity((*worst, *(pair.worst({}) for pair in file_pairs)))
    return Comparison(robot.name, robot.n, samples, worst, (*unread, *_notes(robot, unsolved, samples)))


def random_state(robot: Robot, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return a general state: q from `random_configuration`; v, a and tau without zeros."""
    q = robot.random_configuration(rng)
    v, a, tau = rng.normal(size=(3, robot.n))
    return {"q": q, "v": v, "a": a, "tau": tau * (1 + np.abs(robot.N(q)))}


def _pairs(
    robot: Robot, own: Lagrangian, state: dict[str, np.ndarray], frames: tuple[str, ...], tolerance: float
) -> Iterator[Pair]:
    """Yield both values of every query except forward dynamics, and of two identities."""
    q, v, a = (state[name] for name in ("q", "v", "a"))
    size, absolute = magnitudes(own.linkage, q), {name: np.abs(x) for name, x in state.items()}
    names = _TWIST | {"n": robot.joint_names, "p": parameter_names(robot.body_names)}
    values: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for quantity in QUANTITIES.values():
        if quantity.solves:
            continue
        for frame, options in _frames(quantity, frames):
            one, two = (quantity.evaluate(engine, state, *frame, **options) for engine in (robot, own))
            scale = diagonal_scale(two) if quantity.definite else quantity.terms(size, absolute, *frame)
            values[quantity.name], where = (one, two), "".join((*frame, *(f" ({axes})" for axes in options.values())))
            labels = names | {3: ("by q", "by v", "by a")} if quantity.axes == (3, "n", "n") else names
            yield Pair(quantity.name, one, two, scale, tolerance, tuple(labels[x] for x in quantity.axes), where)
    (M, C, N), pin_C, ID = (values[name][1] for name in "MCN"), values["C"][0], values[INVERSE_DYNAMICS.name][0]
    rate, both = own.mass_matrix_derivative(q) @ v, size.C(v) + size.C(v).T
    yield Pair("Ṁ = C + Cᵀ", pin_C + pin_C.T, rate, both, tolerance, (robot.joint_names,) * 2)
    terms = INVERSE_DYNAMICS.terms(size, absolute)
    yield Pair("M a + C v + N = ID", ID, M @ a + C @ v + N, terms, tolerance, (robot.joint_names,))


def _frames(quantity: Quantity, frames: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], dict[str, str]]]:
    """Yield the frames and options with which a query is compared."""
    for frame in ((name,) for name in frames) if quantity.framed else ((),):
        for axes in Axes if quantity.directed else ("",):
            yield frame, {"expressed_in": axes} if axes else {}


def _forward_pairs(robot: Robot, own: Lagrangian, state: dict[str, np.ndarray], tolerance: float) -> list[Pair]:
    """Return forward dynamics by up to three algorithms, and its inverse; nothing if M is not positive definite."""
    q, v, tau = (state[name] for name in ("q", "v", "tau"))
    size, pairs = magnitudes(own.linkage, q), []
    try:
        implementations = {"forward_dynamics": own.forward_dynamics(q, v, tau)}
        if robot.couplings.trivial:
            implementations["forward_dynamics (articulated body)"] = articulated_body(own.linkage, q, v, tau)
    except SingularError:
        return []
    M = own.M(q)
    tolerance = solved_tolerance(tolerance, M)
    a, C, N = robot.forward_dynamics(q, v, tau), own.C(q, v), own.N(q)
    torque_terms = FORWARD_DYNAMICS.terms(size, {"v": np.abs(v), "tau": np.abs(tau)})
    terms = acceleration_norm(M, (tau, C @ v, N), torque_terms)
    for quantity, b in implementations.items():
        weight = np.abs(a - b) * np.sqrt(np.diagonal(M))
        joint = int(np.argmax(weight))  # to name a joint; the error is the norm of the whole vector
        error = mass_norm(M, a - b)
        scale = terms * np.abs(a - b)[joint] / error if error else 1.0
        where = ((robot.joint_names[joint],),)
        pairs.append(Pair(quantity, a[joint : joint + 1], b[joint : joint + 1], scale, tolerance, where))
    there_and_back = robot.inverse_dynamics(q, v, a)
    scale = size.inverse_dynamics(v, a) + np.abs(tau)
    return [*pairs, Pair("ID(FD(τ)) = τ", there_and_back, tau, scale, tolerance, (robot.joint_names,))]


def _notes(robot: Robot, unsolved: int, samples: int) -> tuple[str, ...]:
    notes = []
    if unsolved:
        notes.append(
            f"forward dynamics not compared at {unsolved} of {samples} states, where M is not positive definite"
        )
    if robot.joint_without_inertia is not None:
        notes.append(f"no forward dynamics: joint {robot.joint_without_inertia!r} carries no inertia")
    return (*notes, *robot.announced_findings)
