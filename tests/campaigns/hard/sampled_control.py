"""Sampled control at 0.98 and 1.02 of the longest stable period, with delay, and with an integral in saturation.

    0.98 T*: |q − q*| over the last tenth ≤ that of the start;   1.02 T*: twice that at 0.98 at least, and it is said

T* is the longest stable period of `linearised` at the equilibrium q*.
Its truth is the spectral radius of the exact map of a period, by matrix exponentials of M⁻¹ and ∂N/∂q, with no line of
the library's own map: ρ(0.98 T*) ≤ 1 < ρ(1.02 T*), to 1e-6 for ∂N/∂q by differences. A loop that starts within 1e-3 rad
stays where it is linear; 1500 periods are enough for growth by e even where ρ − 1 = 1e-3. What grows ends where the
arm's nonlinearity or its effort limits leave it: it blows up or hunts. The integral z of a PID with back-calculation is
u − kp e − kd ė at a tick, and in saturation goes a part T/T_t of the way to ± u_max + T_t ki e − kp e − kd ė: so that
|z| ≤ u_max + max(kp |e| + kd |ė| + T_t ki |e|), to the rounding of its sums, 1e-12, for T ≤ T_t.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

import robot_dyn as rd
from robot_dyn.simulation import RemarkKind, linearised, remark_lines
from tests.campaigns.hard.case import Case, Row
from tests.loops import growth

TITLE = "Sampled control"
ARMS = (
    "pendulum", "planar_2r", "double_pendulum", "finger_edu", "ur3", "ur5", "ur10", "panda", "kinova", "xarm7", "z1",
)  # fmt: skip
SHORT = ("planar_2r", "ur5")
PERIODS, START, BANDWIDTH = 1500, 1e-3, 20.0
LATE = {"PD": (0.0, 0.0), "PD with delay": (0.4, 1.3)}  # of measurement and actuation, in periods


def at_rest(name: str, seed: int) -> tuple[rd.Robot, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """The arm, a posture, and gains of 20 rad/s for the inertia of each joint there."""
    arm = rd.load(name)
    arm = arm.with_(lock=dict.fromkeys(arm.joint_names[7:], 0.0)) if name == "panda" else arm
    q = 0.3 * np.cos(np.arange(arm.n) + 0.4) + np.random.default_rng((41, seed)).uniform(-0.05, 0.05, arm.n)
    inertia = np.diag(arm.M(q))
    return arm, q, (BANDWIDTH**2 * inertia, 1.8 * BANDWIDTH * inertia)


def controller(arm: rd.Robot, q: np.ndarray, gains: tuple[np.ndarray, np.ndarray], kind: str) -> rd.control.Controller:
    if kind == "PID in saturation":
        limit = 1.5 * np.abs(arm.N(q)) + 2e-3 * gains[0]  # [N m], of twice the deviation at the start
        return rd.control.PID(
            rd.control.hold(q), kp=gains[0], ki=3 * gains[0], kd=gains[1], effort_limit=limit, period_s=1e-3
        )
    law = rd.control.PD(rd.control.hold(q + arm.N(q) / gains[0]), kp=gains[0], kd=gains[1], period_s=1e-3)
    return (
        rd.control.Loop(law, measurement_delay_periods=LATE[kind][0], actuation_delay_periods=LATE[kind][1])
        if kind != "PD"
        else law
    )


def run_at(arm: rd.Robot, q: np.ndarray, law: rd.control.Controller, period: float) -> tuple[rd.Trajectory, float]:
    """A run of 1500 periods, and how far it is from q in its last tenth over how far it was at its start."""
    start = q + START * np.cos(3.0 * np.arange(arm.n) + 1.0)
    run = rd.simulate(
        arm, start, duration_s=PERIODS * period, controller=law.at_period(period), method="RK4", step_s=period,
        record_every_s=period, estimate_error=False,
    )  # fmt: skip
    if run.outcome.ending != "finished":
        return run, np.inf
    late = run.t > 0.9 * run.t[-1]
    return run, float(np.abs(run.q[late] - q).max() / np.abs(start - q).max())


def words(run: rd.Trajectory) -> str:
    """What the summary says of a loop that is unstable."""
    of = [each for each in run.remarks if each.kind in (RemarkKind.UNSTABLE, RemarkKind.CHATTER)]
    return "; ".join([run.outcome.text] * bool(run.outcome.text) + remark_lines(of))


def limit_of(name: str, kind: str, seed: int) -> Iterator[Row]:
    arm, q, gains = at_rest(name, seed)
    case, law = f"{name}, {kind}", controller(arm, q, gains, kind)
    z = arm.N(q) if kind not in LATE else np.zeros(0)
    limit = linearised(rd.Plant(arm), law, 0.0, np.concatenate([q, 0 * q, z])).longest_period()
    if kind in LATE:
        radii = [growth(arm, q, gains, part * limit, LATE[kind]) for part in (0.98, 1.02)]
        yield Row(case, "ρ of the exact map at 0.98, less 1", radii[0] - 1, 1e-6)
        yield Row(case, "1 less ρ of the exact map at 1.02", 1 - radii[1], -1e-6)
    run, stays = run_at(arm, q, law, 0.98 * limit)
    yield Row(case, "late deviation over that of the start, at 0.98", stays, 1.0, words(run))
    run, grows = run_at(arm, q, law, 1.02 * limit)
    yield Row(case, "late deviation at 0.98 over that at 1.02", stays / grows, 0.5)
    yield Row(case, "1.02 without a word in the summary", float(not words(run)), 0.0)


def _wound_up(name: str, seed: int) -> Iterator[Row]:
    """A step of the reference by 1 rad, of which the effort limit leaves a tenth of the torque."""
    arm, q, gains = at_rest(name, seed)
    case, limit = f"{name}, a step in saturation", 1.5 * np.abs(arm.N(q)) + 0.1 * gains[0]
    law = rd.control.PID(
        rd.control.hold(q + 1.0), kp=gains[0], ki=2 * gains[0], kd=gains[1], effort_limit=limit, period_s=1e-3
    )
    run = rd.simulate(
        arm,
        q,
        duration_s=2.0,
        controller=law,
        method="RK4",
        step_s=1e-3,
        record_every_s=1e-3,
        estimate_error=False,
    )
    e, z = np.abs(q + 1.0 - run.q), np.abs(run.controller_states)
    asked = law.kp * e + law.kd * np.abs(run.v) + law.tracking_time_s * law.ki * e
    yield Row(case, "integral over its bound", float((z / (limit + asked.max(axis=0))).max()), 1 + 1e-12)
    reached = {each.joint for each in run.remarks if each.kind is RemarkKind.EFFORT_REACHED}
    cut = {name for name, u, most in zip(arm.joint_names, run.u.T, limit, strict=True) if (np.abs(u) >= most).any()}
    yield Row(case, "joints at their limit that are not said", float(len(cut - reached)), 0.0)


CASES = [
    *(
        Case(f"{name}, {kind}", partial(limit_of, name, kind), name not in SHORT)
        for name in ARMS
        for kind in (*LATE, "PID in saturation")
    ),
    *(Case(f"{name}, a step in saturation", partial(_wound_up, name), name not in SHORT) for name in ARMS),
]
