"""Proven runs: the truth lies in the balls, two radii off it does not, and each way to fool a proof is closed."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from math import nextafter
from threading import Thread
from typing import Any

import casadi as ca
import numpy as np
import pytest
from flint import arb, arb_series, ctx

import robot_dyn as rd
from robot_dyn.codegen import program_of
from robot_dyn.control import polynomial
from robot_dyn.foundations import ProofError, QueryError, with_values
from robot_dyn.lagrange.exact import RoundedLiterals
from robot_dyn.model import with_exact_right_angles
from robot_dyn.tools.proof.enclosure import step as steps
from robot_dyn.tools.proof.enclosure import tube as tubes
from robot_dyn.tools.proof.enclosure.balls import Inverse, NotProvenError, between, exact, largest, matrix, upper
from robot_dyn.tools.proof.enclosure.linearised import on_a_set
from robot_dyn.tools.proof.enclosure.lohner import box
from robot_dyn.tools.proof.enclosure.polynomial import Polynomial, defect, taylor
from robot_dyn.tools.proof.motion import Motion
from robot_dyn.tools.proof.node import packed, unpacked
from robot_dyn.tools.proof.proven_run import _precision
from robot_dyn.tools.proof.tape import Tape, straight_line
from tests.accuracy.extrapolation import BITS, motion
from tests.long import long, stress

FINGERS = {"panda_finger_joint1": 0.0}
GENERAL_Q = ["0.31", "-0.42", "0.53", "-0.64", "0.75", "-0.86", "0.97"]
GENERAL_V = ["0.71", "1.12", "-0.43", "0.94", "-0.65", "1.36", "-0.57"]


def arm(name: str) -> rd.Robot:
    robot = rd.load(name)
    return robot.with_(lock=FINGERS) if name == "panda" else robot


def proof(robot: rd.Robot, until_s: float, bits: int = 53, effects: Any = (), **options: Any) -> rd.tools.proof.Proof:
    """From the general start of decimals."""
    n = robot.n
    start = {"q0": GENERAL_Q[:n], "v0": GENERAL_V[:n]}
    setup = rd.Setup(rd.Plant(robot, effects), np.zeros(n), controller=options.pop("controller", None))
    return rd.tools.proof.prove(setup, until_s, bits, **(start | options))


def truth(robot: rd.Robot, until_s: float, count: int, columns: int = 14, **more: Any) -> tuple[Any, Any, float]:
    plant = rd.Plant(rd.Lagrangian(robot, rd.accuracy.Ball(BITS)), more.pop("effects", ()))
    return motion(plant, GENERAL_Q[: robot.n], GENERAL_V[: robot.n], until_s, count, columns, **more)


def off(x: Any, by: np.ndarray, factor: float) -> np.ndarray:
    """Numbers that lie so many radii off."""
    with rd.accuracy.Ball(BITS).scope():
        return np.array([a + factor * arb(float(r)) for a, r in zip(x, by, strict=True)], dtype=object)


def holds(made: rd.tools.proof.Proof, t: float, q: Any, v: Any) -> None:
    """The truth is inside, and nothing two radii off."""
    assert made.proven, made.why_not
    assert made.contains(t, q, v)
    for sign in (-2.0, 2.0):
        assert not made.contains(t, off(q, made.radius_q, sign)) and not made.contains(
            t, q, off(v, made.radius_v, sign)
        )


@pytest.mark.parametrize(
    ("name", "until_s", "count"), [("pendulum", 0.25, 1), ("planar_2r", 0.0625, 1), *long([("ur5", 0.0625, 1)])]
)
def test_the_truth_is_inside_and_two_radii_off_is_outside(name: str, until_s: float, count: int) -> None:
    """By the closed form in balls of 240 bits, extrapolated: that shares neither tape nor method with the proof.

    At 53 bits the radii are tight: roundings of centres and of literals, some 1e-15 over the growth of errors.
    """
    q, v, doubt = truth(arm(name), until_s, count, 11)
    made = proof(arm(name), until_s)
    holds(made, until_s, q, v)
    assert doubt < 1e-3 * made.radius_q.min() and made.radius_q.max() < 1e-12
    assert proof(arm(name), until_s, 100).contains(until_s, made.at(until_s)[0]) is False  # narrower
    if name != "ur5":
        middle_s = 0.4 * until_s
        assert middle_s not in [node.t for node in made.nodes]  # there the tube counts
        assert made.contains(middle_s, *truth(arm(name), middle_s, count, 10)[:2])


@pytest.mark.parametrize(
    ("name", "until_s", "count"),
    [*long([("pendulum", 1.0, 6)]), *stress([("planar_2r", 1.0, 30), ("ur5", 0.1, 3), ("panda", 0.05, 2)])],
)
def test_sixty_digits_of_another_formulation_are_inside_at_100_bits(name: str, until_s: float, count: int) -> None:
    robot = arm(name)
    q, v, doubt = truth(robot, until_s, count, 30)
    made = proof(robot, until_s, 100)
    assert doubt < 1e-30 and made.radius_q.max() < 1e-16
    holds(made, until_s, q, v)
    holds(proof(robot, until_s, 53), until_s, q, v)


@pytest.mark.parametrize("name", ["pendulum", "cart_pole", "planar_2r", "ur5", "mimic_chain", "panda"])
def test_the_tape_is_the_closed_form_in_balls_at_random_states(name: str) -> None:
    """Literals are balls of 400 bits: at 300 bits what a float64 rounds would show from the 16th digit on."""
    robot, bits = arm(name), 300
    tape, rng = Tape(Motion(robot, (), None)), np.random.default_rng(1)
    own, rounded = (
        rd.Lagrangian(robot, rd.accuracy.Ball(bits)),
        rd.Lagrangian(robot, RoundedLiterals(rd.accuracy.Ball(bits))),
    )
    for _ in range(3):
        q, v, a = rng.uniform(-2, 2, (3, robot.n))
        with rd.accuracy.Ball(bits).scope():
            made = tape.residual(arb(0), *([arb(x) for x in each.tolist()] for each in (q, v, a)))
            mass = tape.mass([arb(x) for x in q.tolist()])
        exactly, off_by_rounding = own.inverse_dynamics(q, v, a), rounded.inverse_dynamics(q, v, a)
        assert all(x.overlaps(y) and x.rad() < 1e-60 for x, y in zip(made, exactly, strict=True))
        assert all(x.overlaps(y) for x, y in zip(mass, own.M(q).flat, strict=True))
        if name in ("ur5", "panda"):  # the others' decimals are few
            assert not all(x.overlaps(y) for x, y in zip(made, off_by_rounding, strict=True))


@pytest.mark.parametrize("name", ["planar_2r", "ur5", "panda"])
def test_derivatives_of_the_tape_hold_differences_of_the_closed_form(name: str) -> None:
    """CasADi's differentiation, held to central differences of forward dynamics of width 1e-40, right to 1e-75.

    On a set of width 1e-3, at points anywhere in it: that is what the mean value theorem needs.
    """
    robot, n = arm(name), arm(name).n
    tape, own, rng = (
        Tape(Motion(robot, (), None)),
        rd.Lagrangian(robot, rd.accuracy.Ball(400)),
        np.random.default_rng(2),
    )
    q, v = rng.uniform(-1, 1, (2, n))
    a = own.forward_dynamics(q, v, 0 * q)
    with rd.accuracy.Ball(100).scope():
        x = [[arb(y) for y in known.tolist()] for known in (q, v)]
        inverse, width = Inverse.from_matrix(tape.mass(x[0])), 2.0**-10
        zero = [arb(0)] * n
        sets = on_a_set(
            tape, inverse, arb(0), (*x, [y.mid() for y in a]), [arb(0, width)] * 2 * n, [arb(0, 1e6)] * n, zero
        )
        about_a = tape.residual(arb(0), *x, [y.mid() for y in a])
        assert all(upper(r) < 1e-20 for r in about_a)
    for _ in range(3):
        with rd.accuracy.Ball(400).scope():
            y = np.array([arb(z) for z in np.concatenate([q, v]) + rng.uniform(-width, width, 2 * n)], dtype=object)
            for j in range(2 * n):
                ahead, behind = y.copy(), y.copy()
                ahead[j], behind[j] = y[j] + arb("1e-40"), y[j] - arb("1e-40")
                high, low = (own.forward_dynamics(z[:n], z[n:], 0 * q) for z in (ahead, behind))
                slope = [((b - c) / arb("2e-40")).mid() for b, c in zip(high, low, strict=True)]
                assert all(sets[i, j].contains(slope[i]) for i in range(n))


def test_a_theorem_says_which_numbers_it_is_about() -> None:
    """The decimal 0.31 and the float nearest to it, gravity and its neighbour, literal and completed right angles.

    At 100 bits each of two has its own balls, and they do not overlap.
    """
    robot = arm("ur5")
    decimals = proof(robot, 0.01, 100)
    floats = proof(robot, 0.01, 100, q0=[float(x) for x in GENERAL_Q[:6]], v0=[float(x) for x in GENERAL_V[:6]])
    g = robot.edits.gravity
    heavier = proof(robot.with_(gravity=(0.0, 0.0, nextafter(g[2], -10))), 0.01, 100)
    turned = proof(with_exact_right_angles(robot)[0], 0.01, 100)
    assert with_exact_right_angles(robot)[1]
    for other in (floats, heavier, turned):
        pairs = zip(decimals.at(0.01)[0], other.at(0.01)[0], strict=True)
        assert not all(x.overlaps(y) for x, y in pairs)
    assert "decimals of a text exactly" in decimals.summary and "as float64" in floats.summary
    assert "gravity (0.0, 0.0, -9.80665) m/s² as float64" in decimals.summary


def test_a_polynomial_need_not_be_right() -> None:
    """Spoilt coefficients make a larger defect, and the truth stays in the balls."""
    robot, h = arm("planar_2r"), Fraction(1, 2**8)
    tape, plant = Tape(Motion(robot, (), None)), rd.Plant(rd.Lagrangian(robot, rd.accuracy.Ball(BITS)))
    start_q, start_v = ["0.5", "-0.25"], ["0.75", "1.5"]
    q, v, _ = motion(plant, start_q, start_v, float(h), 1, 12)
    sizes = []
    with _precision(60):
        centre = [tuple(arb(x) for x in known) for known in (start_q, start_v)]
        start = steps.State(Fraction(0), *centre, box([arb(0)] * 4))
        inverse = Inverse.from_matrix(tape.mass(start.q))
        p = taylor(tape, arb(0), *centre, inverse, 10)
        weights, _, rate = steps._weights(tape, arb(0), p, inverse, float(h), [arb(0)] * 4, 1e-16)
        for spoilt in (0.0, 1e-9, 1e-6, 1e-3):
            c = [list(each) for each in p.q]
            c[1][2] = (c[1][2] + arb(spoilt)).mid()
            end = steps._step(
                tape, arb(0), start, Polynomial(tuple(map(tuple, c))), inverse, weights, rate, h, steps.Effort(10, 1.0)
            ).end  # fmt: skip
            bounds = end.error.bounds
            for x, y, bound in zip([*q, *v], [*end.q, *end.v], bounds, strict=True):
                assert upper(x - y) < bound
            sizes.append(float(largest(bounds)))
    assert sizes[0] < 1e-14 and all(low < high for low, high in itertools.pairwise(sizes))


def test_nothing_that_is_not_finite_passes_as_a_bound() -> None:
    for x in (arb("nan"), arb(1) / arb(0, 1), arb("inf")):
        with pytest.raises(NotProvenError):
            upper(x)
        with pytest.raises(NotProvenError):
            largest([arb(1), x, arb(2)])
    inverse = Inverse(matrix([[arb(1), arb(0)], [arb(0), arb(1)]]))
    for M in ([[arb(0, 1), arb(0)], [arb(0), arb(1)]], [[arb("nan"), arb(0)], [arb(0), arb(1)]]):
        with pytest.raises(NotProvenError):
            inverse.contraction(matrix(M))
    with pytest.raises(NotProvenError, match="singular"):
        Inverse.from_matrix([arb(1), arb(2), arb(2), arb(4)])


def test_a_velocity_beyond_a_float64_proves_nothing_and_warns_of_nothing() -> None:
    setup = rd.Setup(rd.Plant(arm("cart_pole")), [0.3, -0.4], duration_s=0.001)
    made = rd.tools.proof.prove(setup, v0=[0.7, 10**390], budget_s=1.0)
    assert made.until_s == 0.0
    assert made.why_not == "the Jacobian is not finite"


def test_solutions_of_all_matrices_of_balls_are_bounded() -> None:
    """M⁻¹ x and M⁻¹ G of random matrices in the balls, with right sides of both signs."""
    rng, n, width = np.random.default_rng(3), 4, 0.01
    F = rng.normal(size=(n, n))
    middle = F @ F.T + np.eye(n)
    with rd.accuracy.Ball(100).scope():
        M = matrix([[arb(x, width) for x in row] for row in middle.tolist()])
        inverse = Inverse.from_matrix([M[i, j] for i in range(n) for j in range(n)])
        more, r = inverse.contraction(M), [arb(x) for x in (1.0, 2.0, 0.5, 3.0)]
        bounds, wide = inverse.bound(more, r), inverse.solve(more, matrix([[x] for x in r]))
        reached = 0.0
        for _ in range(200):
            one = matrix([[arb(x) for x in row] for row in (middle + rng.uniform(-width, width, (n, n))).tolist()])
            signs = rng.choice([-1.0, 1.0], n).tolist()
            x = one.solve(matrix([[s * b] for s, b in zip(signs, r, strict=True)]))
            assert all(upper(x[i, 0]) < bounds[i] for i in range(n))
            reached = max(reached, *(float(upper(x[i, 0]) / bounds[i]) for i in range(n)))
            assert all(wide[i, 0].overlaps(y) for i, y in enumerate(one.solve(matrix([[b] for b in r])).entries()))
    assert reached > 0.8


def test_a_tube_that_the_motion_may_leave_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is no wider than the error at its start: e^{hL} > 1."""
    monkeypatch.setattr(tubes, "_WIDER", 1)
    made = proof(arm("planar_2r"), 0.1)
    assert made.until_s == 0 and made.why_not == "the motion may leave the tube around its polynomial"


