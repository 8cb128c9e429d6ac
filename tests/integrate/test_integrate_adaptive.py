"""Methods with step-size control: error against tolerance, dense output, and runs that end early say so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robot_dyn.foundations import OverflowedError, QueryError
from robot_dyn.integrate import Adaptive, Status, System

ALL = ["DOP853", "Rodas5P"]
OSCILLATOR = System(lambda t, y: np.stack([y[..., 1], -y[..., 0]], axis=-1), 1)
START = np.array([1.0, 0.5])


def motion(t: Any) -> np.ndarray:
    return np.stack([np.cos(t) + np.sin(t) / 2, np.cos(t) / 2 - np.sin(t)], axis=-1)


@pytest.mark.parametrize("name", ALL)
def test_dense_output_is_within_the_tolerance(name: str) -> None:
    """Over 10 s of ẍ = −x errors only add up, some 20 steps of them: 100 tolerances bound it between the steps too."""
    for tolerance in (1e-5, 1e-8):
        solution = Adaptive(name, rtol=tolerance, atol=tolerance).solve(OSCILLATOR, 0.0, START, 10.0)
        assert solution.status is Status.FINISHED
        assert (solution.times[0], solution.times[-1]) == (0.0, 10.0)
        t = np.linspace(0, 10, 400).reshape(2, 200)
        assert solution(t).shape == (2, 200, 2)
        assert np.abs(solution(t) - motion(t)).max() < 100 * tolerance
        np.testing.assert_allclose(solution(solution.times), solution.states, atol=1e-14)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("atol", [0.0, 5e-324, 1e-200])
def test_a_state_at_rest_starts_under_a_relative_tolerance_alone(name: str, atol: float) -> None:
    """ÿ = −y from (1, 0): the error of an entry that is 0 is infinite on that scale, and the first step is no number.

    Until 1 s no other entry passes 0; 100 tolerances bound the error as above.
    """
    solution = Adaptive(name, rtol=1e-8, atol=atol).solve(OSCILLATOR, 0.0, np.array([1.0, 0.0]), 1.0)
    assert solution.status is Status.FINISHED
    assert np.abs(solution(1.0) - [np.cos(1), -np.sin(1)]).max() < 1e-6


@pytest.mark.parametrize("name", ALL)
def test_evaluations_are_all_counted(name: str) -> None:
    """One a row: those of Jacobians come in batches."""
    rows: list[int] = []

    def counted(t: Any, y: np.ndarray) -> np.ndarray:
        rows.append(y.size // 2)
        return OSCILLATOR.rate(t, y)

    solution = Adaptive(name, rtol=1e-6).solve(System(counted, 1), 0.0, START, 3.0)
    assert solution.evaluations == sum(rows)


@pytest.mark.parametrize("name", ALL)
def test_a_run_can_go_back(name: str) -> None:
    options = Adaptive(name, rtol=1e-8, atol=1e-10)
    solution = options.solve(OSCILLATOR, 2.0, motion(2.0), 0.0)
    np.testing.assert_allclose(solution(0.0), START, atol=1e-6)


@pytest.mark.parametrize("name", ALL)
def test_a_run_stops_where_it_is_told(name: str) -> None:
    """Position crosses zero at t = π − atan 2; the solution ends there, and the start on zero is not a crossing."""
    options = Adaptive(name, rtol=1e-9, atol=1e-11)
    solution = options.solve(OSCILLATOR, 0.0, START, 10.0, stop=lambda t, y: y[0])
    assert solution.status is Status.STOPPED
    assert solution.times[-1] == pytest.approx(np.pi - np.arctan(2), abs=1e-7)
    assert solution.states[-1][0] == pytest.approx(0, abs=1e-12)
    with pytest.raises(QueryError, match="within the run"):
        solution(solution.times[-1] + 0.1)
    again = options.solve(OSCILLATOR, 0.0, np.array([0.0, 1.0]), 10.0, stop=lambda t, y: y[0])
    assert again.times[-1] == pytest.approx(np.pi, abs=1e-7)


def refusing(t: Any, y: np.ndarray) -> np.ndarray:
    raise OverflowedError("too large")


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize(
    ("rate", "end", "message"),
    [
        (lambda t, y: y**2, 1.0, "grows without bound"),  # from 1, y = 1/(1 − t): no step reaches beyond 1
        (lambda t, y: np.sqrt(1 - t) * y, 1.0, ""),
        (lambda t, y: np.nan * y, 0.0, "not finite at t = 0.0"),
        (refusing, 0.0, "not finite at t = 0.0"),
    ],
    ids=["blow-up", "no longer finite", "nan", "refusal"],
)
def test_a_rate_that_ends_is_reported_and_what_there_is_is_kept(name: str, rate: Any, end: float, message: str) -> None:
    """Differences for ∂f/∂t look ahead by 1.3e-5."""
    solution = Adaptive(name, rtol=1e-8).solve(System(rate, 0), 0.0, np.array([1.0, 0.5]), 2.0)
    assert solution.status is Status.FAILED
    assert message in solution.message
    assert solution.times[-1] == pytest.approx(end, abs=1.3e-5 if name == "Rodas5P" and not message else 1e-6)
    np.testing.assert_array_equal(solution([0.0, 0.0]), [[1.0, 0.5]] * 2)
    if message == "grows without bound":
        assert solution(0.5)[0] == pytest.approx(2, rel=1e-6)


@pytest.mark.parametrize("name", ["Rodas5P"])
def test_implicit_methods_take_few_steps_on_a_stiff_system_and_dop853_many(name: str) -> None:
    """For y' = −1e6 (y − cos t) an explicit method needs some 1e5 steps a second, so only 1e-3 s of it are run."""
    stiff = System(lambda t, y: -1e6 * (y - np.cos(t)), 0)
    implicit = Adaptive(name, rtol=1e-6, atol=1e-8).solve(stiff, 0.0, np.array([1.0]), 1.0)
    explicit = Adaptive("DOP853", rtol=1e-6, atol=1e-8).solve(stiff, 0.0, np.array([1.0]), 1e-3)
    assert implicit.states[-1][0] == pytest.approx(np.cos(1), abs=1e-5)
    assert len(implicit.times) < 50 < len(explicit.times)


