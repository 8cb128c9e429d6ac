"""What is desired at time t: piecewise polynomials, their ends and joints, lines, circles and turns."""

from __future__ import annotations

from math import factorial, perm

import numpy as np
import pytest
from numpy.polynomial import polynomial

import robot_dyn as rd
from robot_dyn.control import (
    CartesianReference,
    PiecewisePolynomial,
    Samples,
    circle,
    extreme_values,
    hold,
    line,
    orientation_error,
    quintic,
    rotation_vector,
    via_points,
)
from robot_dyn.foundations import ControlError, rotation

Q0, Q1 = np.array([0.3, -1.2, 2.0]), np.array([1.1, 0.4, -0.7])
TIMES = np.array([0.5, 0.9, 2.2, 2.9, 4.4, 5.0])
POINTS = np.random.default_rng(3).normal(size=(6, 3))
AXIS = np.array([2.0, -1.0, 2.0]) / 3
REFERENCES = {
    "hold": hold(Q0),
    "quintic": quintic(Q0, Q1, 1.7, start_s=0.4),
    "quintic between motions": quintic(Q0, Q1, 1.7, v0=[0.3, -0.4, 0.5], v1=-0.8, a0=1.3, a1=[0.2, 0.6, -0.9]),
    "cubic spline": via_points(TIMES, POINTS, kind="cubic"),
    "quintic spline": via_points(TIMES, POINTS),
    "spline with velocities at its ends": via_points(TIMES, POINTS, v0=[0.3, -0.4, 0.5], v1=-0.8),
    "samples of q": Samples(TIMES, POINTS),
    "samples of q, v, a": Samples(TIMES, POINTS, POINTS[::-1], 2 * POINTS),
    "circle": circle([0.4, -0.2, 0.5], 0.3, [1.0, -2.0, 0.5], 2.0, turns=1.3).position,
}


@pytest.mark.parametrize("reference", REFERENCES.values(), ids=REFERENCES)
def test_velocity_and_acceleration_are_derivatives(reference: PiecewisePolynomial) -> None:
    """Central differences, h = 1e-5 s: h² q⁗ / 6 and ε q / h are below 1e-7 for motions of this size.

    Times keep 1e-3 s from the breaks: there only the lower derivatives are continuous.
    """
    t = np.random.default_rng(1).uniform(reference.start_s, reference.end_s, 300)
    t, h = t[np.abs(t[:, None] - reference.breaks).min(axis=1) > 1e-3], 1e-5
    _, v, a = reference.at(t)
    (q_after, v_after, _), (q_before, v_before, _) = reference.at(t + h), reference.at(t - h)
    np.testing.assert_allclose((q_after - q_before) / (2 * h), v, atol=1e-7)
    np.testing.assert_allclose((v_after - v_before) / (2 * h), a, atol=1e-7)


@pytest.mark.parametrize("reference", REFERENCES.values(), ids=REFERENCES)
def test_position_velocity_and_acceleration_are_continuous(reference: PiecewisePolynomial) -> None:
    """Either side of an inner break, a few ulps of time apart: what changes is a rounding."""
    inner = reference.breaks[1:-1]
    for right, left in zip(reference.at(inner), reference.at(np.nextafter(inner, 0)), strict=True):
        np.testing.assert_allclose(right, left, rtol=1e-11, atol=1e-11)


def test_at_a_break_the_piece_to_its_right_counts() -> None:
    """A sawtooth, 3 t and then −2 t: what a sampled controller at a tick sees is what comes."""
    saw = PiecewisePolynomial([0.0, 1.0, 2.0], [[[0.0], [3.0]], [[5.0], [-2.0]]])
    assert [float(x[0]) for x in saw.at(1.0)] == [5.0, -2.0, 0.0]
    assert [float(x[0]) for x in saw.at(2.0)] == [3.0, -2.0, 0.0]


@pytest.mark.parametrize("reference", REFERENCES.values(), ids=REFERENCES)
def test_it_rests_before_its_start_and_after_its_end(reference: PiecewisePolynomial) -> None:
    for outside, end in [(reference.start_s - 0.3, reference.start_s), (reference.end_s + 7.0, reference.end_s)]:
        q, v, a = reference.at(outside)
        np.testing.assert_array_equal(q, reference.at(end)[0])
        assert not v.any()
        assert not a.any()


