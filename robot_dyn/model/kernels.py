"""Kernels: calls of Pinocchio for one state of all joints, and how they are asked for coupled ones and for a batch.

x = reduce(kernel(S q + s₀, S v, …))  for each state
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.couplings import Couplings
from robot_dyn.model.coriolis import Coriolis
from robot_dyn.model.coriolis import jacobian_rate as rate_of
from robot_dyn.queries.dynamics import Axes
from robot_dyn.spatial import hat

Kernel = Callable[..., Any]  # (model or Coriolis, data, q, …) → a fresh array, or a number
Reduction = Callable[[Couplings, Any], Any]  # of answers of all joints, by virtual work


class Scratch(threading.local):
    """Pinocchio's scratch memory, one for each thread that asks."""

    def __init__(self, model: Any) -> None:
        self.data = model.createData()


def frozen(x: ndarray) -> ndarray:
    """x, read-only from now on."""
    x.setflags(write=False)
    return x


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
    """Regressor of the torques of all joints, its bodies as in the model; Pinocchio gives a flat one of one joint."""
    Y = pin.computeJointTorqueRegressor(model, data, q, v, a)
    return Y if Y.ndim == 2 else Y.reshape(len(q), -1)


def placement(frame: int) -> Kernel:
    """Homogeneous matrix of a frame."""

    def kernel(model: Any, data: Any, q: ndarray) -> ndarray:
        pin.forwardKinematics(model, data, q)
        return pin.updateFramePlacement(model, data, frame).homogeneous

    return kernel


def jacobian(frame: int, axes: Axes) -> Kernel:
    """Jacobian of a frame.

    Turned from the body's axes to the world's here: Pinocchio's own would lose the digits of the distance to the base.
    """
    reference = pin.WORLD if axes is Axes.WORLD else pin.LOCAL

    def kernel(model: Any, data: Any, q: ndarray) -> ndarray:
        J = pin.computeFrameJacobian(model, data, q, frame, reference)
        return J if J.ndim == 2 else J.reshape(6, 1)  # Pinocchio gives a flat one if there is one joint

    def aligned(model: Any, data: Any, q: ndarray) -> ndarray:
        return _turned(_rotation(model, data, frame, q), kernel(model, data, q))

    return aligned if axes is Axes.WORLD_ALIGNED else kernel


def jacobian_rate(frame: int, axes: Axes) -> Kernel:
    """Its time derivative."""

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
    """R, from a frame's axes to the base's."""
    pin.forwardKinematics(model, data, q)
    return pin.updateFramePlacement(model, data, frame).rotation


def _turned(R: ndarray, J: ndarray) -> ndarray:
    """diag(R, R) J."""
    return (R @ J.reshape(2, 3, -1)).reshape(6, -1)


def by_state(
    kernel: Kernel, reduce: Reduction | None, model: Any, data: Any, couplings: Couplings
) -> Callable[..., ndarray]:
    """The equation (q, …) → answers of a kernel, asked state by state of a batch, with the positions of all joints.

    Args:
        kernel: The call of Pinocchio for one state of all joints.
        reduce: How its result is reduced to q, or None if it has no axis of joints.
        model: The model of all joints, or what else the kernel takes.
        data: Its scratch memory.
        couplings: How all joints follow q.
    """

    def equation(q: ndarray, *rates: ndarray) -> ndarray:
        full = [couplings.position(q), *(couplings.velocity(x) for x in rates)]
        batch = np.broadcast_shapes(*(x.shape[:-1] for x in full))
        rows = [np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in full]
        answers = np.array([kernel(model, data, *row) for row in zip(*rows, strict=True)])
        answers = answers.reshape(batch + answers.shape[1:])
        return answers if reduce is None else reduce(couplings, answers)

    return equation