def test_a_constant_that_was_rounded_is_refused() -> None:
    x = ca.SX.sym("x")
    for function in (0.1 * x, x**0.5 + x**3.5, ca.fmax(x, 0), ca.fabs(x)):
        with pytest.raises(ProofError):
            straight_line(program_of(ca.Function("f", [x], [function])))
    with rd.accuracy.Ball(60).scope():
        (y,) = straight_line(program_of(ca.Function("f", [x], [ca.tanh(x)])))([arb_series([0.5, 1], 3)])
        assert y[0].overlaps(arb(0.5).tanh()) and y[1].overlaps(1 - arb(0.5).tanh() ** 2)


def test_a_guess_of_the_accelerations_that_is_too_small_is_found_out() -> None:
    tape = Tape(Motion(arm("planar_2r"), (), None))
    with _precision(60):
        q = [arb(0), arb(1)]
        inverse, zero = Inverse.from_matrix(tape.mass(q)), [arb(0)] * 2
        a = inverse.A * matrix([[-x.mid()] for x in tape.residual(arb(0), q, q, zero)])
        given = (tape, inverse, arb(0), (q, q, [a[0, 0].mid(), a[1, 0].mid()]), [arb(0, 0.001)] * 4)
        on_a_set(*given, [arb(0, 1.0)] * 2, zero)
        with pytest.raises(NotProvenError, match="accelerations"):
            on_a_set(*given, [arb(0, 1e-6)] * 2, zero)


