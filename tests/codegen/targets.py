"""Machine code of each kind for other processors: linked with a small C program and run, under qemu where needed.

`python -m tests.codegen.targets` measures the table of docs/studies/targets.md.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from llvmlite import ir

import robot_dyn as rd
from robot_dyn.codegen import INSTEAD, Trace, program_of
from robot_dyn.codegen.llvm import machine_code
from robot_dyn.codegen.llvm.batch import batch_function
from robot_dyn.codegen.llvm.lock_step import write_function
from robot_dyn.codegen.llvm.one_state import Limits, state_function
from robot_dyn.codegen.llvm.target import Target, this_target
from robot_dyn.codegen.llvm.vectors import F32, F64
from robot_dyn.codegen.loops.kinds import kind_of
from robot_dyn.codegen.loops.program import Program
from tests.tools.export import c_program

X86 = "x86_64-unknown-linux-gnu"
TARGETS = {
    "SSE2": Target("x86-64", "", X86),
    "AVX2": Target("x86-64-v3", "", X86),
    "aarch64": Target("generic", "", "aarch64-linux-gnu"),
}
BUILDS = {"aarch64": c_program.TARGETS["aarch64"]}  # others are built and run by this processor's compiler
LIMITS = Limits(1e300, 1e300)
MAIN = """#include <stdio.h>
#include <stdlib.h>
#include <time.h>
{declaration}
{arrays}
static {number} y[{size}] __attribute__((aligned(64)));
int main(int count, char **arguments) {{
  {call};
  if (count == 1) return fwrite(y, sizeof y[0], {size}, stdout) != {size};
  struct timespec a, b;
  long n = atol(arguments[1]);
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
  for (long i = 0; i < n; i++) {{ {call}; }}
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
  printf("%.17g", ((b.tv_sec - a.tv_sec) * 1e9 + (b.tv_nsec - a.tv_nsec)) / n);
}}
"""


@dataclass(frozen=True)
class Form:
    """One kind of machine code, and a C program that calls it.

    Attributes:
        write: Writes it into a module.
        declaration: Its declaration in C.
        call: The call in C, of arrays x0, x1, … and y.
        inputs: The numbers of the arrays.
        size: Number of results.
        eps: Unit of rounding.
    """

    write: machine_code.Write
    declaration: str
    call: str
    inputs: tuple[np.ndarray, ...]
    size: int
    eps: float = 2.0**-53

    def built(self, target: Target, build: c_program.Target, folder: Path) -> tuple[Path, int]:
        """Compile and link the program; return it, and the size of the object file in bytes."""
        code = machine_code.object_file(self.write, "f_", target=target)
        (folder / "f.o").write_bytes(code)
        number = "float" if self.eps > 1e-10 else "double"
        arrays = "\n".join(
            f"static {number} x{i}[] __attribute__((aligned(64))) = {{{', '.join(float(v).hex() for v in x.ravel())}}};"
            for i, x in enumerate(self.inputs)
        )
        text = MAIN.format(declaration=self.declaration, arrays=arrays, number=number, size=self.size, call=self.call)
        (folder / "main.c").write_text(text)
        program = folder / "program"
        c_program.call(build.compiler, "-O1", folder / "main.c", folder / "f.o", "-lm", "-o", program)
        return program, len(code)

    def values(self, program: Path, build: c_program.Target) -> np.ndarray:
        """Return the results."""
        done = subprocess.run([*build.emulator, str(program)], capture_output=True, timeout=120, check=True)
        return np.frombuffer(done.stdout, np.float32 if self.eps > 1e-10 else np.float64)


def swing(y: np.ndarray, steps: int, h: float) -> float:
    """Advance a mass on a cubic spring by the method of Störmer and Verlet; return its energy."""
    for _ in range(steps):
        y[1] -= 0.5 * h * (y[0] + y[0] * y[0] * y[0])
        y[0] += h * y[1]
        y[1] -= 0.5 * h * (y[0] + y[0] * y[0] * y[0])
    return np.sqrt(y[1] * y[1] + y[0] * y[0] * (1.0 + 0.5 * y[0] * y[0]))


def forms(robot: str = "panda", quantity: str = "forward_dynamics") -> dict[str, Form]:
    """Return a form of each kind, for random states."""
    arm = rd.load(robot)
    program = program_of(Trace(arm).quantity(quantity).function)
    rng = np.random.default_rng(5)
    many = [rng.uniform(-1.0, 1.0, (64, n)) for n in program.inputs]
    one = tuple(x[0] for x in many)
    names = [f"x{i}" for i in range(len(one))]
    pointers = ", ".join(["const double *"] * len(one))

    def state(kind: ir.Type, any_angle: bool) -> machine_code.Write:
        return lambda module, name: state_function(module, f"{name}s", program, kind, LIMITS, any_angle, False) and None

    def batch(module: ir.Module, name: str) -> None:
        batch_function(module, f"{name}b", program, F64, LIMITS, False)

    import casadi as ca

    t, y, p, r = ca.SX.sym("t"), ca.SX.sym("y", 2), ca.SX.sym("p", 1), ca.SX.sym("r", 2)
    rate = ca.vertcat(y[1], -p[0] * ca.sin(y[0]) - r[0] * y[1] - r[1] * ca.tanh(10 * y[1]) + ca.cos(t))
    equation = program_of(ca.Function("f", [t, y, p, r], [rate]))

    def lock_step(module: ir.Module, name: str) -> None:
        write_function(module, f"{name}l", equation, 8)

    def loop(module: ir.Module, name: str) -> None:
        Program(module, name, INSTEAD).entry(swing, (kind_of(np.zeros(2)), kind_of(3), kind_of(0.5)), "loop")

    declared = f"long f_s({pointers}, double *);"
    runs = (np.array([0.3]), rng.uniform(-1, 1, (2, 8)), np.array([9.81]), rng.uniform(0, 1, (2, 8)))
    start = np.array([0.7, -0.2])
    swung = (
        "{ double z[2] = {x0[0], x0[1]}; long array[3] = {(long)z, 2, 8}, steps[1] = {1000}, *all[3] ="
        " {array, steps, (long *)x1}; f_loop(all, (long *)y); y[1] = z[0]; y[2] = z[1]; }"
    )
    n = len(program.outputs)
    call = f"f_s({', '.join(names)}, y)"
    return {
        "one state": Form(state(F64, False), declared, call, one, n),
        "one state, any angle": Form(state(F64, True), declared, call, one, n),
        "one state, float32": Form(
            state(F32, False), declared.replace("double", "float"), call,
            tuple(x.astype(np.float32) for x in one), n, 2.0**-24,
        ),
        "batch": Form(
            batch, f"long f_b({pointers}, double *, long, long);", f"f_b({', '.join(names)}, y, 0, 64)", tuple(many),
            64 * n,
        ),
        "lock step": Form(
            lock_step, "void f_l(double, const double *, const double *, const double *, double *);",
            "f_l(x0[0], x1, x2, x3, y)", runs, 16,
        ),
        "loop": Form(loop, "const char *f_loop(long **, long *);", swung, (start, np.array([1e-2])), 3),
    }  # fmt: skip


def on_this_processor(portable: bool = False) -> Target:
    """Return this processor as a target of linked programs."""
    return replace(this_target(), triple=X86, portable=portable)


def difference(values: np.ndarray, truth: np.ndarray) -> float:
    """Return the largest difference, relative to the largest value."""
    return float(np.max(np.abs(values - truth)) / np.max(np.abs(truth)))


def table(folder: Path) -> Iterator[tuple[object, ...]]:
    """Yield form, target, largest difference, equal bits of portable code, bytes, and times: as it is, and portable.

    Times are relative to code for this processor; each is the least of turns.
    """
    for name, form in forms().items():
        targets = {"this processor": on_this_processor(), **TARGETS}
        targets |= {f"{place}, portable": replace(target, portable=True) for place, target in targets.items()}
        programs, values, sizes, times = {}, {}, {}, dict.fromkeys(targets, np.inf)
        for i, (place, target) in enumerate(targets.items()):
            build = BUILDS.get(place.partition(",")[0], c_program.HOST)
            inside = folder / f"{name} {i}"
            inside.mkdir()
            programs[place], sizes[place] = form.built(target, build, inside)
            values[place] = form.values(programs[place], build)
        native = [place for place in targets if "aarch64" not in place]
        first = float(c_program.call(programs["this processor"], "100"))
        count = str(max(100, round(2e7 / first)))  # 20 ms
        for place in native * 9:
            times[place] = min(times[place], float(c_program.call(programs[place], count)))
        truth, unit = values["this processor"], times["this processor"]
        for place in ("this processor", *TARGETS):
            exact = values[f"{place}, portable"]
            equal = np.array_equal(exact.view(np.uint8), values["this processor, portable"].view(np.uint8))
            ratios = times[place] / unit, times[f"{place}, portable"] / unit
            yield name, place, difference(values[place], truth), difference(exact, truth), equal, sizes[place], *ratios


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as place:
        for items in table(Path(place)):
            print(*items, sep=",", flush=True)
