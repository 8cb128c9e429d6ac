"""The Rosenbrock method: its order conditions, L-stability, and the same step from NumPy and from machine code."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import combinations_with_replacement, groupby, product
from math import prod
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import FLOAT64
from robot_dyn.integrate import IntegrationError, System, method
from robot_dyn.integrate.primitives import factor, solve
from robot_dyn.simulation import StateEquation, machine_code, segment_table

HAS_LONGDOUBLE = np.finfo(np.longdouble).nmant > 52
RODAS5P_FIXED = method("Rodas5PFixed")
NUMBERS = RODAS5P_FIXED.table.numbers(FLOAT64, 1)
STAGES = len(NUMBERS.m)
# u = Γ k leads from the coefficients of the u_i back to those of the k_i [HW II, (7.23) to (7.25)]
GAMMA = np.linalg.inv(np.eye(STAGES) / NUMBERS.gamma - NUMBERS.c)
ALPHA, WEIGHTS = NUMBERS.a @ GAMMA, NUMBERS.m @ GAMMA
BETA = ALPHA + GAMMA
ARM = rd.load("planar_2r")
START: dict[str, Any] = {"q0": [0.4, -0.7], "v0": [0.3, 0.5]}
OPTIONS = START | {"duration_s": 0.5, "record_every_s": 0.1, "estimate_error": False, "method": "Rodas5PFixed"}

Tree = tuple[Any, ...]  # a rooted tree: the trees that hang on its root


def parts(n: int, most: int) -> Iterator[tuple[int, ...]]:
    """The ways to write n as a sum, descending."""
    if n == 0:
        yield ()
    for k in range(min(n, most), 0, -1):
        for rest in parts(n - k, k):
            yield (k, *rest)


@cache
def trees(n: int) -> tuple[Tree, ...]:
    """The rooted trees of n vertices."""
    made = []
    for split in parts(n - 1, n - 1):
        groups = [combinations_with_replacement(trees(k), len(list(same))) for k, same in groupby(split)]
        made += [tuple(tree for group in chosen for tree in group) for chosen in product(*groups)]
    return tuple(made)


def size(tree: Tree) -> int:
    return 1 + sum(map(size, tree))


def density(tree: Tree) -> int:
    """γ of a tree."""
    return size(tree) * prod(map(density, tree))


def weights(tree: Tree) -> np.ndarray:
    """Φ_i of a tree: β before a single branch, which is J, and α before several, which are derivatives of f."""
    if not tree:
        return np.ones(STAGES)
    if len(tree) == 1:
        return BETA @ weights(tree[0])
    return np.prod([ALPHA @ weights(each) for each in tree], axis=0)


def stability(z: Any) -> Any:
    """R(z) = 1 + z bᵀ (1 − z B)⁻¹ 1."""
    return 1 + z * (WEIGHTS @ np.linalg.solve(np.eye(STAGES) - z * BETA, np.ones(STAGES)))


@pytest.mark.parametrize(("order", "m"), [(5, NUMBERS.m), (4, NUMBERS.m - np.eye(STAGES)[-1])])
def test_the_conditions_of_its_order_hold_and_those_of_the_next_do_not(order: int, m: np.ndarray) -> None:
    """Σ b_i Φ_i = 1/γ for all 17 trees, to the rounding of coefficients of size 165, by theorem IV.7.3 of HW II.

    Without its last stage it is of order 4 and no more, so that the difference tells the error.
    """
    known = [tree for n in range(1, order + 1) for tree in trees(n)]
    assert len(known) == {5: 17, 4: 8}[order]
    for tree in known:
        assert m @ GAMMA @ weights(tree) == pytest.approx(1 / density(tree), abs=1e-13), tree
    assert max(abs(m @ GAMMA @ weights(tree) - 1 / density(tree)) for tree in trees(order + 1)) > 1e-3


def test_the_nodes_are_the_sums_of_the_rows() -> None:
    np.testing.assert_allclose(ALPHA.sum(axis=1), NUMBERS.alpha, atol=1e-13)
    np.testing.assert_allclose(GAMMA.sum(axis=1), NUMBERS.f[:, 1], atol=1e-13)


@pytest.mark.parametrize("theta", [0.0, 0.17, 0.5, 0.83, 1.0])
def test_the_polynomial_between_is_of_order_4(theta: float) -> None:
    """Σ b_i(θ) Φ_i = θᵖ/γ for all trees of p ≤ 4 vertices; and it is y⁺ at θ = 1."""
    h0, h1, h2 = np.array(RODAS5P_FIXED.table.dense)
    at = (theta * NUMBERS.m + theta * (1 - theta) * (h0 + theta * (h1 + theta * h2))) @ GAMMA
    for n in range(1, 5):
        for tree in trees(n):
            assert at @ weights(tree) == pytest.approx(theta**n / density(tree), abs=1e-13), tree


def test_the_method_is_l_stable() -> None:
    """|R(iy)| ≤ 1 with poles in the right half plane alone, where 1 = γ z, and R(∞) = 1 − bᵀ B⁻¹ 1 = 0."""
    np.testing.assert_allclose(np.diag(BETA), NUMBERS.gamma)  # B is triangular, so these are its eigenvalues
    assert max(abs(stability(1j * y)) for y in np.logspace(-3, 6, 2000)) <= 1 + 1e-14
    assert abs(1 - WEIGHTS @ np.linalg.solve(BETA, np.ones(STAGES))) < 1e-13


@pytest.mark.parametrize("z", [-0.5, -3.0, -1e3, -1e8])
def test_a_step_of_a_linear_equation_multiplies_by_r(z: float) -> None:
    """Of y' = z y at h = 1, with exact J; near R(∞) = 0 sums of size 165 cancel to some 1e-13."""
    system = System(lambda t, y: z * y, 0, exact=lambda t, y: np.array([[z], [0.0]]))
    y = RODAS5P_FIXED.step(system, 0.0, np.array([1.0]), 1.0)
    np.testing.assert_allclose(y[0], stability(z), rtol=1e-13, atol=1e-13)
    assert abs(y[0]) < 13 / abs(z) + 1e-13


