"""C of Pinocchio's regrouped model errs by less than the bound that decides whether it is taken; all else in body axes.

|δC_ij| ≤ ε Ω √(M_ii M_jj),   Ω = Σ |v_k| of revolute joints + Σ |v_k| / D of prismatic ones, D the reach
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.cross_check import random_state
from robot_dyn.foundations import DescriptionError
from robot_dyn.lagrange import magnitudes
from robot_dyn.model.coriolis import MAX_ROUNDING
from robot_dyn.model.regrouped import joint_axes, least_inertia, reach, regrouped, rounding
from tests.lagrange.test_scales import long_chain
from tests.long import long, stress
from tests.random_trees import RandomTree, trees

SEEDS = st.integers(0, 2**32 - 1)
SOME = ("ur5", "panda", "z1", "ur10", "kinova", "so101", "talos_left_arm", "mimic_chain")
NAMES = rd.list_robots()


def states(robot: rd.Robot, seed: int, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """General q and v, and some near multiples of π/2, where M_ii is least and entries of C vanish."""
    rng, drawn = np.random.default_rng(seed), []
    turning = np.array(robot.joint_types) != "prismatic"
    for k in range(count):
        q, v = random_state(robot, rng)["q"], rng.normal(size=robot.n)
        if k % 2:
            near = rng.integers(-2, 3, robot.n) * np.pi / 2 + rng.normal(size=robot.n) * 10 ** rng.uniform(-6, -1)
            q, v = np.where(turning, near, q), np.where(rng.random(robot.n) < 0.5, v, 1e-3 * v)
        drawn.append((q, v))
    return drawn


def excess(robot: rd.Robot, model: object, seed: int, count: int) -> float:
    """The largest error of Pinocchio's C of a model over the bound of the regrouped one, against balls of 128 bits."""
    couplings, own = robot.couplings, regrouped(robot.model)
    bound, D, worst = rounding(robot.model, own, couplings), reach(own).max(), 0.0
    assert bound < np.inf
    true, data = rd.Lagrangian(robot, rd.accuracy.Ball(128)), robot.model.createData()
    per_speed = np.where(joint_axes(own)[:, 3:].any(axis=1), 1.0, 1 / max(D, 1e-300))
    for q, v in states(robot, seed, count):
        position, velocity = couplings.position(q), couplings.velocity(v)
        error = couplings.matrix(pin.computeCoriolisMatrix(model, data, position, velocity)) - rd.accuracy.midpoint(
            true.C(q, v)
        )
        units = np.sqrt(robot.M(q).diagonal())
        allowed = bound * (np.abs(velocity) @ per_speed) * units * units[:, None]
        worst = max(worst, np.max(np.abs(error) / allowed))
    return float(worst)


@pytest.mark.parametrize("name", SOME)
def test_rounding_of_the_regrouped_model_is_below_its_bound(name: str) -> None:
    robot = rd.load(name)
    assert excess(robot, regrouped(robot.model), 1, 8) <= 1


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("name", [*long(NAMES[::4]), *stress(name for k, name in enumerate(NAMES) if k % 4)])
def test_rounding_is_below_its_bound_on_the_catalog(name: str) -> None:
    try:
        robot = rd.load(name)
    except DescriptionError:
        return  # refused, see test_catalog
    if robot.coriolis.rounding == np.inf:
        assert robot.coriolis.regrouped is None  # body axes
        return
    assert (
        not excess(robot, regrouped(robot.model), 2, 40 if robot.n <= 12 else 4) > 1
    )  # 0/0 of a joint without inertia


@pytest.mark.parametrize(("examples", "states"), [(25, 2), *stress([(200, 8)])])
def test_rounding_is_below_its_bound_on_random_trees(examples: int, states: int) -> None:
    @settings(max_examples=examples)
    @given(trees(), SEEDS)
    def law(tree: RandomTree, seed: int) -> None:
        assert excess(tree.robot, regrouped(tree.robot.model), seed, states) <= 1

    law()


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
def test_a_model_that_is_not_regrouped_exceeds_the_bound() -> None:
    """The light wrist of a long arm loses u D²/r² in place of u D/r, so the law above can tell."""
    robot = rd.load("tiago_no_hand")
    assert excess(robot, robot.model, 1, 8) > 1


@pytest.mark.parametrize("name", SOME)
def test_no_diagonal_entry_of_m_is_less_than_its_bound(name: str) -> None:
    """16 u of the entry for the sums."""
    robot = rd.load(name)
    least = least_inertia(robot.model, robot.couplings)
    for q, _ in states(robot, 3, 200):
        assert np.all(robot.M(q).diagonal() >= least * (1 - 2e-15))


@settings(max_examples=40)
@given(trees(), SEEDS)
def test_no_diagonal_entry_of_m_is_less_than_its_bound_on_random_trees(tree: RandomTree, seed: int) -> None:
    robot = tree.robot
    least = least_inertia(robot.model, robot.couplings)
    assert all(np.all(robot.M(q).diagonal() >= least * (1 - 1e-13)) for q, _ in states(robot, seed, 4))


@pytest.mark.parametrize("name", ["ur5", "panda", "z1"])
def test_pinocchio_is_asked_where_the_bound_is_small(name: str) -> None:
    coriolis = rd.load(name).coriolis
    assert coriolis.regrouped is not None and coriolis.rounding <= MAX_ROUNDING


def test_body_axes_are_taken_where_the_bound_is_not_small() -> None:
    """A chain of links from 1 km to 1 µm."""
    assert long_chain().coriolis.regrouped is None and long_chain().coriolis.rounding > MAX_ROUNDING


@pytest.mark.parametrize("name", ["ur5", "panda", "z1", "kinova", "mimic_chain", "skew_tree"])
def test_c_of_one_state_has_13_digits(name: str) -> None:
    """Of its largest entry, in the units of `rd.accuracy.digits`, at general states."""
    robot, rng = rd.load(name), np.random.default_rng(4)
    for _ in range(5):
        state = random_state(robot, rng)
        assert rd.accuracy.digits(robot, "C", state["q"], state["v"]) >= 13


def test_beyond_the_limits_of_a_prismatic_joint_c_keeps_its_digits() -> None:
    """A cart 1e7 m down its rail: 4u of the terms, where the axes of the world leave 1e-9 of them."""
    robot = rd.load("cart_pole")
    assert robot.coriolis.regrouped is not None
    q, v = np.array([1e7, 0.7]), np.array([0.3, -1.1])
    true = rd.accuracy.midpoint(rd.Lagrangian(robot, rd.accuracy.Ball(200)).C(q, v))
    scale = magnitudes(rd.Lagrangian(robot).linkage, np.array([0.0, 0.7])).C(v)
    assert np.all(np.abs(robot.C(q, v) - true) <= 4.5e-16 * scale)
    in_world_axes = pin.computeCoriolisMatrix(robot.coriolis.regrouped, robot.model.createData(), q, v)
    assert np.max(np.abs(in_world_axes - true)[scale > 0] / scale[scale > 0]) > 1e-10
