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
from robot_dyn.model.dynamics import Array, Axes, check_batches, checked
from robot_dyn.model.ties import Ties

Kernel = Callable[..., Any]  # (model, data, q, …) → a fresh array, or a number
_F8 = np.dtype(np.float64)
_REFERENCE = {Axes.WORLD_ALIGNED: pin.LOCAL_WORLD_ALIGNED, Axes.BODY: pin.LOCAL, Axes.WORLD: pin.WORLD}


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


def coriolis_torque(model: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """C v."""
    return pin.computeCoriolisMatrix(model, data, q, v) @ v


def coriolis_transpose(model: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
    """Cᵀ v."""
    return v @ pin.computeCoriolisMatrix(model, data, q, v)


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
    """Jacobian of a frame; Pinocchio gives a flat one if there is one joint."""

    def kernel(model: Any, data: Any, q: ndarray) -> ndarray:
        return pin.computeFrameJacobian(model, data, q, frame, _REFERENCE[axes]).reshape(6, -1)

    return kernel


def jacobian_rate(frame: int, axes: Axes) -> Kernel:
    """Its time derivative."""

    def kernel(model: Any, data: Any, q: ndarray, v: ndarray) -> ndarray:
        pin.computeJointJacobiansTimeVariation(model, data, q, v)
        return pin.getFrameJacobianTimeVariation(model, data, frame, _REFERENCE[axes]).reshape(6, -1)

    return kernel


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
        model: The model of all joints.
        data: Its scratch memory.
        ties: How all joints follow q.
        joint_names: Names of the independent ones.
        state: q, and v, a or tau, in the kernel's order.

    Raises:
        QueryError: If an argument is wrong.
        OverflowedError: If the result is not finite.
    """
    arrays = {name: checked(name, x, joint_names) for name, x in state.items()}
    batch = check_batches(**arrays)
    with np.errstate(all="ignore"):  # what overflows is told below
        full = [ties.position(x) if name == "q" else ties.velocity(x) for name, x in arrays.items()]
        rows = [np.broadcast_to(x, (*batch, model.nv)).reshape(-1, model.nv) for x in full]
        answers = [kernel(model, data, *row) for row in zip(*rows, strict=True)]
        if not answers:  # an empty batch has a shape all the same
            answers = np.empty((0, *np.shape(kernel(model, data, *np.zeros((len(rows), model.nv))))))
        answer = np.array(answers)
        answer = answer.reshape(batch + answer.shape[1:])
        if reduce is not None:
            answer = reduce(answer)
    if not np.isfinite(answer).all():
        raise OverflowedError(f"{', '.join(state)} are so large that the result overflows")
    return answer if answer.ndim else float(answer)
