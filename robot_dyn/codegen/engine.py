"""Engine of a compiled robot or plant: each quantity is traced, compiled and checked on first use.

A quantity at one state is one call of machine code. `evaluate` handles everything else: lists, batches, and states for
which the kernel reports doubt or an error.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.codegen.kernel import Kernel
from robot_dyn.codegen.llvm.one_state import Status
from robot_dyn.codegen.self_check import STATES, SelfCheck
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.trace.from_casadi import program_of
from robot_dyn.codegen.trace.trace import Traced
from robot_dyn.foundations.arithmetic import Float
from robot_dyn.foundations.errors import QueryError, RobotDynWarning
from robot_dyn.foundations.validate import converted, shaped, times
from robot_dyn.foundations.values import OnFirstUse
from robot_dyn.foundations.waiting import log_if_slow
from robot_dyn.queries.batch import DoubtError, answered, into
from robot_dyn.queries.quantity import Key, Quantity, title

# Measured on chains: forward dynamics of 64 joints, 48 875 instructions, takes 8 s to compile; a batch is then 13 times
# as fast as Pinocchio, one state from Python twice. The time is proportional to the count: 15 s at this limit.
LARGEST_KERNEL = 100_000
_FEW = 8  # states; a batch kernel is not worthwhile for fewer


class SizeWarning(RobotDynWarning):
    """Equations are too long to be compiled; Pinocchio computes them instead."""


@final
@dataclass(frozen=True, eq=False)
class Engine:
    """Kernels by quantity.

    Attributes:
        traced: Function that returns the trace of a quantity.
        quantities: Quantities that it computes, by name, or by (name, link, …) for those of a frame.
        self_check: Check of new kernels; its robot defines the joints and the shapes.
        truth: Function that returns the independent result, (quantity, states) → (STATES, …), and the torque of
            effects.
        dtype: "float64" or "float32".
        threads: Number of threads for batches.
        store: Store of compiled code, or None.
        parameters: Values shared by all states, the last argument of each trace unless empty.
        singular: True if M is singular everywhere: forward dynamics has no result, and `otherwise` raises the error.
        coupled: True if joints are coupled: angles beyond the range are then left to `otherwise`, which detects where
            rounding makes positions inexact.
        traces, worthwhile, kernels, ones, many: By quantity, on first use: its trace, True if it is short enough to be
            compiled, its kernel, and the checked functions for one state and for batches.
    """

    traced: Callable[[Key], Traced]
    quantities: Mapping[Key, Quantity]
    self_check: SelfCheck
    truth: Callable[[Key, dict[str, np.ndarray]], tuple[np.ndarray, np.ndarray | float]]
    dtype: str
    threads: int
    store: Store | None
    parameters: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sizes: Mapping[str, int] = field(init=False, repr=False)
    joint_names: tuple[str, ...] = field(init=False)
    singular: bool = field(init=False)
    coupled: bool = field(init=False)
    traces: OnFirstUse = field(init=False, repr=False)
    worthwhile: OnFirstUse = field(init=False, repr=False)
    kernels: OnFirstUse = field(init=False, repr=False)
    ones: OnFirstUse = field(init=False, repr=False)
    many: OnFirstUse = field(init=False, repr=False)

    def __post_init__(self) -> None:
        robot = self.self_check.dynamics
        vars(self).update(
            sizes=robot.sizes,
            joint_names=robot.joint_names,
            singular=robot.joint_without_inertia is not None,
            coupled=not robot.couplings.trivial,
            traces=OnFirstUse(self.traced),
            worthwhile=OnFirstUse(self._is_worthwhile),
            kernels=OnFirstUse(self._kernel),
            ones=OnFirstUse(self._one),
            many=OnFirstUse(self._many),
        )

    @property
    def instructions(self) -> dict[str, dict[str, int]]:
        """Number of instructions of each quantity used so far, by formulation; the first, shortest one is compiled."""
        return {
            title(name): dict(sorted(trace.counts.items(), key=lambda item: item[1]))
            for name, trace in self.traces.items()
        }

    def shape(self, quantity: Key) -> tuple[int, ...]:
        """Return the shape of a quantity for one state, (1,) for a number."""
        return self.quantities[quantity].shape(self.sizes) or (1,)

    def _is_worthwhile(self, quantity: Key) -> bool:
        """Return True if a quantity is short enough to be compiled; issue a SizeWarning otherwise."""
        if self.singular and self.quantities[quantity].solves:
            return False
        with log_if_slow(f"tracing {title(quantity)} of {self.self_check.dynamics.name}"):
            trace = self.traces[quantity]
        if (count := trace.counts[trace.formulation]) <= LARGEST_KERNEL:
            return True
        warnings.warn(
            f"{title(quantity)} needs {count} instructions, too many to compile (limit {LARGEST_KERNEL});"
            f" {self.self_check.name} computes it, more slowly",
            SizeWarning,
            stacklevel=2,
        )
        return False

    def evaluate(
        self,
        quantity: Key,
        arguments: tuple[ArrayLike, ...],
        out: np.ndarray | None,
        nan: bool,
        otherwise: Callable[..., ArrayLike],
    ) -> np.ndarray:
        """Evaluate a quantity in general: check arguments, process batches, leave doubtful states to `otherwise`.

        With `nan`, states without a result become NaN.

        Raises:
            QueryError: If an argument is wrong. Errors of `otherwise` are passed on. In both cases `out` is unchanged.
        """
        if (quick := self._plainly(quantity, arguments, out)) is not None:
            return quick
        requested, shape = self.quantities[quantity], self.shape(quantity)
        timed = requested.arguments[0] == "t"
        arrays = {name: self._array(name, x) for name, x in zip(requested.arguments, arguments, strict=True)}

        def equation(*values: np.ndarray) -> np.ndarray:
            batch = np.broadcast_shapes(*(x.shape[:-1] for x in values))
            alone = not batch
            if self.worthwhile[quantity]:
                y = self._computed(quantity, values, batch)
                if y is not None:
                    return y
                if not alone:
                    raise DoubtError
            elif timed and not alone:
                raise DoubtError  # effects may accept only one time
            state = (float(values[0][0]), *values[1:]) if timed else values
            return np.broadcast_to(np.asarray(otherwise(*state), self.dtype), (*batch, *shape))

        answer = answered(equation, arrays, shape, self.joint_names, nan, Float(np.dtype(self.dtype)))
        return into(out, answer if requested.axes else answer[..., 0][()])

    def _computed(self, quantity: Key, arguments: tuple[np.ndarray, ...], batch: tuple[int, ...]) -> np.ndarray | None:
        """Return the kernel's results for a batch of states, or None if it reports doubt."""
        flat = [
            np.ascontiguousarray(np.broadcast_to(x, (*batch, x.shape[-1])), self.dtype).reshape(-1, x.shape[-1])
            for x in arguments
        ]
        y = np.empty((*batch, *self.shape(quantity)), self.dtype)
        return y if self._run(quantity, flat, y.reshape(len(flat[0]), -1)) is Status.FINE else None

    def _plainly(self, quantity: Key, arguments: tuple[Any, ...], out: np.ndarray | None) -> np.ndarray | None:
        """Return the result for plain arrays (B, n) if the kernel reports no doubt; otherwise None."""
        requested, states = self.quantities[quantity], getattr(arguments[-1], "shape", ())[:-1]
        if len(states) != 1 or states[0] <= _FEW or not requested.axes:
            return None
        shape = requested.shape(self.sizes)
        if requested.arguments[0] == "t":
            t = arguments[0]
            if type(t) is not np.ndarray or t.dtype.kind not in "fiu" or t.shape != states:
                return None
            try:
                t = converted("t", t[:, None], self.joint_names, Float(np.dtype(self.dtype)))
            except QueryError:
                return None
            arguments = (t, *arguments[1:])
        try:
            if all(type(x) is np.ndarray and x.flags.aligned for x in arguments):
                # not `out`: doubt may arise after some rows
                y = np.empty((states[0], int(np.prod(shape))), self.dtype)
                if self.many[quantity](arguments, y, self.threads) is Status.FINE:
                    return into(out, y.reshape(*states, *shape))
        except (AttributeError, TypeError):  # other objects
            pass
        return None

    def _array(self, name: str, x: object) -> np.ndarray:
        """Convert an argument to an array; the kernel checks faster that its numbers are finite."""
        if name == "t":
            return times(name, x)[..., None]
        plain = type(x) is np.ndarray
        if isinstance(x, np.ndarray) and plain and x.dtype == self.dtype and x.shape[-1:] == (len(self.joint_names),):
            return x
        return shaped(name, x, self.joint_names)

    def _run(self, quantity: Key, inputs: list[np.ndarray], y: np.ndarray) -> Status:
        if len(y) > _FEW:
            return self.many[quantity](inputs, y, self.threads)
        timed = self.kernels[quantity].times
        results = y.reshape(len(y), *self.shape(quantity))
        rows = [[float(x[i, 0]) if timed and j == 0 else x[i] for j, x in enumerate(inputs)] for i in range(len(y))]
        return max(self._single(quantity, *row, results[i]) for i, row in enumerate(rows))

    def _single(self, quantity: Key, *arguments: Any) -> Status:
        status = Status(self.ones[quantity](*arguments))
        if status is not Status.FAR or self.coupled:
            return status
        return Status(self.kernels[quantity].any_angle(*arguments))

    def _kernel(self, quantity: Key) -> Kernel:
        """Return the kernel of a quantity."""
        requested = self.quantities[quantity]
        times = requested.arguments[0] == "t"
        program = program_of(self.traces[quantity].function)
        about = f"{self.self_check.dynamics.name}: {title(quantity)}, {self.dtype}"
        return Kernel(
            program,
            self.shape(quantity),
            self.dtype,
            times=times,
            doubtful=requested.doubtful,
            store=self.store,
            about=about,
            parameters=self.parameters,
            takes_any_angle=not self.coupled,
        )

    def _one(self, quantity: Key) -> Any:
        """Return the checked kernel for one state."""
        if not self.worthwhile[quantity]:
            return _never
        kernel = self.kernels[quantity]
        self._judge(quantity, lambda inputs, y: [kernel.call(*row, y[i]) for i, row in enumerate(inputs)])
        return kernel.call

    def _many(self, quantity: Key) -> Any:
        """Return the checked kernel for batches."""
        if not self.worthwhile[quantity]:
            return _never
        kernel = self.kernels[quantity]
        length = int(np.prod(kernel.shape))

        def run(rows: list[list[Any]], y: np.ndarray) -> Status:
            columns = [np.array([row[j] for row in rows], self.dtype).reshape(STATES, -1) for j in range(len(rows[0]))]
            return kernel.many(columns, y.reshape(STATES, length), 1)

        self._judge(quantity, run)
        return kernel.many

    def _judge(self, quantity: Key, run: Callable[[list[list[Any]], np.ndarray], Any]) -> None:
        """Compare the result of `run`, which compiles the kernel, with the independent result.

        `run` returns one Status, or one for each state.
        """
        with log_if_slow(f"compiling {title(quantity)} of {self.self_check.dynamics.name}, once for these equations"):
            self._compare(quantity, run)

    def _compare(self, quantity: Key, run: Callable[[list[list[Any]], np.ndarray], Any]) -> None:
        requested = self.quantities[quantity]
        state = {name: x.astype(self.dtype).astype(float) for name, x in self.self_check.states().items()}
        rows = [
            [float(state[n][i]) if n == "t" else state[n][i].astype(self.dtype) for n in requested.arguments]
            for i in range(STATES)
        ]
        ours = np.full((STATES, *self.shape(quantity)), np.nan, self.dtype)  # doubtful states are not written
        answered = np.broadcast_to(np.equal(run(rows, ours), Status.FINE), STATES)
        theirs, effects = self.truth(quantity, state)
        self.self_check.check(requested, ours.reshape(theirs.shape), theirs, self.dtype, effects, answered)


def _never(*_: Any) -> int:
    """Replace a kernel that is not worthwhile: `evaluate` takes over."""
    return Status.SHAPE
