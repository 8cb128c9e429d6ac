"""Ball arithmetic: M, C, N with a proven radius, and the rounding of each implementation in floats against them."""

from __future__ import annotations

import numpy as np
import pytest
from flint import arb, ctx

import robot_dyn as rd
from robot_dyn.foundations import Ball
from robot_dyn.lagrange import articulated_body, magnitudes

U = np.finfo(np.float64).eps / 2
ARMS = ["ur5", "panda"]


def arm(name: str) -> rd.Robot:
    robot = rd.load(name)
    return robot.with_(lock={"panda_finger_joint1": 0.0}) if name == "panda" else robot


def general_state(robot: rd.Robot) -> np.ndarray:
    return np.random.default_rng(5).uniform(-1.5, 1.5, (3, robot.n))


def terms(engine, q, v) -> dict[str, np.ndarray]:
    return {"M": engine.M(q), "C": engine.C(q, v), "N": engine.N(q)}


def distance(values: np.ndarray, balls: np.ndarray, bits: int = 200) -> np.ndarray:
    """|value − ball|, rounded up to float64."""
    with ctx.workprec(bits):
        return np.vectorize(lambda x, ball: float(abs(arb(float(x)) - ball).upper()), otypes=[float])(values, balls)


def test_placement_and_jacobian_are_balls_throughout() -> None:
    """Those entries too that are 0 or 1 at any state; they hold the float64 values to their rounding."""
    robot, ball = arm("ur5"), Ball(100)
    own, (q, v, _) = rd.Lagrangian(robot, ball), general_state(robot)
    for name, arguments in (("placement", (q,)), ("jacobian", (q,)), ("jacobian_rate", (q, v))):
        balls = getattr(own, name)(*arguments, "wrist_3_link")
        assert {type(x) for x in balls.flat} == {arb}
        np.testing.assert_allclose(
            rd.accuracy.midpoint(balls), getattr(robot, name)(*arguments, "wrist_3_link"), atol=1e-14
        )


@pytest.mark.parametrize("name", ARMS)
def test_balls_of_more_bits_lie_inside_balls_of_fewer(name: str) -> None:
    """Both enclose the exact value, so they meet; 147 bits more shrink the radius by 2⁻¹⁴⁷ = 6e-45, to rounding."""
    robot = arm(name)
    q, v, _ = general_state(robot)
    coarse, fine = (terms(rd.Lagrangian(robot, Ball(bits)), q, v) for bits in (53, 200))
    with ctx.workprec(200):
        for key, balls in coarse.items():
            assert all(a.overlaps(b) for a, b in zip(balls.flat, fine[key].flat, strict=True))
            wide, narrow = rd.accuracy.radius(balls), rd.accuracy.radius(fine[key])
            assert 0 < wide.max() < 1e-11, "53 bits: rounding on the scale of 1 to 100 N m"
            assert narrow.max() <= 1e-44 * wide.max()


IN_FLOATS = {
    "Pinocchio": lambda robot: robot,
    **{
        np.dtype(each).name: lambda robot, each=each: rd.Lagrangian(robot, each)
        for each in (np.float32, np.float64, np.longdouble)
    },
}


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize(("engine", "bits"), [("Pinocchio", 53), *((engine, 200) for engine in IN_FLOATS)])
def test_each_implementation_lies_within_its_rounding_bound_of_the_balls(name: str, engine: str, bits: int) -> None:
    """|value − exact| ≤ 128 n u · (terms added into the entry), u of its precision, to first order in u.

    A joint's placement has an error of at most 20 u: the literals u; rpy by a quaternion 12 u; sin, cos and the
    product with the rotation 6 u. Along n joints that is 20 n u on orientations, and on levers as part of their length.
    A term of M has two Jacobian columns, 40 n u, and an inertia (literals, turned and merged, 30 u) with products of
    depth 6, 12 u; one of C has a third column, 60 n u. A sum over n bodies and 3 indices adds 4 n u. For n ≥ 1 all
    stay below 128 n u. What the ball itself does not know is added: its radius. Compared at a q that float32 holds
    exactly; values are split into two float64 so that flint takes longdouble exactly.
    """
    robot = arm(name)
    q, v, _ = general_state(robot).astype(np.float32).astype(np.float64)
    size = magnitudes(rd.Lagrangian(robot).linkage, q)
    scale = {"M": size.M, "C": size.C(v), "N": size.N}
    exact, got = terms(rd.Lagrangian(robot, Ball(bits)), q, v), terms(IN_FLOATS[engine](robot), q, v)
    for key, balls in exact.items():
        assert engine in ("Pinocchio", got[key].dtype.name)
        high = got[key].astype(np.float64)
        with ctx.workprec(200):
            low = np.vectorize(lambda x: arb(float(x)), otypes=[object])(got[key] - high)
            error = distance(high, balls - low)
        bound = 128 * robot.n * float(np.finfo(got[key].dtype).eps / 2) * scale[key] + rd.accuracy.radius(balls)
        assert np.all(error <= bound), key


