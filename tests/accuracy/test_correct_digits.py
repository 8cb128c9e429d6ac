"""Digits of an answer: counted against truth by other implementations, lost where an answer is wrong, and warned of."""

from __future__ import annotations

import pickle
import warnings
from dataclasses import replace
from fractions import Fraction
from math import log10

import numpy as np
import pytest
from flint import arb, ctx

import robot_dyn as rd
from robot_dyn.accuracy import digits_of
from robot_dyn.accuracy.correct_digits import QUANTITIES
from robot_dyn.lagrange import articulated_body, newton_euler
from robot_dyn.lagrange import exact as exact_module
from robot_dyn.lagrange.exact import RESOLUTION, Exact
from robot_dyn.queries import FORWARD_DYNAMICS, INVERSE_DYNAMICS, C, M, N
from tests.campaigns.hard.chains import coincident, text
from tests.chains import body, chain

THIN = 0.01, 0.03, 0.03
FAR = chain(body(1.3, "1e6 0 0", THIN), body(0.4, "0.25 0 0", THIN), at=("0 0 0", "2e6 0 0"), axes=["0 1 0"])


def state(robot: rd.Robot, seed: int = 5) -> dict[str, np.ndarray]:
    q, v, a, tau = np.random.default_rng(seed).uniform(-1.5, 1.5, (4, robot.n))
    return {"q": q, "v": v, "a": a, "tau": tau}


@pytest.mark.parametrize("name", ["ur5", "skew_tree", "cart_pole"])
def test_truth_by_other_recursions_in_400_bits_lies_inside(name: str) -> None:
    """Newton–Euler for inverse dynamics and for M, column by column; articulated bodies for forward dynamics."""
    robot = rd.load(name)
    own, x = rd.Lagrangian(robot, rd.accuracy.Ball(400)), state(robot)
    exact = Exact(robot)
    with own.arithmetic.scope():
        q, v, a, tau = (own.arithmetic.array(x[name]) for name in ("q", "v", "a", "tau"))
        zero, unit = own.arithmetic.array(np.zeros(robot.n)), own.arithmetic.array(np.eye(robot.n))
        rest = newton_euler(own.linkage, q, zero, zero)
        others = {
            M: np.array([newton_euler(own.linkage, q, zero, row) - rest for row in unit]),
            N: rest,
            INVERSE_DYNAMICS: newton_euler(own.linkage, q, v, a),
            FORWARD_DYNAMICS: articulated_body(own.linkage, q, v, tau),
        }
    for quantity, other in others.items():
        truth = exact.at(quantity, x)
        with ctx.workprec(400):
            assert all(ball.overlaps(each) for ball, each in zip(truth.values.flat, other.flat, strict=True))
        assert np.all(
            truth.scale.relative(0 * rd.accuracy.midpoint(truth.values), rd.accuracy.radius(truth.values)) <= RESOLUTION
        )
        assert truth.error(other) <= 2 * RESOLUTION


@pytest.mark.parametrize("quantity", [M, N, FORWARD_DYNAMICS], ids=lambda each: each.name)
def test_bits_are_doubled_until_the_balls_are_narrow(monkeypatch, quantity) -> None:
    """1e-20 is 66 bits; 16 leave a relative radius of 1e-4, and M undecided."""
    robot = rd.load("ur5")
    x, few = state(robot), exact_module._FIRST_BITS
    fine = Exact(robot).at(quantity, x)
    monkeypatch.setattr(exact_module, "_FIRST_BITS", 16)
    truth = Exact(robot).at(quantity, x)
    assert truth.bits in (few, few * 2)
    assert np.all(
        truth.scale.relative(0 * rd.accuracy.midpoint(truth.values), rd.accuracy.radius(truth.values)) <= RESOLUTION
    )
    assert fine.error(truth.values) <= 2 * RESOLUTION


@pytest.mark.parametrize("name", ["ur5", "panda"])
@pytest.mark.parametrize("quantity", [M, C, N, INVERSE_DYNAMICS, FORWARD_DYNAMICS], ids=lambda each: each.name)
def test_an_entry_that_is_moved_loses_the_digits_beyond(name: str, quantity) -> None:
    """By 1e-k of its scale: k digits are left, of Pinocchio's 14 or more."""
    robot = rd.load(name)
    x = state(robot)
    truth, answer = Exact(robot).at(quantity, x), np.array(quantity.evaluate(robot, x))
    assert (
        14
        < rd.accuracy.digits(robot, quantity.name, *(x[each] for each in quantity.arguments))
        == digits_of(truth.error(answer))
    )
    entry = (1,) * answer.ndim
    for k in (3, 8, 12):
        moved = answer.copy()
        if quantity.solves:  # in the norm of M
            assert truth.scale.M is not None
            moved[entry] += 10.0**-k * truth.scale.size / np.sqrt(truth.scale.M[1, 1])
        else:
            moved[entry] += 10.0**-k * truth.scale.size[entry]
        assert digits_of(truth.error(moved)) == pytest.approx(k, abs=0.01)
    answer[entry] = np.nan
    assert digits_of(truth.error(answer)) == 0


