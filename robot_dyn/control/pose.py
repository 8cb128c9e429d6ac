"""Joint positions that bring a frame to a pose: q with g(q) = g_d, within the joint limits.

    e = log(g(q)⁻¹ g_d),   de = −J_b dq  to first order of e

e is the body twist (v, ω) that takes the frame to the pose in unit time. If the frame may spin about its axis a, ω is
the shortest rotation of a to the desired direction d, both in body axes: ω = θ (a × d)/sin θ, with two components.
[Murray, Li, Sastry 1994, ch. 2 §3.2; Siciliano et al. 2009, sec. 3.7]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.control.levenberg_marquardt import Descent, at_bound, descend
from robot_dyn.control.orientation import rotation_vector
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.arithmetic import transpose
from robot_dyn.foundations.errors import PlanError
from robot_dyn.foundations.result import reported
from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.foundations.validate import choice, instance, integer, number, numbers, one_state
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Axes
from robot_dyn.queries.units import of_joint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from robot_dyn.foundations.validate import JointValues


_SOUGHT = 1e-11  # ‖e‖ at which a descent ends, in [m] and [rad]: below usual tolerances, above rounding
_ROTATION = 1e-6  # largest entry of RᵀR − 1 for a rotation
_SAME = 1e-4  # [rad] or [m]: solutions closer than this count as one
_FAR = 100.0  # [m]: a pose further away may be in [mm]
FIXED, SPHERE = np.zeros((0, 3)), np.eye(3)  # axes about which the frame may spin: none, all
_RANK = 1e-9  # relative to the largest entry of J


@final
@dataclass(frozen=True, eq=False, repr=False)
class InverseKinematics(Answer, ReadOnly):
    """Joint positions that bring a frame to a pose, or the nearest that the search found.

    Attributes:
        arm: Name of the arm.
        joint_names: Names of the n joints, in the order of q.
        joint_types: Types of the joints, such as "revolute".
        frame: Name of the frame.
        q: The solution nearest to q0; without a solution, the position of the smallest ‖e‖², in which 1 rad counts as
            much as 1 m. Shape (n,), in [rad] or [m].
        position_error: Distance of the frame's origin from the pose at q, in [m].
        rotation_error: Angle between the frame and the pose at q, in [rad]; for a direction, the angle between it and
            the tool axis; nan if the orientation is free.
        converged: True if both errors are within the tolerance.
        limited_by: Limits that keep the frame from coming nearer to the pose, as text; empty if it converged.
        solutions: All solutions, the nearest to q0 first, (k, n).
        starts: Number of starts.
        first: Number of the first start that converged, from 1; 0 if none did.
        redundancy: Number of directions in which the joints may move at q without leaving the pose.
        moving_joints: Number of joints that move the frame.
        conditions: Number of conditions of the pose: 6, or 5 with the spin free, or 3 with the orientation free.
    """

    arm: str
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    frame: str
    q: np.ndarray
    position_error: float
    rotation_error: float
    converged: bool
    limited_by: tuple[str, ...]
    solutions: np.ndarray = field(repr=False)
    starts: int
    first: int
    redundancy: int
    moving_joints: int
    conditions: int

    @reported
    def unique(self) -> bool:
        """True if all converged starts gave the same solution."""
        return len(self.solutions) == 1

    def blocks(self) -> Iterator[Block]:
        spin = " to its tool axis, spin free" if self.conditions == 5 else ""
        turn = "orientation free" if np.isnan(self.rotation_error) else f"{self.rotation_error:.2g} rad{spin}"
        reached = "is at" if self.converged else "does not reach"
        yield f"{self.arm}: {self.frame} {reached} the pose, to {self.position_error:.2g} m, {turn}"
        units = [of_joint("rad", kind) for kind in self.joint_types]
        yield Table(("joint", "q", "unit"), tuple(zip(self.joint_names, self.q.tolist(), units, strict=True)), 10)
        if not self.converged:
            far = f"; it is {self.position_error:.4g} m away: if the pose is in mm, give it in m"
            free = f"out of reach; no joint limit is active{far if self.position_error > _FAR else ''}"
            yield f"limited by {', '.join(self.limited_by)}" if self.limited_by else free
            if not np.isnan(self.rotation_error):
                yield "q minimises the sum of both squared errors, where 1 rad counts as 1 m"
            if self.moving_joints < self.conditions == 6:
                yield f"{self.moving_joints} joints move {self.frame}, and its pose has 6 conditions"
                yield "if the tool may spin about its axis, give the direction of this axis instead of the rotation"
            yield f"best of {self.starts} starts; if in doubt, give q0 near a solution, or more starts"
            return
        others = len(self.solutions) - 1
        free = f"; {self.redundancy} direction{'s' * (self.redundancy != 1)} of motion left" if self.redundancy else ""
        yield f"{others or 'no'} other solution{'s' * (others != 1)} from {self.starts} starts{free}"


def inverse_kinematics(
    arm: Robot,
    pose: ArrayLike | tuple[ArrayLike, ArrayLike | None],
    *,
    frame: str,
    q0: JointValues | None = None,
    seed: int = 0,
    starts: int = 20,
    tolerance: float = 1e-9,
    iterations: int = 100,
    tool_axis: ArrayLike = (0, 0, 1),
) -> InverseKinematics:
    """Compute joint positions within the limits that bring a frame to a pose.

    The method is Levenberg–Marquardt from several starts. The first start is q0; the others are random positions of the
    joints that move the frame, within their limits. All starts descend in parallel, so more starts take little time.
    Joints that do not move the frame keep q0. Angles are in the turn nearest to q0 that the limits allow. If no start
    reaches the pose, the result minimises ‖e‖² = ‖v‖² + ‖ω‖², a compromise between position and rotation in which 1 rad
    counts as much as 1 m.

    A direction instead of a rotation leaves the spin about the tool axis free: for arms with five axes, and for tools
    that may spin, such as torches. Other software calls this the mask (1, 1, 1, 1, 1, 0) in tool axes, or a tolerance
    of π about the z axis. None instead of a rotation is the mask (1, 1, 1, 0, 0, 0): position-only inverse kinematics.

    Args:
        arm: The robot.
        pose: Pose of the frame in base axes, as `arm.placement` returns it, (4, 4); or a pair of a position, (3,), in
            [m], and a rotation, (3, 3), or the direction of the tool axis in base axes, (3,), or None to leave the
            orientation free.
        frame: Name of a link.
        q0: The first start, (n,) or by joint name, in [rad] or [m]; by default the middle between the limits, or 0
            without limits.
        seed: Seed of the random starts.
        starts: Number of starts, including q0.
        tolerance: Largest error of position, in [m], and of rotation, in [rad], at a solution.
        iterations: Largest number of evaluations for each start.
        tool_axis: Axis of the frame that is aligned with a given direction, in frame axes, (3,).

    Raises:
        PlanError: If the pose is invalid, or q0 is outside the limits.
        QueryError: If the frame is unknown, or a value is invalid.

    Source: Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg–Marquardt method, 2011.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=PlanError)
    choice("frame", frame, arm.frame_names)
    start, (pose, free) = _start(arm, q0), _pose(pose, _unit("tool_axis", tool_axis))
    rng = np.random.default_rng(integer("seed", seed, most=2**128 - 1))
    starts, most = (
        integer("starts", starts, least=1, most=10_000),
        integer("iterations", iterations, least=2, most=100_000),
    )
    tolerance = number("tolerance", tolerance, above=0, error=PlanError)
    moving = _moving(arm, frame, rng)
    q = np.array([start, *(np.where(moving, arm.random_configuration(rng), start) for _ in range(starts - 1))])

    def residual(q: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return error_and_jacobian(arm, frame, pose[None], q, free)

    descent = descend(residual, q, arm.lower, arm.upper, tolerance=min(_SOUGHT, tolerance), most=most)
    return _best(arm, frame, start, pose, descent, tolerance, int(moving.sum()))


def error_and_jacobian(
    arm: Robot, frame: str, g: np.ndarray, q: np.ndarray, free: np.ndarray = FIXED
) -> tuple[np.ndarray, np.ndarray]:
    """Return e, (B, m), and −∂e/∂q to first order of e, (B, m, n), with m the number of conditions.

    Args:
        arm: The robot.
        frame: Name of the frame.
        g: Poses, (B, 4, 4).
        q: Positions, (B, n).
        free: Axes about which the frame may spin, in frame axes: none, (0, 3), one, (1, 3), or all, (3, 3).
    """
    here = arm.placement(q, frame)
    J, R_back = arm.jacobian(q, frame, expressed_in=Axes.BODY), transpose(here[:, :3, :3])
    p, R = (R_back @ (g[:, :3, 3] - here[:, :3, 3])[..., None])[..., 0], R_back @ g[:, :3, :3]
    if not len(free):
        return logarithm(R, p), J
    across = _orthogonal(free)
    if len(free) == 1:
        p = np.concatenate([p, _shortest(free[0], R @ free[0]) @ across.T], axis=1)
    return p, np.concatenate([J[:, :3], across @ J[:, 3:]], axis=1)


def _shortest(a: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Compute the rotation vectors of the shortest rotations that take a unit vector to others, (B, 3)."""
    turn = np.cross(a, d)
    sine = np.linalg.norm(turn, axis=-1, keepdims=True)
    # for opposite directions, any axis orthogonal to a will do
    axis = np.where(sine > 0, turn / np.where(sine > 0, sine, 1), _orthogonal(a[None])[0])
    return np.arctan2(sine, (d @ a)[..., None]) * axis


def _orthogonal(axes: np.ndarray) -> np.ndarray:
    """Return orthonormal rows orthogonal to k orthonormal axes, (3 − k, 3)."""
    _, _, V = np.linalg.svd(axes)
    return V[len(axes) :]


def logarithm(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Compute the twist (v, φ) whose exponential is (R, p), shape (..., 6).

    v = p − ½ φ × p + c φ × (φ × p),   c = (1 − (θ/2) cot(θ/2))/θ²,   θ = ‖φ‖ ≤ π
    """
    phi = rotation_vector(R)
    half = np.linalg.norm(phi, axis=-1, keepdims=True) / 2
    small = half < 1e-2  # the series is exact to rounding here, and the closed form loses digits
    safe = np.where(small, 1.0, half)
    c = np.where(small, 1 / 12 + half**2 / 180 + half**4 / 1890, (1 - safe / np.tan(safe)) / (4 * safe**2))
    turned = np.cross(phi, p)
    return np.concatenate([p - turned / 2 + c * np.cross(phi, turned), phi], axis=-1)


def _best(
    arm: Robot, frame: str, start: np.ndarray, g: np.ndarray, descent: Descent, tolerance: float, moving: int
) -> InverseKinematics:
    """Return the solution nearest to the start or, without a solution, the position of the smallest error."""
    q = _nearest_turns(arm, descent.q, start)
    length = np.linalg.norm(arm.placement(q, frame)[:, :3, 3] - g[:3, 3], axis=1)
    angle = np.linalg.norm(descent.e[:, 3:], axis=1) if descent.e.shape[1] > 3 else np.full(len(q), np.nan)
    good = np.flatnonzero((length <= tolerance) & ~(angle > tolerance))
    order = good[np.argsort(np.abs(q[good] - start).max(axis=1), kind="stable")]
    best = order[0] if len(order) else int((descent.e**2).sum(axis=1).argmin())
    J = descent.J[best]
    limited_by = (
        () if len(order) else _limits(arm, q[best], at_bound(q[best], descent.e[best], J, arm.lower, arm.upper))
    )
    rank = int(np.linalg.matrix_rank(J, tol=_RANK * np.abs(J).max(initial=0.0)))
    return InverseKinematics(
        *(arm.name, arm.joint_names, arm.joint_types, frame, q[best], float(length[best]), float(angle[best])),
        *(bool(len(order)), limited_by, _distinct(q[order]), len(q), int(good[0]) + 1 if len(good) else 0),
        *(moving - rank, moving, len(J)),
    )


def _distinct(solutions: np.ndarray) -> np.ndarray:
    """Return the first solution of each group of nearly equal ones."""
    distinct = solutions[:0]
    for solution in solutions:
        if (np.abs(distinct - solution).max(axis=1) > _SAME).all():
            distinct = np.vstack([distinct, solution])
    return distinct


def _limits(arm: Robot, q: np.ndarray, blocked: np.ndarray) -> tuple[str, ...]:
    """Return the active limits, as text."""
    rows = zip(arm.joint_names, arm.joint_types, q, arm.lower, blocked, strict=True)
    return tuple(
        f"the {'lower' if x <= low else 'upper'} limit of {name}, {x:.6g} {of_joint('rad', kind)}"
        for name, kind, x, low, is_blocked in rows
        if is_blocked
    )


def _start(arm: Robot, q0: Any) -> np.ndarray:
    """Return the first start; raise a PlanError if it is outside the limits."""
    if q0 is None:
        both = np.isfinite(arm.lower) & np.isfinite(arm.upper)
        middle = (np.where(both, arm.lower, 0.0) + np.where(both, arm.upper, 0.0)) / 2
        return np.clip(middle, arm.lower, arm.upper)
    q0 = one_state("q0", q0, arm.joint_names)
    for name, x, low, high in zip(arm.joint_names, q0, arm.lower, arm.upper, strict=True):
        if not low <= x <= high:
            raise PlanError(f"q0: {name} at {x:g} is outside its limits, {low:g} to {high:g}; start within them")
    return q0


def _pose(pose: Any, tool_axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pose as a matrix (4, 4), orthogonal to rounding, and the axes about which the frame may spin."""
    if isinstance(pose, tuple) and len(pose) == 2:
        p, R = numbers("the position of the pose", pose[0], (3,), error=PlanError), pose[1]
        if R is None:
            return homogeneous(np.eye(3), p), SPHERE
        R = numbers("the rotation of the pose", R, (3, 3), (3,), error=PlanError)
        if R.ndim == 1:
            d = _unit("the direction of the pose", R)  # only R a = d is compared, not all of R
            return homogeneous(np.outer(d, tool_axis), p), tool_axis[None]
    else:
        g = numbers("a pose that is not a pair (position, rotation or None)", pose, (4, 4), error=PlanError)
        R, p = g[:3, :3], g[:3, 3]
        if np.any(g[3] != [0, 0, 0, 1]):
            raise PlanError(f"pose: its last row must be 0 0 0 1, got {g[3]}")
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    if off > _ROTATION or np.linalg.det(R) < 0:
        fault = f"RᵀR differs from 1 by {off:.2g}" if off > _ROTATION else "its determinant is −1"
        raise PlanError(f"pose: its 3 × 3 part is not a rotation, {fault}; give an orthogonal matrix of determinant 1")
    U, _, V = np.linalg.svd(R)
    return homogeneous(U @ V, p), FIXED


def _unit(label: str, axis: Any) -> np.ndarray:
    """Return a direction as a unit vector; raise a PlanError if it is zero."""
    axis = numbers(label, axis, (3,), error=PlanError)
    largest = np.abs(axis).max()
    if not largest > 0:
        raise PlanError(f"{label} must not be zero; give a vector along it, of any length, such as (0, 0, -1)")
    return axis / largest / np.linalg.norm(axis / largest)


def _moving(arm: Robot, frame: str, rng: np.random.Generator) -> np.ndarray:
    """Return True for joints that move a frame, (n,)."""
    q = np.array([arm.random_configuration(rng) for _ in range(3)])
    return np.any(arm.jacobian(q, frame) != 0, axis=(0, 1))


def _nearest_turns(arm: Robot, q: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return positions (B, n) with angles in the turn nearest to the start, within the limits.

    Joints that others follow by a ratio other than 1 are not changed: a whole turn would move the others.
    """
    S = arm.couplings.S
    alone = ((S != 0).sum(axis=0) == 1) & ((S == 1).sum(axis=0) == 1)
    turns = np.round((start - q) / (2 * np.pi)) * np.array([kind != "prismatic" for kind in arm.joint_types]) * alone
    moved = q + 2 * np.pi * turns
    return np.where((arm.lower <= moved) & (moved <= arm.upper), moved, q)
