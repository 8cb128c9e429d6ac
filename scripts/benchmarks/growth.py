"""Cost against n: chains of 2 to 64 joints, compiled and in Pinocchio's C++; and the memory of a large batch."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

import robot_dyn as rd
from benchmarks.measure import BATCH, Effort, alternate, printed, row, seconds, table

JOINTS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)


def chain(n: int) -> str:
    """A chain of n joints without symmetries, as URDF."""
    draw = np.random.default_rng(n)
    parts = ['<robot name="chain"><link name="link0"/>']
    for i in range(1, n + 1):
        axis = ("0 0 1", "0 1 0", "1 0 0")[i % 3]
        xyz, com = [" ".join(f"{x:.6f}" for x in draw.uniform(-0.3, 0.3, 3)) for _ in range(2)]
        rpy = " ".join(f"{x:.6f}" for x in draw.uniform(-1.5, 1.5, 3))
        ixx, iyy, izz = draw.uniform(0.02, 0.03, 3)
        parts.append(
            f'<joint name="j{i}" type="revolute"><parent link="link{i - 1}"/><child link="link{i}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f'<limit lower="-3" upper="3" effort="50" velocity="5"/></joint>'
            f'<link name="link{i}"><inertial><origin xyz="{com}"/><mass value="{draw.uniform(0.5, 2):.6f}"/>'
            f'<inertia ixx="{ixx:.6f}" iyy="{iyy:.6f}" izz="{izz:.6f}" ixy="0.001" ixz="0.0005" iyz="-0.0007"/>'
            "</inertial></link>"
        )
    return "".join([*parts, "</robot>"])


def growth(effort: Effort) -> None:
    """Instructions, time per state and compile time of forward dynamics against the number of joints."""
    table("joints", "instructions", "which", "compile, s", "batch, µs per state", "C++, µs per state", "ratio")
    found = []
    for n in JOINTS[:3] if effort.quick else JOINTS:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "chain.urdf"
            file.write_text(chain(n))
            robot = rd.load(file)
        ours: Any = rd.compiled(robot, cache=False)
        batch, out = np.random.default_rng(1).normal(size=(3, BATCH, n)), np.empty((BATCH, n))
        first = seconds(lambda: ours.forward_dynamics(*batch, out=out))
        pool, columns = pin.ModelPool(robot.model, 1), [np.asfortranarray(x.T) for x in batch]
        result = np.asfortranarray(np.empty((n, BATCH)))
        sides = {
            "ours": lambda: ours.forward_dynamics(*batch, out=out),
            "C++": lambda: pin.abaInParallel(1, pool, *columns, result),
        }
        t = {side: time / BATCH for side, time in alternate(sides, effort).items()}
        which, count = ours.served_by("forward_dynamics"), min(ours.instructions["forward_dynamics"].values())
        row(n, count, which, f"{first:.1f}", f"{t['ours']:.3f}", f"{t['C++']:.3f}", f"{t['C++'] / t['ours']:.1f}")
        found.append((n, count, first, t["ours"], t["C++"]))
    if (picture := effort.picture("growth")) is not None:
        draw(np.array(found), picture)


def draw(found: np.ndarray, picture: Path) -> None:
    """The figure of the table."""
    from matplotlib.figure import Figure

    n, count, first, ours, cpp = found.T
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    axes = figure.subplots(1, 3)
    axes[0].loglog(n, ours, "o-", label="compiled, batch")
    axes[0].loglog(n, cpp, "s--", label="Pinocchio's C++, abaInParallel")
    axes[0].set(ylabel="µs per state", title="forward dynamics, one thread")
    axes[0].legend(loc="upper left", frameon=False)
    axes[0].set_ylim(top=100)
    axes[1].loglog(n, count, "o-")
    axes[1].set(ylabel="instructions", title="size of the kernel")
    axes[2].loglog(n, first, "o-")
    axes[2].set(ylabel="s", title="trace, compile and check")
    for each in axes:
        each.set_xlabel("joints of the chain")
        each.set_xscale("log", base=2)
        each.set_xticks([2, 4, 8, 16, 32, 64], labels=["2", "4", "8", "16", "32", "64"])
        each.grid(alpha=0.3)
    figure.savefig(picture, dpi=110)


_MEMORY = """
import resource, sys, numpy as np, robot_dyn as rd
arm, states = rd.load("ur5"), int(sys.argv[1])
ours, batch, out = rd.compiled(arm), np.random.default_rng(1).normal(size=(3, states, 6)), np.empty((states, 6))
ours.forward_dynamics(*(x[:4096] for x in batch), out=out[:4096])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
ours.forward_dynamics(*batch, out=out)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024, (batch.nbytes + out.nbytes) / 2**20)
"""


def memory(effort: Effort) -> None:
    """What a batch of forward dynamics takes beyond its arguments and its result."""
    states = 100_000 if effort.quick else 1_000_000
    extra, arrays = printed(_MEMORY, str(states))
    print(f"\nA batch of {states} states of UR5 takes {extra:.1f} MiB beyond the {arrays:.0f} MiB of its arrays.")
