"""Pinocchio's Coriolis matrix of a regrouped model, and a bound on its rounding error.

A point on the axis of a revolute joint moves with both bodies that the joint connects, so a point mass there may be
counted with either of them [Gautier, Khalil 1990]. C does not depend on the location of a joint that is attached to the
base. In world axes, Pinocchio sums C_ij = Σ_b J_iᵀ (Y_b dJ_j/dt + B_b J_j), terms of the size of

    T_ij Ω,   T_ij = Σ_b m_b r_ib r_jb + ‖I_b‖,   r_ib = D_i + D_b + |c_b|

with D the largest distance of a joint from the origin and Ω the sum of the joint speeds. For a prismatic joint r is 1,
‖I_b‖ does not count, and the speed is divided by the largest D. A wrist of mass m and radius r loses a factor (D/r)² of
its accuracy; after its mass is moved to its parents, only D/r. Up to a few roundings of the terms

    |δC_ij| ≤ ε Ω √(M_ii M_jj),   ε = u (8 N + max T_ij / √(least M_ii · least M_jj))
"""

from __future__ import annotations

from math import inf

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray
from numpy.linalg import norm

from robot_dyn.description.couplings import Couplings
from robot_dyn.description.urdf import UNBOUNDED


def regrouped(model: pin.Model) -> pin.Model:
    """Return a model with the same C, with its first joints at the origin and with little mass in distal bodies.

    A body at reach D has its centre of mass at p + r e, with p on the joint's axis and e normal to it. It is replaced
    by a mass m r/R at p + R e with R = max(r, D), and I − m r (R − r) (1 − e eᵀ); the parent gets m − m r/R at p.
    """
    model = model.copy()
    for j, parent in enumerate(model.parents):
        if j and not parent:
            model.jointPlacements[j] = pin.SE3.Identity()
    D, axes = reach(model), joint_axes(model)
    for j in reversed(range(1, model.njoints)):
        body, axis, parent = model.inertias[j].copy(), axes[j - 1, 3:], model.parents[j]
        on_axis = axis * (axis @ body.lever)
        offset = body.lever - on_axis
        r = float(norm(offset))
        if not (axis.any() and r < D[j] < inf):
            continue
        e, mass = offset / (r or 1.0), body.mass * r / D[j]
        rest = pin.Inertia.Zero()  # set by attributes, which are not checked: part of a body may be non-physical
        rest.mass, rest.lever = mass, on_axis + D[j] * e
        rest.inertia = body.inertia - body.mass * r * (D[j] - r) * (np.eye(3) - np.outer(e, e))
        model.inertias[j] = rest
        if parent:
            point = model.jointPlacements[j].act(on_axis)
            model.inertias[parent] += pin.Inertia(body.mass - mass, point, np.zeros((3, 3)))
    return model


def joint_axes(model: pin.Model) -> ndarray:
    """Return the twist of each joint in its own frame, (N, 6)."""
    axes, q = np.empty((model.nv, 6)), np.zeros(model.nq)
    for j in range(model.nv):
        joint = model.joints[j + 1]
        data = joint.createData()
        joint.calc(data, q)
        axes[j] = data.S.ravel()
    return axes


def moved(model: pin.Model) -> ndarray:
    """Return True where a body (row) is moved by a joint (column), (N, N)."""
    table = np.zeros((model.nv, model.nv), dtype=bool)
    for b in range(model.nv):
        table[b, [j - 1 for j in model.supports[b + 1] if j]] = True
    return table


def slides(model: pin.Model) -> tuple[tuple[int, float], ...]:
    """Return the index and largest |q| within its limits of each prismatic joint; inf without limits."""
    most = np.maximum(np.abs(model.lowerPositionLimit), np.abs(model.upperPositionLimit))
    most[most >= float(UNBOUNDED)] = inf
    return tuple((j, float(most[j])) for j, axis in enumerate(joint_axes(model)) if not axis[3:].any())


def reach(model: pin.Model) -> ndarray:
    """Return the largest distance D of each joint from the world's origin, within prismatic limits, (N + 1,)."""
    D, slide = np.zeros(model.njoints), dict(slides(model))
    for j in range(1, model.njoints):
        D[j] = D[model.parents[j]] + norm(model.jointPlacements[j].translation) + slide.get(j - 1, 0.0)
    return D


def least_inertia(model: pin.Model, couplings: Couplings) -> ndarray:
    """Return a lower bound of M_ii at every q, (n,): the joint's own body counts with its inertia about the axis.

    Later bodies count with their smallest principal moment, or for a prismatic joint with their mass. Bodies that
    several joints of one coordinate move may be at rest, and count as 0.
    """
    axes, table, bodies, S = joint_axes(model), moved(model), model.inertias[1:], couplings.S
    moment = [np.linalg.eigvalsh(body.inertia)[0] for body in bodies]
    least = np.where(
        axes[:, 3:].any(axis=1), np.array(moment)[:, None], np.array([body.mass for body in bodies])[:, None]
    )
    np.fill_diagonal(least, [axis @ body.matrix() @ axis for axis, body in zip(axes, bodies, strict=True)])
    alone = table.astype(int) @ (S != 0) == 1
    return model.armature @ S**2 + np.where(alone, (least * table) @ S**2, 0.0).sum(axis=0)


def rounding(model: pin.Model, regrouped: pin.Model, couplings: Couplings) -> float:
    """Return ε of the bound above; inf if some joint may have no inertia, or a prismatic joint has no limits."""
    least, D, table = least_inertia(model, couplings), reach(regrouped)[1:], moved(model)
    if not (np.all(least > 0) and np.isfinite(D).all()):
        return inf
    turning, bodies = joint_axes(model)[:, 3:].any(axis=1), regrouped.inertias[1:]
    mass, lever, size = np.array([(body.mass, norm(body.lever), norm(body.inertia)) for body in bodies]).T[..., None]
    r = np.where(turning, D + D[:, None] + lever, 1.0) * table
    turned, S = table & turning, np.abs(couplings.S)
    T = r.T @ (mass * r) + turned.T @ (size * turned)
    ratio = (S.T @ T @ S) / np.sqrt(np.outer(least, least))
    return float(np.finfo(float).eps / 2 * (8 * model.nv + ratio.max()))
