"""Laws of the excitation: base parameters, information, optimality, limits and files."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.control import extreme_values
from robot_dyn.foundations import PlanError
from robot_dyn.tools.identify import FourierSeries, Information, gram
from robot_dyn.tools.identify.base_parameters import base_parameters
from robot_dyn.tools.identify.excitation import Problem, _limits, motion
from tests.long import long, stress

ARM = rd.load("planar_2r")
LIMITS = {"velocity": 2.0, "acceleration": 9.0, "torque": 60.0, "lower": -2.0, "upper": 2.0}


def problem(arm: rd.Robot = ARM, harmonics: int = 5, **limits: float) -> Problem:
    information = Information(arm, base_parameters(arm), np.full(arm.n, 0.5), np.full(arm.n, 0.1))
    return Problem(information, FourierSeries(10.0, harmonics), *_limits(arm, limits or LIMITS, 0.9))


@cache
def excitation(seed: int = 0) -> rd.tools.identify.Excitation:
    return rd.tools.identify.excite(ARM, 10.0, limits=LIMITS, starts=1, seed=seed, compare_longer=False)


@pytest.mark.parametrize("name", ["planar_2r", "ur5", "cart_pole", "mimic_chain"])
def test_the_regressor_of_base_parameters_is_the_regressor(name: str) -> None:
    """Y = Y_k R at states that were not used; columns are independent. Rounding of R: 1e-9 of the largest entry."""
    arm = rd.load(name)
    base, rng = base_parameters(arm), np.random.default_rng(5)
    q, v, a = rng.normal(size=(3, 60, arm.n))
    Y = np.asarray(arm.regressor(q, v, a))
    assert np.allclose(Y[..., base.columns] @ base.R, Y, atol=1e-9 * np.abs(Y).max())
    rows = Y[..., base.columns].reshape(-1, len(base.columns))
    assert np.linalg.matrix_rank(rows / np.linalg.norm(rows, axis=0), tol=1e-9) == len(base.columns)


def test_the_number_of_base_parameters_of_known_arms() -> None:
    """36 of the UR5 and 43 of the Panda's seven joints [Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca 2019]."""
    panda = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
    assert [len(base_parameters(arm).columns) for arm in (rd.load("ur5"), panda)] == [36, 43]


def test_fourier_series_rest_at_both_ends() -> None:
    """V = a = 0 at t = 0 and t = T, and the bases are derivatives of each other: differences are O(h²) = 1e-8."""
    series, h = FourierSeries(7.0, 6), 1e-4
    x = np.random.default_rng(1).normal(size=series.size)
    position, velocity, acceleration = series.basis(np.array([0.0, 7.0]))
    assert np.allclose([velocity @ x, acceleration @ x], 0.0, atol=1e-12)
    assert np.allclose(position[0], position[1])
    before, at, after = (series.basis(np.array([2.3 + s])) for s in (-h, 0.0, h))
    for order in (0, 1):
        assert np.allclose((after[order] - before[order]) / (2 * h), at[order + 1], atol=1e-5)


def test_the_slope_of_the_lagrangian_is_its_derivative() -> None:
    """Central difference with h = 1e-5: error O(h²) and rounding 1e-10 · value, together below 1e-6 of the slope."""
    case, rng = problem(), np.random.default_rng(2)
    x = case.random(rng).ravel()
    multipliers = rng.uniform(0, 3, (2, *case.uses(motion(x.reshape(case.series.size, -1), case.basis)).shape))
    direction = rng.normal(size=x.size) / np.sqrt(x.size)
    above, below = (case.lagrangian(x + s * 1e-5 * direction, multipliers, 30.0)[0] for s in (1, -1))
    slope = case.lagrangian(x, multipliers, 30.0)[1] @ direction
    assert (above - below) / 2e-5 == pytest.approx(slope, rel=1e-6)


def test_an_excitation_shows_more_than_random_series() -> None:
    """By 0.5 of log det a parameter: standard errors are smaller by 1.28 in the geometric mean. See the long test."""
    arm = rd.load("ur5").with_(lock={f"wrist_{k}_joint": 0.3 * k for k in (1, 2, 3)})
    case, rng = problem(arm, 8, acceleration=30.0), np.random.default_rng(3)
    best = max((case.random(rng) for _ in range(200)), key=case.log_det)
    planned = case.best(1, seed=0)[0]
    assert case.log_det(planned) >= case.log_det(best) + 0.5 * len(case.information.parameters)


def test_an_excitation_respects_its_limits() -> None:
    """Extremes of the polynomials are exact; the series between knots adds less than 1e-3 of a limit."""
    reference = excitation().reference
    for order, limit in ((0, 2.0), (1, 2.0), (2, 9.0)):
        assert extreme_values(reference, order).largest.max() <= 0.9 * limit * (1 + 1e-3)
    tau = ARM.inverse_dynamics(*reference.at(np.linspace(0, 10, 5001)))
    assert np.abs(tau).max() <= 0.9 * 60.0 * (1 + 1e-3)
    assert np.allclose(reference.at(np.array([0.0, 10.0]))[1:], 0.0, atol=1e-9)


def test_an_excitation_stays_in_a_box() -> None:
    box = np.array([[0.2, -0.6, -3.0], [3.0, 1.2, 3.0]])
    tip = ARM.frame_names[-1]
    planned = rd.tools.identify.excite(
        ARM, 6.0, limits=LIMITS, box=box, tool=tip, starts=1, compare_longer=False, fraction=0.8
    )
    p = ARM.placement(planned.reference.at(np.linspace(0, 6, 2001))[0], tip)[:, :3, 3]
    assert (p >= box[0] - 1e-3).all()
    assert (p <= box[1] + 1e-3).all()