@pytest.mark.parametrize("name", ARMS)
def test_the_rounding_bound_is_no_wider_than_the_cross_check_needs(name: str) -> None:
    """A bound that a 1e-11 error of a mass could pass would prove nothing: move Pinocchio's values by it and fail."""
    robot = arm(name)
    q, *_ = general_state(robot)
    size = magnitudes(rd.Lagrangian(robot).linkage, q)
    balls = rd.Lagrangian(robot, Ball(200)).N(q)
    moved = robot.N(q) + 1e-11 * size.N
    assert np.all((distance(moved, balls) > 128 * robot.n * U * size.N)[size.N > 0])


def test_balls_follow_the_literals_of_the_file_not_their_float64() -> None:
    """0.1 in the file is the decimal 0.1: the ball of 200 bits tells it from the float64 nearest to it."""
    balls = rd.Lagrangian(rd.load("pendulum"), Ball(200)).M([0.3])
    with ctx.workprec(200):
        exact = arb("0.083333333333333333") + arb("0.25")  # Iyy of the file + m (l/2)²
        assert balls[0, 0].overlaps(exact)
        assert balls[0, 0].rad() < arb("1e-55")
        assert not balls[0, 0].contains(arb(1) / 3)


@pytest.mark.parametrize("name", ["ur5", "skew_tree"])
def test_forward_dynamics_of_balls_encloses_all_implementations(name: str) -> None:
    """Cholesky and articulated body in 200 bits meet; Pinocchio's ABA lies at 1e-12 of them in the norm of a."""
    robot = arm(name)
    q, v, tau = general_state(robot)
    own = rd.Lagrangian(robot, Ball(200))
    first = own.forward_dynamics(q, v, tau)
    with own.arithmetic.scope():
        second = articulated_body(own.linkage, *(own.arithmetic.array(x) for x in (q, v, tau)))
        assert all(a.overlaps(b) for a, b in zip(first, second, strict=True))
    assert np.max(rd.accuracy.radius(first)) < 1e-50
    error = distance(robot.forward_dynamics(q, v, tau), first)
    assert error.max() <= 1e-12 * np.abs(rd.accuracy.midpoint(first)).max()


def test_balls_of_a_box_of_states_enclose_every_state_in_it() -> None:
    """Interval evaluation: q known to ±1e-6 gives N known to a radius that holds N at random points of the box."""
    robot = arm("ur5")
    q, *_ = general_state(robot)
    box = np.array([arb(float(x), 1e-6) for x in q], dtype=object)
    N = rd.Lagrangian(robot, Ball(53)).N(box)
    rng = np.random.default_rng(0)
    for _ in range(20):
        inside = robot.N(q + rng.uniform(-1e-6, 1e-6, robot.n))
        assert all(ball.contains(arb(float(x))) for ball, x in zip(N, inside, strict=True))


def test_precision_is_given_back() -> None:
    """The precision of flint is one for the whole process: a query leaves it as it was."""
    before = ctx.prec
    rd.Lagrangian(rd.load("pendulum"), Ball(300)).N([0.2])
    assert ctx.prec == before
