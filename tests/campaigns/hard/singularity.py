"""Operational-space control where J M⁻¹ Jᵀ is singular, beside the same path 0.1 m away from there.

    |τ| ≤ 3 |τ′|,   |v| ≤ 3 |v′|,   largest over joints and times;   what is damped is said, with its eigenvalue

τ′ and v′ are of the parallel path, within reach, 0.1 m beside it on which the smallest eigenvalue stays largest. At the
edge of reach the elbow moves by the root of what is left, which doubles v there; a damped task asks for no more than
‖ẍ‖/ε. Where a target beyond reach takes more than threefold, the damping has to be said: whether it acts is judged at
the samples by numpy.linalg, outside the library. Orientation errors are θ a in closed form. R and R_d are rounded to
3 u each, four times their sum stands in the products of the quaternion, and φ is twice its angle, of length π:
2 · 4 · 6 u π < 64 u π.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn.control import POSE, POSITION, CartesianReference, line, orientation_error
from robot_dyn.foundations import rotation
from robot_dyn.simulation import RemarkKind, remark_lines
from tests.campaigns.hard.case import Case, Row

TITLE = "Kinematic singularity"
U = 2.0**-53
AWAY = 0.1  # [m]
MOST = 3.0
TURN = 64 * np.pi  # u, of a rotation vector near π
NEAR = (1e-3, 1e-6, 1e-9, 0.0)  # [rad] of half a turn


@dataclass(frozen=True)
class Path:
    """A straight path of a frame to a singular posture, or past it.

    Attributes:
        robot: Name in the catalog.
        frame: The frame.
        rows: Rows of its twist.
        start: Posture at the start.
        singular: Singular posture.
        part: Where the path ends: 1 at the pose of that posture, 2 as far behind it.
        beyond: How far beyond that, in [m].
        threshold: Of the damping.
    """

    robot: str
    frame: str
    rows: tuple[int, ...]
    start: tuple[float, ...]
    singular: tuple[float, ...]
    part: float = 1.0
    beyond: float = 0.0
    threshold: float = 0.01


PLANAR = Path("planar_2r", "tip", (0, 2), (0.4, 1.2), (0.5, 0.0))
ELBOW = Path("ur5", "wrist_1_link", POSITION, (0.3, -0.9, 1.4, -0.5, 1.0, 0.2), (0.3, -0.5, 0.0, -0.5, 1.0, 0.2))
WRIST = Path("ur5", "tool0", POSE, (0.3, -0.9, 1.4, -0.5, 0.4, 0.2), (0.35, -0.9, 1.4, -0.5, 0.0, 0.2), 2.0)
PANDA = Path(
    "panda", "panda_hand_tcp", POSE, (0.1, 0.4, 0.2, -1.3, 0.1, 1.5, 0.1), (0.1, 0.6, 0.1, -0.5, 0.1, 1.5, 0.1)
)
PATHS = {
    "planar_2r to the edge of its reach": PLANAR,
    "planar_2r 0.1 m beyond": replace(PLANAR, beyond=0.1),
    "planar_2r 0.1 m beyond, threshold 0.1": replace(PLANAR, beyond=0.1, threshold=0.1),
    "ur5's elbow to the edge of its reach": ELBOW,
    "ur5's elbow 0.1 m beyond": replace(ELBOW, beyond=0.1),
    "ur5's elbow 0.1 m beyond, threshold 0.1": replace(ELBOW, beyond=0.1, threshold=0.1),
    "ur5's pose through its wrist": WRIST,
    "panda's pose towards its elbow": PANDA,
    "panda's pose 0.2 m beyond": replace(PANDA, beyond=0.2),
}
SHORT = {"ur5's elbow 0.1 m beyond", "ur5's pose through its wrist"}


def arm(name: str) -> rd.Robot:
    """The arm, without its fingers."""
    made = rd.load(name)
    return made.with_(lock=dict.fromkeys(made.joint_names[7:], 0.0)) if name == "panda" else made


def reference(robot: rd.Robot, path: Path, start: np.ndarray, shift: Any = 0.0) -> CartesianReference:
    """The line in 1 s, and the turn of a pose."""
    g, s = (robot.placement(q, path.frame) for q in (start, np.array(path.singular)))
    way = s[:3, 3] - g[:3, 3]
    end = g[:3, 3] + path.part * way + path.beyond * way / np.linalg.norm(way)
    if path.rows != POSE:
        return line(g[:3, 3] + shift, end + shift, 1.0)
    turn = path.part * orientation_error(s[:3, :3], g[:3, :3])
    angle = np.linalg.norm(turn)
    last = rotation(turn / angle, angle) @ g[:3, :3]
    return line(g[:3, 3] + shift, end + shift, 1.0, rotation=g[:3, :3], rotation_end=last)


def smallest(robot: rd.Robot, path: Path, q: np.ndarray) -> float:
    """Smallest eigenvalue of J M⁻¹ Jᵀ at a posture."""
    J = robot.jacobian(q, path.frame)[list(path.rows)]
    return float(np.linalg.eigvalsh(J @ np.linalg.inv(robot.M(q)) @ J.T)[0])


def reached(robot: rd.Robot, path: Path, target: CartesianReference, t: float, q: np.ndarray) -> np.ndarray | None:
    """The posture near q with the pose of a time, by Newton's method; None if there is none."""
    p, R, *_ = target.at(t)
    for _ in range(30):
        g, J = robot.placement(q, path.frame), robot.jacobian(q, path.frame)[list(path.rows)]
        turn = np.zeros(3) if R is None else orientation_error(R, g[:3, :3])
        e = np.concatenate([p - g[:3, 3], turn])[list(path.rows)]
        if np.abs(e).max() < 1e-10:
            return q
        q = q + np.linalg.pinv(J, rcond=1e-6) @ e
    return None