def test_the_defect_bounds_the_residual_anywhere_on_a_step() -> None:
    tape = Tape(Motion(arm("ur5"), (), None))
    with _precision(100):
        q, v = ([arb(x).mid() for x in known[:6]] for known in (GENERAL_Q, GENERAL_V))
        inverse, h = Inverse.from_matrix(tape.mass(q)), arb(2) ** -7
        p = taylor(tape, arb(0), q, v, inverse, 8)
        T = between(arb(0), h)
        of = defect(tape, arb(0), p, p.about(T), inverse, h, T, 8)
        for part in np.linspace(0, 1, 23).tolist():
            rho = tape.residual(h * part, *p.at(h * part))
            assert all(upper(x) < bound for x, bound in zip(rho, of.rho, strict=True))
        end = max(float(upper(x) / bound) for x, bound in zip(rho, of.rho, strict=True))
    assert end > 0.01  # and is not far from it


def test_precision_and_length_of_series_are_left_as_they_were() -> None:
    before = ctx.prec, ctx.cap
    proof(arm("pendulum"), 0.1, 77)
    assert (ctx.prec, ctx.cap) == before


def test_proofs_in_several_threads_are_those_of_one() -> None:
    made: dict[int, rd.tools.proof.Proof] = {}

    def work(bits: int) -> None:
        made[bits] = proof(arm("planar_2r"), 0.05, bits)

    threads = [Thread(target=work, args=(bits,)) for bits in (53, 80, 120)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    for bits, each in made.items():
        assert each.nodes == proof(arm("planar_2r"), 0.05, bits).nodes


def test_balls_are_kept_exactly() -> None:
    for bits in (53, 200):
        with rd.accuracy.Ball(bits).scope():
            for x in (arb("0.1"), arb(0), arb("-3e-40") ** 5, arb(2) ** 70, arb(1, 1e-30), arb("0.1").sqrt()):
                again = unpacked(packed(x))
                assert again.mid() == x.mid() and x.rad() <= again.rad() <= x.rad() * (1 + 1e-8)
            assert exact(Fraction(3, 2**60)) * 2**60 == 3


@pytest.mark.parametrize(
    ("q0", "v0"),
    [(GENERAL_Q[:2], GENERAL_V[:2]), (["0", "0"], ["0", "0"])],
    ids=["general", "level and at rest, where the Jacobian is 0"],
)
def test_a_box_of_starts_holds_the_motion_from_its_corners(q0: list[str], v0: list[str]) -> None:
    robot, wide, h = arm("planar_2r"), 1e-4, 0.1
    made = proof(robot, h, q0=q0, v0=v0, width_q=wide, width_v=wide)
    assert made.proven and wide < made.radius_q.max() < 3 * wide
    plant = rd.Plant(rd.Lagrangian(robot, rd.accuracy.Ball(BITS)))
    reach = 0.0
    for signs in ((1, 1, 1, 1), (1, -1, 1, -1), (-1, 1, -1, 1), (-1, -1, 1, 1)):
        start = np.array([*map(float, q0), *map(float, v0)]) + 0.999 * wide * np.array(signs)
        q, v, _ = motion(plant, start[:2].tolist(), start[2:].tolist(), h, 1, 10)
        assert made.contains(h, q, v)
        reach = max(reach, *(abs(float(x - y.mid())) for x, y in zip(q, made.at(h)[0], strict=True)))
    assert reach > 0.5 * made.radius_q.max()  # corners come near the end of the ball


def test_what_is_not_proven_is_said_and_no_wide_ball_given() -> None:
    made = proof(arm("planar_2r"), 1.0, width_q=0.003)
    assert not made.proven and 0 < made.until_s < 1.0 and made.why_not
    assert f"Not proven beyond t = {made.until_s!r} s, because {made.why_not}." in made.summary
    assert made.radius_q.max() < 1.0
    with pytest.raises(QueryError, match="the end of the proof"):
        made.at(1.0)
    late = proof(arm("ur5"), 10.0, budget_s=0.5)
    assert not late.proven and late.why_not == "the budget of 0.5 s is used up" and late.until_s > 0


def test_few_bits_are_enough_for_a_theorem_of_few_digits() -> None:
    """Roundings of centres are part of the balls: at 40 bits they are most of them."""
    made = proof(arm("planar_2r"), 0.125, 40)
    holds(made, 0.125, *truth(arm("planar_2r"), 0.125, 1, 10)[:2])


def test_steps_end_at_floats_and_cover_the_time() -> None:
    made = proof(arm("planar_2r"), 0.1)
    t = [node.t for node in made.nodes]
    assert t[0] == 0 and t[-1] == 0.1 and all(a < b for a, b in itertools.pairwise(t))
    assert all(d & (d - 1) == 0 for d in (Fraction(x).denominator for x in t))


def test_a_run_is_confirmed_to_the_digits_that_it_has() -> None:
    robot, q, v = arm("planar_2r"), np.array([0.31, -0.42]), np.array([0.71, 1.12])
    setup = rd.Setup(rd.Plant(robot), q, v, duration_s=0.1, engine="interpreted")
    made, run = rd.tools.proof.prove(setup), rd.simulate(setup)
    digits = run.proven_digits(made)
    assert 9 < digits < 16
    for error in (1e-3, 1e-6):
        spoilt = run.q.copy()
        spoilt[len(spoilt) // 2, 1] += error
        assert replace(run, q=spoilt).proven_digits(made) == pytest.approx(-np.log10(error), abs=1e-3)
    bad = run.q.copy()
    bad[-1, 0] = np.nan
    with pytest.raises(QueryError, match="finite"):
        replace(run, q=bad).proven_digits(made)
    elsewhere = rd.simulate(replace(setup, q0=q + 1e-12))
    with pytest.raises(QueryError, match="starts from another state"):
        elsewhere.proven_digits(made)
    with pytest.raises(QueryError, match="has the joints"):
        rd.simulate(rd.load("pendulum"), q0=[0.1], duration_s=0.01).proven_digits(made)
    heavier = rd.simulate(replace(setup, plant=rd.Plant(robot.with_(payload=rd.Payload("tip", 0.01)))))
    assert heavier.proven_digits(made) < 5


class Own(rd.effects.Dissipative):
    def torque(self, dynamics: Any, t: Any, q: Any, v: Any) -> Any:
        return -v * abs(v)


def refused() -> list[tuple[str, dict[str, Any]]]:
    n, plan = 2, rd.control.hold([0.1, 0.2])
    pd, robot = rd.control.PD(plan, kp=9.0, kd=1.0, period_s=0.01), rd.load("planar_2r")
    payload = rd.effects.CarriedPayload(rd.Payload("tip", 1.0), 0.01, 0.02)
    return [
        ("dry_friction", {"effects": [rd.effects.DryFriction([1.0] * n)]}),
        ("rigid_stops", {"effects": [rd.effects.RigidStops(-1.0, 1.0)]}),
        ("joint_stops", {"effects": rd.effects.joint_stops(-1.0, 1.0)}),
        ("effort_limit", {"effects": [rd.effects.EffortLimit(9.0)]}),
        ("actuator_lag", {"effects": [rd.effects.ActuatorLag(0.1)]}),
        ("lugre_friction", {"effects": [rd.effects.LuGreFriction(9.0, 1.0, 1.0, 1.0, 2.0, 0.1)]}),
        ("own", {"effects": [Own()]}),
        ("carried_payload", {"effects": [payload]}),
        ("PD is sampled", {"controller": pd}),
        ("Loop", {"controller": rd.control.Loop(pd)}),
        ("PID", {"controller": rd.control.PID(plan, kp=9.0, ki=1.0, kd=1.0, effort_limit=5.0)}),
        ("torque", {"controller": lambda t, q, v: -q}),
        (
            "Samples",
            {
                "controller": rd.control.PD(rd.control.Samples([0.0, 1.0], np.ones((2, 2))), kp=9.0, kd=1.0),
                "robot": robot,
            },
        ),
    ]


@pytest.mark.parametrize(("name", "parts"), refused()[:-1], ids=lambda x: x if isinstance(x, str) else "")
def test_what_switches_is_refused_by_name(name: str, parts: dict[str, Any]) -> None:
    with pytest.raises(ProofError, match=name if name != "torque" else "controller"):
        proof(rd.load("planar_2r"), 0.1, **parts)


@pytest.mark.parametrize(
    "wrong",
    [
        {"q0": ["0.1", "nan"]}, {"q0": ["0.1"]}, {"q0": "0.1"}, {"v0": [1j, 0]}, {"q0": [True, 0]},
        {"q0": ["1e999", "0"]}, {"q0": [[0.1], [0.2]]}, {"width_q": -1.0}, {"budget_s": 0.0},
        {"bits": 20}, {"until_s": 1e9},
    ],
)  # fmt: skip
def test_starts_that_are_no_numbers_are_refused(wrong: dict[str, Any]) -> None:
    setup = rd.Setup(rd.Plant(rd.load("planar_2r")), [0.1, 0.2])
    with pytest.raises(QueryError):
        rd.tools.proof.prove(setup, **wrong)


class ExactReference:
    """A polynomial of a reference in balls."""

    def __init__(self, reference: rd.control.PiecewisePolynomial) -> None:
        self.start, self.table = float(reference.breaks[0]), reference.coefficients[0]

    def at(self, t: Any) -> Any:
        return polynomial(self.table, np.array([t - arb(self.start)], dtype=object))


PLAN = rd.control.quintic([0.3, -0.4], [0.8, 0.5], 0.5)
ACTING: dict[str, Any] = {
    "payload": ("planar_2r", [rd.effects.CarriedPayload(rd.Payload("tip", 0.75, (0.1, 0.02, 0.03)))], None),
    "viscous": ("planar_2r", [rd.effects.ViscousFriction([0.5, 0.3])], None),
    "spring": ("planar_2r", [rd.effects.Spring([10.0, 3.0], 0.2)], None),
    "tanh": ("planar_2r", [rd.effects.RegularisedCoulombFriction([1.0, 0.5], 0.5)], None),
    "PD": ("planar_2r", (), lambda model: rd.control.PD(PLAN, kp=100.0, kd=[10.0, 4.0])),
    "PDGravity": ("planar_2r", (), lambda model: rd.control.PDGravity(model, PLAN, kp=100.0, kd=[10.0, 4.0])),
    "FeedForward": ("planar_2r", (), lambda model: rd.control.FeedForward(model, PLAN, kp=100.0, kd=[10.0, 4.0])),
    "ComputedTorque": ("planar_2r", (), lambda model: rd.control.ComputedTorque(model, PLAN, kp=100.0, kd=20.0)),
    "prismatic": ("cart_pole", (), None),
    "mimic": ("mimic_chain", (), None),
}


@pytest.mark.parametrize("name", ACTING)
def test_the_truth_is_inside_with_what_acts_on_the_arm(name: str) -> None:
    """Each beside the library's own effects and controllers on the closed form; the controller's model is wrong."""
    known, effects, control = ACTING[name]
    robot, until_s, n = arm(known), 0.015625, arm(known).n
    torque, controller = None, None
    if name == "payload":
        exact_plant = rd.Plant(rd.Lagrangian(robot.with_(payload=effects[0].payload), rd.accuracy.Ball(BITS)))
    else:
        exact_plant = rd.Plant(rd.Lagrangian(robot, rd.accuracy.Ball(BITS)), effects)
    if control is not None:
        wrong = robot.with_(mass_scale=0.875)
        controller = control(wrong)
        own = with_values(control(rd.Lagrangian(wrong, rd.accuracy.Ball(BITS))), {"reference": ExactReference(PLAN)})
        torque = lambda t, q, v: own.torque(t, q, v, q[:0])  # noqa: E731
    q, v, doubt = motion(exact_plant, GENERAL_Q[:n], GENERAL_V[:n], until_s, 1, 8, torque)
    made = proof(robot, until_s, 53, effects, controller=controller)
    holds(made, until_s, q, v)
    assert doubt < 0.1 * made.radius_q.min() and made.radius_q.max() < 1e-12
    if effects or control:
        assert not proof(robot, until_s, 53).contains(until_s, q, v)  # it does act


def test_a_reference_may_pass_from_one_polynomial_to_another() -> None:
    """Steps end at its breaks, and behind the last one it rests."""
    plan = rd.control.quintic([0.31, -0.42], [0.5, -0.5], 0.05, start_s=0.01)
    robot = arm("planar_2r")
    setup = rd.Setup(rd.Plant(robot), [0.31, -0.42], duration_s=0.08, controller=rd.control.PD(plan, kp=100.0, kd=10.0))
    made, run = (
        rd.tools.proof.prove(setup),
        rd.simulate(replace(setup, method=rd.integrate.Adaptive("DOP853", 1e-13, 1e-14))),
    )
    assert made.proven and {0.01, float(plan.end_s), 0.08} <= {node.t for node in made.nodes}
    assert run.proven_digits(made) > 11


@pytest.mark.parametrize(
    ("name", "count"),
    [*long([("pendulum", 8), ("planar_2r", 4)]), *stress([("planar_2r", 8), ("ur5", 8), ("panda", 6)])],
)
def test_random_starts_are_proven_to_twelve_digits(name: str, count: int) -> None:
    """To 1 s, and 0.1 s of the six and seven joints; all of these 30 were."""
    robot, rng, until_s = arm(name), np.random.default_rng(20261122), 1.0 if arm(name).n < 3 else 0.1
    failed = 0
    for _ in range(count):
        q, v = rng.uniform(-2, 2, (2, robot.n))
        made = rd.tools.proof.prove(rd.Setup(rd.Plant(robot), q, v), until_s, budget_s=600.0)
        failed += not (made.proven and made.radius_q.max() <= 1e-12)
    assert not failed


@pytest.mark.parametrize(
    "start",
    [{}, {"q0": [str(np.pi / 2)] * 6, "v0": ["0"] * 6}],
    ids=["general", "at rest at right angles, where parts of the Jacobian are 0"],
)
def test_a_small_box_of_a_six_axis_arm(start: dict[str, Any]) -> None:
    made = proof(arm("ur5"), 0.1, 100, width_q=1e-6, **start)
    assert made.proven and 1e-6 < made.radius_q.max() < 2e-6
