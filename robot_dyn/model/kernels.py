"""Kernels: calls of Pinocchio for one state of all joints, and how they are asked in general.

x = reduce(kernel(S q + s₀, S v, …))  for each state of a batch
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from math import hypot
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.errors import OverflowedError
from robot_dyn.model.coriolis import Bodies
from robot_dyn.model.coriolis import jacobian_rate as rate_of
from robot_dyn.model.dynamics import Array, Axes, check_batches, checked
from robot_dyn.model.ties import Ties
from robot_dyn.spatial import block_diagonal, hat

Kernel = Callable[..., Any]  # (model or Bodies, data, q, …) → a fresh array, or a number
_F8 = np.dtype(np.float64)


class Scratch(threading.local):
    """Pinocchio's scratch memory, one for each thread that asks."""

    def __init__(self, model: Any) -> None:
        self.data = model.createData()


def is_state(x: Any, shape: tuple[int] | None) -> bool:
    """Whether x has the form that goes to Pinocchio as it is: float64 of that shape."""
    return x.__class__ is ndarray and x.dtype is _F8 and x.shape == shape


def is_moderate(x: ndarray, most: float = 1e100) -> bool:
    """Whether ‖x‖ < most: then x holds neither NaN nor inf, nor numbers whose products overflow."""
    return hypot(*x.tolist()) < most  # faster than any reduction of NumPy at this size, and never warns


def frozen(x: ndarray) -> ndarray:
    """x, read-only from now on."""
    x.setflags(write=False)
    return x


def coriolis_matrix(bodies: Bodies, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """C."""
    return bodies.coriolis_matrix(data, q, v)


def coriolis_transpose(bodies: Bodies, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """Cᵀ v."""
    return v @ bodies.coriolis_matrix(data, q, v)


def coriolis_torque(weightless: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """C v, by a model without gravity: less its gravity torque, the torque at a = 0 would keep the digits of N."""
    return pin.rnea(weightless, data, q, v, np.zeros_like(v))


def momentum(model: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """M v."""
    return pin.crba(model, data, q) @ v


def kinetic_energy(model: Any, data: Any, q: ndarray, v: ndarray) -> float:
    """½ vᵀ M v; pin.computeKineticEnergy leaves out the armature of joints whose axis is none of x, y, z."""
    return v @ pin.crba(model, data, q) @ v / 2


def placement(frame: int) -> Kernel:
    """Homogeneous matrix of a frame."""

    def kernel(model: Any, data: Any, q: ndarray) -> ndarray:
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[frame].homogeneous

    return kernel


def jacobian(frame: int, axes: Axes) -> Kernel:
    """Jacobian of a frame; Pinocchio gives a flat one if there is one joint.

    Turned from the body's axes to the world's here: Pinocchio's own would lose the digits of the distance to the base.
    """

    def kernel(model: Any, data: Any, q: ndarray) -> ndarray:
        if axes is Axes.WORLD:
            return pin.computeFrameJacobian(model, data, q, frame, pin.WORLD).reshape(6, -1)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL).reshape(6, -1)
        if axes is Axes.BODY:
            return J
        pin.framesForwardKinematics(model, data, q)
        return _turned(data, frame, J)

    return kernel


def jacobian_rate(frame: int, axes: Axes) -> Kernel:
    """Its time derivative."""

    def kernel(model: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
        if axes is Axes.WORLD:
            pin.computeJointJacobiansTimeVariation(model, data, q, v)
            return pin.getFrameJacobianTimeVariation(model, data, frame, pin.WORLD).reshape(6, -1)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL).reshape(6, -1)
        rate, twist = rate_of(J, v)
        if axes is Axes.BODY:
            return rate
        # d/dt diag(R, R) = diag(R, R) diag(ω̂, ω̂)
        pin.framesForwardKinematics(model, data, q)
        return _turned(data, frame, rate + block_diagonal(hat(twist[3:])) @ J)

    return kernel


def _turned(data: Any, frame: int, J: ndarray) -> ndarray:
    """diag(R, R) J, from a frame's axes to the base's."""
    return block_diagonal(data.oMf[frame].rotation) @ J


def ask(
    kernel: Kernel,
    reduce: Callable[[Any], Any] | None,
    model: Any,
    data: Any,
    ties: Ties,
    joint_names: tuple[str, ...],
    state: dict[str, Array],
) -> Any:
    """Check the arguments, untie the joints, go through the batch, tie again.

    Args:
        kernel: The call of Pinocchio for one state of all joints.
        reduce: How its result is tied, or None if it has no axis of joints.
        model: The model of all joints, or what else the kernel takes.
        data: Its scratch memory.
        ties: How all joints follow q.
        joint_names: Names of the independent ones.
        state: q, and v, a or tau, in the kernel's order.

    Raises:
        QueryError: If an argument is wrong.
        OverflowedError: If the result is not finite.
    """
    arrays = {name: checked(name, x, joint_names) for name, x in state.items()}
    N = len(ties.s0)
    batch = check_batches(**arrays)
    with np.errstate(all="ignore"):  # what overflows is told below
        full = [ties.position(x) if name == "q" else ties.velocity(x) for name, x in arrays.items()]
        rows = [np.broadcast_to(x, (*batch, N)).reshape(-1, N) for x in full]
        answers = [kernel(model, data, *row) for row in zip(*rows, strict=True)]
        if not answers:  # an empty batch has a shape all the same
            answers = np.empty((0, *np.shape(kernel(model, data, *np.zeros((len(rows), N))))))
        answer = np.array(answers)
        answer = answer.reshape(batch + answer.shape[1:])
        if reduce is not None:
            answer = reduce(answer)
    if not np.isfinite(answer).all():
        raise OverflowedError(f"{', '.join(state)} are so large that the result overflows")
    return answer if answer.ndim else float(answer)
