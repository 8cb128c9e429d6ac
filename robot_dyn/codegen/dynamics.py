"""A robot's equations as machine code, M(q) a + C(q, v) v + N(q) = τ."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy import empty
from numpy.typing import DTypeLike

from robot_dyn.codegen.derivatives import forward_dynamics_derivatives
from robot_dyn.codegen.engine import Engine
from robot_dyn.codegen.self_check import SelfCheck
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.codegen.threads import thread_count
from robot_dyn.codegen.trace.trace import QUANTITIES, Trace, keyed
from robot_dyn.description.inertial_parameters import Parametrised
from robot_dyn.foundations.validate import JointValues, choice, instance, truth
from robot_dyn.foundations.values import OnFirstUse
from robot_dyn.model.right_angles import RightAngle, with_exact_right_angles
from robot_dyn.model.robot import Robot
from robot_dyn.queries.batch import into
from robot_dyn.queries.dynamics import FORWARD_DYNAMICS_DERIVATIVES, Axes, Dynamics, NanRows
from robot_dyn.queries.quantity import Key

_FEW = 8  # states; a query of a frame at fewer is left to Pinocchio
_DERIVATIVES = FORWARD_DYNAMICS_DERIVATIVES.name


class _Derivatives(Dynamics[np.ndarray]):
    """Queries with the derivatives of forward dynamics."""

    def forward_dynamics_derivatives(
        self, q: JointValues, v: JointValues, tau: JointValues
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ∂a/∂q, ∂a/∂v, ∂a/∂τ of forward dynamics, each (..., n, n): −M⁻¹ ∂ID/∂q, −M⁻¹ ∂ID/∂v, M⁻¹."""
        three = self._answer(_DERIVATIVES, (q, v, tau), None)
        return three[..., 0, :, :], three[..., 1, :, :], three[..., 2, :, :]


@dataclass(frozen=True)
class CompiledNanRows(_Derivatives, NanRows[np.ndarray]):
    """The queries of a compiled robot, with NaN for states without a result; see `Dynamics.nan_rows`."""


