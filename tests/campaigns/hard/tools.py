"""One question asked in several ways: alone or in a batch, on one thread or two, of code made anew or kept.

Bit-equal where the same instructions run: threads, code from the cache, another process, runs beside one that diverges.
Elsewhere sums are ordered otherwise, and answers differ by 4 κ u of the scales of `compare` at most, κ that of M scaled
to a unit diagonal (1 where M is singular): what is solved has it as a factor, and entries of M, which is its own scale,
are that much smaller than their terms where links fold back (5 to 8 u of a batch of z1, κ 13 to 32). Right
angles written out in full change an rpy by a known angle δ: an entry is made of products of rotations, so that it
changes by 2 n δ of its terms at most, and forward dynamics by κ times as much. A run of RK4 by either engine adds up N
steps: 4 κ u √N of |q| + |v|, where the motion is not chaotic.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import robot_dyn as rd
from robot_dyn.lagrange import (
    acceleration_norm,
    diagonal_scale,
    floored,
    magnitudes,
    mass_norm,
    scaled,
    unit_diagonal_condition,
)
from robot_dyn.model import with_exact_right_angles
from robot_dyn.queries import CORIOLIS_TORQUE, FORWARD_DYNAMICS, INVERSE_DYNAMICS, C, M, N, Quantity
from tests.campaigns.hard.case import Case, Row
from tests.campaigns.hard.conditioning import U

TITLE = "The tools"
ASKED = (M, C, N, CORIOLIS_TORQUE, INVERSE_DYNAMICS, FORWARD_DYNAMICS)
BATCH, TILE, STEPS = 37, 70, 200
DIGEST = "import sys; from tests.campaigns.hard.tools import digest; print(digest(*sys.argv[1:]))"


def states(n: int, seed: int) -> dict[str, np.ndarray]:
    """Of a batch, (BATCH, n) each."""
    rng = np.random.default_rng((31, seed))
    v, a, tau = rng.normal(size=(3, BATCH, n))
    return {"q": rng.uniform(-1, 1, (BATCH, n)), "v": v, "a": a, "tau": 10 * tau}


def queries(robot: rd.Robot) -> tuple[Quantity, ...]:
    """Those that have an answer."""
    return tuple(each for each in ASKED if not each.solves or robot.joint_without_inertia is None)


def condition(robot: rd.Robot, q: np.ndarray) -> float:
    """κ of M, scaled to a unit diagonal; 1 where M is singular."""
    return unit_diagonal_condition(robot.M(q)) if robot.joint_without_inertia is None else 1.0


def part(robot: rd.Robot, quantity: Quantity, state: dict[str, np.ndarray], one: np.ndarray, two: np.ndarray) -> float:
    """How far two answers at one state are apart on the scale of `compare`."""
    size, absolute = magnitudes(rd.Lagrangian(robot).linkage, state["q"]), {key: np.abs(x) for key, x in state.items()}
    inertia = robot.M(state["q"])
    if quantity.solves:
        torques = state["tau"], robot.coriolis_torque(state["q"], state["v"]), robot.N(state["q"])
        whole = acceleration_norm(inertia, torques, FORWARD_DYNAMICS.terms(size, absolute))
        return float(mass_norm(inertia, one - two)) / whole
    scale = diagonal_scale(inertia) if quantity.definite else quantity.terms(size, absolute)
    return float(scaled(one - two, floored(np.asarray(scale))).max())


def batches(robot: rd.Robot, seed: int) -> Iterator[Row]:
    """A batch against its states one by one, and two threads against one."""
    given, name = states(robot.n, seed), robot.name
    one, two = rd.compiled(robot), rd.compiled(robot, threads=2)
    engines = {"Pinocchio": robot, "Lagrangian": rd.Lagrangian(robot), "machine code": one}
    for implementation, engine in engines.items():
        worst = 0.0
        for quantity in queries(robot):
            whole = quantity.evaluate(engine, given)
            for k in (0, BATCH // 2, BATCH - 1):
                state = {key: x[k] for key, x in given.items()}
                apart = part(robot, quantity, state, whole[k], quantity.evaluate(engine, state))
                worst = max(worst, apart / (condition(robot, state["q"]) * U))
        yield Row(f"{name}: batch and single", f"{implementation}: difference in κ u", worst, 4)
    other = sum(
        int(np.sum(quantity.evaluate(one, given) != quantity.evaluate(two, given))) for quantity in queries(robot)
    )
    yield Row(f"{name}: one thread and two", "machine code: entries with other bits", other, 0)


def digest(name: str, seed: str, kept: str = "") -> str:
    """Of all answers of machine code, taken from the cache where `kept` is not empty."""
    robot = rd.load(name)
    made, hashed = rd.compiled(robot, cache=bool(kept)), hashlib.sha256()
    for quantity in queries(robot):
        hashed.update(quantity.evaluate(made, states(robot.n, int(seed))).tobytes())
    return hashed.hexdigest()


def caches(name: str, seed: int) -> Iterator[Row]:
    """Code made anew, code from the cache, and that of another process."""
    fresh, kept = digest(name, str(seed)), [digest(name, str(seed), "kept") for _ in range(2)]
    command = [sys.executable, "-W", "ignore", "-c", DIGEST, name, str(seed), "kept"]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    others = [*kept, child.stdout.strip() or child.stderr[-200:]]
    differing = sum(each != fresh for each in others)
    yield Row(f"{name}: made anew, kept twice, another process", "answers with other bits", differing, 0)


def right_angles(name: str, seed: int) -> Iterator[Row]:
    """The file as it stands against its right angles written out in full."""
    robot = rd.load(name)
    exact, changes = with_exact_right_angles(robot)
    if not changes:
        yield Row(f"{name}: right angles", "none is written short: difference", 0.0, 0.0)
        return
    change, given, worst = max(each.change for each in changes), states(robot.n, seed), 0.0
    for quantity in queries(robot):
        for k in range(3):
            state = {key: x[k] for key, x in given.items()}
            apart = part(robot, quantity, state, quantity.evaluate(robot, state), quantity.evaluate(exact, state))
            factor = condition(robot, state["q"]) if quantity.solves else 1.0
            worst = max(worst, (apart - 4 * factor * U) / (factor * robot.n * change))
    yield Row(f"{name}: right angles, δ = {change:.0e}", "difference in κ n δ", max(worst, 0.0), 2)


def engines(name: str, seed: int) -> Iterator[Row]:
    """A run by the interpreted engine, by machine code, and in lock step on one thread and two."""
    robot, _ = with_exact_right_angles(rd.load(name))
    q, v = np.random.default_rng((37, seed)).uniform(-0.5, 0.5, (2, TILE, robot.n))
    inertia = np.diag(robot.M(q[0]))  # gains in its units are as slow on every arm
    setup = rd.Setup(
        rd.Plant(robot, [rd.effects.ViscousFriction(inertia)]), q[0], v[0], duration_s=STEPS * 1e-3, method="RK4",
        controller=rd.control.PD(rd.control.hold(q[0]), kp=25 * inertia, kd=2 * inertia, period_s=5e-3), step_s=1e-3,
        estimate_error=False,
    )  # fmt: skip
    case = f"{name}: a run of {STEPS} steps"
    runs = {each: rd.simulate(replace(setup, engine=each)) for each in ("interpreted", "compiled")}
    many = [rd.rollouts(setup, q, v, threads=threads) for threads in (1, 2)]
    size = np.abs(runs["compiled"].q).max() + np.abs(runs["compiled"].v).max()
    unit = max(condition(robot, x) for x in runs["compiled"].q[::50]) * U * np.sqrt(STEPS) * size
    apart = np.abs(runs["interpreted"].q - runs["compiled"].q).max()
    yield Row(case, "interpreted and machine code: q apart, in κ u √N (|q| + |v|)", float(apart / unit), 4)
    apart = np.abs(many[0].q[0] - runs["compiled"].q).max()
    yield Row(case, "lock step and machine code: q apart, in κ u √N (|q| + |v|)", float(apart / unit), 4)
    other = sum(int(np.sum(getattr(many[0], x) != getattr(many[1], x))) for x in ("q", "v"))
    yield Row(case, "one thread and two: entries with other bits", other, 0)
    v[TILE // 2] = 1e9
    wild = rd.rollouts(setup, q, v, threads=1)
    beside = np.arange(TILE) != TILE // 2
    other = int(np.sum(wild.q[beside] != many[0].q[beside]))
    yield Row(case, "beside a run that diverges: entries with other bits", other, 0)
    yield Row(case, "runs that diverge and are not named", int(not wild.diverged[TILE // 2]), 0)


def rows(name: str, seed: int) -> Iterator[Row]:
    yield from batches(with_exact_right_angles(rd.load(name))[0], seed)
    yield from caches(name, seed)
    yield from right_angles(name, seed)
    yield from engines(name, seed)


ROBOTS = ("planar_2r", "ur5", "panda", "kinova")
CASES = [Case(name, partial(rows, name), name != "planar_2r") for name in ROBOTS]
