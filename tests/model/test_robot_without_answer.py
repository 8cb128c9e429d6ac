"""States without an answer: M is singular, results overflow, rounding hides a position or a time; rows of a batch."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import (
    EditError,
    NotFiniteError,
    OverflowedError,
    QueryError,
    SingularError,
    UndecidedError,
    midpoint,
)
from robot_dyn.lagrange import articulated_body
from robot_dyn.queries import EQUATION
from tests.chains import body, chain
from tests.codegen.arms import compiled
from tests.hostile.kinds import BODY, POINT, joint
from tests.long import long
from tests.queries import ARGUMENTS, FRAMED, general
from tests.user_parts import Push

INERTIA = ((0.02, 0.001, -0.002), (0.001, 0.03, 0.003), (-0.002, 0.003, 0.04))


Z = '<axis xyz="0 0 1"/>'


def arm(links: dict[str, str], *joints: str) -> rd.Robot:
    """The robot of links (name → content) and joints."""
    parts = [f'<link name="{name}">{content}</link>' for name, content in links.items()]
    return rd.Robot.from_text(f'<robot name="arm">{"".join(parts + list(joints))}</robot>')


def point_mass(xyz: str) -> str:
    return POINT.replace("<inertial>", f'<inertial><origin xyz="{xyz}"/>')


# --- where M is singular


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
def test_a_zero_on_the_diagonal_of_M_decides_that_it_is_singular() -> None:
    """Three parallel axes and a point mass on the last: M = m (l₁₂ᵀ l₁₂ …) with M₃₃ = 0, of rank 1.

    Which of the first two pivots is positive is lost in rounding; the third joint carries no inertia at any q.
    """
    links = {"base": "", "l0": "", "l1": "", "l2": point_mass("0 0 0")}
    offset = '<origin xyz="0 0.1 0"/>'
    robot = arm(links, joint("j0", "base", "l0"), joint("j1", "l0", "l1"), joint("j2", "l1", "l2", offset))
    assert robot.joint_without_inertia == "j2"
    assert robot.findings[0].startswith("link 'l0' moves but has no mass")
    assert_allclose(robot.M(np.array([0.3, 0.9, -0.4])), np.pad(np.full((2, 2), 0.01), (0, 1)), rtol=0, atol=1e-17)
    with pytest.raises(SingularError, match="'j2' carries no inertia"):
        robot.forward_dynamics(np.zeros(3), np.zeros(3), np.zeros(3))


def test_massless_tip_has_no_forward_dynamics_until_it_is_held_or_loaded():
    with pytest.warns(ModelWarning, match="link 'pointer'"):
        robot = rd.load("massless_tip")
    q, v, tau = general(robot, 9)
    assert np.isfinite(robot.inverse_dynamics(q, v, tau)).all()
    for x in (q, q.tolist(), [q, q]):
        with pytest.raises(SingularError, match="'pointer_joint'"):
            robot.forward_dynamics(x, v, tau)
    assert np.isfinite(robot.with_(lock={"pointer_joint": 0.2}).forward_dynamics(q[:1], v[:1], tau[:1])).all()
    loaded = robot.with_(payload=rd.Payload("pointer", 0.1, inertia=INERTIA))
    assert_allclose(loaded.inverse_dynamics(q, v, loaded.forward_dynamics(q, v, tau)), tau, rtol=1e-12)


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
def test_M_that_is_singular_where_the_mass_lies_on_the_outer_axis():
    """M = diag(m l² sin² q₂, m l²) for a point mass on the z axis at q₂ = 0."""
    links = {"base": "", "yoke": "", "bob": point_mass("0 0 0.5")}
    robot = arm(links, joint("pan", "base", "yoke", Z), joint("tilt", "yoke", "bob", '<axis xyz="0 1 0"/>'))
    v, tau = np.array([0.3, -0.4]), np.array([0.6, 0.7])
    assert_allclose(robot.M(np.array([0.7, 0.9])), np.diag([0.25 * np.sin(0.9) ** 2, 0.25]), rtol=0, atol=1e-16)
    for tilt in (0.9, 0.1, -0.1, 2.0):
        q = np.array([0.7, tilt])
        assert_allclose(robot.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau, rtol=1e-10)
    for q in (np.array([0.7, 0.0]), [0.7, 0.0], [[0.7, 0.9], [0.7, 0.0]]):
        with pytest.raises(SingularError, match="'pan' carries no inertia at this q"):
            robot.forward_dynamics(q, v, tau)


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
@pytest.mark.parametrize(("l1", "l2"), [(0.3, 0.7), (0.67, 0.34), (0.83, 0.92)])
def test_M_that_is_singular_where_the_arm_is_straight(l1: float, l2: float):
    """M has det M = m² l₁² l₂² sin² q₂ for a point mass at the tip alone; rounding decides how ABA fails at q₂ = 0."""
    links = {"base": "", "upper": "", "lower": point_mass(f"{l2} 0 0")}
    elbow = joint("elbow", "upper", "lower", f'<origin xyz="{l1} 0 0"/>{Z}')
    robot = arm(links, joint("shoulder", "base", "upper", Z), elbow)
    v, tau = np.array([0.3, -0.4]), np.array([0.6, 0.7])
    q = np.array([0.2, 0.9])
    assert_allclose(robot.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau, rtol=1e-10)
    with pytest.raises(SingularError, match=r"forward dynamics.* joint '(shoulder|elbow)' carries"):
        robot.forward_dynamics(np.array([0.2, 0.0]), v, tau)


# --- what overflows


@pytest.mark.parametrize("name", ["ur5", "panda", "skew_tree"])
@pytest.mark.parametrize("form", [np.asarray, np.ndarray.tolist])
def test_arguments_too_large_for_float64_raise(name: str, form: Any):
    """A force quadratic in v, 1e200² > 1.8e308; the argument that the user gave is named."""
    robot = rd.load(name)
    q, v, a = general(robot, 10)
    fast = 1e200 * v
    for method in ("coriolis_torque", "coriolis_transpose", "kinetic_energy"):
        with pytest.raises(OverflowedError, match="result overflows: q, v are too large"):
            getattr(robot, method)(form(q), form(fast))
    with pytest.raises(OverflowedError, match="result overflows: q, v, a are too large"):
        robot.inverse_dynamics(form(q), form(fast), form(a))
    with pytest.raises(OverflowedError, match="result overflows: q, v, tau are too large"):
        robot.forward_dynamics(form(q), form(fast), form(a))
    with pytest.raises(OverflowedError, match="result overflows: q, v are too large"):
        robot.momentum(form(q), form(np.full(robot.n, 1e308)))


def test_overflow_is_seen_where_position_and_velocity_are_orthogonal():
    """C of a slide at 1e200 m on a shaft at 1e200 rad/s overflows although q · v = 0."""
    robot = rd.load("skew_tree")
    with pytest.raises(OverflowedError, match="result overflows: q, v are too large"):
        robot.C(np.array([0, 0, 1e200, 0, 0]), np.array([1e200, 0, 0, 0, 0]))
    with pytest.raises(OverflowedError, match="result overflows: q is too large"):
        robot.M(np.array([0, 0, 1e200, 0, 0]))


def test_huge_arguments_with_a_finite_answer_are_answered_without_a_warning():
    """sin(1e200) is a number; pytest turns NumPy's warnings into errors."""
    robot = rd.load("ur5")
    q, v, a = general(robot, 11)
    far = 1e200 * q
    assert_array_equal(robot.M(far), robot.M(far.tolist()))
    assert_array_equal(robot.N(far), robot.N(far.tolist()))
    assert_array_equal(robot.C(far, v), robot.C(far.tolist(), v))
    assert np.isfinite(robot.M(np.full(robot.n, 1.7e308))).all()
    assert np.isfinite(robot.inverse_dynamics(q, v, 1e200 * a)).all()
    assert np.isfinite(robot.forward_dynamics(q, v, 1e200 * a)).all()


