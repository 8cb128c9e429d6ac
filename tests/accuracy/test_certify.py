"""Certificates: digits against independent counts, the search for worst states, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import log10
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.accuracy import Certificate, DigitCount, Implementation, implementations, random_states
from robot_dyn.accuracy.certificate.diagram import draw
from robot_dyn.accuracy.correct_digits import QUANTITIES
from robot_dyn.lagrange import articulated_body
from robot_dyn.queries import FORWARD_DYNAMICS, INVERSE_DYNAMICS, C, M, N
from tests.chains import body, chain
from tests.long import long, third

GIVEN = {"q": [0.3, -1.1], "v": [0.5, 0.4], "a": [0.2, 0.9], "tau": [1.0, -2.0]}
QUICK = {"samples": 100, "repeats": 1}


@pytest.fixture(scope="module")
def made() -> Certificate:
    return rd.accuracy.certify(rd.load("planar_2r"), **GIVEN, **QUICK)


def implementation(robot: rd.Robot, name: str) -> Implementation:
    return next(each for each in implementations(robot)[0] if each.name == name)


def test_each_implementation_has_the_digits_of_its_numbers(made: Certificate) -> None:
    """Rounding is 6e-8, 1.1e-16 and 5e-20; what two joints compute takes less than 3 digits."""
    whole = {"float32": 7.2, "longdouble": 19.3}
    for each in made.digits:
        most = (
            20.0
            if each.implementation.startswith("balls")
            else whole.get(each.implementation.removeprefix("Lagrangian, "), 15.95)
        )
        assert most - 3 < each.searched <= each.random <= each.typical <= min(most + 1.5, 20), each
        assert each.at_state is not None and most - 2 < each.at_state <= 20
    assert {each.quantity for each in made.digits} == QUANTITIES.keys()
    assert {each.implementation for each in made.digits} == {
        "Pinocchio", "Lagrangian, float32", "Lagrangian, float64", "Lagrangian, longdouble", "articulated body",
        "machine code", "balls, 128 bits",
    }  # fmt: skip


@pytest.mark.parametrize("quantity", [M, FORWARD_DYNAMICS], ids=lambda each: each.name)
def test_digits_are_those_of_the_state_that_is_told(made: Certificate, quantity) -> None:
    """Of M and forward dynamics the scale is that of `rd.accuracy.digits`."""
    robot, found = rd.load("planar_2r"), made.digits_of(quantity.name, "Pinocchio")
    assert (
        rd.accuracy.digits(robot, quantity.name, *(found.state[name] for name in quantity.arguments)) == found.searched
    )
    assert rd.accuracy.digits(robot, quantity.name, *(GIVEN[name] for name in quantity.arguments)) == found.at_state


def test_digits_of_articulated_bodies_follow_from_400_bits(made: Certificate) -> None:
    """By the same recursion in balls of 400 bits, in the norm of M and on the scale, written anew."""
    found, own = made.digits_of("forward_dynamics", "articulated body"), rd.Lagrangian(rd.load("planar_2r"))
    q, v, tau = (np.array(found.state[name]) for name in ("q", "v", "tau"))
    fine = rd.Lagrangian(own.robot, rd.accuracy.Ball(400))
    with fine.arithmetic.scope():
        exact = articulated_body(fine.linkage, *(fine.arithmetic.array(x) for x in (q, v, tau)))
        computed = articulated_body(own.linkage, *(np.tile(x, (8, 1)) for x in (q, v, tau)))[0]
        error = rd.accuracy.midpoint(fine.arithmetic.array(computed) - exact)
    inertia = own.M(q)
    parts = [np.linalg.solve(inertia, x) for x in (tau, own.coriolis_torque(q, v), own.N(q))]
    norm = [np.sqrt(x @ inertia @ x) for x in (error, *parts)]
    assert found.searched == pytest.approx(-log10(norm[0] / sum(norm[1:])), abs=1e-6)


def test_decimals_of_the_file_are_held_to_their_float64() -> None:
    """M of the pendulum is the decimal 0.083333333333333333 and 0.25, at every state."""
    found = rd.accuracy.certify(rd.load("pendulum"), **QUICK)
    literal = Fraction("0.083333333333333333")
    error = abs(Fraction(float(literal)) - literal) / (literal + Fraction("0.25"))
    assert found.decimals["M"] == pytest.approx(-log10(error), abs=1e-6)
    assert found.decimals["C"] == 20, "zero, at every state and of any numbers"


@pytest.mark.parametrize(
    ("quantity", "name"),
    [
        (C, "planar_2r"),
        *third([(M, "skew_tree"), *((each, "planar_2r") for each in (N, INVERSE_DYNAMICS, FORWARD_DYNAMICS))]),
    ],
    ids=lambda each: getattr(each, "name", each),
)
def test_the_search_finds_worse_than_ten_thousand_random_states(quantity, name: str) -> None:
    """Of two seeds: those that it began with, and others. In M of planar_2r the worst entry is one that is constant."""
    robot, rng = rd.load(name), np.random.default_rng(1)
    digit_count = DigitCount(robot, random_states(robot, 10_000, rng), None, rng)
    found = digit_count.count(implementation(robot, "machine code"), quantity)
    others = DigitCount(robot, random_states(robot, 10_000, np.random.default_rng(2)), None, rng)
    errors = others._errors(implementation(robot, "machine code"), quantity, others.states)
    assert found.samples == 10_000
    assert found.searched < found.random < found.typical
    assert found.searched < -log10(np.nanmax(errors))


@dataclass(frozen=True)
class Moved:
    """Pinocchio with one entry off by a part of its scale."""

    robot: Any
    by: float

    @property
    def nan_rows(self) -> Moved:
        return Moved(self.robot.nan_rows, self.by)

    def M(self, q):
        answer = np.array(self.robot.M(q))
        answer[..., 1, 0] += self.by * np.sqrt(answer[..., 0, 0] * answer[..., 1, 1])
        return answer


@pytest.mark.parametrize("digits", [4, 9, 13])
def test_an_implementation_with_a_wrong_entry_has_the_digits_before_it(digits: int) -> None:
    robot, rng = rd.load("planar_2r"), np.random.default_rng(1)
    digit_count = DigitCount(robot, random_states(robot, 100, rng), None, rng)
    found = digit_count.count(Implementation("moved", robot, Moved(robot, 10.0**-digits), (M,)), M)
    assert found.typical == pytest.approx(digits, abs=0.01)
    assert found.searched == pytest.approx(digits, abs=0.02)


def test_condition_of_two_links_is_largest_where_they_are_in_line(made: Certificate) -> None:
    """κ = (1 + ρ) / (1 − ρ) with ρ = M₁₂ / √(M₁₁ M₂₂), which is largest at q₂ = 0."""
    inertia = rd.load("planar_2r").M([0.0, 0.0])
    rho = inertia[0, 1] / np.sqrt(inertia[0, 0] * inertia[1, 1])
    of = made.condition
    assert of.typical < of.random < of.searched == pytest.approx((1 + rho) / (1 - rho), rel=1e-6)
    assert of.q[1] == pytest.approx(0, abs=1e-3)
    assert of.digits == log10(of.searched)


def test_machine_code_is_judged_by_its_right_angles_and_the_file_by_its_own() -> None:
    """UR5 states 1.57079632679: 5e-12 of a right angle."""
    robot, rng = rd.load("ur5"), np.random.default_rng(0)
    digit_count = DigitCount(robot, random_states(robot, 100, rng), None, rng)
    assert digit_count.count(implementation(robot, "machine code"), M).searched > 14
    assert 10 < digit_count.right_angles["M"] < 12


def test_a_joint_without_inertia_is_named_and_the_rest_is_counted() -> None:
    with pytest.warns(rd.ModelWarning):
        robot = rd.load("massless_tip")
    made = rd.accuracy.certify(robot, **QUICK)
    assert made.left_out == ("forward dynamics: joint 'pointer_joint' carries no inertia",)
    assert made.quantities == ("M", "C", "N", "inverse_dynamics")
    assert made.condition.searched == np.inf
    assert made.lost == {}


@pytest.mark.parametrize(
    ("name", "left_out"),
    [("mimic_chain", ("articulated bodies: coupled joints are not supported",)), *long([("cart_pole", ())])],
)
def test_coupled_joints_and_joints_that_slide_are_counted(name: str, left_out: tuple[str, ...]) -> None:
    found = rd.accuracy.certify(rd.load(name), **QUICK)
    assert found.left_out == left_out
    assert min(each.searched for each in found.digits if "float32" not in each.implementation) > 12


def test_the_same_seed_counts_the_same(made: Certificate) -> None:
    again = rd.accuracy.certify(rd.load("planar_2r"), **GIVEN, **QUICK)
    other = rd.accuracy.certify(rd.load("planar_2r"), seed=1, **QUICK)
    assert [each.searched for each in again.digits] == [each.searched for each in made.digits]
    assert [each.searched for each in other.digits] != [each.searched for each in made.digits]


def test_ctrl_c_keeps_what_was_counted() -> None:
    def stop(part: float, what: str) -> None:
        if what.startswith("C"):
            raise KeyboardInterrupt

    made = rd.accuracy.certify(rd.load("pendulum"), on_progress=stop, **QUICK)
    assert made.interrupted and made.quantities == ("M",)
    assert made.left_out == ("the remaining parts, because of an interruption",)


def test_what_was_not_counted_is_told(made: Certificate) -> None:
    with pytest.raises(rd.RobotDynError, match=r"^no implementation 'pinochio'; nearest: Pinocchio$"):
        made.digits_of("M", "pinochio")
    with pytest.raises(rd.RobotDynError, match=r"^'articulated body' does not compute M; see .*"):
        made.digits_of("M", "articulated body")
    with pytest.raises(rd.RobotDynError, match=r"q must have shape \(2,\), got \(1, 2\)"):
        rd.accuracy.certify(rd.load("planar_2r"), q=[[0.1, 0.2]])


def test_rows_hold_what_was_counted(made: Certificate) -> None:
    rows = list(made.rows)
    assert len(rows) == len(made.digits) + len(made.decimals)
    assert [row["searched"] for row in rows[: len(made.digits)]] == [each.searched for each in made.digits]


def test_the_diagram_has_a_panel_for_each_quantity(made: Certificate) -> None:
    figure = draw(made)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["M", "C", "N", "inverse dynamics", "forward dynamics"]
    for axes, quantity in zip(figure.axes, made.quantities, strict=True):
        drawn = {(x, y) for line in axes.lines for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)}
        for each in made.digits:
            if each.quantity == quantity:
                assert {(1e6 * each.time_s, y) for y in (each.typical, each.random, each.searched)} <= drawn


def test_articulated_bodies_answer_a_batch_with_joints_that_slide() -> None:
    own = rd.Lagrangian(rd.load("cart_pole"))
    q, v, tau = np.random.default_rng(4).normal(size=(3, 5, 2))
    np.testing.assert_allclose(articulated_body(own.linkage, q, v, tau), own.forward_dynamics(q, v, tau), rtol=1e-12)


def test_an_implementation_whose_numbers_overflow_everywhere_is_left_out_by_name() -> None:
    """A joint that turns its follower 1e9 times as fast: C of it is beyond float32."""
    text = chain(*[body(com="0 0 0.1")] * 2, axes=["0 1 0"], last='<mimic joint="j1" multiplier="1e9"/>')
    with pytest.warns(rd.ModelWarning, match="1e\\+09 times"):
        robot = rd.Robot.from_text(text)
    made = rd.accuracy.certify(robot, samples=100, repeats=1)
    assert any(
        each.endswith("by Lagrangian, float32: no finite result at any random state") for each in made.left_out
    ), made.left_out
