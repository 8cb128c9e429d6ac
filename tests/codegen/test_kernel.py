"""Kernels by themselves: what arrays they take as they are, and what they leave to the general way."""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from robot_dyn.codegen import Kernel, Kind, program_of
from robot_dyn.codegen.llvm.one_state import Status
from robot_dyn.codegen.llvm.sine_groups import in_groups
from robot_dyn.codegen.threads import shared
from tests.long import third


class Own(np.ndarray):
    """A class of the user's own, whose items may mean anything."""


@pytest.fixture(scope="module")
def double() -> Kernel:
    """Y = 2 x of three numbers."""
    x = ca.SX.sym("x", 3)
    return Kernel(program_of(ca.Function("f", [x], [2 * x])), (3,))


STRANGE: dict[str, Any] = {
    "strided": np.ones(6)[::2],
    "backwards": np.ones(3)[::-1],
    "byte-swapped": np.ones(3, ">f8"),
    "integers": np.ones(3, int),
    "float32": np.ones(3, np.float32),
    "of a subclass": np.ones(3).view(Own),
    "too long": np.ones(4),
    "of two axes": np.ones((1, 3)),
    "of no axes": np.array(1.0),
    "complex": np.ones(3, complex),
    "extended": np.ones(3, np.longdouble),
    "dates": np.ones(3, "M8[s]"),
    "records": np.ones(3, [("x", float)]),
    "objects": np.ones(3, object),
    "masked": np.ma.masked_array(np.ones(3)),
    "misaligned": np.zeros(25, np.int8)[1:].view(float),
    "a list": [1.0, 1.0, 1.0],
    "None": None,
    "a number": 1.0,
    "another buffer": memoryview(np.ones(3)),
    "a class": np.ndarray,
}


@pytest.mark.parametrize("what", STRANGE)
def test_what_is_no_plain_array_is_reported(double: Kernel, what: str) -> None:
    """Each is left to the general way, as an argument and as a result, of a state or a batch; nothing is written."""
    y, X, Y = np.zeros(3), np.ones((20, 3)), np.zeros((20, 3))
    assert double.call(STRANGE[what], y) == Status.SHAPE
    assert double.call(np.ones(3), STRANGE[what]) == Status.SHAPE
    assert double.batch(STRANGE[what], Y, 0, 20) == double.batch(X, STRANGE[what], 0, 20) == Status.SHAPE
    assert not y.any() and not Y.any()


def used(*objects: Any) -> list[int]:
    """References to each object."""
    return [sys.getrefcount(x) for x in objects]


@pytest.mark.parametrize("what", [*STRANGE, "read-only", "not finite", "right"])
def test_a_call_releases_what_it_has_read(double: Kernel, what: str) -> None:
    """In every place, of a state and of a batch, also the arrays before the one that is refused."""
    x, y, locked = np.ones(3), np.zeros(3), np.ones(3)
    locked.flags.writeable = False
    other = {**STRANGE, "read-only": locked, "not finite": np.full(3, np.nan), "right": np.ones(3)}[what]
    X, Y = np.ones((20, 3)), np.zeros((20, 3))
    objects = x, y, other, X, Y, type(other), np.ndarray
    before = used(*objects)
    for _ in range(100):
        double.call(other, y)
        double.call(x, other)
        double.call(x, y, other)
        double.batch(other, Y, 0, 20)
        double.batch(X, other, 0, 20)
        double.batch(X, Y, 0, 20)
        double.batch(X, X, 0, 20)
    assert used(*objects) == before


def test_threads_share_arrays(double: Kernel) -> None:
    """Each thread gets its own results, and no reference is lost or left over."""
    x, X = np.arange(3.0), np.ones((200, 3))

    def work(k: int) -> bool:
        y, Y, right = np.empty(3), np.empty((200, 3)), True
        for i in range(2000):
            right &= double.call(x, y) == Status.FINE and np.array_equal(y, 2 * x)
            right &= double.call(x, "no array" if (i + k) % 2 else x[::2]) == Status.SHAPE
            right &= i % 20 != 0 or (double.batch(X, Y, 0, 200) == Status.FINE and bool(np.all(Y == 2)))
        return right

    assert work(0)
    before = used(x, X)
    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(4)))
    assert used(x, X) == before


