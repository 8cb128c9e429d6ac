"""Kernels: the machine code of y = f(x₁, x₂, …) for one state, and for many in tiles on one thread or several.

The checks are in machine code as well: a shape, a number that is not finite, a result that is too large. A kernel only
reports them; the words are found on the slow path.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.compiled.checks import Status, batch_text, exact_text, one_text
from robot_dyn.compiled.overload import Store, compiled
from robot_dyn.compiled.sincos import RANGE
from robot_dyn.compiled.single import Object, has_form, is_array, state_of
from robot_dyn.compiled.source import FASTMATH, Source
from robot_dyn.compiled.threads import shared
from robot_dyn.compiled.vectors import batch_of, lanes

# Instructions of vectors that a thread takes at a time, about 50 µs; fewer than _PIECES of these, and to wake a second
# thread costs what it saves.
_PIECE, _PIECES = 600_000, 6
_LARGEST = {"float64": 1e100, "float32": 1e18}  # as Robot: below, products do not overflow


@final
@dataclass(frozen=True, eq=False)
class Kernel:
    """A function of states as machine code, compiled when first asked for.

    Attributes:
        source: Its straight-line code.
        shape: Shape of the result for one state.
        dtype: "float64" or "float32".
        times: Whether the first input is a time: a number in `one`, (B, 1) in `many`.
        doubtful: Results whose absolute values sum to more are reported.
        store: Where compiled code is kept, or None.
        about: What it is of, for a reader of the store.
    """

    source: Source
    shape: tuple[int, ...]
    dtype: str = "float64"
    times: bool = False
    doubtful: float = np.inf
    store: Store | None = None
    about: str = ""
    _lock: Any = field(default_factory=threading.RLock, init=False, repr=False)

    @cached_property
    def one(self) -> Any:
        """For one state, (x₁, …, y) → Status: arrays (nᵢ,), y of the shape of the result, C-contiguous."""
        with self._lock:
            return self._compiled("state", one_text(*self._form), self._arrays)

    @cached_property
    def call(self) -> Callable[..., int]:
        """The same for Python, (x₁, …, y, like) → Status, where `like` is an array of the kernel's dtype.

        It takes any objects; those that are no such arrays it reports.
        """
        with self._lock:
            objects = [x if number else Object() for x, number in zip(self._arrays, self._numbers, strict=True)]
            function = self._compiled("call", one_text(*self._form, "call"), [*objects, Object()])
            (overload,) = function.overloads.values()
            return overload.entry_point  # the dispatcher would look at the types once more

    @cached_property
    def _exact(self) -> Any:
        """As `one`, the sines and cosines of the C library where an angle is beyond the range of ours."""
        with self._lock:
            return self._compiled("exact", exact_text(*self._form), self._arrays)

    @property
    def _arrays(self) -> list[Any]:
        """Numba's types of the arguments of `one`."""
        inputs = [_array(self.dtype, 1, readonly=True) for _ in self.source.inputs]
        if self.times:
            inputs[0] = _array("float64", 0)
        return [*inputs, _array(self.dtype, len(self.shape))]

    @property
    def _form(self) -> tuple[Source, tuple[int, ...], bool]:
        return self.source, self.shape, self.times

    @property
    def _numbers(self) -> list[bool]:
        return [self.times, *([False] * len(self.source.inputs))]

    def far(self, *arguments: Any) -> Status:
        """One state whose angles are beyond the range of the sine and cosine."""
        return Status(self._exact(*arguments))

    @cached_property
    def _batch(self) -> Any:
        """batch(x₁, …, y, start, stop) → Status, for states start … stop − 1 of arrays (B, nᵢ) and y (B, m)."""
        with self._lock:
            arrays = [_array(self.dtype, 2, readonly=True) for _ in self.source.inputs]
            arrays += [_array(self.dtype, 2), _array("int64", 0), _array("int64", 0)]
            return self._compiled("batch", batch_text(self.source), arrays)

    def many(self, inputs: Sequence[np.ndarray], y: np.ndarray, threads: int = 1) -> Status:
        """Run a batch: inputs (B, nᵢ) and y (B, m).

        Raises:
            TypeError: If an array is not C-contiguous or not of the kernel's dtype.
        """
        states, least = len(y), lanes(self.dtype)
        if states < least:  # a vector of its own
            made = np.empty((least, y.shape[1]), y.dtype)
            status = self._run([np.resize(x, (least, x.shape[1])) for x in inputs], made, 0, least)
            y[:] = made[:states]
            return status
        piece = max(_PIECE // (self.source.instructions + 1), 1) * least
        if threads == 1 or states < _PIECES * piece:
            return self._run(inputs, y, 0, states)
        return Status(shared(lambda start, stop: self._run(inputs, y, start, stop), states, piece, threads))

    def _run(self, inputs: Sequence[np.ndarray], y: np.ndarray, start: int, stop: int) -> Status:
        status = Status(self._batch(*inputs, y, start, stop))
        if status is not Status.FAR:
            return status
        first = [[float(t) for t in inputs[0][:, 0]] if self.times else inputs[0], *inputs[1:]]
        shaped = y.reshape(len(y), *self.shape)
        return max(self.far(*(x[i] for x in first), shaped[i]) for i in range(start, stop))

    def assembly(self) -> str:
        """The machine code of the batch, as text; compiles it afresh, for what comes from a store has none."""
        return _fresh(self, "batch", batch_text(self.source))[1](self._batch.signatures[0])

    def _compiled(self, name: str, text: str, arguments: list[Any]) -> Any:
        about = f"{self.about}, {'batch' if name == 'batch' else 'one state'}"
        return compiled(lambda: _fresh(self, name, text)[0], arguments, self.store, [text, *self._identity], about)

    @cached_property
    def _identity(self) -> tuple[str, ...]:
        """What the code depends on: for the key of the store."""
        return (
            self.source.scalar,
            self.source.tile,
            repr(self.source.constants),
            self.dtype,
            repr(self.doubtful),
            _writers(),
        )


@cache
def _writers() -> str:
    """SHA-256 of the modules that write the machine code: a checkout that changes must not run what it wrote before."""
    modules = ("kernel", "lanes", "sincos", "single", "tanh", "tiles", "vectors", "writer")
    return sha256(b"".join(Path(__file__).with_name(f"{name}.py").read_bytes() for name in modules)).hexdigest()


def _state(kernel: Kernel) -> Any:
    return state_of(kernel.source, kernel.dtype, RANGE, _LARGEST[kernel.dtype], kernel.doubtful)


def _array(dtype: str, axes: int, readonly: bool = False) -> Any:
    """Numba's type of a C-contiguous array, or of a number; what is read may be read-only or not."""
    from numba.core import types

    number = getattr(types, dtype)
    return types.Array(number, axes, "C", readonly=readonly) if axes else number


def _fresh(kernel: Kernel, name: str, text: str) -> tuple[Any, Callable[[Any], str]]:
    """A Numba function of this text, and how to get its assembly."""
    import numba as nb

    number = np.dtype(kernel.dtype).type
    namespace = kernel.source.namespace(kernel.dtype)
    namespace |= {"np": np, "dtype": np.dtype(kernel.dtype), "number": number}
    namespace |= {"is_array": is_array, "has_form": has_form, "single": _state(kernel)}
    namespace |= {
        "vectors": batch_of(kernel.source, kernel.dtype),
        "most": number(_LARGEST[kernel.dtype]),
        "doubtful": number(kernel.doubtful),
    }
    exec(compile(text, f"<robot_dyn {name}>", "exec"), namespace)
    made = nb.njit(fastmath=FASTMATH, error_model="numpy", nogil=True)(namespace[name])

    def assembly(signature: Any) -> str:
        made.compile(signature)
        return made.inspect_asm(signature)

    return made, assembly
