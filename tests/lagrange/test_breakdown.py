"""The breakdown: the parts of the links and the armature add up to M, C and N; each is what its name says."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import block_diagonal
from robot_dyn.lagrange import composite_body, newton_euler
from robot_dyn.lagrange.breakdown import breakdown
from robot_dyn.lagrange.recursions.kinetic_energy import kinetic_energy
from robot_dyn.lagrange.recursions.propagation import accelerations, twists

ROBOTS = ("ur5", "panda", "mimic_chain", "skew_tree", "cart_pole", "talos_left_arm", "pr2")
U = np.finfo(float).eps / 2


def parts_of(name: str):
    with warnings.catch_warnings(action="ignore", category=rd.ModelWarning):
        robot = rd.load(name)
    robot = robot.with_(armature=0.1)
    return robot, np.random.default_rng(4).uniform(-1, 1, (3, robot.n))


@pytest.mark.parametrize("quantity", ["M", "C", "N"])
@pytest.mark.parametrize("name", ROBOTS)
def test_the_parts_add_up(name: str, quantity: str) -> None:
    """To the rounding of a sum: u for each part and for each entry's own terms, of the absolute values of the parts."""
    robot, (q, v, _) = parts_of(name)
    own = rd.Lagrangian(robot)
    parts = [getattr(part, quantity) for part in breakdown(own, q, v)]
    whole = getattr(own, quantity)(*(q, v)[: 2 if quantity == "C" else 1])
    size = sum(map(np.abs, parts))
    assert np.all(np.abs(sum(parts) - whole) <= (len(parts) + 4) * U * np.max(size))


@pytest.mark.parametrize("name", ["cart_pole", "ur5", "xarm7", "light_tip"])
def test_the_parts_are_the_terms_themselves(name: str) -> None:
    """Chains whose bodies are one link each: M, C and N are these very sums, equal to the last bit."""
    robot = rd.load(name)
    q, v = np.random.default_rng(4).uniform(-1, 1, (2, robot.n))
    own = rd.Lagrangian(robot)
    parts = {own.linkage.links[part.source][0]: part for part in breakdown(own, q, v)}
    assert sorted(parts) == list(range(robot.n))
    for quantity, whole in (("M", own.M(q)), ("C", own.C(q, v)), ("N", own.N(q))):
        assert np.array_equal(sum(getattr(parts[body], quantity) for body in range(robot.n)), whole)


@pytest.mark.parametrize("quantity", ["M", "C", "N"])
def test_the_parts_add_up_in_balls(quantity: str) -> None:
    """At 200 bits sum and whole share a number, with radii below 1e-50."""
    robot, (q, v, _) = parts_of("mimic_chain")
    own = rd.Lagrangian(robot, rd.accuracy.Ball(200))
    with own.arithmetic.scope():
        total = sum(getattr(part, quantity) for part in breakdown(own, q, v))
        difference = total - getattr(own, quantity)(*(q, v)[: 2 if quantity == "C" else 1])
    assert all(0 in ball and float(ball.rad()) < 1e-50 for ball in difference.flat)


