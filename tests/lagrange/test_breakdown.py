"""The breakdown: the parts of the links and the armature add up to M, C and N; each is what its name says."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.lagrange.breakdown import breakdown

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
