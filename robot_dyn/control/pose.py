"""Joint positions that bring a frame to a pose: q with g(q) = g_d, within the joint limits.

    e = log(g(q)⁻¹ g_d),   de = −J_b dq  to first order of e

e is the body twist (v, ω) that takes the frame to the pose in unit time. [Murray, Li, Sastry 1994, ch. 2 §3.2;
Siciliano et al. 2009, sec. 3.7]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from robot_dyn.control.levenberg_marquardt import Descent, descend, held
from robot_dyn.control.orientation import rotation_vector
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.arithmetic import transpose
from robot_dyn.foundations.errors import PlanError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.foundations.validate import choice, instance, integer, number, numbers, one_state
from robot_dyn.foundations.values import Value, read_only
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Axes
from robot_dyn.queries.units import of_joint

_SOUGHT = 1e-11  # of ‖e‖, in [m] and [rad]: below what is asked for, above rounding
_ROTATION = 1e-6  # of RᵀR − 1: beyond, R was not meant as a rotation
_SAME = 1e-4  # [rad] or [m] between solutions that are one
_FAR = 100.0  # [m] from the pose: beyond, it may be in [mm]
_RANK = 1e-9  # of the largest singular value of J


@final
@dataclass(frozen=True, eq=False, repr=False)
class InverseKinematics(Answer, Value):
    """The joint positions that bring a frame to a pose, or as near as the search came.

    Attributes:
        arm: Name of the arm.
        joint_names: Names of the n joints, in the order of q.
        joint_types: Their types.
        frame: The frame that was brought there.
        q: The solution nearest to q0; without one, the position of the least ‖e‖², in which 1 rad of rotation counts as
            much as 1 m. Shape (n,), in [rad] or [m].
        position_error: Distance of the frame's origin from the pose at q, in [m].
        rotation_error: Angle of the turn that is left at q, in [rad]; nan if the orientation is free.
        converged: Whether both are within the tolerance.
        held_by: Limits that keep the frame from coming nearer to the pose, in words; empty if it converged.
        solutions: All that were found, the nearest to q0 first, (k, n).
        starts: Number of starts.
        first: Number of the first start that converged, from 1; 0 if none did.
        redundancy: Number of directions in which the joints may move at q with the frame at rest.
    """

    arm: str
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    frame: str
    q: np.ndarray
    position_error: float
    rotation_error: float
    converged: bool
    held_by: tuple[str, ...]
    solutions: np.ndarray = field(repr=False)
    starts: int
    first: int
    redundancy: int

    def __post_init__(self) -> None:
        read_only(self)

    @reported
    def unique(self) -> bool:
        """Whether no other start gave another solution."""
        return len(self.solutions) == 1

    def blocks(self) -> Iterator[Block]:
        turn = "orientation free" if np.isnan(self.rotation_error) else f"{self.rotation_error:.2g} rad"
        reached = "is at" if self.converged else "does not reach"
        yield f"{self.arm}: {self.frame} {reached} the pose, to {self.position_error:.2g} m, {turn}"
        units = [of_joint("rad", kind) for kind in self.joint_types]
        yield Table(("joint", "q", "unit"), tuple(zip(self.joint_names, self.q.tolist(), units, strict=True)), 10)
        if not self.converged:
            far = f"; it is {self.position_error:.4g} m away: if the pose is in mm, give it in m"
            free = f"no joint limit holds it: it is out of reach{far if self.position_error > _FAR else ''}"
            yield f"held by {', '.join(self.held_by)}" if self.held_by else free
            if not np.isnan(self.rotation_error):
                yield "as near as it comes: the sum of both errors squared is least, where 1 rad counts as 1 m"
            yield f"the nearest of {self.starts} starts; give q0 near a solution, or more starts, to be surer"
            return
        others = len(self.solutions) - 1
        more = f"; {self.redundancy} directions are free" if self.redundancy else ""
        yield f"{others or 'no'} other solution{'s' * (others != 1)} from {self.starts} starts{more}"


def inverse_kinematics(
    arm: Robot,
    pose: Any,
    *,
    frame: str,
    q0: Any = None,
    seed: int = 0,
    starts: int = 20,
    tolerance: float = 1e-9,
    iterations: int = 100,
) -> InverseKinematics:
    """Joint positions within the limits that bring a frame to a pose, by Levenberg–Marquardt from several starts.

    The first start is q0; the others are random positions of the joints that move the frame, within their limits. All
    descend in lock step, so that a further solution costs little. Joints that do not move the frame keep q0. A joint
    that turns is given in the turn nearest to q0 that its limits allow. Where no start reaches the pose, the answer is
    the position of the least ‖e‖² = ‖v‖² + ‖ω‖², with 1 rad as heavy as 1 m: a compromise between place and rotation.

    Args:
        arm: The robot.
        pose: Of the frame in base axes, as `arm.placement` returns it, (4, 4); or a position (3,) in [m] and a rotation
            (3, 3), as a pair; with None in place of the rotation the orientation is free.
        frame: Name of a link.
        q0: The first start, (n,), in [rad] or [m]; by default the middle between the limits, 0 without.
        seed: Of the random starts.
        starts: How many, with q0.
        tolerance: What an error of position, in [m], and of rotation, in [rad], may be at a solution.
        iterations: Most evaluations of each start.

    Raises:
        PlanError: If the pose is not one, or q0 is outside the limits.
        QueryError: If the frame is unknown, or a value is not allowed.

    Source: Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg–Marquardt method, 2011.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=PlanError)
    choice("frame", frame, arm.frame_names)
    start, (pose, turns) = _start(arm, q0), _pose(pose)
    rng = np.random.default_rng(integer("seed", seed, most=2**128 - 1))
    starts, most = (
        integer("starts", starts, least=1, most=10_000),
        integer("iterations", iterations, least=2, most=100_000),
    )
    tolerance = number("tolerance", tolerance, above=0, error=PlanError)
    moving = _moving(arm, frame, rng)
    q = np.array([start, *(np.where(moving, arm.random_configuration(rng), start) for _ in range(starts - 1))])

    def residual(q: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return error_and_jacobian(arm, frame, pose[None], q, turns)

    found = descend(residual, q, arm.lower, arm.upper, tolerance=min(_SOUGHT, tolerance), most=most)
    return _answer(arm, frame, start, pose, found, tolerance, int(moving.sum()))


def error_and_jacobian(
    arm: Robot, frame: str, g: np.ndarray, q: np.ndarray, turns: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """The body twist e = log(g(q)⁻¹ g) and the body Jacobian, (B, 6) and (B, 6, n); (B, 3) of a position alone."""
    here = arm.placement(q, frame)
    J, R_back = arm.jacobian(q, frame, expressed_in=Axes.BODY), transpose(here[:, :3, :3])
    p = (R_back @ (g[:, :3, 3] - here[:, :3, 3])[..., None])[..., 0]
    if not turns:
        return p, J[:, :3]
    return logarithm(R_back @ g[:, :3, :3], p), J


def logarithm(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """The twist (v, φ) whose exponential is (R, p), shape (..., 6).

    v = p − ½ φ × p + c φ × (φ × p),   c = (1 − (θ/2) cot(θ/2))/θ²,   θ = ‖φ‖ ≤ π
    """
    phi = rotation_vector(R)
    half = np.linalg.norm(phi, axis=-1, keepdims=True) / 2
    small = half < 1e-2  # the series is exact to rounding here, and the closed form loses digits
    safe = np.where(small, 1.0, half)
    c = np.where(small, 1 / 12 + half**2 / 180 + half**4 / 1890, (1 - safe / np.tan(safe)) / (4 * safe**2))
    turned = np.cross(phi, p)
    return np.concatenate([p - turned / 2 + c * np.cross(phi, turned), phi], axis=-1)


def _answer(
    arm: Robot, frame: str, start: np.ndarray, g: np.ndarray, found: Descent, tolerance: float, moving: int
) -> InverseKinematics:
    """The solution nearest to the start, or else the position of the least error."""
    q = _nearest_turns(arm, found.q, start)
    length = np.linalg.norm(arm.placement(q, frame)[:, :3, 3] - g[:3, 3], axis=1)
    angle = np.linalg.norm(found.e[:, 3:], axis=1) if found.e.shape[1] > 3 else np.full(len(q), np.nan)
    good = np.flatnonzero((length <= tolerance) & ~(angle > tolerance))
    order = good[np.argsort(np.abs(q[good] - start).max(axis=1), kind="stable")]
    best = order[0] if len(order) else int((found.e**2).sum(axis=1).argmin())
    J = found.J[best]
    held_by = () if len(order) else _limits(arm, q[best], held(q[best], found.e[best], J, arm.lower, arm.upper))
    return InverseKinematics(
        *(arm.name, arm.joint_names, arm.joint_types, frame, q[best], float(length[best]), float(angle[best])),
        *(bool(len(order)), held_by, _distinct(q[order]), len(q), int(good[0]) + 1 if len(good) else 0),
        redundancy=moving - int(np.linalg.matrix_rank(J, tol=_RANK * np.abs(J).max(initial=0.0))),
    )


def _distinct(solutions: np.ndarray) -> np.ndarray:
    """The first of each group of solutions that are one."""
    kept = solutions[:0]
    for each in solutions:
        if (np.abs(kept - each).max(axis=1) > _SAME).all():
            kept = np.vstack([kept, each])
    return kept


def _limits(arm: Robot, q: np.ndarray, blocked: np.ndarray) -> tuple[str, ...]:
    """The limits at which joints are held, in words."""
    rows = zip(arm.joint_names, arm.joint_types, q, arm.lower, blocked, strict=True)
    return tuple(
        f"the {'lower' if x <= low else 'upper'} limit of {name}, {x:.6g} {of_joint('rad', kind)}"
        for name, kind, x, low, at in rows
        if at
    )


def _start(arm: Robot, q0: Any) -> np.ndarray:
    """The first start; PlanError if it is outside the limits."""
    if q0 is None:
        both = np.isfinite(arm.lower) & np.isfinite(arm.upper)
        middle = (np.where(both, arm.lower, 0.0) + np.where(both, arm.upper, 0.0)) / 2
        return np.clip(middle, arm.lower, arm.upper)
    q0 = one_state("q0", q0, arm.joint_names)
    for name, x, low, high in zip(arm.joint_names, q0, arm.lower, arm.upper, strict=True):
        if not low <= x <= high:
            raise PlanError(f"q0: {name} at {x:g} is outside its limits, {low:g} to {high:g}; start within them")
    return q0


def _pose(pose: Any) -> tuple[np.ndarray, bool]:
    """The pose as a matrix (4, 4), and whether its orientation counts; the rotation is made exact to rounding."""
    if isinstance(pose, tuple) and len(pose) == 2:
        p, R = numbers("the position of the pose", pose[0], (3,), error=PlanError), pose[1]
        if R is None:
            return homogeneous(np.eye(3), p), False
        R = numbers("the rotation of the pose", R, (3, 3), error=PlanError)
    else:
        g = numbers("pose", pose, (4, 4), error=PlanError)
        R, p = g[:3, :3], g[:3, 3]
        if np.any(g[3] != [0, 0, 0, 1]):
            raise PlanError(f"pose: its last row must be 0 0 0 1, got {g[3]}")
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    if off > _ROTATION or np.linalg.det(R) < 0:
        what = f"RᵀR is off 1 by {off:.2g}" if off > _ROTATION else "it mirrors"
        raise PlanError(f"pose: its rotation is none, {what}; give an orthogonal matrix of determinant 1")
    U, _, V = np.linalg.svd(R)
    return homogeneous(U @ V, p), True


def _moving(arm: Robot, frame: str, rng: np.random.Generator) -> np.ndarray:
    """The joints that move a frame, (n,): those of the way from the base to it."""
    q = np.array([arm.random_configuration(rng) for _ in range(3)])
    return np.any(arm.jacobian(q, frame) != 0, axis=(0, 1))


def _nearest_turns(arm: Robot, q: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Positions (B, n) with joints that turn in the turn nearest to the start, within their limits.

    A whole turn is no motion of a joint unless others follow it by a ratio.
    """
    S = arm.couplings.S
    alone = ((S != 0).sum(axis=0) == 1) & ((S == 1).sum(axis=0) == 1)
    turns = np.round((start - q) / (2 * np.pi)) * np.array([kind != "prismatic" for kind in arm.joint_types]) * alone
    moved = q + 2 * np.pi * turns
    return np.where((arm.lower <= moved) & (moved <= arm.upper), moved, q)