def test_longest_step_is_kept_and_inputs_are_left_alone() -> None:
    y0 = START.copy()
    y0.setflags(write=False)
    solution = Adaptive(rtol=1e-3, max_step_s=0.1).solve(OSCILLATOR, 0.0, y0, 1.0)
    assert np.diff(solution.times).max() <= 0.1 * (1 + 1e-12)
    assert np.array_equal(y0, START)
    with pytest.raises(ValueError, match="read-only"):
        solution.states[0] = 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "BDF"}, "known: DOP853, Rodas5P"),
        ({"rtol": 1e-15}, "rtol must be between 2.22e-14 and 1"),
        ({"rtol": float("nan")}, "rtol must be"),
        ({"atol": -1.0}, "atol must "),
        ({"max_step_s": 0.0}, "max_step_s must be positive"),
    ],
)
def test_meaningless_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(QueryError, match=message):
        Adaptive(**options)


@pytest.mark.parametrize(
    ("y0", "t1", "message"),
    [
        (np.ones((2, 2)), 1.0, r"shape \(m,\)"),
        (np.array([1.0, np.inf]), 1.0, "must be finite"),
        (START.astype(object), 1.0, "float64"),
        (START, 0.0, "t0 and t1 must differ"),
        (START, float("inf"), "t1 must be finite"),
    ],
)
def test_an_unfit_start_is_refused(y0: np.ndarray, t1: float, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        Adaptive().solve(OSCILLATOR, 0.0, y0, t1)


def test_the_table_of_dop853_is_scipys() -> None:
    """Bit by bit, although SciPy prints 30 digits."""
    from scipy.integrate import DOP853

    from robot_dyn.integrate import dop853_coefficients as table

    s = table.STAGES
    own = {"A": table.A[:s, :s], "B": table.B, "C": table.C[:s], "D": table.D, "A_EXTRA": table.A[s + 1 :]}
    own |= {"E3": np.append(table.E3, 0.0), "E5": np.append(table.E5, 0.0), "C_EXTRA": table.C[s + 1 :]}
    for name, numbers in own.items():
        np.testing.assert_array_equal(numbers, getattr(DOP853, name), err_msg=name)


@pytest.mark.parametrize("name", ["DOP853", "Rodas5P"])
def test_steps_iterated_again_begin_as_a_run_from_there(name: str) -> None:
    """After a break the next steps are those of a run that begins at the state reached."""
    oscillator = System(lambda t, y: np.stack([y[..., 1], -50 * y[..., 0]], axis=-1), 1)
    method = Adaptive(name)
    steps = method.steps(oscillator, 0.0, np.array([1.0, 0.0]), 1.0)
    for count, _ in enumerate(steps, 1):
        if count == 3:
            break
    t, y = steps.t, steps.y.copy()
    assert [each[0] for each in steps] == [each[0] for each in method.steps(oscillator, t, y, 1.0)]