@pytest.mark.parametrize("reference", REFERENCES.values(), ids=REFERENCES)
@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_times_may_carry_axes(reference: PiecewisePolynomial, shape: tuple[int, ...]) -> None:
    t = np.random.default_rng(5).uniform(reference.start_s - 0.2, reference.end_s + 0.2, shape)
    batch = reference.at(t)
    for got in batch:
        assert got.shape == (*shape, reference.n)
    for index in np.ndindex(*shape):
        for got, one in zip(batch, reference.at(t[index] if shape else float(t)), strict=True):
            np.testing.assert_array_equal(got[index], one)


def test_quintic_is_the_minimum_jerk_motion() -> None:
    """10 s³ − 15 s⁴ + 6 s⁵, of greatest velocity 15/8 halfway; roundings only."""
    s = np.linspace(0, 1, 101)
    q, v, a = quintic(Q0, Q1, 1.7, start_s=0.4).at(0.4 + 1.7 * s)
    expected = Q0 + (Q1 - Q0) * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]
    np.testing.assert_allclose(q, expected, atol=1e-14)
    np.testing.assert_allclose(np.abs(v).max(axis=0), 15 / 8 * np.abs(Q1 - Q0) / 1.7, rtol=1e-13)
    np.testing.assert_allclose(v[50], 15 / 8 * (Q1 - Q0) / 1.7, rtol=1e-13)
    np.testing.assert_allclose(np.stack([v, a])[:, [0, -1]], 0, atol=1e-13)