def circle_rate(t: Any, y: np.ndarray) -> np.ndarray:
    """Solved by (cos θ, sin θ) with θ = t + t²/4, whatever the stiffness of what pulls it there."""
    theta, turn = t + t * t / 4, 1 + t / 2
    wanted = np.stack([np.cos(theta), np.sin(theta)])
    off = y - wanted
    return turn * np.stack([-wanted[1], wanted[0]]) - 3 * off - 2 * off * (y @ off)


def circle_derivatives(t: Any, y: np.ndarray) -> np.ndarray:
    """∂f/∂y_j for each j, then ∂f/∂t, written out."""
    theta, turn = t + t * t / 4, 1 + t / 2
    wanted = np.stack([np.cos(theta), np.sin(theta)])
    across = np.stack([-wanted[1], wanted[0]])
    off, to = y - wanted, -turn * across  # and ∂off/∂t
    J = -(3 + 2 * (y @ off)) * np.eye(2, dtype=y.dtype) - 2 * np.outer(off, 2 * y - wanted)
    by_t = across / 2 - turn**2 * wanted - 3 * to - 2 * (to * (y @ off) + off * (y @ to))
    return np.vstack([J.T, by_t])


@pytest.mark.skipif(not HAS_LONGDOUBLE, reason="rounding hides the errors of order 5 in float64")
def test_measured_order_with_exact_derivatives() -> None:
    """Of a nonlinear equation with time in it, 5 within 0.15 over five halvings, and by differences alike."""
    end, counts = np.longdouble(1.5), [8, 16, 32, 64, 128, 256]
    off_circle = np.array([1.1, -0.3], np.longdouble)
    each = System(lambda t, y: np.array([circle_rate(t, row) for row in y.reshape(-1, 2)]).reshape(y.shape), 0)
    np.testing.assert_allclose(
        circle_derivatives(0.4, off_circle), each.derivatives(0.4, off_circle, 1.0), rtol=1e-9, atol=1e-9
    )
    for system in (System(circle_rate, 0, exact=circle_derivatives), each):
        errors = []
        for count in counts:
            y, h = np.array([1, 0], np.longdouble), end / count
            for i in range(count):
                y = RODAS5P_FIXED.step(system, i * h, y, h)
            theta = end + end**2 / 4
            errors.append(float(np.abs(y - np.stack([np.cos(theta), np.sin(theta)])).max()))
        assert -np.polyfit(np.log2(counts), np.log2(errors), 1)[0] == pytest.approx(5, abs=0.15)


def test_singular_matrix_is_an_integration_error() -> None:
    """For f = z y, 1 − h γ J = 0 at h = 1/(γ z), for those h at which that is so in floats."""
    gamma = RODAS5P_FIXED.table.gamma
    z, h = next((z, h) for h in np.linspace(1, 2, 99) if (z := 1 / (h * gamma)) * (h * gamma) == 1)
    system = System(lambda t, y: z * y, 0, exact=lambda t, y: np.array([[z], [0.0]]))
    with pytest.raises(IntegrationError, match=r"Rodas5PFixed: 1 − h γ J is singular for the step 1"):
        RODAS5P_FIXED.step(system, 0.0, np.zeros(1), h)


