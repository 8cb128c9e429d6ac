"""Remarks on unexpected properties of a robot or state: no gravity torque, order of q, angles in degrees."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

_TURN = 2 * np.pi
_LISTED = 8  # largest number of joints that one line of a robot lists


def no_torque(gravity: tuple[float, float, float]) -> str:
    """Return the remark on a robot on which gravity exerts no torque."""
    if not any(gravity):
        return "gravity is zero, so N(q) = 0"
    return f"gravity {gravity} m/s² exerts no torque on any joint at any position, so N(q) = 0"


def gravity_lines(
    gravity: tuple[float, float, float], free: tuple[str, ...], balanced: tuple[str, ...], n: int
) -> Iterator[str]:
    """Yield remarks on joints on which gravity exerts no torque at any position; on `balanced` ones in any mounting."""
    if len(free) == n:
        yield f"{no_torque(gravity)} without effects{', in any mounting' if len(balanced) == n else ''}"
        return
    mounted = [name for name in free if name not in balanced]
    for names, when in ((mounted, "as the robot is mounted"), (balanced, "in any mounting")):
        if names:
            yield f"gravity exerts no torque on {', '.join(names)} at any position, {when}"


def order_lines(joints: tuple[str, ...], file_order: tuple[str, ...]) -> Iterator[str]:
    """Yield the order of q if the file has another order."""
    if joints != file_order:
        yield f"order of q: {', '.join(joints)}; the file lists {', '.join(file_order)}: give states by joint name"


def short_order(joints: tuple[str, ...], file_order: tuple[str, ...]) -> Iterator[str]:
    """Yield the order of q, without all names of a long one, if the file has another order."""
    if joints != file_order:
        more = f", … ({len(joints)} in joint_names)" if len(joints) > _LISTED else ""
        yield f"order of q: {', '.join(joints[:_LISTED])}{more}; the file has another order"


def degree_lines(
    joints: Sequence[str], types: Sequence[str], q: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> Iterator[str]:
    """Yield a remark if angles beyond the limits, and beyond a turn, are within the limits as degrees.

    Args:
        joints: Names of the n joints.
        types: Their types.
        q: Positions, (n,), in [rad] or [m].
        lower: Lower limits, (n,).
        upper: Upper limits, (n,).
    """
    turns = np.array([kind == "revolute" for kind in types])
    degrees = np.deg2rad(q)
    beyond = turns & ((q < lower) | (q > upper)) & (np.abs(q) > _TURN)
    if beyond.any() and ((degrees >= lower) & (degrees <= upper))[turns].all():
        i = int(beyond.argmax())
        yield (
            f"q may be in degrees: {q[i]:g} rad of {joints[i]} is beyond its limits, {lower[i]:.4g} to {upper[i]:.4g},"
            f" but {q[i]:g}° is not; give angles in rad, for example np.deg2rad(q)"
        )