def test_equal_seeds_return_the_same_motion() -> None:
    again = rd.tools.identify.excite(ARM, 10.0, limits=LIMITS, starts=1, compare_longer=False)
    assert np.array_equal(again.reference.coefficients, excitation().reference.coefficients)


def test_expected_standard_errors_are_those_of_least_squares() -> None:
    """Of 4000 logs with white noise; a standard deviation is then known to 1/√8000, five of which are 6 %."""
    information, rng = problem().information, np.random.default_rng(4)
    q, v, a = excitation().reference.at(np.linspace(0.02, 9.98, 150))
    W = information.rows(q, v, a).reshape(-1, len(information.parameters))
    estimates = np.linalg.lstsq(W, rng.normal(size=(len(W), 4000)), rcond=None)[0] * information.sizes[:, None]
    expected = information.expected(q, v, a)
    assert np.allclose(estimates.std(axis=1), expected.standard_errors, rtol=0.06)
    assert expected.log_det == pytest.approx(np.linalg.slogdet(gram(information.rows(q, v, a)))[1])


def test_a_repeated_motion_shows_more_by_a_closed_form() -> None:
    """Log det grows by p log 2 and errors fall by √2 if every row is there twice."""
    information = problem().information
    q, v, a = excitation().reference.at(np.linspace(0.02, 9.98, 150))
    once, twice = (information.expected(*(np.tile(x, (k, 1)) for x in (q, v, a))) for k in (1, 2))
    assert twice.log_det == pytest.approx(once.log_det + len(once.parameters) * np.log(2))
    assert np.allclose(once.standard_errors, np.sqrt(2) * twice.standard_errors)


def test_a_motion_that_holds_a_joint_is_blind_to_its_friction() -> None:
    information = problem().information
    q, v, a = (x.copy() for x in excitation().reference.at(np.linspace(0, 10, 150)))
    v[:, 1] = a[:, 1] = 0.0
    assert information.expected(q, v, a).log_det == -np.inf


def test_ten_more_seconds_show_more() -> None:
    planned = rd.tools.identify.excite(ARM, 6.0, limits=LIMITS, starts=1)
    assert planned.longer is not None
    assert planned.longer.log_det > planned.expected.log_det


def test_a_saved_excitation_is_the_same_motion(tmp_path: Path) -> None:
    """Hermite polynomials through exact values 10 ms apart: error O(Δ⁶), far below 1e-9 rad."""
    path = excitation().save(tmp_path / "x.csv")
    plan, t = rd.control.from_samples(ARM, path, ends="measured"), np.linspace(0, 10, 777)
    assert np.allclose(plan.reference.at(t)[0], excitation().reference.at(t)[0], atol=1e-9)


def test_a_scene_follows_a_saved_excitation(tmp_path: Path) -> None:
    """Computed torque with the exact model follows the motion: error of the method, below 1e-5 rad."""
    excitation().save(tmp_path / "x.csv")
    q0 = excitation().reference.at(0.0)[0].tolist()
    (tmp_path / "scene.toml").write_text(
        f'robot = "planar_2r"\nduration_s = 1.0\nmethod = "RK4"\nstep_s = 0.01\n[start]\nq = {q0}\n'
        '[[effect]]\nkind = "gravity"\n[control]\nkind = "computed_torque"\nbandwidth_rad_s = 20.0\n'
        '[reference]\nkind = "samples"\nfile = "x.csv"\nends = "measured"\n',
        encoding="utf-8",
    )
    run = rd.simulate(rd.read_scene(tmp_path / "scene.toml"))
    assert np.abs(run.tracking_error).max() < 1e-5


@pytest.mark.parametrize(
    "arguments",
    [
        {"limits": {"speed": 1.0}},
        {"limits": {"velocity": -1.0}},
        {"limits": {"velocity": {"knee": 1.0}}},
        {"limits": {"lower": 1.0, "upper": -1.0}},
        {"limits": LIMITS | {"torque": 1.0}},
        {"box": [[0, 0, 0], [-1, 1, 1]], "tool": ARM.frame_names[-1]},
        {"box": [[0, 0, 0], [1, 1, 1]], "tool": "hand"},
        {"duration_s": 0.0},
        {"starts": 0},
    ],
)
def test_wrong_requests_raise_errors(arguments: dict[str, object]) -> None:
    with pytest.raises(PlanError):
        rd.tools.identify.excite(ARM, **({"duration_s": 6.0, "limits": LIMITS} | arguments))  # pyright: ignore


@pytest.mark.parametrize("name", [*long(["ur5"]), *stress(["panda"])])
def test_real_arms_gain_as_much(name: str) -> None:
    """By 0.5 a parameter above the best of 1000, for six and seven joints with the limits of their files."""
    arm = rd.load(name)
    arm = arm.with_(lock={"panda_finger_joint1": 0.0}) if name == "panda" else arm
    planned = rd.tools.identify.excite(arm, compare_longer=False)
    base = base_parameters(arm)
    information = Information(arm, base, 0.01 * arm.effort_limit, 0.05 * 0.9 * arm.velocity_limit)
    case = Problem(information, FourierSeries(20.0, 10), *_limits(arm, {}, 0.9))
    rng = np.random.default_rng(3)
    random = max((case.random(rng) for _ in range(1000)), key=case.log_det)
    gain = planned.expected.log_det - case.expected(random, 100.0).log_det
    assert gain >= 0.5 * len(planned.expected.parameters)