@pytest.mark.parametrize("follower", [False, True])
@pytest.mark.parametrize(
    "name", ["kinetic_energy", "coriolis_torque", "coriolis_transpose", "inverse_dynamics", "regressor"]
)
def test_products_of_four_numbers_that_overflow_are_refused(name: str, follower: bool) -> None:
    """A slide at 4e99 m that turns at 5e99 rad/s: m q² v² is 4e398, as an array, as a list and by `errors`."""
    body = BODY.replace("<inertial>", '<inertial><origin xyz="0.1 0.2 0.3"/>')
    limits = '<axis xyz="1 0 0"/><limit lower="-1e120" upper="1e120" effort="1" velocity="1"/>'
    tilts = '<axis xyz="0 1 0"/>'
    joints = [
        joint("turn", "base", "l1", Z, "continuous"),
        joint("tilt", "l1", "l2", tilts, "continuous"),
        joint("slide", "l2", "l3", limits, "prismatic"),
        joint("follow", "l1", "l4", f'{tilts}<mimic joint="tilt" multiplier="-1"/>', "continuous"),
    ][: 4 if follower else 3]
    robot = arm({"base": ""} | {f"l{i + 1}": body for i in range(len(joints))}, *joints)
    q, v = np.array([0.3, 0.7, 4.5e99]), np.array([4e99, 5e99, 3e99])
    given = [q, v, v][: 3 if name in ("inverse_dynamics", "regressor") else 2]
    for state in (given, [x.tolist() for x in given]):
        with pytest.raises(OverflowedError):
            getattr(robot, name)(*state)
        assert np.isnan(getattr(robot.nan_rows, name)(*state)).all()


