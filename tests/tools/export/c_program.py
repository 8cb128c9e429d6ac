"""Exported C built and run by a C compiler, also for other processors under qemu."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from robot_dyn.tools.export import CSource

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
FLOAT = ["-Wdouble-promotion", "-Wunsuffixed-float-constants"]  # no operation in double
WRITABLE = {*"bBcCdDgGsS"}  # kinds of symbols of data that change, as nm prints them


@dataclass(frozen=True)
class Target:
    """A processor: its compiler, the command that runs its programs, and its nm."""

    compiler: str = "cc"
    emulator: tuple[str, ...] = ()
    nm: str = "nm"

    @property
    def missing(self) -> str:
        """Programs that are not installed."""
        programs = (self.compiler, *self.emulator[:1], self.nm)
        return ", ".join(program for program in programs if shutil.which(program) is None)


HOST = Target()
TARGETS = {
    "aarch64": Target(
        "aarch64-linux-gnu-gcc", ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"), "aarch64-linux-gnu-nm"
    ),
    "arm": Target("arm-linux-gnueabihf-gcc", ("qemu-arm", "-L", "/usr/arm-linux-gnueabihf"), "arm-linux-gnueabihf-nm"),
}


def call(*command: str | Path) -> str:
    """Return the output of a command that succeeds."""
    done = subprocess.run([str(x) for x in command], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def library(source: CSource, folder: Path, target: Target = HOST, level: str = "-O1") -> Path:
    """Write and compile a source; return its object file."""
    source.write(folder)
    compiled = folder / "dynamics.o"
    flags = [*STRICT, *(FLOAT if source.dtype == "float32" else [])]
    (code,) = (name for name in source.files if name.endswith(("_dynamics.c", "_controller.c")))
    call(target.compiler, *flags, level, "-c", folder / code, "-o", compiled)
    return compiled


def symbols(compiled: Path, target: Target = HOST) -> tuple[set[str], set[str]]:
    """Return the names that an object file needs, and the kinds of those that it defines."""
    lines = [line.split() for line in call(target.nm, compiled).splitlines()]
    return {line[-1] for line in lines if line[-2] == "U"}, {line[-2] for line in lines if line[-2] != "U"}


def self_test(source: CSource, folder: Path, target: Target = HOST) -> str:
    """Build and run the self-test next to a compiled source; return its output."""
    program = folder / "self_test"
    call(target.compiler, *STRICT, folder / f"{source.name}_self_test.c", folder / "dynamics.o", "-lm", "-o", program)
    return call(*target.emulator, program)
