"""The uniform box, or ellipsoid, with the mass and inertia of a body.

    l_x² = 6 (I_y + I_z − I_x) / m        the uniform box of mass m with principal moments I

[the moments of `robot_dyn.description.solids.box`, solved for its edges]
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.inertia import implausibility
from robot_dyn.description.structure import structure_of
from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.model.robot import Robot
from robot_dyn.shapes.triangles import Mesh
from robot_dyn.view.geometry.shapes import box, ellipsoid

_THIN = 1e-3  # fraction of the longest edge that replaces an edge of length 0
_SMALL = 0.01  # [m], edge drawn for a mass in one point
_POINT, _LARGEST = 1e-6, 1e6  # [m]: shorter edges belong to a point mass; the largest length of an edge


def inertia_boxes(robot: Robot) -> Iterator[tuple[str, ndarray, Mesh, str | None]]:
    """Yield link, pose in the link (4, 4), uniform box and doubt of each body that moves and has mass.

    Bodies are those of the dynamics: they include payloads and all links fixed to them. For impossible moments, the
    square of an edge is negative; this edge is drawn thin. A box far larger than the robot is drawn as long as the
    robot's longest link.
    """
    stated = structure_of(robot.description, robot.edits)
    for frame in robot.model.frames:
        joint = frame.parentJoint
        if frame.type != pin.FrameType.BODY or not joint or not frame.placement.isIdentity(0):
            continue  # the base, or fixed to a link that has its mass
        body = robot.model.inertias[joint]
        if body.mass > 0:
            edges, axes = _lengths(body.mass, body.inertia, 6.0)
            doubt = implausibility(body.mass, body.lever, body.inertia)
            if doubt:
                doubt = f"{doubt}; drawn thin"
            elif radius := stated.radius_beyond_reach(body.mass, body.inertia):
                doubt = f"its inertia needs mass at least {radius:.3g} m from the centre; drawn smaller"
                edges = edges * (stated.longest_link / edges.max())
            yield frame.name, homogeneous(axes, np.array(body.lever)), box(*edges), doubt


def off_centre(mesh: Mesh, pose: ndarray, com: ndarray) -> float:
    """Return the distance in [m] of the middle of a mesh, placed by a pose (4, 4), from a centre of mass."""
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return float(np.linalg.norm(pose[:3, :3] @ middle + pose[:3, 3] - com))


def inertia_ellipsoid(mass: float, inertia: ndarray) -> tuple[Mesh, ndarray]:
    """Return the uniform ellipsoid of a mass and a central inertia, a² = 5 (I_y + I_z − I_x) / (2 m), and its axes."""
    lengths, axes = _lengths(mass, inertia, 2.5)
    return ellipsoid(*np.maximum(lengths, 0.02 * lengths.max())), axes


def _lengths(mass: float, inertia: ndarray, factor: float) -> tuple[ndarray, ndarray]:
    """Return √(factor (I_y + I_z − I_x) / m) along the principal axes, and these axes as the columns of a rotation."""
    moments, axes = np.linalg.eigh(inertia)
    axes = axes * np.sign(np.linalg.det(axes))
    with np.errstate(over="ignore"):  # for a mass of 1e-320 kg
        squares = factor * (moments.sum() - 2 * moments) / mass
    lengths = np.clip(np.sqrt(np.maximum(squares, 0.0)), 0.0, _LARGEST)
    return np.maximum(lengths, _THIN * lengths.max() if lengths.max() > _POINT else _SMALL), axes