ARM = rd.load("ur5")
NEAR = np.array([0.3, -0.2, 0.5, 0.7, -0.4, 0.9])
NARROW = {"Lagrangian": rd.Lagrangian(ARM, np.float32), "machine code": rd.compiled(ARM, dtype="float32")}
# what cannot be held, by what cannot hold it: the distance to the nearest number is 2⁻¹¹ and more
HIDDEN: dict[str, tuple[Any, Any]] = {
    "float64 in float32": (NARROW["Lagrangian"], NEAR + 1e12),
    "float64 in machine code of float32": (NARROW["machine code"], NEAR + 1e12),
    "longdouble in float64": (rd.Lagrangian(ARM), NEAR.astype(np.longdouble) + np.longdouble(2) ** 56),
    "longdouble in Pinocchio": (ARM, NEAR.astype(np.longdouble) + np.longdouble(2) ** 56),
    "integers in Pinocchio": (ARM, [10**17 + 1] * 6),
    "of a plant": (rd.Plant(NARROW["Lagrangian"]), NEAR + 1e12),
}


@pytest.mark.parametrize("case", HIDDEN)
def test_a_position_that_rounding_hides_is_refused(case: str) -> None:
    """M is a function of the angle; rounded by more than 1e-3 rad it is that of another configuration."""
    dynamics, q = HIDDEN[case]
    with pytest.raises(OverflowedError, match="q of joint 'shoulder_pan_joint' is too large for"):
        dynamics.M(q)


@pytest.mark.parametrize("name", NARROW)
def test_in_a_batch_the_row_that_rounding_hides_has_no_answer(name: str) -> None:
    q = np.tile(NEAR, (20, 1))
    q[7, 2] = 1e12 + 0.3
    answer = NARROW[name].nan_rows.M(q)
    assert np.isnan(answer[7]).all()
    assert np.array_equal(np.delete(answer, 7, axis=0), NARROW[name].M(np.delete(q, 7, axis=0)))
    with pytest.raises(OverflowedError, match="in row 7 of the batch"):
        NARROW[name].M(q)


@pytest.mark.parametrize("name", NARROW)
@pytest.mark.parametrize("far", [8e3, 1e12])
def test_a_float32_is_one_angle_however_large(name: str, far: float) -> None:
    """What float32 holds is not rounded: 64 u of float32 for M, whose terms are of one sign but for a few."""
    q = (NEAR + far).astype(np.float32)
    exact = midpoint(rd.Lagrangian(ARM, rd.accuracy.Ball(200)).M(q))
    for given in (q, q.astype(float)):
        difference = np.abs(NARROW[name].M(given) - exact).max()
        assert difference < 64 * np.finfo(np.float32).eps / 2 * np.abs(exact).max()