@dataclass(frozen=True)
class CompiledDynamics(_Derivatives, Parametrised):
    """A robot as machine code; each quantity is compiled on first use and checked against Pinocchio.

    Placements and Jacobians of a frame are compiled for batches; those of up to eight states are computed by Pinocchio.

    Attributes:
        original: Robot passed by the user.
        dtype: "float64" or "float32"; np.float64 and np.float32 are stored as their names.
        threads: Number of threads for batches; None for all processors.
        cache: Store compiled code on disk.
    """

    original: Robot
    dtype: str = "float64"
    threads: int | None = 1
    cache: bool = True

    def __post_init__(self) -> None:
        instance("robot", self.original, Robot, "give a Robot, for example rd.load('ur5')")
        object.__setattr__(self, "dtype", name_of_dtype(self.dtype))
        truth("cache", self.cache)
        thread_count(self.threads)

    def __reduce__(self) -> tuple[object, ...]:
        return CompiledDynamics, (self.original, self.dtype, self.threads, self.cache)

    @cached_property
    def _completed(self) -> tuple[Robot, tuple[RightAngle, ...]]:
        return with_exact_right_angles(self.original)

    @property
    def robot(self) -> Robot:
        """Robot whose equations are compiled: `original`, with right angles at full precision."""
        return self._completed[0]

    @property
    def right_angles(self) -> tuple[str, ...]:
        """Angles that the file states with too few digits and that are treated as right angles, as text."""
        return tuple(map(str, self._completed[1]))

    @cached_property
    def engine(self) -> Engine:
        """Kernels of the robot."""

        def truth(quantity: Key, state: dict[str, np.ndarray]) -> tuple[np.ndarray, float]:
            return np.asarray(self._otherwise(quantity)(*(state[name] for name in keyed(quantity).arguments))), 0.0

        return Engine(
            Trace(self.robot).quantity,
            OnFirstUse(keyed),
            SelfCheck(self.robot, "Pinocchio"),
            truth,
            self.dtype,
            thread_count(self.threads),
            default_store() if self.cache else None,
        )

    @cached_property
    def _ones(self) -> OnFirstUse:
        return self.engine.ones

    @property
    def instructions(self) -> dict[str, dict[str, int]]:
        """Number of instructions of each quantity used so far, by formulation; the first, smallest one is compiled."""
        return self.engine.instructions

    def served_by(self, quantity: str) -> str:
        """Return the formulation compiled for a quantity; "Pinocchio" if the code would be too long to compile."""
        if quantity not in QUANTITIES or not self.engine.worthwhile[quantity]:
            return "Pinocchio"
        return self.engine.traces[quantity].formulation

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.original.n

    @cached_property
    def joint_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Names of the n joints, in the order of q."""
        return self.original.joint_names

    @property
    def nan_rows(self) -> CompiledNanRows:
        return CompiledNanRows(self)

    @cached_property
    def _vector(self) -> tuple[int, Any]:
        """Arguments of `empty` for a result (n,)."""
        return self.n, np.dtype(self.dtype)

    @cached_property
    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of results for one state."""
        return {name: quantity.shape(self.engine.sizes) for name, quantity in QUANTITIES.items()}

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self.robot.body_names

    @property
    def inertial_parameters(self) -> np.ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self.robot.inertial_parameters

    def _answer(
        self, name: str, state: tuple[Any, ...], out: Any, frame: tuple[str, ...] = (), *, nan: bool = False
    ) -> Any:
        if frame:
            return self._of_frame(name, state, out, frame, nan)
        if shape := self._shapes[name]:
            y = empty(shape, self._vector[1]) if out is None else out
            if not self._ones[name](*state, y):
                return y
        return self.engine.evaluate(name, state, out, nan, self._otherwise(name))

    def _of_frame(self, name: str, state: tuple[Any, ...], out: Any, frame: tuple[str, ...], nan: bool) -> Any:
        """Return a query of a frame: a batch by machine code, otherwise by Pinocchio."""
        largest = max(x.size if isinstance(x, np.ndarray) else 0 for x in state)
        if largest <= _FEW * self.n or not isinstance(frame[0], str):
            answer = self.robot._answer(name, state, None, frame, nan=nan)
            return into(out, np.asarray(answer, self.dtype))
        link = self.robot.description.joint_frames.get(frame[0], frame[0])
        key = name, link, *map(str, map(Axes.from_name, frame[1:]))
        return self.engine.evaluate(key, state, out, nan, self._otherwise(key))

    # --- queries that take half a microsecond and skip `_answer`

    def inverse_dynamics(
        self, q: JointValues, v: JointValues, a: JointValues, *, out: np.ndarray | None = None
    ) -> np.ndarray:
        y = empty(*self._vector) if out is None else out
        if not self._ones["inverse_dynamics"](q, v, a, y):
            return y
        return self._answer("inverse_dynamics", (q, v, a), out)

    def forward_dynamics(
        self, q: JointValues, v: JointValues, tau: JointValues, *, out: np.ndarray | None = None
    ) -> np.ndarray:
        y = empty(*self._vector) if out is None else out
        if not self._ones["forward_dynamics"](q, v, tau, y):
            return y
        return self._answer("forward_dynamics", (q, v, tau), out)

    def _otherwise(self, quantity: Key) -> Callable[..., Any]:
        """Return Pinocchio's method for a quantity."""
        if isinstance(quantity, tuple):
            return lambda *state: self.robot._answer(quantity[0], state, None, quantity[1:])
        if quantity == _DERIVATIVES:
            return partial(forward_dynamics_derivatives, self.robot)
        return getattr(self.robot, quantity)


def name_of_dtype(dtype: DTypeLike) -> str:
    """Return the name of a NumPy dtype that machine code supports; raise QueryError for any other."""
    name = dtype
    if dtype is not None and not isinstance(dtype, str):
        with suppress(Exception):  # a foreign object may raise anything
            resolved = np.dtype(dtype)
            name = resolved.name if resolved.isnative else dtype
    return choice("dtype", name, ("float64", "float32"))