def systems(m: int, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """Random J, by column, whose 1 − s J need exchanges which differ from run to run; and right-hand sides."""
    rng = np.random.default_rng(8)
    return rng.normal(size=(m + 1, m, runs)), rng.normal(size=(m, runs))


def test_elimination_solves_each_system() -> None:
    """Residuals to 100 roundings of the sizes; a matrix that is singular is told."""
    J, x = systems(6, 20)
    J[:6, :, 7] = 0.5 * np.eye(6)
    A = np.eye(6)[:, :, None] - 2 * J[:6]
    LU, rows, got, lost = np.empty_like(A), np.empty((6, 20), np.int64), x.copy(), np.empty(20, np.int64)
    factor(LU, J, 2.0, rows, lost)
    solve(LU, rows, got)
    assert lost.nonzero()[0].tolist() == [7]
    residual = np.einsum("jib,jb->ib", A, got) - x
    scale = np.einsum("jib,jb->ib", abs(A), abs(got))
    assert (np.abs(residual) <= 100 * np.finfo(float).eps * scale.max(axis=0))[:, lost == 0].all()


@pytest.mark.parametrize("runs", [1, 3, 64])
def test_elimination_in_machine_code_gives_equal_bits(runs: int) -> None:
    from robot_dyn.codegen import INSTEAD, MachineFunction

    def both(A: Any, J: Any, scale: Any, rows: Any, lost: Any, x: Any) -> int:
        factor(A, J, scale, rows, lost)
        solve(A, rows, x)
        return 0

    J, x = systems(7, runs)
    results = []
    for function in (both, MachineFunction(both, INSTEAD, lambda: None, "").calls()):
        LU, rows, got, lost = np.empty((7, 7, runs)), np.empty((7, runs), np.int64), x.copy(), np.empty(runs, np.int64)
        function(LU, J, 1.7, rows, lost, got)
        results.append((LU, rows, got, lost))
    for ours, theirs in zip(*results, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
def test_a_run_converges_to_that_of_rk4_at_small_steps(engine: str) -> None:
    """planar_2r with friction: half the step leaves 1/32 of the difference, within a quarter."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3)])
    fine = rd.simulate(plant, **OPTIONS | {"method": "RK4", "step_s": 1e-4}, engine="compiled")
    runs = [rd.simulate(plant, **OPTIONS, step_s=step, engine=engine) for step in (0.025, 0.0125)]
    far, near = (np.abs(run.q - fine.q).max() for run in runs)
    assert near < 1e-8
    assert far / near == pytest.approx(32, rel=0.25)


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
def test_steps_are_not_bounded_by_stiff_damping(engine: str) -> None:
    """With b = 1e5 N m s/rad and h |λ| of some 1e4, the arm creeps: b v = −N(q), to M a / N = 1e-8."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(1e5)])
    run = rd.simulate(plant, **OPTIONS, step_s=0.01, engine=engine)
    np.testing.assert_allclose(run.v[-1], -ARM.N(run.q[-1]) / 1e5, rtol=1e-6)
    explicit = rd.simulate(plant, **OPTIONS | {"method": "RK4"}, step_s=0.01, engine=engine)
    assert explicit.outcome.ending == "diverged"


def test_both_engines_make_the_same_steps() -> None:
    """To 4 κ u, of κ the condition of 1 − h γ J, where both have one Jacobian: stiff, with a moving reference."""
    law = rd.control.PD(rd.control.quintic([0.0, 0.1], [0.5, 0.9], 1.0, v0=0.3), kp=[2000.0, 900.0], kd=[40.0, 20.0])
    plant, h = rd.Plant(ARM, [rd.effects.ViscousFriction([1e3, 1e4]), rd.effects.Spring(1e4)]), 0.01
    options: dict[str, Any] = {"controller": law, "method": "Rodas5PFixed", "step_s": h, "duration_s": h}
    setup, equation = rd.Setup(plant, **START, **options), StateEquation(plant, law)
    machine, m = machine_code(equation, rd.integrate.method("Rodas5PFixed")), equation.size
    p, run_parameters = segment_table(setup).parameters[0], machine.run_parameters({})

    def exact(t: Any, y: np.ndarray) -> np.ndarray:
        out = np.empty((m + 1, m, 1))
        machine.in_python.jacobian(float(t), np.ascontiguousarray(y)[:, None], p, run_parameters, out)
        return out[:, :, 0]

    interpreted = System(lambda t, y: equation.rate(t, y, None)[0], 2, exact=exact)
    rng = np.random.default_rng(4)
    for _ in range(10):
        y = np.concatenate([rng.normal(size=4), np.zeros(m - 4)])
        after = RODAS5P_FIXED.step(interpreted, 0.0, y, h)[:4]
        run = rd.simulate(plant, y[:2], y[2:4], **options, engine="compiled", estimate_error=False)
        kappa = np.linalg.cond(np.eye(m) - h * RODAS5P_FIXED.table.gamma * exact(0.0, y)[:m].T)
        difference = np.abs(np.concatenate([run.q[-1], run.v[-1]]) - after).max()
        assert difference <= 4 * kappa * np.finfo(float).eps * np.abs(after).max()


def test_the_error_follows_the_tolerance() -> None:
    """Samples between the ends of steps included; a hundredth of the tolerance takes 100^(1/5) = 2.5 times as many."""
    plant = rd.Plant(ARM, [rd.effects.RegularisedCoulombFriction([1.0, 0.6], 0.3), rd.effects.Spring([40.0, 20.0])])
    options = OPTIONS | {"duration_s": 2.0, "record_every_s": 0.003, "engine": "compiled"}
    exact = rd.simulate(plant, **options | {"method": rd.integrate.Adaptive(rtol=1e-13, atol=1e-13)})
    steps = []
    for tolerance in (1e-5, 1e-7, 1e-9):
        run = rd.simulate(plant, **options | {"method": rd.integrate.Adaptive("Rodas5P", tolerance, tolerance)})
        assert np.abs(run.q - exact.q).max() < 30 * tolerance
        steps.append(run.statistics.steps)
    np.testing.assert_allclose(np.divide(steps[1:], steps[:-1]), 2.5, rtol=0.2)


@pytest.mark.parametrize(
    "segments", [{}, {"controller": rd.control.PD(rd.control.hold([0.2, 0.1]), kp=[40.0, 20.0], kd=3.0, period_s=0.01)}]
)
def test_both_engines_choose_the_same_steps(segments: dict[str, Any]) -> None:
    """Though one has differences for its Jacobian: right to 1e-10, which the error of a step does not see."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction([100.0, 300.0])])
    options = OPTIONS | segments | {"duration_s": 0.1, "record_every_s": 0.003}
    method = {"method": rd.integrate.Adaptive("Rodas5P", 1e-7, 1e-9)}
    ours, theirs = (rd.simulate(plant, **options | method, engine=engine) for engine in ("compiled", "interpreted"))
    assert ours.statistics.steps == theirs.statistics.steps
    assert ours.statistics.evaluations == theirs.statistics.evaluations
    assert theirs.statistics.engine == "interpreted (Jacobian by differences)"
    np.testing.assert_allclose(ours.q, theirs.q, rtol=0, atol=1e-9)


def test_stiffness_does_not_bound_its_steps() -> None:
    """Dampers of 1e5 and springs of 1e8 together, 0.1 rad off the rest: a thousandth of an explicit method's steps.

    Within the first 10 ms against the explicit method, whose steps stability bounds, so that 1 s takes 100 times as
    many; then at rest, but for what gravity bends, 1e-7 rad.
    """
    rest = np.array([0.4, -0.7])
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(1e5), rd.effects.Spring(1e8, rest)])
    options: dict[str, Any] = {"record_every_s": 1e-4, "estimate_error": False, "engine": "compiled"}
    run = rd.simulate(plant, rest + 0.1, **options, duration_s=1.0, method=rd.integrate.Adaptive("Rodas5P", 1e-6, 1e-6))
    explicit = rd.simulate(
        plant, rest + 0.1, **options, duration_s=0.01, method=rd.integrate.Adaptive("DOP853", 1e-12, 1e-12)
    )
    np.testing.assert_allclose(run.q[:101], explicit.q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.q[-1], rest, rtol=0, atol=1e-6)
    assert 100 * explicit.statistics.steps > 1000 * run.statistics.steps


def test_runs_in_lock_step_are_those_of_simulate() -> None:
    """Though each has pivots of its own, and friction of its own."""
    options = OPTIONS | {"duration_s": 0.3, "step_s": 5e-3}
    del options["q0"], options["v0"], options["estimate_error"]
    rng = np.random.default_rng(0)
    starts, damping = rng.normal(size=(70, 2)), 10 ** rng.uniform(-1, 5, (70, 2))
    friction = rd.effects.RegularisedCoulombFriction([1.0, 0.6], 0.1)
    plant = rd.Plant(ARM, [friction, rd.effects.ViscousFriction(1.0)])
    runs = rd.rollouts(plant, starts, vary={"viscous_friction.viscous": damping}, **options)
    assert runs.q is not None
    assert not runs.diverged.any()
    for i in (0, 35, 69):
        run_parameters = rd.Plant(ARM, [friction, rd.effects.ViscousFriction(damping[i])])
        alone = rd.simulate(run_parameters, starts[i], **options, engine="compiled", estimate_error=False)
        np.testing.assert_allclose(runs.q[i], alone.q, rtol=0, atol=1e-13)