@pytest.mark.parametrize("rows", [0, 1, 20])
def test_a_time_that_rounding_hides_is_refused_by_machine_code(rows: int) -> None:
    """float32 tells 1e9 s to 64 s; what it holds, 2^30 s, it takes."""
    plant = rd.compiled(rd.Plant(ARM, [Push(lambda t, q, v: 0 * v + t)]), dtype="float32")
    q = np.tile(NEAR, (rows, 1) if rows else 1).astype(np.float32)

    def torque(t: float) -> Any:
        return plant.torque(q, 0 * q, t=np.full(rows, t) if rows else t)

    with pytest.raises(OverflowedError, match="t is too large for float32 to resolve"):
        torque(1e9 + 0.5)
    assert (torque(2.0**30) == np.float32(2**30)).all()


UR5 = rd.load("ur5")
ENGINES = {"robot": UR5, "own": rd.Lagrangian(UR5), "machine code": compiled("ur5")}
every_engine = pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)


def batch_of(rows: int) -> dict[str, np.ndarray]:
    """q, v, a, tau without zeros, (rows, 6) each."""
    values = np.random.default_rng(5).uniform(0.1, 1.5, (4, rows, 6))
    return dict(zip(("q", "v", "a", "tau"), values, strict=True))


@every_engine
@pytest.mark.parametrize("rows", [40, *long([5])])
@pytest.mark.parametrize("method", ARGUMENTS)
def test_states_that_are_not_finite_leave_the_others_their_answers(engine: Any, method: str, rows: int) -> None:
    """As in a batch without bad ones, to 1e-13 of the largest: tiles are cut otherwise."""
    given = [batch_of(rows)[name] for name in ARGUMENTS[method]]
    frame = ["tool0"] if method in FRAMED else []
    expected = getattr(engine, method)(*given, *frame)
    bad = [x.copy() for x in given]
    bad[-1][1, 2], bad[0][rows - 1, 0] = np.nan, np.inf
    with pytest.raises(
        NotFiniteError, match="must be finite, got nan for joint 'elbow_joint' in row 1 of the batch"
    ) as told:
        getattr(engine, method)(*bad, *frame)
    assert told.value.row == (1,)
    answer = getattr(engine.nan_rows, method)(*bad, *frame)
    lost = np.isin(np.arange(rows), (1, rows - 1))
    assert np.isnan(answer[lost]).all()
    np.testing.assert_allclose(answer[~lost], expected[~lost], rtol=0, atol=1e-13 * np.abs(expected).max())


@every_engine
@pytest.mark.parametrize("method", ["C", "inverse_dynamics", "kinetic_energy"])
def test_a_state_that_overflows_is_told_by_its_row(engine: Any, method: str) -> None:
    """v² = 1e360 does not fit into float64; the row has as many indices as the batch has axes."""
    given = [batch_of(24)[name].reshape(4, 6, 6) for name in ARGUMENTS[method]]
    given[1][2, 3] = 1e180 if method != "C" else 1.5e308
    with pytest.raises(OverflowedError, match=r"too large in row \(2, 3\) of the batch"):
        getattr(engine, method)(*given)
    answer = getattr(engine.nan_rows, method)(*given)
    assert np.isnan(answer[2, 3]).all()
    assert np.isfinite(np.delete(answer.reshape(24, -1), 15, axis=0)).all()


@every_engine
def test_no_answer_is_ever_other_than_finite(engine: Any) -> None:
    """One state at speeds up to 1e308: a finite answer or OverflowedError."""
    state = {name: x[0] for name, x in batch_of(1).items()}
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
        with pytest.raises(OverflowedError, match="result overflows: q, v, tau are too large"):
            robot.forward_dynamics(q, v, tau)


@pytest.mark.parametrize(
    "edit", [{"mass_scale": 1e300}, {"gravity": (0, 0, 1e13)}, {"armature": 1e200}], ids=lambda edit: next(iter(edit))
)
def test_edits_beyond_what_a_file_may_state_are_refused(edit: dict[str, Any]) -> None:
    """So that M, C and N of moderate batch_of cannot overflow."""
    with pytest.raises(EditError, match=r"beyond ±1e\+12 in SI units"):
        UR5.with_(**edit)


