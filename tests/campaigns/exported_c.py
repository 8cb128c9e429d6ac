"""C of every robot of the catalog, compiled, tested and timed: python -m tests.campaigns.exported_c [ROBOT …].

Float is built and tested, too, without an operation in double. A table of each function in double: operations, largest
difference from Pinocchio, bound, time of a call from C, bytes of code.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path

import robot_dyn as rd
from robot_dyn.foundations import RobotDynWarning
from tests.tools.export.c_program import WRITABLE, call, library, self_test, symbols

_TIMED = """
#include "{name}_dynamics.h"
#include <stdio.h>
#include <time.h>
int main(void) {{
    static double x[8][512], y[65536];
    struct timespec a, b;
    double sum = 0, ns, best = 1e30;
    int i, k, r;
    for (i = 0; i < 8; i++) for (k = 0; k < 512; k++) x[i][k] = 0.3 + 0.01 * k + 0.1 * i;
    {calls}
    return sum == 12345.0;
}}
"""
_CALL = """
    best = 1e30;
    for (r = 0; r < 5; r++) {{
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (k = 0; k < {repeats}; k++) {{ x[0][0] += 1e-9; {function}({inputs}, y); sum += y[0]; }}
        clock_gettime(CLOCK_MONOTONIC, &b);
        ns = ((double)(b.tv_sec - a.tv_sec) * 1e9 + (double)(b.tv_nsec - a.tv_nsec)) / {repeats};
        best = ns < best ? ns : best;
    }}
    printf("{quantity} %.0f\\n", best);
"""


def timed(source: rd.tools.export.CSource, folder: Path) -> dict[str, float]:
    """Return the nanoseconds of a call of each function."""
    calls = [
        _CALL.format(
            quantity=function.quantity,
            function=f"{source.name}_{function.quantity}",
            inputs=", ".join(f"x[{i}]" for i in range(len(function.arguments))),
            repeats=max(20, 1_000_000 // (function.instructions + 10)),
        )
        for function in source.functions
    ]
    (folder / "timed.c").write_text(_TIMED.format(name=source.name, calls="".join(calls)))
    call(
        "cc",
        "-std=gnu99",
        "-O2",
        "-I",
        folder,
        folder / "timed.c",
        folder / "dynamics.o",
        "-lm",
        "-o",
        folder / "timed",
    )
    return {line.split()[0]: float(line.split()[1]) for line in call(folder / "timed").splitlines()}


def sizes(compiled: Path) -> dict[str, int]:
    """Return the bytes of code of each function."""
    lines = call("nm", "-S", compiled).splitlines()
    return {x[3]: int(x[1], 16) for x in map(str.split, lines) if len(x) == 4 and x[2] == "T"}


def named(arguments: list[str]) -> list[str]:
    """Return the robots among arguments of the command; `--seed N`, which the other campaigns take, changes nothing."""
    return arguments[: arguments.index("--seed")] if "--seed" in arguments else arguments


def main(names: list[str]) -> None:
    """Print the table; fail at the first robot whose self-test fails."""
    print("| robot | joints | function | operations | difference | bound | ns | bytes | export s |")
    print("|---|--:|---|--:|--:|--:|--:|--:|--:|")
    for name in names or rd.list_robots():
        start = time.perf_counter()
        try:
            arm = rd.load(name)
            source = rd.tools.export.c_source(arm)
        except rd.RobotDynError as error:
            print(f"| {name} | | {str(error)[:90]} | | | | | | |", flush=True)
            continue
        seconds = time.perf_counter() - start
        with tempfile.TemporaryDirectory() as folder:
            compiled = library(source, Path(folder), level="-O2")
            needed, kinds = symbols(compiled)
            assert needed <= {*source.math, "sincos"} and not kinds & WRITABLE, (name, needed, kinds)
            assert re.search(r"^passed$", self_test(source, Path(folder)), re.MULTILINE), name
            ns, code = timed(source, Path(folder)), sizes(compiled)
        with tempfile.TemporaryDirectory() as folder:
            in_float = rd.tools.export.c_source(arm, dtype="float32")
            needed, _ = symbols(library(in_float, Path(folder)))
            assert needed <= {*(x + "f" for x in in_float.math), "sincosf"}, (name, needed)
            assert re.search(r"^passed$", self_test(in_float, Path(folder)), re.MULTILINE), name
        for x in source.functions:
            bound = "" if x.bound is None else f"{x.bound:.1e}"
            of_code = code[f"{source.name}_{x.quantity}"]
            print(
                f"| {name} | {arm.n} | {x.quantity} | {x.instructions} | {x.difference:.1e} | {bound} |"
                f" {ns[x.quantity]:.0f} | {of_code} | {seconds:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    import warnings

    warnings.simplefilter("ignore", RobotDynWarning)
    main(named(sys.argv[1:]))