def parallel(robot: rd.Robot, path: Path, start: np.ndarray) -> tuple[CartesianReference, np.ndarray]:
    """The path 0.1 m away on which the smallest eigenvalue stays largest, and a posture at its start.

    It is parallel to the part within reach.
    """
    found, path = [], replace(path, beyond=0.0)
    for axis in (each for each in range(3) if each in path.rows):
        for side in (-AWAY, AWAY):
            target = reference(robot, path, start, side * np.eye(3)[axis])
            first = q = reached(robot, path, target, 0.0, start)
            worst = np.inf
            for t in np.linspace(0, 1, 21):
                q = None if q is None else reached(robot, path, target, float(t), q)
                worst = min(worst, smallest(robot, path, q)) if q is not None else -1.0
            found.append((worst, len(found), target, first))
    worst, _, target, first = max(found)
    assert worst > 0, "no parallel path within reach"
    return target, first


def control(
    robot: rd.Robot, path: Path, target: CartesianReference, posture: np.ndarray
) -> rd.control.OperationalSpace:
    """A bandwidth of 10 rad/s, critically damped, and the posture of the start where the task leaves one free."""
    return rd.control.OperationalSpace(
        robot,
        path.frame,
        target,
        kp=100.0,
        kd=20.0,
        posture=posture,
        posture_kp=25.0,
        posture_kd=10.0,
        rows=path.rows,
        threshold=path.threshold,
    )


def _path(name: str, path: Path, seed: int) -> Iterator[Row]:
    robot, rng = arm(path.robot), np.random.default_rng((31, seed))
    start = np.array(path.start) + rng.uniform(-0.03, 0.03, robot.n)
    beside, other = parallel(robot, path, start)
    options = {"duration_s": 1.5, "record_every_s": 2e-3, "estimate_error": False}
    law = control(robot, path, reference(robot, path, start), start)
    run = rd.simulate(robot, start, controller=law, **options)
    away = rd.simulate(robot, other, controller=control(robot, path, beside, other), **options)
    told = [each for each in run.remarks if each.kind is RemarkKind.DAMPED]
    said = "; ".join([run.outcome.text] * bool(run.outcome.text) + remark_lines(told))
    for symbol, row in (("v", 1), ("τ", 2)):
        largest = [float(np.abs(each.extremes[row]).max()) for each in (run, away)]
        yield Row(name, f"|{symbol}| over that of the path {AWAY} m away", largest[0] / largest[1], MOST, said)
    least = min(smallest(robot, path, q) for q in run.q)
    yield Row(name, "damping that is not said", float(least < path.threshold and not told), 0.0)
    if told:
        off = abs(max(least, 0.0) - max(told[0].value, 0.0)) / path.threshold
        yield Row(name, "its eigenvalue beside that of the samples, of the threshold", off, 0.01)


def _half_turns(seed: int) -> Iterator[Row]:
    """Torques of random postures with an orientation error near π, and a run that begins with it."""
    robot, rng, case = arm("ur5"), np.random.default_rng((32, seed)), "ur5, orientation errors near π"
    ratio, off, frame = 0.0, 0.0, "tool0"
    for _ in range(50):
        q, a = np.array(WRIST.start) + rng.uniform(-0.3, 0.3, 6) + [0, 0, 0, 0, 1.0, 0], rng.normal(size=3)
        g, a = robot.placement(q, frame), a / np.linalg.norm(a)

        def torque(angle: float, q=q, a=a, g=g) -> float:
            R = rotation(a, angle) @ g[:3, :3]
            law = rd.control.OperationalSpace(
                robot, frame, line(g[:3, 3], g[:3, 3], 1.0, rotation=R), kp=100.0, kd=20.0
            )
            return float(np.abs(law.torque(0.0, q, 0 * q, np.zeros(0))).max())

        usual = max(torque(np.pi - 0.1), torque(-np.pi + 0.1))
        ratio = max(ratio, *(torque(np.pi - side * each) / usual for each in NEAR for side in (-1, 1)))
        for each in NEAR:
            found = orientation_error(rotation(a, np.pi - each) @ g[:3, :3], g[:3, :3])
            exact = (np.pi - each) * a * (1.0 if each or found @ a > 0 else -1.0)
            off = max(off, float(np.abs(found - exact).max()) / U)
    yield Row(case, "|τ| over that at π − 0.1", ratio, MOST)
    yield Row(case, "error of the rotation vector, in u", off, TURN)
    g = robot.placement(np.array(WRIST.start), frame)
    largest = []
    for angle in (np.pi - 0.1, np.pi):
        R = g[:3, :3] @ rotation(np.array([0.0, 0.0, 1.0]), angle)
        law = rd.control.OperationalSpace(robot, frame, line(g[:3, 3], g[:3, 3], 1.0, rotation=R), kp=100.0, kd=20.0)
        run = rd.simulate(robot, WRIST.start, duration_s=1.5, controller=law, estimate_error=False)
        largest.append(np.abs(run.extremes).max(axis=(1, 2)))
    yield Row(case, "|v| of a half turn in place, over that of π − 0.1", largest[1][1] / largest[0][1], MOST)
    left = float(np.linalg.norm(orientation_error(R, robot.placement(run.q[-1], frame)[:3, :3])))
    # e(t) of the critically damped loop: π (1 + 10 t) e^{−10 t} after 1.5 s, of a posture where nothing is damped
    yield Row(case, "what is left of it after 1.5 s, of the linear error", left / (np.pi * 16 * np.exp(-15)), 1.1)


CASES = [
    *(Case(name, partial(_path, name, path), name not in SHORT) for name, path in PATHS.items()),
    Case("orientation errors near π", _half_turns),
]
