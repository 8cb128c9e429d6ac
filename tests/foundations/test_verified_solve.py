"""Verified solutions of M x = b in balls: what they enclose, how narrow they are, and what they refuse."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from flint import arb, ctx

import robot_dyn as rd
from robot_dyn.foundations import NotPositiveDefiniteError, UndecidedError, cholesky_solve
from robot_dyn.lagrange import articulated_body

LINK = """
<link name="link_{i}"><inertial><origin xyz="0.25 0 0"/><mass value="1.3"/>
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
<joint name="joint_{i}" type="continuous"><parent link="{parent}"/><child link="link_{i}"/>
  <origin xyz="{x} 0 0"/><axis xyz="0 1 0"/></joint>"""


def chain(n: int) -> rd.Robot:
    """Bars in a plane, one after the other."""
    links = [LINK.format(i=i, parent=f"link_{i - 1}" if i else "base", x=0.5 if i else 0) for i in range(n)]
    return rd.Robot.from_text(f'<robot name="chain"><link name="base"/>{"".join(links)}</robot>')


def test_a_straight_chain_of_16_joints_keeps_its_digits_at_53_bits() -> None:
    """κ is 4e5, so that balls of relative radius 1e-16 leave 1e-16 κ of a ≈ 50 rad/s² at best, 2e-9.

    The recursion over bodies loses 5 to 6 bits a joint and fails; in 700 bits it is the truth inside.
    """
    robot = chain(16)
    q, (v, tau) = np.zeros(16), np.random.default_rng(1).normal(size=(2, 16))
    coarse, fine = rd.Lagrangian(robot, rd.accuracy.Ball(53)), rd.Lagrangian(robot, rd.accuracy.Ball(700))
    a = coarse.forward_dynamics(q, v, tau)
    assert rd.accuracy.radius(a).max() < 1e-7
    with fine.arithmetic.scope():
        exact = articulated_body(fine.linkage, *(fine.arithmetic.array(x) for x in (q, v, tau)))
        assert all(ball.contains(x) for ball, x in zip(a, exact, strict=True))
        assert max(float(x.rad()) for x in exact) < 1e-100
    with coarse.arithmetic.scope(), pytest.raises(UndecidedError):
        articulated_body(coarse.linkage, *(coarse.arithmetic.array(x) for x in (q, v, tau)))


@pytest.mark.parametrize("radius", [0.0, 1e-10, 0.05])
def test_solutions_of_all_systems_in_the_balls_lie_inside(radius: float) -> None:
    """A 2 × 2 system by Cramer's rule, at all corners of the box of its five numbers."""
    middle = {"a": 2.0, "b": 0.7, "c": 1.0, "d": 0.4, "e": -0.9}
    with ctx.workprec(53):
        balls = {name: arb(x, radius) for name, x in middle.items()}
        M = np.array([[balls["a"], balls["b"]], [balls["b"], balls["c"]]])
        x = cholesky_solve(M, np.array([balls["d"], balls["e"]]))
    with ctx.workprec(300):
        for signs in product((-1, 1), repeat=5):
            a, b, c, d, e = (arb(x) + sign * arb(radius) for x, sign in zip(middle.values(), signs, strict=True))
            whole = a * c - b * b
            for ball, exact in zip(x, ((d * c - b * e) / whole, (a * e - b * d) / whole), strict=True):
                assert ball.contains(exact)
    assert rd.accuracy.radius(x).max() < 12 * radius + 1e-15, "κ of M is 4.4, and |x| is at most 1.9"


def test_each_system_of_a_batch_is_solved_by_itself() -> None:
    rng = np.random.default_rng(3)
    A, b = rng.normal(size=(2, 1, 3, 3)), rng.normal(size=(4, 3))
    M = A @ A.swapaxes(-1, -2) + np.eye(3)
    ball = rd.accuracy.Ball(80)
    with ball.scope():
        x = cholesky_solve(ball.array(M), ball.array(b))
    assert x.shape == (2, 4, 3)
    np.testing.assert_allclose(rd.accuracy.midpoint(x), np.linalg.solve(M, b[..., None])[..., 0], rtol=1e-12)


@pytest.mark.parametrize(
    ("entries", "row", "decided"),
    [
        (((1, 0), (2, 0), (1, 0)), 1, True),  # indefinite
        (((0, 0), (0, 0), (1, 0)), 0, True),  # without inertia
        (((1, 0), (1, 1e-3), (1, 0)), 1, False),  # some are singular
        (((1, 0), (0.5, 0), (1, 1.5)), 1, False),  # some are indefinite
    ],
)
def test_what_is_not_certainly_positive_definite_is_refused(entries, row: int, decided: bool) -> None:
    a, b, c = (arb(*each) for each in entries)
    with ctx.workprec(53), pytest.raises(NotPositiveDefiniteError) as found:
        cholesky_solve(np.array([[a, b], [b, c]]), np.array([arb(1), arb(2)]))
    assert (found.value.row, found.value.decided) == (row, decided)
