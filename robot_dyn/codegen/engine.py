"""The engine of a compiled robot or plant: each quantity is traced, compiled and checked on first use.

A quantity of one state is one call of machine code. `ask` handles everything else: lists, batches, and states for
which the kernel reports a doubt or an error.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

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
from robot_dyn.queries.quantity import Quantity

# Measured on chains: forward dynamics of 64 joints, 48 875 instructions, takes 8 s to compile; a batch is then 13 times
# as fast as Pinocchio, one state from Python twice. The time grows as the count: above this, a quarter of a minute.
LARGEST_KERNEL = 100_000
_FEW = 8  # states; for fewer a batch kernel is not worthwhile


class SizeWarning(RobotDynWarning):
    """Equations too long to be compiled: Pinocchio computes them instead."""


@final
@dataclass(frozen=True, eq=False)
class Engine:
    """Kernels by quantity.

    Attributes:
        traced: Returns the trace of a quantity.
        quantities: Those it computes, by name.
        self_check: What kernels must agree with; its robot has the joints and the shapes.
        truth: The independent result: (quantity, states) → (STATES, …), and the torque of effects, a term.
        dtype: "float64" or "float32".
        threads: For batches.
        store: Where compiled code is stored, or None.
        parameters: What all states share, the last argument of each trace; none if it is empty.
        singular: Whether M is singular everywhere: forward dynamics has no result, and `otherwise` raises the error.
        coupled: Whether joints follow others: then far angles are left to `otherwise`, which knows what rounding
            of theirs hides.
        traces, worthwhile, kernels, ones, many: By quantity, on first use: its trace, whether it is small enough to be
            compiled, its kernel, and that of one state and of batches, checked.
    """

    traced: Callable[[str], Traced]
    quantities: Mapping[str, Quantity]
    self_check: SelfCheck
    truth: Callable[[str, dict[str, np.ndarray]], tuple[np.ndarray, Any]]
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
        """Instructions by formulation, of each quantity used so far; the shortest first, which is compiled."""
        return {
            name: dict(sorted(trace.counts.items(), key=lambda item: item[1])) for name, trace in self.traces.items()
        }

    def shape(self, quantity: str) -> tuple[int, ...]:
        """Shape of a quantity for one state, (1,) of a number."""
        return self.quantities[quantity].shape(self.sizes) or (1,)

    def _is_worthwhile(self, quantity: str) -> bool:
        """Whether a quantity is small enough to be compiled; a SizeWarning if not."""
        if self.singular and self.quantities[quantity].solves:
            return False
        with log_if_slow(f"tracing {quantity} of {self.self_check.dynamics.name}"):
            trace = self.traces[quantity]
        if (count := trace.counts[trace.formulation]) <= LARGEST_KERNEL:
            return True
        warnings.warn(
            f"{quantity} takes {count} instructions, more than the {LARGEST_KERNEL} that are worth compiling;"
            f" {self.self_check.name} computes it, at its own speed",
            SizeWarning,
            stacklevel=2,
        )
        return False

    def ask(
        self,
        quantity: str,
        arguments: tuple[Any, ...],
        out: np.ndarray | None,
        errors: str,
        otherwise: Callable[..., Any],
    ) -> Any:
        """A quantity in general: check the arguments, go through the batch, leave doubtful states to `otherwise`.

        Raises:
            QueryError: If an argument is wrong; and what `otherwise` raises. Then `out` is left as it was.
        """
        if (quick := self._plainly(quantity, arguments, out)) is not None:
            return quick
        requested, shape = self.quantities[quantity], self.shape(quantity)
        timed = requested.arguments[0] == "t"
        arrays = {name: self._array(name, x) for name, x in zip(requested.arguments, arguments, strict=True)}

        def equation(*given: np.ndarray) -> np.ndarray:
            batch = np.broadcast_shapes(*(x.shape[:-1] for x in given))
            alone = not batch
            if self.worthwhile[quantity]:
                y = self._computed(quantity, given, batch)
                if y is not None:
                    return y
                if not alone:
                    raise DoubtError
            elif timed and not alone:
                raise DoubtError  # effects may take one time only
            state = (float(given[0][0]), *given[1:]) if timed else given
            return np.broadcast_to(np.asarray(otherwise(*state), self.dtype), (*batch, *shape))

        answer = answered(equation, arrays, shape, self.joint_names, errors, Float(np.dtype(self.dtype)))
        return into(out, answer if requested.axes else answer[..., 0][()])

    def _computed(self, quantity: str, given: tuple[np.ndarray, ...], batch: tuple[int, ...]) -> np.ndarray | None:
        """The kernel's results for a batch of states, or None if it reports a doubt."""
        flat = [
            np.ascontiguousarray(np.broadcast_to(x, (*batch, x.shape[-1])), self.dtype).reshape(-1, x.shape[-1])
            for x in given
        ]
        y = np.empty((*batch, *self.shape(quantity)), self.dtype)
        return y if self._run(quantity, flat, y.reshape(len(flat[0]), -1)) is Status.FINE else None

    def _plainly(self, quantity: str, arguments: tuple[Any, ...], out: np.ndarray | None) -> Any:
        """The result for arrays (B, n) that the kernel takes as they are, if it reports no doubt; otherwise None."""
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
                # not `out`: a doubt may come after some rows
                y = np.empty((states[0], int(np.prod(shape))), self.dtype)
                if self.many[quantity](arguments, y, self.threads) is Status.FINE:
                    return into(out, y.reshape(*states, *shape))
        except (AttributeError, TypeError):  # not such arrays
            pass
        return None

    def _array(self, name: str, x: Any) -> np.ndarray:
        """An argument as an array; the kernel checks faster that its numbers are finite."""
        if name == "t":
            return times(name, x)[..., None]
        plain = x.__class__ is np.ndarray and x.dtype == self.dtype and x.shape[-1:] == (len(self.joint_names),)
        return x if plain else shaped(name, x, self.joint_names)

    def _run(self, quantity: str, inputs: list[np.ndarray], y: np.ndarray) -> Status:
        if len(y) > _FEW:
            return self.many[quantity](inputs, y, self.threads)
        timed = self.kernels[quantity].times
        results = y.reshape(len(y), *self.shape(quantity))
        rows = [[float(x[i, 0]) if timed and j == 0 else x[i] for j, x in enumerate(inputs)] for i in range(len(y))]
        return max(self._single(quantity, *row, results[i]) for i, row in enumerate(rows))

    def _single(self, quantity: str, *arguments: Any) -> Status:
        status = Status(self.ones[quantity](*arguments))
        if status is not Status.FAR or self.coupled:
            return status
        return Status(self.kernels[quantity].any_angle(*arguments))

    def _kernel(self, quantity: str) -> Kernel:
        requested = self.quantities[quantity]
        times = requested.arguments[0] == "t"
        program = program_of(self.traces[quantity].function)
        about = f"{self.self_check.dynamics.name}: {quantity}, {self.dtype}"
        return Kernel(
            program, self.shape(quantity), self.dtype, times, requested.doubtful, self.store, about, self.parameters,
            not self.coupled,
        )  # fmt: skip

    def _one(self, quantity: str) -> Any:
        """The checked kernel for one state."""
        if not self.worthwhile[quantity]:
            return _never
        kernel = self.kernels[quantity]
        self._judge(quantity, lambda inputs, y: [kernel.call(*row, y[i]) for i, row in enumerate(inputs)])
        return kernel.call

    def _many(self, quantity: str) -> Any:
        """The checked kernel for batches."""
        if not self.worthwhile[quantity]:
            return _never
        kernel = self.kernels[quantity]
        length = int(np.prod(kernel.shape))

        def run(rows: list[list[Any]], y: np.ndarray) -> Status:
            columns = [np.array([row[j] for row in rows], self.dtype).reshape(STATES, -1) for j in range(len(rows[0]))]
            return kernel.many(columns, y.reshape(STATES, length), 1)

        self._judge(quantity, run)
        return kernel.many

    def _judge(self, quantity: str, run: Callable[[list[list[Any]], np.ndarray], Any]) -> None:
        """Compare what `run` writes, which compiles it, with the independent result.

        It reports one Status, or one for each state.
        """
        with log_if_slow(f"compiling {quantity} of {self.self_check.dynamics.name}, once for these equations"):
            self._compare(quantity, run)

    def _compare(self, quantity: str, run: Callable[[list[list[Any]], np.ndarray], Any]) -> None:
        requested = self.quantities[quantity]
        state = {name: x.astype(self.dtype).astype(float) for name, x in self.self_check.states().items()}
        rows = [
            [float(state[n][i]) if n == "t" else state[n][i].astype(self.dtype) for n in requested.arguments]
            for i in range(STATES)
        ]
        ours = np.full((STATES, *self.shape(quantity)), np.nan, self.dtype)  # a state in doubt is not written
        answered = np.broadcast_to(np.equal(run(rows, ours), Status.FINE), STATES)
        theirs, effects = self.truth(quantity, state)
        self.self_check.judge(requested, ours.reshape(theirs.shape), theirs, self.dtype, effects, answered)


def _never(*_: Any) -> int:
    """In place of a kernel that is not worthwhile: `ask` takes over."""
    return Status.SHAPE
