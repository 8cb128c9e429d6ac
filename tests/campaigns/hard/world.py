"""Every arm of up to twelve joints of the catalog, through what the families above hold their own cases to.

The laws are theirs: n u of the terms under Conditioning and Range, κ u under The tools. A free swing of 0.3 s is held
to its own error estimate, which has to be 0.3 of the true error at least, SciPy's DOP853 at 3e-14 being the truth. Dry
friction 1 % above the weight of each joint holds the arm for 1 s, to the last bit. The sampled loop is that of the
longest stable period: at 0.98 of it deviations shrink, at 1.02 the summary has words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.model import with_exact_right_angles
from robot_dyn.queries import FORWARD_DYNAMICS, M, N
from tests.campaigns.estimates.truth import truth
from tests.campaigns.hard import conditioning, far_out, sampled_control, tools
from tests.campaigns.hard.case import Case, Row

TITLE = "The world"
MATRIX = True
MAX_JOINTS, SWING_S, HELD_S = 12, 0.3, 1.0
LEAST = 0.3  # part of the true error that an estimate has to be
ARMS = [
    "a1", "anymal_b", "anymal_c", "b1", "bolt", "borinot_flying_arm_2", "cart_pole", "double_pendulum",
    "double_pendulum_continuous", "double_pendulum_simple", "finger_edu", "flyball_governor", "go1", "go2",
    "hextilt_flying_arm_5", "hyq_no_sensors", "iris", "kinova", "laikago", "light_tip", "massless_tip", "mimic_chain",
    "panda", "panda_collision", "pendulum", "planar_2r", "quadruped", "simple_pendulum", "skew_tree", "so100",
    "so101", "solo", "solo12", "talos_left_arm", "tiago_no_hand", "twodofs", "ur10", "ur10_joint_limited", "ur3",
    "ur3_gripper", "ur3_joint_limited", "ur5", "ur5_gripper", "ur5_joint_limited", "xarm7", "z1",
]  # fmt: skip
Column = Callable[[str, rd.Robot, int], Iterator[Row]]


def implementations(name: str, robot: rd.Robot, seed: int) -> Iterator[Row]:
    """All implementations against balls."""
    engines = conditioning.implementations(robot, compiled=True)
    found = list(conditioning.errors(robot, engines, conditioning.states(robot.n, seed)))
    sums = max(each.error for each in found if each.quantity != FORWARD_DYNAMICS.name)
    yield Row(name, "implementations: M … ID, n u", sums, conditioning.SUMS)
    solved = [each for each in found if each.quantity == FORWARD_DYNAMICS.name]
    worst = max(solved, key=lambda each: np.nan_to_num(each.error, nan=np.inf))
    yield Row(name, "implementations: FD, n u κ", worst.error, conditioning.SOLVED, worst.said)


def far(name: str, robot: rd.Robot, seed: int) -> Iterator[Row]:
    """M and N at 1e16 rad or m."""
    of = far_out.implementations(robot)
    q = 1e16 * far_out.general(robot.n, seed)[0]
    worst = max(
        far_out.error(of, implementation, quantity, {"q": q}) for implementation in of.engines for quantity in (M, N)
    )
    yield Row(name, "1e16 rad: M, N, n u", worst, conditioning.SUMS)


def rows_of_a_batch(name: str, robot: rd.Robot, seed: int) -> Iterator[Row]:
    """A row of NaN; a batch against its states; two threads."""
    found = list(far_out.beside(name, far_out.implementations(robot), np.nan, seed))
    yield Row(name, "NaN in a row: other bits, rows not named", sum(row.found for row in found), 0.0)
    found = list(tools.batches(robot, seed))
    single = max(row.found for row in found if row.allowed)
    yield Row(name, "batch and single, κ u", single, 4)
    yield Row(name, "two threads: other bits", sum(row.found for row in found if not row.allowed), 0.0)


def swing(name: str, robot: rd.Robot, seed: int) -> Iterator[Row]:
    """True error over the estimate."""
    rng = np.random.default_rng((47, seed))
    setup = rd.Setup(rd.Plant(robot), rng.uniform(-0.5, 0.5, robot.n), np.zeros(robot.n), duration_s=SWING_S)
    run = rd.simulate(setup)
    if run.outcome.ending != "finished":
        yield Row(name, "swing: true error / estimate", np.nan, 1 / LEAST, run.outcome.text or run.outcome.ending)
        return
    if robot.couplings.trivial:
        true = np.vstack([setup.q0, truth(setup, run.t[1:])])
    else:
        true = _integrated(robot, setup.q0, run.t)
    floor = 1e-12 * (1 + np.abs(run.q).max())
    error, estimate = np.abs(run.q - true).max(), run.error.largest
    yield Row(
        name, "swing: true error / estimate", float(max(error, floor) / max(estimate, floor)), 1 / LEAST, run.error.note
    )


def _integrated(robot: rd.Robot, q0: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Of coupled joints, which Pinocchio alone does not have."""
    n = robot.n

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], robot.forward_dynamics(y[:n], y[n:], np.zeros(n))])

    start = np.concatenate([q0, np.zeros(n)])
    return solve_ivp(rate, (0, times[-1]), start, "DOP853", times, rtol=3e-14, atol=3e-14).y[:n].T


def held(name: str, robot: rd.Robot, seed: int) -> Iterator[Row]:
    """What friction above the weight lets the arm move."""
    q = np.random.default_rng((53, seed)).uniform(-0.5, 0.5, robot.n)
    weight = np.abs(robot.N(q))
    effects = [rd.effects.DryFriction(1.01 * weight + 1e-3 * weight.max() + 1e-9)]
    run = rd.simulate(rd.Plant(robot, effects), q, duration_s=HELD_S)
    yield Row(name, "held by friction: moved", float(np.abs(run.q - q).max()), 0.0, run.outcome.text)


def sampled(name: str, robot: rd.Robot, seed: int) -> Iterator[Row]:
    """A PD at 0.98 and 1.02 of the longest stable period."""
    robot.forward_dynamics(np.zeros(robot.n), np.zeros(robot.n), np.zeros(robot.n))  # refused where M is singular
    for row in sampled_control.limit_of(name, "PD", seed):
        if "exact map" not in row.measure:
            yield replace(row, case=name, measure=f"PD: {row.measure}")


COLUMNS: tuple[Column, ...] = (implementations, far, rows_of_a_batch, swing, held, sampled)


def arm(name: str, seed: int) -> Iterator[Row]:
    """All columns of an arm; a refusal is a figure too."""
    robot, _ = with_exact_right_angles(rd.load(name))
    for column in COLUMNS:
        try:
            yield from column(name, robot, seed)
        except RobotDynError as refusal:
            yield Row(name, column.__name__, np.nan, 0.0, str(refusal))


def left_out(seed: int) -> Iterator[Row]:
    """Arms of the catalog that are not in ARMS."""
    there = []
    for name in rd.list_robots():
        with suppress(RobotDynError):  # what is refused is in docs/reference/findings.md
            there += [name] * (rd.load(name).n <= MAX_JOINTS)
    yield Row("the catalog", "arms that are left out", float(len(set(there) - set(ARMS))), 0.0)


CASES = [
    *(Case(name, partial(arm, name), name != "double_pendulum") for name in ARMS),
    Case("none is left out", left_out, full=True),
]