def test_quintic_meets_its_end_conditions() -> None:
    start, end = REFERENCES["quintic between motions"].at(0.0), REFERENCES["quintic between motions"].at(1.7)
    for got, expected in zip([*start, *end], [Q0, [0.3, -0.4, 0.5], 1.3, Q1, -0.8, [0.2, 0.6, -0.9]], strict=True):
        np.testing.assert_allclose(got, np.broadcast_to(expected, 3), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(("kind", "degree"), [("cubic", 3), ("quintic", 5)])
def test_derivatives_of_a_spline_are_continuous(kind: str, degree: int) -> None:
    """Below the degree; with the points and the ends, this determines the spline. To rounding: 1e-10."""
    reference = via_points(TIMES, POINTS, kind=kind)
    c, h = reference.coefficients, np.diff(TIMES)
    assert c.shape == (len(h), degree + 1, 3)
    for r in range(degree):
        falling = np.array([perm(j, r) for j in range(degree + 1)], dtype=float)
        powers = h[:, None] ** np.maximum(np.arange(degree + 1) - r, 0)
        at_end = np.einsum("kj,kjn->kn", falling * powers, c)
        at_start = factorial(r) * c[:, r]
        np.testing.assert_allclose(at_end[:-1], at_start[1:], rtol=1e-10, atol=1e-10 * np.abs(at_start).max())
        if 0 < r < (degree + 1) // 2:
            np.testing.assert_allclose([at_start[0], at_end[-1]], 0, atol=1e-10)


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_spline_passes_its_points_from_rest_to_rest(kind: str) -> None:
    spline = via_points(TIMES, POINTS, kind=kind)
    np.testing.assert_allclose(spline.at(TIMES)[0], POINTS, atol=1e-13)
    np.testing.assert_allclose(spline.at(TIMES[[0, -1]])[1], 0, atol=1e-12)
    only_two = via_points(TIMES[:2], POINTS[:2])
    np.testing.assert_allclose(
        only_two.coefficients,
        quintic(*POINTS[:2], duration_s=TIMES[1] - TIMES[0], start_s=TIMES[0]).coefficients,
        rtol=1e-12,
    )


def test_spline_does_not_depend_on_the_unit_of_time() -> None:
    """In milliseconds the coefficients of tʲ scale by 1000⁻ʲ: to rounding, by the scaling before the solve."""
    slow, fast = via_points(TIMES, POINTS), via_points(TIMES / 1000, POINTS)
    np.testing.assert_allclose(fast.at(1.7 / 1000)[0], slow.at(1.7)[0], rtol=1e-11)


@pytest.mark.parametrize("ramp", [None, 0.0, 0.02, 0.3, 0.9, 1.0, 1.7, 2.6])
@pytest.mark.parametrize("turns", [0.3, 1.3])
def test_circle_stays_on_its_circle(ramp: float | None, turns: float) -> None:
    """Within 1e-9 of the radius, as stated, and in its plane to rounding."""
    centre, normal, r, period = np.array([0.4, -0.2, 0.5]), np.array([1.0, -2.0, 0.5]), 0.3, 2.0
    if ramp is not None and ramp > turns * period:
        with pytest.raises(ControlError, match="ramp_s must be at most"):
            circle(centre, r, normal, period, turns=turns, ramp_s=ramp)
        return
    reference = circle(centre, r, normal, period, turns=turns, ramp_s=ramp, start_s=0.7)
    path = reference.position
    p, _, V, _ = reference.at(np.linspace(path.breaks[0], path.breaks[-1], 20001))
    assert np.abs(np.linalg.norm(p - centre, axis=-1) / r - 1).max() < 1e-9
    np.testing.assert_allclose((p - centre) @ normal, 0, atol=1e-15)
    speed = np.linalg.norm(V[:, :3], axis=-1)
    np.testing.assert_allclose(speed.max(), 2 * np.pi * r / period, rtol=1e-6)
    ends = 2 * np.pi * r / period if ramp == 0 else 0
    np.testing.assert_allclose(speed[[0, -1]], ends, atol=1e-12)
    rise = min(0.5, turns * period) if ramp is None else ramp
    assert path.breaks[-1] - path.breaks[0] == pytest.approx(turns * period + rise, rel=1e-14)


def test_circle_turns_by_the_right_hand_from_where_it_is_told() -> None:
    """A quarter turn about z from x ends at y; the angle is exact, so roundings only."""
    quarter = circle([0.0, 0.0, 1.0], 2.0, [0, 0, 5.0], 4.0, turns=0.25, toward=[3.0, 0.0, 0.7], start_s=1.0)
    np.testing.assert_allclose(quarter.at(1.0)[0], [2, 0, 1], atol=1e-14)
    np.testing.assert_allclose(quarter.at(9.0)[0], [0, 2, 1], atol=1e-14)


def test_line_is_straight_and_its_turn_is_the_shortest() -> None:
    """p(t) and R(t) share one time law; Ṙ = ω̂ R by central differences, h = 1e-5 s: 1e-9."""
    R0 = rotation(np.array([0.6, 0.0, 0.8]), 0.9)
    reference = line([0.1, 0.2, 0.3], [0.5, -0.1, 0.9], 1.5, rotation=R0, rotation_end=rotation(AXIS, 2.5) @ R0)
    s, h = 0.37, 1e-5
    share = 10 * s**3 - 15 * s**4 + 6 * s**5
    p, R, V, V_rate = reference.at(1.5 * s)
    np.testing.assert_allclose(p, np.array([0.1, 0.2, 0.3]) + share * np.array([0.4, -0.3, 0.6]), atol=1e-15)
    np.testing.assert_allclose(R, rotation(AXIS, 2.5 * share) @ R0, atol=1e-14)
    (_, R_after, V_after, _), (_, R_before, V_before, _) = reference.at(1.5 * s + h), reference.at(1.5 * s - h)
    np.testing.assert_allclose(rotation_vector(R_after @ R_before.T) / (2 * h), V[3:], atol=1e-9)
    np.testing.assert_allclose((V_after - V_before) / (2 * h), V_rate, atol=1e-8)


def test_line_without_a_turn_holds_its_orientation_or_leaves_it_free() -> None:
    R = rotation(AXIS, 0.4)
    for reference in (line(Q0, Q1, 1.0, rotation=R), line(Q0, Q1, 1.0, rotation=R, rotation_end=R)):
        np.testing.assert_array_equal(reference.at(0.4)[1], R)
        assert not reference.at(0.4)[2][3:].any()
    assert line(Q0, Q1, 1.0).at(0.4)[1] is None


@pytest.mark.parametrize("angle", [0.0, 1e-160, 1e-9, 1e-3, 0.5, 1.6, 2.4, 3.1, np.pi - 1e-7])
def test_rotation_vector_is_the_angle_times_the_axis(angle: float) -> None:
    """Any angle up to half a turn keeps all digits: R itself is rounded, which moves φ by some 1e-16: 2e-15."""
    for axis in [AXIS, -AXIS, np.array([0.0, 1.0, 0.0]), np.array([-0.6, 1e-9, 0.8])]:
        np.testing.assert_allclose(rotation_vector(rotation(axis, angle)), angle * axis, atol=2e-15, rtol=1e-15)


def test_rotation_vector_of_half_a_turn_is_one_of_the_two() -> None:
    half = 2 * np.outer(AXIS, AXIS) - np.eye(3)
    np.testing.assert_allclose(rotation_vector(half) * np.sign(rotation_vector(half)[0]), np.pi * AXIS, rtol=1e-14)


def test_orientation_error_is_the_turn_in_base_axes_that_is_missing() -> None:
    R = rotation(np.array([0.6, 0.0, 0.8]), np.linspace(0.1, 3.0, 7))
    np.testing.assert_allclose(orientation_error(rotation(AXIS, 1.9) @ R, R), np.tile(1.9 * AXIS, (7, 1)), atol=1e-14)


def test_references_are_copied_and_frozen() -> None:
    q = Q0.copy()
    reference = hold(q)
    q[0] = 9.0
    assert reference.at(0.0)[0][0] == Q0[0]
    with pytest.raises(ValueError, match="read-only"):
        reference.coefficients[0] = 1.0
    reference.at(0.0)[0][0] = 4.0  # the answer is a fresh array
    assert reference.at(0.0)[0][0] == Q0[0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hold(0.3), r"q must have shape \(n,\), got \(\)"),
        (lambda: hold([]), "q must have shape"),
        (lambda: hold([0.1, np.nan]), "q must be finite"),
        (lambda: hold([[1.0], [1.0, 2.0]]), "q must be real numbers"),
        (lambda: quintic(Q0, Q1[:2], 1.0), r"q1 must have shape \(3,\), got \(2,\)"),
        (lambda: quintic(Q0, Q1, 0.0), "duration_s must be a positive number of seconds"),
        (lambda: quintic(Q0, Q1, 1.0, v0=[1.0]), r"v0 must be one number or of shape \(3,\)"),
        (lambda: via_points([0.0, 1.0], POINTS), r"times_s must have shape \(6,\)"),
        (lambda: via_points(TIMES[::-1], POINTS), "times_s must increase"),
        (lambda: via_points(TIMES, POINTS, kind="linear"), "known: cubic, quintic"),
        (lambda: via_points([0.0], POINTS[:1]), "at least 2 are needed"),
        (lambda: PiecewisePolynomial([0.0, 1.0], [1.0]), "coefficients must have shape"),
        (lambda: line(Q0, Q1, 1.0, rotation=np.ones((3, 3))), "rotation must be a rotation matrix"),
        (lambda: line(Q0, Q1, 1.0, rotation_end=np.eye(3)), "needs rotation, the orientation"),
        (lambda: circle(Q0, 1.0, [0, 0, 0], 1.0), "normal must not be zero"),
        (lambda: circle(Q0, 1.0, [0, 0, 1], 1.0, toward=[0, 0, 2]), "toward, in the plane of the circle, must not"),
        (lambda: circle(Q0, -1.0, [0, 0, 1], 1.0), "radius must be positive"),
        (lambda: CartesianReference(hold([1.0])), "position must be"),
        (lambda: CartesianReference(hold(Q0), angle=hold([1.0])), "needs an initial orientation, rotation"),
    ],
)
def test_references_without_meaning_are_refused(make, message: str) -> None:
    with pytest.raises(ControlError, match=message):
        make()