@pytest.mark.parametrize("name", ["ur5", "mimic_chain", "skew_tree"])
def test_a_part_is_the_robot_with_all_other_masses_removed(name: str) -> None:
    """M, C and N of one link by Pinocchio, from a file in which only that link has mass; to rounding of the whole."""
    robot, (q, v, _) = parts_of(name)
    parts = {part.source: part for part in breakdown(rd.Lagrangian(robot), q, v)}
    whole = robot.M(q).max() + np.abs(robot.C(q, v)).max() + np.abs(robot.N(q)).max()
    root = robot.description.element
    chosen = list(parts)[len(parts) // 2]
    for link in root.iterfind("link"):
        inertial = link.find("inertial")
        if inertial is not None and link.get("name") != chosen:
            link.remove(inertial)
    with warnings.catch_warnings(action="ignore", category=rd.ModelWarning):
        alone = rd.Robot.from_text(_text(root))
    part = parts[chosen]
    for ours, theirs in ((part.M, alone.M(q)), (part.C, alone.C(q, v)), (part.N, alone.N(q))):
        assert np.max(np.abs(ours - theirs)) <= 1e-14 * whole


def _text(root) -> bytes:
    from lxml import etree

    return etree.tostring(root)


def test_the_armature_is_a_part_of_M_alone() -> None:
    robot, (q, v, _) = parts_of("mimic_chain")
    own = rd.Lagrangian(robot)
    armature = breakdown(own, q, v)[-1]
    assert armature.source == "(armature)"
    assert np.array_equal(armature.M, 0.1 * np.eye(robot.n))
    assert not armature.C.any() and not armature.N.any()


FIVE = ("planar_2r", "ur5", "mimic_chain", "skew_tree", "cart_pole")


@pytest.fixture(params=FIVE)
def lagrangian(request: pytest.FixtureRequest) -> rd.Lagrangian:
    return rd.Lagrangian(rd.load(request.param))


@pytest.fixture
def state(lagrangian: rd.Lagrangian) -> np.ndarray:
    """q, v, a without zeros."""
    return np.random.default_rng(3).uniform(0.2, 1.5, (3, lagrangian.n)) * [[1], [-1], [1]]


def test_velocities_and_accelerations_are_those_of_the_jacobians(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """V_i = Jᵢ v, and R A_i = J a + J̇ v of the joint's frame along the base's axes; 1e-13 of the largest."""
    q, v, a = state
    linkage = lagrangian.linkage
    X, full_v, full_a = linkage.steps(q), linkage.couplings.velocity(v), linkage.couplings.velocity(a)
    V = twists(linkage, X, full_v)
    A = accelerations(linkage, X, V, full_v, full_a, np.zeros(6))
    for body, twist, acceleration in zip(linkage.bodies, V, A, strict=True):
        assert np.allclose(twist, lagrangian.jacobian(q, body.joint, expressed_in="body") @ v, rtol=0, atol=1e-13)
        R = block_diagonal(lagrangian.placement(q, body.joint)[:3, :3])
        of_frame = lagrangian.jacobian(q, body.joint) @ a + lagrangian.jacobian_rate(q, v, body.joint) @ v
        assert np.allclose(R @ acceleration, of_frame, rtol=0, atol=1e-13 * (1 + np.max(np.abs(of_frame))))


def test_newton_euler_is_the_closed_form(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """τ = M a + C v + N, and M a + C v without gravity; a few hundred roundings, so 1e-12 of the largest torque."""
    q, v, a = state
    expected = lagrangian.inverse_dynamics(q, v, a)
    size = np.max(np.abs(expected)) + np.max(np.abs(lagrangian.N(q)))
    assert np.max(np.abs(newton_euler(lagrangian.linkage, q, v, a) - expected)) <= 1e-12 * size
    free = newton_euler(lagrangian.linkage, q, v, a, gravity=False)
    assert np.max(np.abs(free + lagrangian.N(q) - expected)) <= 1e-12 * size


def test_composite_bodies_make_the_mass_matrix(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """M = Σ Jᵢᵀ 𝓜ᵢ Jᵢ to 1e-13 of its largest entry."""
    expected = lagrangian.M(state[0])
    assert np.max(np.abs(composite_body(lagrangian.linkage, state[0]) - expected)) <= 1e-13 * np.max(np.abs(expected))


def test_the_energies_of_the_bodies_add_up(lagrangian: rd.Lagrangian, state: np.ndarray) -> None:
    """K = ½ vᵀ M v: all terms are positive in the sum over the bodies, so 1e-13 of it."""
    q, v, _ = state
    expected = lagrangian.kinetic_energy(q, v)
    assert abs(kinetic_energy(lagrangian.linkage, q, v) - expected) <= 1e-13 * expected