def test_digits_of_a_pendulum_follow_from_its_decimals() -> None:
    """M = Iyy + m (l/2)² of the decimals of the file, as fractions."""
    robot = rd.load("pendulum")
    exact = Fraction("0.083333333333333333") + Fraction("0.25")
    error = abs(Fraction(float(robot.M([0.3])[0, 0])) - exact) / exact
    assert rd.accuracy.digits(robot, "M", [0.3]) == pytest.approx(-log10(error), abs=1e-6)


def test_digits_that_a_lever_of_1000_km_costs_are_seen() -> None:
    """On the scale of its terms, that of `compare`, forward dynamics errs by rounding there; its answer does not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rd.ModelWarning)
        robot = rd.Robot.from_text(FAR)
    x = state(robot)
    assert rd.accuracy.digits(robot, "forward_dynamics", x["q"], x["v"], x["tau"]) < 11
    assert rd.accuracy.digits(robot, "M", x["q"]) > 14
    with pytest.warns(
        rd.PrecisionWarning, match=r"^forward_dynamics of chain has 10\.\d digits, fewer than 13; use rd"
    ):
        rd.accuracy.warn_below(robot, 13).forward_dynamics(x["q"], x["v"], x["tau"])


@pytest.mark.parametrize(("thin", "warns"), [(0.1, False), (1e-4, True)])
def test_a_nearly_singular_robot_says_so_and_its_answers_say_how_many_digits_they_have(
    thin: float, warns: bool
) -> None:
    """Four axes through one point, nearly parallel: of thin links between them few digits are kept."""
    written = text("axes", coincident(1e-7, thin))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        robot = rd.Robot.from_text(written)
    assert [("nearly singular" in str(each.message), each.filename) for each in said] == [(True, __file__)] * warns
    assert any("M is nearly singular, κ = 4.7e+12" in each for each in robot.findings) == warns
    q = np.array([0.2, -0.9, 0.4, 0.7])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        a = robot.forward_dynamics(q, 2 * q, 0.3 * q)
    held = rd.accuracy.digits(robot, "forward_dynamics", q, 2 * q, 0.3 * q)
    assert [(each.category, each.filename) for each in said] == [(rd.PrecisionWarning, __file__)] * warns
    assert [f"has {held:.1f} digits" in str(each.message) for each in said] == [True] * (held < 8)
    assert np.isfinite(a).all() and (held >= 8) != warns
    assert pickle.loads(pickle.dumps(robot)) == robot
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(
            rd.accuracy.warn_below(robot, None).forward_dynamics(q, 2 * q, 0.3 * q), a, strict=True
        )


@pytest.mark.parametrize("angle", [1e-7, 1e-6, 1e-5])
def test_a_nearly_singular_robot_warns_exactly_where_an_answer_has_fewer_than_8_digits(angle: float) -> None:
    """κ depends on q by orders of magnitude; digits are counted, so that no bound warns of an answer that has them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rd.ModelWarning)
        loaded = rd.Robot.from_text(text("axes", coincident(angle, 1e-4)))
    robot = loaded.with_(mass_scale=1.1)  # keeps the check
    q, v, tau = np.random.default_rng(3).uniform(-1.5, 1.5, (3, 12, robot.n))
    few = [rd.accuracy.digits(robot, "forward_dynamics", *row) < 8 for row in zip(q, v, tau, strict=True)]
    for k in range(len(q)):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            robot.forward_dynamics(q[k], v[k], tau[k])
            robot.M(q[k]), robot.N(q[k])  # which no condition spoils
        assert len(said) == few[k]
    with pytest.warns(rd.PrecisionWarning, match=r"in row \d+ of the batch"):
        robot.forward_dynamics(q, v, tau)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # states without an answer have no digits
        assert robot.forward_dynamics(np.zeros((0, robot.n)), v[0], tau[0]).shape == (0, robot.n)
        assert np.isnan(robot.nan_rows.forward_dynamics([q[0] * np.nan], v[0], tau[0])).all()