def test_steps_end_where_a_reference_jumps() -> None:
    """Constants one after the other have knots between them; one constant has none."""
    stairs = PiecewisePolynomial([0.0, 0.5, 1.0], [[[0.1, 0.2]], [[0.3, -0.2]]])
    np.testing.assert_array_equal(stairs.knots, [0.0, 0.5, 1.0])
    assert not len(hold([0.1, 0.2]).knots)


def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    w = np.array([2.0, 3.0])
    t = t[:, None]
    return np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)


@pytest.mark.parametrize(("given", "order"), [(1, 6), (2, 4), (3, 6)])
def test_samples_converge_to_the_motion(given: int, order: int) -> None:
    """With half the spacing the error falls by 2 to the order: splines and Hermite's polynomials of smooth motions."""
    x, errors = np.linspace(0.8, 1.2, 500), []  # where what the ends do to a spline has died away
    for m in (33, 65):
        t = np.linspace(0.0, 2.0, m)
        reference = Samples(t, *motion(t)[:given])
        np.testing.assert_allclose(reference.at(t)[0], motion(t)[0], atol=1e-14)
        errors.append(np.abs(reference.at(x)[0] - motion(x)[0]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("m", [2, 3, 4, 5, 6])
def test_few_samples_give_the_polynomial_of_least_degree(m: int) -> None:
    t, x = np.sort(np.random.default_rng(m).uniform(0, 2, m)), np.random.default_rng(0).normal(size=(m, 2))
    exact = np.stack([np.polyfit(t, column, m - 1) for column in x.T])
    between = np.linspace(t[0], t[-1], 50)
    for i in range(2):
        np.testing.assert_allclose(Samples(t, x).at(between)[0][:, i], np.polyval(exact[i], between), atol=1e-8)


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_a_spline_has_the_velocities_asked_for_at_its_ends(kind: str) -> None:
    reference = via_points(TIMES, POINTS, kind=kind, v0=[0.3, -0.4, 0.5], v1=-0.8)
    np.testing.assert_allclose(reference.at(TIMES)[0], POINTS, atol=1e-12)
    np.testing.assert_allclose(reference.at(TIMES[0])[1], [0.3, -0.4, 0.5], atol=1e-12)
    np.testing.assert_allclose(reference.at(TIMES[-1])[1], -0.8, atol=1e-12)


def test_the_estimate_along_dense_samples_is_honest() -> None:
    """Samples nearer than a step: each ends a step, no order is lost, and the error estimate covers the error.

    The truth is a run of a tenth of the step; 2 allows for what Richardson's first term leaves out.
    """
    arm, t = rd.load("planar_2r"), np.linspace(0, 0.3, 101)
    reference = Samples(t, *motion(t)[:2])
    controller = rd.control.ComputedTorque(arm, reference, kp=100.0, kd=20.0)
    setup = rd.Setup(
        rd.Plant(arm), motion(t)[0][0] + 0.1, duration_s=0.3, controller=controller, method="RK4", step_s=5e-3
    )
    run, truth = rd.simulate(setup), rd.simulate(setup, method="RK4", step_s=3e-4, estimate_error=False)
    error = np.abs(run.q[-1] - truth.q[-1]).max()
    assert run.error is not None and run.error.until_s == 0.3
    assert 0 < error < 2 * run.error.largest < 1e-4


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("pieces", [1, 7, 100])
def test_extremes_are_those_at_the_roots_of_the_derivative(pieces: int, order: int) -> None:
    """Eigenvalues of NumPy's companion matrices find a root to 1e-8 and, being extremes, values to its square."""
    rng = np.random.default_rng(pieces + order)
    breaks = np.cumsum(np.concatenate([[0.3], rng.uniform(0.1, 0.9, pieces)]))
    motion = PiecewisePolynomial(breaks, rng.normal(size=(pieces, 6, 3)))
    found = extreme_values(motion, order)
    for joint in range(3):
        values, times = [], []
        for start, h, table in zip(breaks, np.diff(breaks), motion.coefficients[..., joint], strict=False):
            p = polynomial.polyder(table, order)
            roots = polynomial.polyroots(polynomial.polyder(p))
            real = roots[np.abs(roots.imag) < 1e-9].real
            at = np.array([0.0, h, *real[(real > 0) & (real < h)]])
            values, times = [*values, *polynomial.polyval(at, p)], [*times, *(start + at)]
        low, high = int(np.argmin(values)), int(np.argmax(values))
        given = found.least[joint], found.greatest[joint], found.least_at_s[joint], found.greatest_at_s[joint]
        np.testing.assert_allclose(given, [values[low], values[high], times[low], times[high]], rtol=1e-7, atol=1e-9)


def test_joints_that_rest_have_their_position_as_both() -> None:
    found = extreme_values(PiecewisePolynomial([0.0, 1.0, 2.0], np.full((2, 1, 2), [[0.3, -0.4]])))
    np.testing.assert_array_equal(found.least, [0.3, -0.4])
    np.testing.assert_array_equal(found.greatest, [0.3, -0.4])
