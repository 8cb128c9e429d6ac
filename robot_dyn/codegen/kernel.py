"""Kernels: machine code of y = f(x₁, x₂, …) for one state, and for many states in vectors and threads.

Machine code also checks shapes, finite arguments and the size of results. A kernel reports a `Status`; the slow path
raises the error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.codegen.llvm import machine_code
from robot_dyn.codegen.llvm.batch import batch_function, lanes
from robot_dyn.codegen.llvm.entries import write_batch_entry, write_state_entry
from robot_dyn.codegen.llvm.one_state import Limits, Status, state_function
from robot_dyn.codegen.llvm.python_function import python_function
from robot_dyn.codegen.llvm.vectors import F32, F64
from robot_dyn.codegen.program import Program
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.store.keys import digest, sources_of_the_writer
from robot_dyn.codegen.threads import shared

if TYPE_CHECKING:
    from llvmlite import ir

# Vector instructions that a thread executes per piece, about 50 µs; below _PIECES of these, waking a second thread
# takes as long as it saves.
_PIECE, _PIECES = 600_000, 6
_LARGEST = {"float64": 1e100, "float32": 1e18}  # same as Robot: products of smaller numbers do not overflow


@final
@dataclass(frozen=True, eq=False)
class Kernel:
    """A function of states as machine code, compiled on first use.

    Attributes:
        program: Instructions; the inputs are x₁, x₂, …, and the parameters if there are any.
        shape: Shape of the result for one state.
        dtype: "float64" or "float32".
        times: True if the first input is a time: a number in `call`, (B, 1) in `many`.
        doubtful: Limit of the sum of absolute results; larger results are reported.
        store: Store of compiled code, or None.
        about: Description for readers of the store.
        parameters: Numbers shared by all states, (P,); kernels that differ only in these run the same code.
        takes_any_angle: True if `many` also computes angles beyond the range of the vectorised sine; otherwise it
            reports them.
    """

    program: Program
    shape: tuple[int, ...]
    dtype: str = "float64"
    times: bool = False
    doubtful: float = np.inf
    store: Store | None = None
    about: str = ""
    parameters: np.ndarray = field(default_factory=lambda: np.zeros(0))
    takes_any_angle: bool = True

    @cached_property
    def call(self) -> Callable[..., int]:
        """Function of one state, (x₁, …, y) → Status: C-contiguous arrays (nᵢ,), y of the shape of the result.

        It accepts any objects and reports those that are not such arrays.
        """
        return self._function("one state", self._write_state)

    @cached_property
    def any_angle(self) -> Callable[..., int]:
        """Same function as `call`, with the C library's sine and cosine, for angles beyond the vectorised range."""
        write = partial(self._write_state, any_angle=True)
        return self._function("one state, any angle", write)

    @property
    def state(self) -> int:
        """Address of the function of one state for other machine code: pointers (x₁, …, y) → int64."""
        return self._address("state", "one state", self._write_state)

    @cached_property
    def batch(self) -> Callable[..., int]:
        """Function (x₁, …, y, start, stop) → Status, for states start … stop − 1 of arrays (B, nᵢ) and y (B, m)."""
        return self._function("batch", self._write_batch)

    @property
    def lanes(self) -> int:
        """Number of states computed in one vector."""
        return lanes(self._kind)

    def many(self, inputs: Sequence[np.ndarray], y: np.ndarray, threads: int = 1) -> Status:
        """Run a batch: inputs (B, nᵢ) and y (B, m), C-contiguous and of the kernel's dtype; otherwise report SHAPE."""
        states, least = len(y), self.lanes
        if states < least:  # all states fit into one vector
            results = np.empty((least, y.shape[1]), y.dtype)
            status = self._run([np.resize(x, (least, x.shape[1])) for x in inputs], results, 0, least)
            y[:] = results[:states]
            return status
        piece = max(_PIECE // (len(self.program) + 1), 1) * least
        if threads == 1 or states < _PIECES * piece:
            return self._run(inputs, y, 0, states)
        return Status(shared(lambda start, stop: self._run(inputs, y, start, stop), states, piece, threads))

    def _run(self, inputs: Sequence[np.ndarray], y: np.ndarray, start: int, stop: int) -> Status:
        status = Status(self.batch(*inputs, y, start, stop))
        if status is not Status.FAR or not self.takes_any_angle:
            return status
        first = [[float(t) for t in inputs[0][:, 0]] if self.times else inputs[0], *inputs[1:]]
        shaped = y.reshape(len(y), *self.shape)
        return Status(max(self.any_angle(*(x[i] for x in first), shaped[i]) for i in range(start, stop)))

    def assembly(self) -> str:
        """Return the machine code of the batch function as text."""
        return machine_code.assembly(self._write_batch, "batch")

    @property
    def _kind(self) -> ir.Type:
        return F32 if self.dtype == "float32" else F64

    @property
    def _limits(self) -> Limits:
        return Limits(_LARGEST[self.dtype], self.doubtful)

    def _write_state(self, module: ir.Module, name: str, any_angle: bool = False) -> None:
        settings = self.program, self._kind, self._limits, any_angle, self._parametrised
        state = state_function(module, f"{name}state", *settings)
        write_state_entry(module, f"{name}call", state, self._of_states, self.shape, self.times, self._parametrised)

    def _write_batch(self, module: ir.Module, name: str) -> None:
        settings = self.program, self._kind, self._limits, self._parametrised
        batch = batch_function(module, f"{name}batch", *settings)
        outputs = len(self.program.outputs)
        write_batch_entry(module, f"{name}call", batch, self._of_states, outputs, self._parametrised)

    @property
    def _parametrised(self) -> bool:
        return self.parameters.size > 0

    @property
    def _of_states(self) -> tuple[int, ...]:
        """Lengths of the inputs that vary between states."""
        return self.program.inputs[: len(self.program.inputs) - self._parametrised]

    def _function(self, form: str, write: machine_code.Write) -> Callable[..., int]:
        return python_function(self._address("call", form, write), np.array(self.parameters, self.dtype).tobytes())

    def _address(self, function: str, form: str, write: machine_code.Write) -> int:
        settings = str(self.shape), self.dtype, str(self.times), repr(self.doubtful), str(self._parametrised)
        key = digest([form, sources_of_the_writer(), str(self.program), *settings])
        return machine_code.addresses((function,), key, write, self.store, f"{self.about}, {form}")[0]
