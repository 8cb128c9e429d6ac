"""Other frames and fewer numbers: the linkage that is compiled has the M, C and N of the one that the file states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.codegen import Trace
from robot_dyn.codegen.trace.base_parameters import regrouped
from robot_dyn.codegen.trace.origins import slid
from robot_dyn.lagrange import Linkage, composite_body, magnitudes, newton_euler
from robot_dyn.lagrange.recursions.kinetic_energy import kinetic_energy
from robot_dyn.model import completed
from tests.random_trees import RandomTree, trees


def assert_same(given: Linkage, made: Linkage, seed: int) -> None:
    """M, M a + C v + N, N and K, to 1e-12 of the terms added into them: some hundred roundings."""
    n = given.couplings.S.shape[1]
    rng = np.random.default_rng(seed)
    q, (v, a) = rng.uniform(-np.pi, np.pi, n), rng.normal(size=(2, n))
    size = magnitudes(given, q)
    assert np.all(np.abs(composite_body(made, q) - composite_body(given, q)) <= 1e-12 * size.M)
    for rates in ((v, a), (v, 0 * a), (0 * v, 0 * a)):
        difference = newton_euler(made, q, *rates) - newton_euler(given, q, *rates)
        assert np.all(np.abs(difference) <= 1e-12 * size.inverse_dynamics(*rates))
    energy = kinetic_energy(made, q, v) - kinetic_energy(given, q, v)
    assert abs(energy) <= 1e-12 * np.abs(v) @ size.M @ np.abs(v)


@settings(max_examples=40)
@given(trees(), st.integers(0, 2**32 - 1))
def test_the_equations_stay_the_same(tree: RandomTree, seed: int) -> None:
    """Any axis, branches, couplings, up to twelve joints; armature is of the joint and stays there."""
    robot = tree.robot
    linkage = rd.Lagrangian(robot.with_(armature={robot.joint_names[-1]: 0.05})).linkage
    for change in (slid, regrouped, lambda linkage: regrouped(slid(linkage))):
        assert_same(linkage, change(linkage), seed)


def test_bodies_that_turn_have_no_mass_left() -> None:
    """Of ten numbers seven are left, or less: m, m c along the axis and one moment across it are exactly 0."""
    linkage = regrouped(slid(Trace(completed(rd.load("panda"))[0]).lagrangian.linkage))
    for body, inertia in zip(linkage.bodies, linkage.inertias, strict=True):
        if body.revolute:
            axis = int(np.argmax([abs(float(x.constant)) for x in body.axis]))
            zeros = [inertia[0, 0], inertia[3 + (axis + 1) % 3, (axis + 2) % 3]]
            assert all(x == 0 for x in zeros)
            assert any(inertia[3 + k, 3 + k] == 0 for k in range(3) if k != axis)
        else:
            assert all(x == 0 for x in inertia[3:, 3:].flat)


def test_origins_slide_to_where_distances_vanish() -> None:
    """UR5: shoulder offset 0.13585 and elbow offset −0.1197 lie along parallel axes, so both go on to the wrist."""
    linkage = rd.Lagrangian(completed(rd.load("ur5"))[0]).linkage
    count = [sum(np.count_nonzero(body.pose.p) for body in each.bodies) for each in (linkage, slid(linkage))]
    assert count[1] <= count[0] - 2
    before, after = (each.at(np.zeros(6)).in_base.values() for each in (linkage, slid(linkage)))
    for body, (R, p), (S, r) in zip(linkage.bodies, before, after, strict=True):
        assert np.array_equal(R, S)
        assert np.allclose(np.cross(R @ body.axis, r - p), 0, atol=1e-14)  # moved along the axis, if at all


@pytest.mark.parametrize("name", ["ur5", "kinova", "panda", "skew_tree"])
def test_rounding_does_not_grow(name: str) -> None:
    """Against longdouble, M in units of √M_ii: at most twice the worst of 200 states."""
    lagrangian, exact = rd.Lagrangian(rd.load(name)), rd.Lagrangian(rd.load(name), np.longdouble)
    if np.finfo(np.longdouble).eps > 1e-18:
        pytest.skip("longdouble is float64 here")
    worst = {}
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (200, lagrangian.n))
    truth = exact.M(q)
    d = np.sqrt(np.diagonal(truth, axis1=-2, axis2=-1))
    for what, linkage in (("stated", lagrangian.linkage), ("made", regrouped(slid(lagrangian.linkage)))):
        error = np.array([composite_body(linkage, each) for each in q]) - truth
        worst[what] = np.max(np.abs(error) / (d[:, :, None] * d[:, None, :]))
    assert worst["made"] <= 2 * worst["stated"] + 4 * np.finfo(float).eps