def test_read_only_arrays_are_read_and_not_written(double: Kernel) -> None:
    """The writeable flag counts for the result alone."""
    x, y = np.ones(3), np.zeros(3)
    x.flags.writeable = False
    assert double.call(x, y) == Status.FINE
    assert np.array_equal(y, 2 * x)
    assert double.call(y, x) == Status.SHAPE
    assert np.array_equal(x, np.ones(3))


def test_numbers_that_are_not_finite_are_reported(double: Kernel) -> None:
    """In any place, of one state and of a batch."""
    for k in range(3):
        for bad in (np.nan, np.inf, -np.inf, 1e101):
            x = np.ones((20, 3))
            x[13, k] = bad
            assert double.call(x[13], np.empty(3)) == Status.ARGUMENT
            assert double.many([x], np.empty((20, 3))) is Status.ARGUMENT


@pytest.mark.parametrize(
    ("width", "dtype"),
    [
        *((width, "float64") for width in (1, 7, 8, 17)),
        *((width, "float32") for width in (2, 9)),
        *third(
            [
                *((width, "float64") for width in (2, 9, 15, 36)),
                *((width, "float32") for width in (1, 7, 8, 15, 17, 36)),
            ]
        ),
    ],
)
def test_rows_of_any_width_and_number_are_transposed(width: int, dtype: str) -> None:
    """Blocks of 8 × 8 with a part of one at the end, overlapping last vectors: y = x − 2 exactly, nothing beside it."""
    x = ca.SX.sym("x", width)
    kernel = Kernel(program_of(ca.Function("f", [x], [x - 2])), (width,), dtype)
    for count in (1, 7, 8, 9, 16, 17, 31, 100):
        data = np.arange(count * width, dtype=dtype).reshape(count, width)
        around = np.full((count + 2, width), -5, dtype)
        assert kernel.many([data], around[1:-1]) is Status.FINE
        assert np.array_equal(around[1:-1], data - 2)
        assert np.all(around[[0, -1]] == -5)


def test_results_over_arguments_are_reported(double: Kernel) -> None:
    """A batch that would read what it has written is left to the general way, which copies."""
    block = np.ones((40, 3))
    assert double.many([block], block) is Status.SHAPE
    assert double.many([block[:20]], block[19:39]) is Status.SHAPE
    assert double.many([block[:20]], block[20:]) is Status.FINE


