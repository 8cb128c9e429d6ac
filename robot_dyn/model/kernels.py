"""Kernels: Pinocchio computations for one state of all joints that need more than a direct call.

A kernel takes (model, data, q, …) and returns a new array or a number; `data` is Pinocchio's working memory.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.couplings import Couplings
from robot_dyn.foundations.spatial import hat
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.coriolis import jacobian_rate as rate_of
from robot_dyn.queries.dynamics import Axes, entry

Kernel = Callable[..., Any]  # the model argument may be a `Coriolis`


class Scratch(threading.local):
    """Pinocchio's working memory, one instance per thread."""

    def __init__(self, model: Any) -> None:
        self.data = model.createData()


def coriolis_transpose(coriolis: Coriolis, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """Cᵀ v."""
    return v.dot(coriolis.matrix(data, q, v))


def momentum(model: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """M v."""
    return pin.crba(model, data, q).dot(v)


def kinetic_energy(model: Any, data: Any, q: ndarray, v: ndarray) -> float:
    """½ vᵀ M v; pin.computeKineticEnergy leaves out the armature of joints whose axis is not x, y or z."""
    return float(v.dot(pin.crba(model, data, q).dot(v))) / 2


def regressor(model: Any, data: Any, q: ndarray, v: ndarray, a: ndarray) -> ndarray:
    """Regressor of all joint torques, bodies in model order; for one joint Pinocchio returns a flat array."""
    Y = pin.computeJointTorqueRegressor(model, data, q, v, a)
    return Y if Y.ndim == 2 else Y.reshape(len(q), -1)


def regressor_of_coordinates(order: list[int], couplings: Couplings, Y: ndarray) -> ndarray:
    """Regressor of all joints, (..., N, 10 N), reduced to q, with bodies in the order of their parameters."""
    N = len(order)
    return couplings.rows(Y.reshape(*Y.shape[:-1], N, -1)[..., order, :].reshape(Y.shape))


class FrameKernels:
    """Frame kernels, each built once.

    Args:
        frames: Indices of the frames in the model, by name.
    """

    def __init__(self, frames: dict[str, int]) -> None:
        self._frames, self._cached = frames, {}

    def __call__(self, build: Callable[..., Kernel], frame: str, *axes: str) -> Kernel:
        """The kernel that `placement`, `jacobian` or `jacobian_rate` builds for a frame; QueryError if not found."""
        try:
            return self._cached[build, frame, axes]
        except (KeyError, TypeError):  # TypeError: the name is not hashable
            pass
        kernel = build(entry(self._frames, frame), *map(Axes.of, axes))
        return self._cached.setdefault((build, frame, axes), kernel)


def placement(frame: int) -> Kernel:
    """Homogeneous matrix of a frame."""

    def kernel(model: Any, data: Any, q: ndarray) -> ndarray:
        pin.forwardKinematics(model, data, q)
        return pin.updateFramePlacement(model, data, frame).homogeneous

    return kernel


def jacobian(frame: int, axes: Axes) -> Kernel:
    """Jacobian of a frame.

    Computed in body axes and rotated here: Pinocchio's world-aligned one loses digits with distance from the base.
    """
    reference = pin.WORLD if axes is Axes.WORLD else pin.LOCAL

    def kernel(model: Any, data: Any, q: ndarray) -> ndarray:
        J = pin.computeFrameJacobian(model, data, q, frame, reference)
        return J if J.ndim == 2 else J.reshape(6, 1)  # Pinocchio returns a flat array for one joint

    def aligned(model: Any, data: Any, q: ndarray) -> ndarray:
        return _turned(_rotation(model, data, frame, q), kernel(model, data, q))

    return aligned if axes is Axes.WORLD_ALIGNED else kernel


def jacobian_rate(frame: int, axes: Axes) -> Kernel:
    """Time derivative of the Jacobian of a frame."""

    def kernel(model: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
        if axes is Axes.WORLD:
            pin.computeJointJacobiansTimeVariation(model, data, q, v)
            rate = pin.getFrameJacobianTimeVariation(model, data, frame, pin.WORLD)
            return rate if rate.ndim == 2 else rate.reshape(6, 1)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL).reshape(6, -1)
        rate, twist = rate_of(J, v)
        if axes is Axes.BODY:
            return rate
        # d/dt diag(R, R) = diag(R, R) diag(ω̂, ω̂)
        return _turned(_rotation(model, data, frame, q), rate + _turned(hat(twist[3:]), J))

    return kernel


def _rotation(model: Any, data: Any, frame: int, q: ndarray) -> ndarray:
    """Rotation R from the axes of a frame to those of the base."""
    pin.forwardKinematics(model, data, q)
    return pin.updateFramePlacement(model, data, frame).rotation


def _turned(R: ndarray, J: ndarray) -> ndarray:
    """diag(R, R) J."""
    return (R @ J.reshape(2, 3, -1)).reshape(6, -1)