@pytest.mark.parametrize("rows", [3, 5000])
@pytest.mark.parametrize("wrong", [np.nan, 1e250])
def test_a_refused_batch_leaves_out_as_it_was(rows: int, wrong: float) -> None:
    """The bad state is the last, after rows that a kernel has computed."""
    fast, state = compiled("ur5"), batch_of(rows)
    state["v"][-1, 3] = wrong
    out = np.full((rows, 6), 7.0)
    with pytest.raises(QueryError):
        fast.inverse_dynamics(state["q"], state["v"], state["a"], out=out)
    assert_array_equal(out, 7.0)
    assert fast.nan_rows.inverse_dynamics(state["q"], state["v"], state["a"], out=out) is out
    assert np.isnan(out[-1]).all()
    assert np.isfinite(out[:-1]).all()


@every_engine
def test_nan_rows_hide_no_error_of_the_query_itself(engine: Any) -> None:
    """Only a state can be without a result, also a single one; wrong shapes and names are errors."""
    assert (engine.nan_rows.n, engine.nan_rows.joint_names) == (6, UR5.joint_names)
    assert np.isnan(engine.nan_rows.M(np.full(6, np.nan))).all()
    with pytest.raises(QueryError, match="q must have shape"):
        engine.nan_rows.M(np.ones((2, 5)))
    with pytest.raises(QueryError, match="nowhere"):
        engine.nan_rows.jacobian(np.full(6, np.nan), "nowhere")
    with pytest.raises(QueryError, match="read-only"):
        out = np.zeros((2, 6, 6))
        out.flags.writeable = False
        engine.nan_rows.M(np.ones((2, 6)), out=out)
    with pytest.raises(rd.RobotDynError, match="pass the robot itself"):
        rd.Plant(engine.nan_rows)


def test_compiled_plants_and_derivatives_have_nan_rows() -> None:
    """The other rows are those of a batch without bad ones, to 1e-13 of the largest."""
    fast = compiled("ur5")
    plant = rd.compiled(rd.Plant(UR5, [rd.effects.ViscousFriction(0.3)]))
    q, v, _, tau = batch_of(20).values()
    bad = q.copy()
    bad[3] = np.nan
    for engine, name in ((fast, "forward_dynamics_derivatives"), (plant, "forward_dynamics")):
        with pytest.raises(NotFiniteError):
            getattr(engine, name)(bad, v, tau)
        ours, theirs = getattr(engine.nan_rows, name)(bad, v, tau), getattr(engine, name)(q, v, tau)
        if isinstance(theirs, tuple):
            ours, theirs = np.stack(ours, axis=1), np.stack(theirs, axis=1)
        assert np.isnan(ours[3]).all()
        np.testing.assert_allclose(
            np.delete(ours, 3, axis=0), np.delete(theirs, 3, axis=0), rtol=0, atol=1e-13 * np.abs(theirs).max()
        )
    assert np.isnan(plant.nan_rows.M(bad)[3]).all() and plant.nan_rows.engine is plant.engine


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
    with pytest.raises(UndecidedError, match=f"not decided: rounding of {rounding} hides whether joint 'j"):
        own.forward_dynamics(q, v, tau)
    assert own.arithmetic.asarray(own.nan_rows.forward_dynamics(np.stack([q, q]), v, tau)).shape == (2, n)
    answer = rd.Lagrangian(robot, enough).forward_dynamics(q, v, tau)
    assert robot.joint_without_inertia is None
    if isinstance(enough, rd.accuracy.Ball):
        answer = rd.accuracy.midpoint(answer)
        with own.arithmetic.scope(), pytest.raises(UndecidedError, match=rounding):
            articulated_body(own.linkage, *(own.arithmetic.array(x) for x in (q, v, tau)))
    np.testing.assert_allclose(answer, robot.forward_dynamics(q, v, tau), rtol=0, atol=1e-8 * np.abs(answer).max())
