"""A state without an answer is named by its row, `out` stays as it was, and errors="nan" answers the others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import robot_dyn as rd
from robot_dyn.foundations import EditError, NotFiniteError, OverflowedError, QueryError, UndecidedError
from robot_dyn.lagrange import articulated_body
from robot_dyn.queries import EQUATION
from tests.chains import body, chain
from tests.codegen.arms import compiled
from tests.long import long
from tests.queries import ARGUMENTS, FRAMED

UR5 = rd.load("ur5")
ENGINES = {"robot": UR5, "own": rd.Lagrangian(UR5), "machine code": compiled("ur5")}
every_engine = pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)


def states(rows: int) -> dict[str, np.ndarray]:
    """q, v, a, tau without zeros, (rows, 6) each."""
    values = np.random.default_rng(5).uniform(0.1, 1.5, (4, rows, 6))
    return dict(zip(("q", "v", "a", "tau"), values, strict=True))


@every_engine
@pytest.mark.parametrize("rows", [40, *long([5])])
@pytest.mark.parametrize("method", ARGUMENTS)
def test_states_that_are_not_finite_leave_the_others_their_answers(engine: Any, method: str, rows: int) -> None:
    """As in a batch without bad ones, to 1e-13 of the largest: tiles are cut otherwise."""
    given = [states(rows)[name] for name in ARGUMENTS[method]]
    frame = ["tool0"] if method in FRAMED else []
    expected = getattr(engine, method)(*given, *frame)
    bad = [x.copy() for x in given]
    bad[-1][1, 2], bad[0][rows - 1, 0] = np.nan, np.inf
    with pytest.raises(
        NotFiniteError, match="must be finite, got nan for joint 'elbow_joint' in row 1 of the batch"
    ) as told:
        getattr(engine, method)(*bad, *frame)
    assert told.value.row == (1,)
    answer = getattr(engine, method)(*bad, *frame, errors="nan")
    lost = np.isin(np.arange(rows), (1, rows - 1))
    assert np.isnan(answer[lost]).all()
    np.testing.assert_allclose(answer[~lost], expected[~lost], rtol=0, atol=1e-13 * np.abs(expected).max())


@every_engine
@pytest.mark.parametrize("method", ["C", "inverse_dynamics", "kinetic_energy"])
def test_a_state_that_overflows_is_told_by_its_row(engine: Any, method: str) -> None:
    """v² = 1e360 does not fit into float64; the row has as many indices as the batch has axes."""
    given = [states(24)[name].reshape(4, 6, 6) for name in ARGUMENTS[method]]
    given[1][2, 3] = 1e180 if method != "C" else 1.5e308
    with pytest.raises(OverflowedError, match=r"so large that the result overflows in row \(2, 3\) of the batch"):
        getattr(engine, method)(*given)
    answer = getattr(engine, method)(*given, errors="nan")
    assert np.isnan(answer[2, 3]).all()
    assert np.isfinite(np.delete(answer.reshape(24, -1), 15, axis=0)).all()


@every_engine
def test_no_answer_is_ever_other_than_finite(engine: Any) -> None:
    """One state at speeds up to 1e308: a finite answer or OverflowedError."""
    state = {name: x[0] for name, x in states(1).items()}
    for speed in (1e100, 1e154, 1e160, 1e250, 1e308):
        for method in (quantity.name for quantity in EQUATION.values() if "v" in quantity.arguments):
            given = [state[name] * (speed if name == "v" else 1.0) for name in ARGUMENTS[method]]
            try:
                assert np.isfinite(getattr(engine, method)(*given)).all(), (method, speed)
            except OverflowedError:
                assert speed > 1e100


def test_forward_dynamics_of_coupled_joints_overflows_in_words() -> None:
    robot = rd.load("mimic_chain")
    q, tau = np.full(robot.n, 0.4), np.full(robot.n, 0.3)
    for v in (np.full(robot.n, 1e160), np.full((2, robot.n), 1e200)):
        with pytest.raises(OverflowedError, match="q, v, tau are so large"):
            robot.forward_dynamics(q, v, tau)


@pytest.mark.parametrize(
    "edit", [{"mass_scale": 1e300}, {"gravity": (0, 0, 1e13)}, {"armature": 1e200}], ids=lambda edit: next(iter(edit))
)
def test_edits_beyond_what_a_file_may_state_are_refused(edit: dict[str, Any]) -> None:
    """So that M, C and N of moderate states cannot overflow."""
    with pytest.raises(EditError, match=r"beyond ±1e\+12 in SI units"):
        UR5.with_(**edit)


@pytest.mark.parametrize("rows", [3, 5000])
@pytest.mark.parametrize("wrong", [np.nan, 1e250])
def test_a_refused_batch_leaves_out_as_it_was(rows: int, wrong: float) -> None:
    """The bad state is the last, after rows that a kernel has computed."""
    fast, state = compiled("ur5"), states(rows)
    state["v"][-1, 3] = wrong
    out = np.full((rows, 6), 7.0)
    with pytest.raises(QueryError):
        fast.inverse_dynamics(state["q"], state["v"], state["a"], out=out)
    assert_array_equal(out, 7.0)
    assert fast.inverse_dynamics(state["q"], state["v"], state["a"], out=out, errors="nan") is out
    assert np.isnan(out[-1]).all()
    assert np.isfinite(out[:-1]).all()


@every_engine
def test_a_way_to_deal_with_errors_is_one_of_two(engine: Any) -> None:
    with pytest.raises(QueryError, match="errors must be 'raise' or 'nan', got 'ignore'"):
        engine.M(np.ones((2, 6)), errors="ignore")


@pytest.mark.parametrize(
    ("n", "dtype", "rounding", "enough"),
    [(64, np.float32, "float32", np.float64), (16, rd.accuracy.Ball(20), "balls of 20 bits", rd.accuracy.Ball(300))],
    ids=["float32", "balls"],
)
def test_a_pivot_lost_in_rounding_accuses_no_joint(n: int, dtype: Any, rounding: str, enough: Any) -> None:
    """Equal bars about parallel axes: what is not decided in one arithmetic is answered in a wider one."""
    robot = rd.Robot.from_text(chain(*[body(1, "0.5 0 0", (0.01, 0.08, 0.08))] * n, at=("0 0 0", "1 0 0")))
    q, v, tau = np.random.default_rng(2).uniform(-0.01, 0.01, (3, n))
    own = rd.Lagrangian(robot, dtype)
    with pytest.raises(UndecidedError, match=f"not decided: whether joint 'j.*' .* lost in the rounding of {rounding}"):
        own.forward_dynamics(q, v, tau)
    assert own.arithmetic.asarray(own.forward_dynamics(np.stack([q, q]), v, tau, errors="nan")).shape == (2, n)
    answer = rd.Lagrangian(robot, enough).forward_dynamics(q, v, tau)
    assert robot.joint_without_inertia is None
    if isinstance(enough, rd.accuracy.Ball):
        answer = rd.accuracy.midpoint(answer)
        with own.arithmetic.scope(), pytest.raises(UndecidedError, match=rounding):
            articulated_body(own.linkage, *(own.arithmetic.array(x) for x in (q, v, tau)))
    np.testing.assert_allclose(answer, robot.forward_dynamics(q, v, tau), rtol=0, atol=1e-8 * np.abs(answer).max())
