"""Compiled dynamics against Pinocchio's C++: one state in a compiled loop and from Python, batches, threads, first use.

ratio = t(Pinocchio) / t(compiled), both in µs per state
"""

from __future__ import annotations

import ctypes
import os
import tempfile
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

import robot_dyn as rd
from benchmarks.measure import BATCH, Effort, alternate, arms, printed, row, table

QUERIES = ("forward_dynamics", "inverse_dynamics", "M")


def looped(state: int, arguments: int) -> Callable[..., int]:
    """A compiled loop over the kernel for one state, by its address: one call a row, nothing of Python between."""
    import numba as nb

    one = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * (arguments + 1))(state)
    if arguments == 1:

        @nb.njit(nogil=True)
        def of_one(q: Any, y: Any) -> int:
            status = 0
            for i in range(len(q)):
                status |= one(q[i].ctypes, y[i].ctypes)
            return status

        return of_one

    @nb.njit(nogil=True)
    def of_three(q: Any, v: Any, a: Any, y: Any) -> int:
        status = 0
        for i in range(len(q)):
            status |= one(q[i].ctypes, v[i].ctypes, a[i].ctypes, y[i].ctypes)
        return status

    return of_three


def in_cpp(robot: rd.Robot, batch: np.ndarray) -> dict[str, Callable[[], object]]:
    """Pinocchio over a batch: its own C++ loop on one thread; of crba, which has none, the calls from Python."""
    model = robot.model
    pool, data = pin.ModelPool(model, 1), model.createData()
    q, v, a = (np.asfortranarray(x.T) for x in batch)
    result = np.asfortranarray(np.empty_like(q))
    return {
        "forward_dynamics": lambda: pin.abaInParallel(1, pool, q, v, a, result),
        "inverse_dynamics": lambda: pin.rneaInParallel(1, pool, q, v, a, result),
        "M": lambda: [pin.crba(model, data, x) for x in batch[0]],
    }


def binding_cost(effort: Effort) -> float:
    """Cost of a call from Python, in µs: crba of one joint, which is more than the binding's own."""
    model = rd.load("pendulum").model
    data, q = model.createData(), [np.array([0.3])] * BATCH
    return alternate({"call": lambda: [pin.crba(model, data, x) for x in q]}, effort)["call"] / BATCH


def kernels(effort: Effort) -> None:
    """Time per state in µs, and how many times faster than Pinocchio's C++."""
    binding = binding_cost(effort)
    print(f"\nOf crba the call from Python minus {binding:.2f} µs, its cost for one joint, stands for the C++.")
    timed = ("one state, µs", f"batch of {BATCH}, µs", "float32, µs")
    table("arm", "query", "instructions", "C++, µs", *(heading for what in timed for heading in (what, "ratio")))
    for arm, robot in arms().items():
        batch = np.random.default_rng(1).normal(size=(3, BATCH, robot.n))
        for name, cpp in in_cpp(robot, batch).items():
            ours, single = rd.compiled(robot), rd.compiled(robot, dtype="float32")
            arguments = tuple(batch[: 1 if name == "M" else 3])
            loop = looped(ours.engine.kernels[name].state, len(arguments))
            y = np.empty((BATCH, *ours.engine.shape(name)))
            small, z = [x.astype(np.float32) for x in arguments], np.empty(y.shape, np.float32)
            sides = {
                "C++": cpp,
                "one": lambda: loop(*arguments, y),
                "batch": lambda: getattr(ours, name)(*arguments, out=y),
                "float32": lambda: getattr(single, name)(*small, out=z),
            }
            t = {side: time / BATCH for side, time in alternate(sides, effort).items()}
            t["C++"] -= binding if name == "M" else 0.0
            ratios = [
                x for side in ("one", "batch", "float32") for x in (f"{t[side]:.4f}", f"{t['C++'] / t[side]:.1f}")
            ]
            row(arm, name, min(ours.instructions[name].values()), f"{t['C++']:.3f}", *ratios)


def from_python(effort: Effort) -> None:
    """One state called from Python, shape and NaN checked, against pin.aba and pin.rnea from Python."""
    table("arm", "query", "pin, µs", "compiled, µs", "ratio", "with out=, µs", "ratio")
    for arm, robot in arms().items():
        q, v, a = np.random.default_rng(1).normal(size=(3, robot.n))
        ours, model, out = rd.compiled(robot), robot.model, np.empty(robot.n)
        data = model.createData()
        for name, bare in (("forward_dynamics", pin.aba), ("inverse_dynamics", pin.rnea)):
            query = getattr(ours, name)
            sides = {
                "pin": lambda: bare(model, data, q, v, a),
                "new": lambda: query(q, v, a),
                "out": lambda: query(q, v, a, out=out),
            }
            t = alternate(sides, effort)
            ratios = (f"{t['pin'] / t['new']:.2f}", f"{t['out']:.2f}", f"{t['pin'] / t['out']:.2f}")
            row(arm, name, f"{t['pin']:.2f}", f"{t['new']:.2f}", *ratios)


def threads(effort: Effort) -> None:
    """Two threads against one, in batches of forward dynamics; of a small one a single thread serves both."""
    table("arm", "states", "1 thread, µs per state", "2 threads", "ratio")
    for arm, robot in arms().items():
        one, two = rd.compiled(robot, threads=1), rd.compiled(robot, threads=2)
        for states in (BATCH, 8 * BATCH, (16 if effort.quick else 64) * BATCH):
            batch, out = np.random.default_rng(1).normal(size=(3, states, robot.n)), np.empty((states, robot.n))
            sides = {
                "1": lambda batch=batch, out=out: one.forward_dynamics(*batch, out=out),
                "2": lambda batch=batch, out=out: two.forward_dynamics(*batch, out=out),
            }
            t = alternate(sides, effort)
            row(arm, states, f"{t['1'] / states:.4f}", f"{t['2'] / states:.4f}", f"{t['1'] / t['2']:.2f}")


_FIRST = """
import time, numpy as np, casadi, llvmlite.binding, pinocchio, robot_dyn as rd
import robot_dyn.codegen.dynamics, robot_dyn.codegen.plant
arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
q = np.linspace(-0.5, 0.6, 7)
arm.forward_dynamics(q, q, q)
began = time.perf_counter()
rd.compiled(arm).forward_dynamics(q, q, q)
print(time.perf_counter() - began)
"""


def first_use(effort: Effort) -> None:
    """The first forward dynamics of a 7-joint arm after imports: cold, and from the cache."""
    cold, warm = [], []
    for _ in range(1 if effort.quick else 5):
        with tempfile.TemporaryDirectory() as folder:
            for times in (cold, warm):
                times += printed(_FIRST, ROBOT_DYN_CACHE=os.path.join(folder, "kernels"))
    table("what", "s")
    row("first forward dynamics, Panda-7, nothing in the cache", f"{np.median(cold):.2f}")
    row("the same in a second process, from the cache", f"{np.median(warm):.3f}")
