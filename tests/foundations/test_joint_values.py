"""Numbers by joint name are those in the order of q, wherever a motion takes them; joints left out have 0."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.foundations import ControlError, PlanError, QueryError
from robot_dyn.tools.motors import path, point_to_point
from robot_dyn.tools.step import Stepper

ARM = rd.load("planar_2r")
NAMES = ARM.joint_names
FIRST, SECOND = NAMES
BY_JOINT, IN_ORDER = {SECOND: 0.4}, [0.0, 0.4]
ROWS = [{FIRST: 0.1}, {SECOND: 0.4, FIRST: 0.3}, {}]
T = np.linspace(-0.1, 1.1, 7)


def extra(module: str) -> Any:
    return pytest.mark.skipif(find_spec(module) is None, reason="the extra plan")


def motion(reference: rd.control.PiecewisePolynomial) -> np.ndarray:
    return np.concatenate(reference.at(T))


def hold(q: Any) -> np.ndarray:
    return motion(rd.control.hold(q, joint_names=NAMES))


def quintic(q: Any) -> np.ndarray:
    return motion(rd.control.quintic(q, q, 1.0, v0=q, v1=q, a0=q, a1=q, joint_names=NAMES))


def via_points(q: Any) -> np.ndarray:
    points = [q, {FIRST: 0.2, SECOND: 0.7} if isinstance(q, dict) else [0.2, 0.7]]
    return motion(rd.control.via_points([0.0, 1.0], points, v0=q, v1=q, joint_names=NAMES))


def rests(q: Any) -> np.ndarray:
    table = {"t": [0.0, 0.5, 1.0], f"{FIRST} [rad]": [0.0, 0.01, 0.02]}
    return motion(rd.control.from_samples(ARM, table, q0=q, ends="rest").reference)


def pose(q: Any) -> np.ndarray:
    target = ARM.placement([0.3, 0.5], ARM.frame_names[-1])[:3, 3]
    return rd.control.inverse_kinematics(ARM, (target, None), frame=ARM.frame_names[-1], q0=q, starts=1).q


def straight(q: Any) -> np.ndarray:
    end = {FIRST: 0.5, SECOND: -0.2} if isinstance(q, dict) else [0.5, -0.2]
    rate = {FIRST: 2.0, SECOND: 2.0} if isinstance(q, dict) else 2.0
    jerk = {FIRST: 20.0} if isinstance(q, dict) else [20.0, np.inf]
    plan = point_to_point(ARM, q, end, velocity=rate, acceleration=rate, jerk=jerk, v1={FIRST: 0.1, SECOND: 0.0})
    return motion(plan.reference)


def curved(q: Any) -> np.ndarray:
    points = [q, {FIRST: 0.5, SECOND: -0.2} if isinstance(q, dict) else [0.5, -0.2]]
    return motion(path(ARM, points, effort=60.0, velocity=3.0).reference)


def lanes(q: Any) -> np.ndarray:
    arms = Stepper(ARM, 3, period_s=0.01, step_s=1e-3)
    arms.reset(q, q)
    state = arms.step({FIRST: np.ones(3)} if isinstance(q, dict) else np.tile([1.0, 0.0], (3, 1)))
    return np.concatenate([state.q, state.v])


WAYS = [
    hold, quintic, via_points, rests, pose, lanes,
    pytest.param(straight, marks=extra("ruckig")), pytest.param(curved, marks=extra("toppra")),
]  # fmt: skip


@pytest.mark.parametrize("of", WAYS)
def test_numbers_by_joint_are_those_in_the_order_of_q(of: Any) -> None:
    np.testing.assert_array_equal(of(BY_JOINT), of(IN_ORDER))


@pytest.mark.parametrize("of", WAYS)
@pytest.mark.parametrize("wrong", [{"elbow": 0.1}, {}, {FIRST: "x"}, {FIRST: np.nan}])
def test_unknown_joints_and_other_values_are_refused(of: Any, wrong: dict[str, Any]) -> None:
    with pytest.raises(RobotDynError, match=r"joint|number|finite"):
        of(wrong)


def test_a_list_of_states_by_joint_is_a_batch() -> None:
    rows = np.array([[0.1, 0.0], [0.3, 0.4], [0.0, 0.2]])
    np.testing.assert_array_equal(ARM.N([{FIRST: 0.1}, {SECOND: 0.4, FIRST: 0.3}, {SECOND: 0.2}]), ARM.N(rows))
    columns = {FIRST: rows[:, 0], SECOND: rows[:, 1]}
    np.testing.assert_array_equal(
        motion(rd.control.via_points([0.0, 0.5, 1.0], columns, joint_names=NAMES)),
        motion(rd.control.via_points([0.0, 0.5, 1.0], rows)),
    )


def test_states_of_a_list_may_be_by_name_or_in_order() -> None:
    rows = [{FIRST: 0.1}, [0.3, 0.4], {SECOND: 0.2}]
    array = np.array([[0.1, 0.0], [0.3, 0.4], [0.0, 0.2]])
    np.testing.assert_array_equal(ARM.N(rows), ARM.N(array))
    for plan in (
        lambda points: rd.control.via_points([0.0, 0.5, 1.0], points, joint_names=NAMES),
        lambda points: rd.control.from_samples(ARM, points, time=[0.0, 0.5, 1.0]).reference,
    ):
        np.testing.assert_array_equal(motion(plan(rows)), motion(plan(array)))
    with pytest.raises(QueryError, match=r"q\[1\] must have shape \(2,\)"):
        ARM.N([{FIRST: 0.1}, [0.3]])


def test_a_row_without_joints_and_rows_of_several_shapes_are_refused() -> None:
    with pytest.raises(QueryError, match=r"q\[2\]: no joint is named"):
        ARM.N(ROWS)
    with pytest.raises(QueryError, match="one shape"):
        ARM.N([{FIRST: [0.1, 0.2, 0.3]}, {FIRST: [0.1, 0.2]}])


@pytest.mark.parametrize(
    "call",
    [
        lambda q: rd.control.hold(q),
        lambda q: rd.control.quintic(q, [0.0, 0.1], 1.0),
        lambda q: rd.control.quintic([0.0, 0.1], q, 1.0),
        lambda q: rd.control.via_points([0.0, 1.0], [q, q]),
        lambda q: rd.control.via_points([0.0, 1.0], [[0.0, 0.1], [0.2, 0.3]], v1=q),
    ],
)
def test_names_without_an_order_ask_for_it(call: Any) -> None:
    with pytest.raises(ControlError, match=r"joint_names=.*arm\.joint_names"):
        call(BY_JOINT)


@extra("ruckig")
def test_a_joint_without_a_limit_of_acceleration_is_refused() -> None:
    with pytest.raises(PlanError, match="acceleration must be finite"):
        point_to_point(ARM, BY_JOINT, [0.5, -0.2], velocity=1.0, acceleration={FIRST: 2.0}, jerk=np.inf)


def test_points_of_a_scene_are_by_joint_or_in_order(tmp_path: Path) -> None:
    motions = []
    for points in (f"[[0.1, 0.0], {{{SECOND} = 0.4}}]", "[[0.1, 0.0], [0.0, 0.4]]"):
        reference = f'[reference]\nkind = "via_points"\ntimes_s = [0.5, 1.0]\npoints = {points}\n'
        scene = f'robot = "planar_2r"\nduration_s = 1.0\n[control]\nkind = "pd"\nkp = 9.0\nkd = 3.0\n{reference}'
        (tmp_path / "scene.toml").write_text(scene)
        controller: Any = rd.read_scene(tmp_path / "scene.toml").controller
        motions.append(motion(controller.reference))
    np.testing.assert_array_equal(*motions)