def test_any_function_can_check_the_answers_of_a_robot() -> None:
    seen = []
    robot, x = rd.load("planar_2r"), state(rd.load("planar_2r"))
    watched = replace(robot, answer_check=lambda robot, query, arguments, answer: seen.append((query, len(arguments))))
    for each in QUANTITIES.values():
        each.evaluate(watched.with_(mass_scale=1.1), x)
    assert seen == [(each.name, len(each.arguments)) for each in QUANTITIES.values()]
    with pytest.raises(rd.RobotDynError, match="answer_check must be a function"):
        replace(robot, answer_check=8)  # pyright: ignore[reportArgumentType]


def test_queries_warn_below_the_digits_that_are_set_and_answer_the_same() -> None:
    robot = rd.load("ur5")
    x = state(robot)
    batch = np.array([x["q"], -x["q"]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wary = rd.accuracy.warn_below(robot, 13)
        for each in QUANTITIES.values():
            np.testing.assert_array_equal(each.evaluate(wary, x), each.evaluate(robot, x))
    strict = rd.accuracy.warn_below(robot, 18)
    for each in QUANTITIES.values():
        with pytest.warns(
            rd.PrecisionWarning, match=rf"{each.name} of ur5 has 1[4-7]\.\d digits, fewer than 18"
        ) as seen:
            each.evaluate(strict, x)
        assert [warning.filename for warning in seen] == [QUANTITY_FILE]
    with pytest.warns(rd.PrecisionWarning, match="in row [01] of the batch"):
        strict.forward_dynamics(batch, x["v"], x["tau"])
    assert rd.accuracy.warn_below(strict.with_(mass_scale=1.1), 18) == strict.with_(mass_scale=1.1)
    assert pickle.loads(pickle.dumps(strict)) == strict != robot == rd.accuracy.warn_below(strict, None)


QUANTITY_FILE = rd.load.__code__.co_filename.replace(
    "model/loading.py", "queries/quantity.py"
)  # where `ask` calls the engine


def test_states_without_an_answer_are_not_warned_of() -> None:
    robot = rd.accuracy.warn_below(rd.load("planar_2r"), 12)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        answers = robot.nan_rows.N([[0.3, np.nan], [0.3, 0.4]])
        assert robot.N(np.zeros((0, 2))).shape == (0, 2)
    assert np.isnan(answers[0]).all() and np.isfinite(answers[1]).all()


def test_the_estimate_is_no_less_than_the_error() -> None:
    """8 n u κ of the terms, without which a warning would be left out in silence."""
    from robot_dyn.accuracy.correct_digits import _bound

    for name in ("pendulum", "planar_2r", "cart_pole", "skew_tree", "ur5", "panda", "light_tip"):
        robot = rd.load(name)
        for seed in range(3):
            x = state(robot, seed)
            for each in QUANTITIES.values():
                answer = each.evaluate(robot, x)
                assert Exact(robot).at(each, x).error(answer) <= _bound(robot, each, x, answer) or not answer.any()


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda robot, q: rd.accuracy.digits(robot, "M", q, q), "digits of M need the arguments q, got 2 arguments"),
        (
            lambda robot, q: rd.accuracy.digits(robot, "N", [q, q]),
            r"digits are counted at one state: q must have .* got \(2, 2\)",
        ),
        (
            lambda robot, q: rd.accuracy.warn_below(robot, 21),
            "digits must be at most 20, got 21",
        ),
    ],
)
def test_mistakes_are_told(ask, message: str) -> None:
    with pytest.raises(rd.RobotDynError, match=f"^{message}$"):
        ask(rd.load("planar_2r"), np.array([0.3, -0.4]))


def test_a_singular_arm_is_refused_by_its_joint() -> None:
    with pytest.warns(rd.ModelWarning):
        robot, q = rd.load("massless_tip"), np.array([0.3, -0.4])
    with pytest.raises(rd.RobotDynError, match="no forward dynamics: joint 'pointer_joint' carries no inertia"):
        rd.accuracy.digits(robot, "forward_dynamics", q, q, q)
    assert rd.accuracy.digits(robot, "M", q) > 15
    truth = Exact(robot).at(N, {"q": q})  # the joint has no unit of its own, in which all errors would be small
    assert digits_of(truth.error(robot.N(q))) > 14
    assert digits_of(truth.error(robot.N(q) * (1 + 1e-5))) < 6


def test_balls_of_rounded_literals_hold_the_float64_of_the_file() -> None:
    """0.083333333333333333 in the file, and the float64 nearest to it."""
    truth = Exact(rd.load("pendulum"), rounded=True).at(M, {"q": np.array([0.3])})
    with ctx.workprec(200):
        assert truth.values[0, 0].contains(arb(0.083333333333333333) + arb("0.25"))
        assert not truth.values[0, 0].contains(arb("0.083333333333333333") + arb("0.25"))
