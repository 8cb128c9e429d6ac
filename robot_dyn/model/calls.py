"""Pinocchio's functions by the names of the queries.

A call is created for a model, and for a frame and its axes if the query has them. It evaluates one state of all joints,
(data, q, …) → a new array or a number, where `data` is Pinocchio's working memory.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.foundations.spatial import hat
from robot_dyn.model.coriolis import jacobian_rate as rate_of
from robot_dyn.model.inverse_dynamics_derivatives import inverse_dynamics_derivatives
from robot_dyn.model.pinocchio_model import Built, link_frames
from robot_dyn.queries.dynamics import Axes, entry

Call = Callable[..., Any]


class Scratch(threading.local):
    """Pinocchio's working memory, one instance per thread."""

    def __init__(self, model: pin.Model) -> None:
        self.data = model.createData()


def _coriolis_torque(built: Built) -> Call:
    weightless = built.model.copy()  # subtracting N would keep its rounding errors
    weightless.gravity = pin.Motion.Zero()
    return partial(pin.nonLinearEffects, weightless)


def _coriolis_transpose(built: Built) -> Call:
    matrix = built.coriolis.matrix
    return lambda data, q, v: v.dot(matrix(data, q, v))


def _momentum(built: Built) -> Call:
    model, crba = built.model, pin.crba
    return lambda data, q, v: crba(model, data, q).dot(v)


def _kinetic_energy(built: Built) -> Call:
    """Return ½ vᵀ M v: pin.computeKineticEnergy omits the armature of joints whose axis is not x, y or z."""
    model, crba = built.model, pin.crba
    return lambda data, q, v: float(v.dot(crba(model, data, q).dot(v))) / 2


def _regressor(built: Built) -> Call:
    """Return the regressor, with bodies in the order of their parameters. Pinocchio returns it flat for one joint."""
    model, names = built.model, list(built.model.names[1:])
    N, order = model.nv, [names.index(name) for name in built.body_names]

    def regressor(data: pin.Data, q: ndarray, v: ndarray, a: ndarray) -> ndarray:
        Y = pin.computeJointTorqueRegressor(model, data, q, v, a)
        return Y if in_order else Y.reshape(N, N, -1)[:, order].reshape(N, -1)

    in_order = order == list(range(N)) and N > 1
    return regressor


def _frame(built: Built, name: str) -> int:
    """Return the index of the frame of a link or joint; raise QueryError if it is unknown."""
    links = link_frames(built.model)
    return entry(links | {joint: links[child] for joint, child in built.description.joint_frames.items()}, name)


def _placement(built: Built, frame: str) -> Call:
    model, index = built.model, _frame(built, frame)

    def placement(data: pin.Data, q: ndarray) -> ndarray:
        pin.forwardKinematics(model, data, q)
        return pin.updateFramePlacement(model, data, index).homogeneous

    return placement


def _jacobian(built: Built, frame: str, expressed_in: str) -> Call:
    """Return the Jacobian computed in body axes and rotated: the world-aligned one loses digits far from the base."""
    model, index, axes = built.model, _frame(built, frame), Axes.from_name(expressed_in)
    reference = pin.WORLD if axes is Axes.WORLD else pin.LOCAL

    def jacobian(data: pin.Data, q: ndarray) -> ndarray:
        J = pin.computeFrameJacobian(model, data, q, index, reference)
        return J if J.ndim == 2 else J.reshape(6, 1)  # Pinocchio returns a flat array for one joint

    def aligned(data: pin.Data, q: ndarray) -> ndarray:
        return _turned(_rotation(model, data, index, q), jacobian(data, q))

    return aligned if axes is Axes.WORLD_ALIGNED else jacobian


def _jacobian_rate(built: Built, frame: str, expressed_in: str) -> Call:
    model, index, axes = built.model, _frame(built, frame), Axes.from_name(expressed_in)

    def jacobian_rate(data: pin.Data, q: ndarray, v: ndarray) -> ndarray:
        if axes is Axes.WORLD:
            pin.computeJointJacobiansTimeVariation(model, data, q, v)
            rate = pin.getFrameJacobianTimeVariation(model, data, index, pin.WORLD)
            return rate if rate.ndim == 2 else rate.reshape(6, 1)
        J = pin.computeFrameJacobian(model, data, q, index, pin.LOCAL).reshape(6, -1)
        rate, twist = rate_of(J, v)
        if axes is Axes.BODY:
            return rate
        # d/dt diag(R, R) = diag(R, R) diag(ω̂, ω̂)
        return _turned(_rotation(model, data, index, q), rate + _turned(hat(twist[3:]), J))

    return jacobian_rate


def _rotation(model: pin.Model, data: pin.Data, frame: int, q: ndarray) -> ndarray:
    """Return the rotation R from the axes of a frame to those of the base."""
    pin.forwardKinematics(model, data, q)
    return pin.updateFramePlacement(model, data, frame).rotation


def _turned(R: ndarray, J: ndarray) -> ndarray:
    """Return diag(R, R) J."""
    return (R @ J.reshape(2, 3, -1)).reshape(6, -1)


PINOCCHIO: dict[str, Callable[..., Call]] = {
    "M": lambda built: partial(pin.crba, built.model),
    "C": lambda built: built.coriolis.matrix,
    "N": lambda built: partial(pin.computeGeneralizedGravity, built.model),
    "coriolis_torque": _coriolis_torque,
    "coriolis_transpose": _coriolis_transpose,
    "inverse_dynamics": lambda built: partial(pin.rnea, built.model),
    "forward_dynamics": lambda built: partial(pin.aba, built.model),
    "kinetic_energy": _kinetic_energy,
    "potential_energy": lambda built: partial(pin.computePotentialEnergy, built.model),
    "momentum": _momentum,
    "inverse_dynamics_derivatives": lambda built: partial(inverse_dynamics_derivatives, built),
    "centre_of_mass": lambda built: built.centroid.position,
    "centre_of_mass_jacobian": lambda built: built.centroid.jacobian,
    "centre_of_mass_jacobian_rate": lambda built: built.centroid.jacobian_rate,
    "centroidal_momentum_matrix": lambda built: built.centroid.momentum_matrix,
    "regressor": _regressor,
    "placement": _placement,
    "jacobian": _jacobian,
    "jacobian_rate": _jacobian_rate,
}