@pytest.mark.parametrize("count", [1, 99, 100, 1001])
def test_shared_work_is_done_once(count: int) -> None:
    """Every index in one piece, the worst result the answer."""
    done = np.zeros(count, int)

    def work(start: int, stop: int) -> int:
        done[start:stop] += 1
        return start

    worst = shared(work, count, 100, 3)
    assert np.all(done == 1)
    assert worst == max(0, count // 100 - 1) * 100


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_forked_child_has_threads_of_its_own() -> None:
    """Those of the parent are not in the child; to wait for them would take for ever."""
    code = (
        "import os; from robot_dyn.codegen.threads import shared\n"
        "shared(lambda a, b: 0, 100, 1, 2)\n"
        "child = os.fork()\n"
        "if not child: shared(lambda a, b: 0, 100, 1, 2); os._exit(0)\n"
        "assert os.waitpid(child, 0)[1] == 0"
    )
    subprocess.run([sys.executable, "-W", "ignore", "-c", code], check=True, timeout=60)


class Memory(dict[str, bytes]):
    def load(self, key: str) -> bytes | None:
        return self.get(key)

    def save(self, key: str, payload: bytes, about: str = "") -> None:
        self[key] = payload


def test_what_is_loaded_is_kept_once(double: Kernel) -> None:
    """Machine code is never freed: 600 kernels that are alike share it, and what is new to a store still gets there.

    No module of LLVM and no function is left over; 10 MB allow for what the count itself allocates, 4 MB late in the
    suite (24 MB were lost).
    """

    def load(count: int) -> tuple[int, int]:
        for _ in range(count):
            kernel = Kernel(double.program, (3,), store=memory)
            assert kernel.call(np.arange(3.0), np.empty(3)) == Status.FINE
        del kernel
        gc.collect()
        kinds = [type(each).__name__ for each in gc.get_objects()]
        return kinds.count("ModuleRef") + kinds.count("builtin_function_or_method"), len(memory)

    memory = Memory()
    first = load(20)
    before = resident()
    assert load(600) == first == (first[0], 1)
    assert resident() - before < 10_000_000


def resident() -> int:
    """Memory of this process in [bytes]; 0 where the system does not tell."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if statm.exists() else 0


def test_numbers_of_threads_share_one_pool() -> None:
    """As many threads as were ever asked for at once, not as many as all that were asked for."""
    code = (
        "import threading, time\n"
        "from robot_dyn.codegen.threads import shared\n"
        "for k in (5, 2, 6, 3, 4, 6, 1):\n"
        "    shared(lambda a, b: time.sleep(0.01) or 0, 100, 1, k)\n"
        "    time.sleep(0.1)\n"
        "print(threading.active_count())"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, timeout=60, capture_output=True, text=True)
    assert int(done.stdout) == 1 + 5  # this one, and the five that six need besides


def test_other_machine_code_may_call_it_by_its_address(double: Kernel) -> None:
    """A C function of pointers, which reports what is not finite and then writes nothing."""
    function = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)(double.state)
    x, y = np.arange(3.0), np.zeros(3)
    assert function(x.ctypes.data, y.ctypes.data) == Status.FINE
    assert np.array_equal(y, 2 * x)
    x[1] = np.nan
    assert function(x.ctypes.data, y.ctypes.data) == Status.ARGUMENT
    assert np.array_equal(y, [0, 2, 4])


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_time_is_any_number_of_python(dtype: str) -> None:
    """What cannot become a float is reported, and leaves no exception behind; −1 is a number."""
    t, x = ca.SX.sym("t", 1), ca.SX.sym("x", 2)
    kernel = Kernel(program_of(ca.Function("f", [t, x], [t * x])), (2,), dtype, times=True)
    one, y = np.ones(2, dtype), np.zeros(2, dtype)
    for time in (-1, -1.0, 0.5, np.float64(3), True):
        assert kernel.call(time, one, y) == Status.FINE
        assert np.array_equal(y, [time, time])
    for wrong in ("1", None, 1j, 10**400, [1.0], np.ones(2)):
        assert kernel.call(wrong, one, y) == Status.SHAPE
        assert np.array_equal(y, [True, True])
    assert kernel.call(np.nan, one, y) == Status.ARGUMENT


def test_a_wrong_number_of_arguments_is_reported(double: Kernel) -> None:
    y = np.zeros(3)
    for arguments in ((), (y,), (y, y, y)):
        assert double.call(*arguments) == Status.SHAPE
    assert double.batch(y, y) == Status.SHAPE


def test_batches_of_other_arrays_are_reported(double: Kernel) -> None:
    """Strides, dtypes, lengths, axes, and results that are read-only; nothing is written."""
    right, y = np.ones((20, 3)), np.zeros((20, 3))
    wrong: list[Any] = [right[:, ::-1], right.astype(np.float32), np.ones((19, 3)), np.ones((20, 4)), np.ones(60)]
    wrong += [right.view(Own), np.asfortranarray(right), right.tolist()]
    assert [double.batch(other, y, 0, 20) for other in wrong] == [Status.SHAPE] * len(wrong)
    assert not y.any()
    y.flags.writeable = False
    assert double.batch(right, y, 0, 20) == Status.SHAPE


def test_sines_of_one_state_come_together_after_what_they_need() -> None:
    """Eight at a time; those of other sines alone; each value is made before it is read, and once."""
    x = ca.SX.sym("x", 12)
    sines = ca.sin(x * 2 + 1)
    program = program_of(ca.Function("f", [x], [ca.cos(sines[0] + x[1]) + ca.sum1(sines)]))
    groups = list(in_groups(program))
    assert [len(group) for group in groups if group[0].kind is Kind.SINE_COSINE] == [8, 4, 1]
    known = set(range(sum(program.inputs) + len(program.constants)))
    for group in groups:
        assert known.issuperset(value for op in group for value in op.operands)
        known.update(value for op in group for value in op.results)
    assert sorted(map(str, (op for group in groups for op in group))) == sorted(map(str, program.ops))
