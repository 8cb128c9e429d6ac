"""Formulas of every robot of the catalog, held against Pinocchio: python -m tests.campaigns.symbols [ROBOT …].

A table of those that are printed: terms, letters, rounded angles, difference to the file as written, difference from
Pinocchio at random letters, seconds. Ṁ = C + Cᵀ is checked as polynomials. Others are refused, or stopped after 300 s.
"""

from __future__ import annotations

import subprocess
import sys
import time
import warnings

import numpy as np

import robot_dyn as rd
from robot_dyn.foundations import RobotDynWarning
from robot_dyn.tools.symbols import symbols
from tests.campaigns.exported_c import named
from tests.tools.symbols.in_pinocchio import differences, rate_is_C_plus_its_transpose

_LONGEST_S = 300


def row(name: str, letters: str) -> str:
    """Return the row of a robot."""
    start = time.perf_counter()
    try:
        equations = symbols(rd.load(name), letters)  # pyright: ignore[reportArgumentType]
        equations.latex()
    except rd.RobotDynError as error:
        return f"| {name} | | {letters} | {str(error)[:70]} | | | | | | | {time.perf_counter() - start:.1f} |"
    seconds, terms = time.perf_counter() - start, equations.terms
    different = max(differences(equations, np.random.default_rng(0)).values())
    to_file = max(equations.difference.values())
    failed = "" if different < 1e-12 and rate_is_C_plus_its_transpose(equations) else "FAILED "
    return (
        f"{failed}| {name} | {equations.n} | {letters} | | {terms['M']} | {terms['C']} | {terms['N']} |"
        f" {len(equations.letters)} | {len(equations.rounded)} | {to_file:.0e} | {different:.0e} | {seconds:.1f} |"
    )


def main(names: list[str]) -> int:
    """Print the table, each row by a process of its own; return 1 if a row fails."""
    print("| robot | joints | letters | refused | M | C | N | letters | rounded | to file | Pinocchio | s |")
    print("|---|--:|---|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    failed = False
    for name in names or rd.list_robots():
        for letters in ("file", "base"):
            command = [sys.executable, "-m", "tests.campaigns.symbols", name, "--letters", letters]
            try:
                done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S)
                line = done.stdout.strip() or f"FAILED {name}: {done.stderr[-300:]}"
            except subprocess.TimeoutExpired:
                line = f"| {name} | | {letters} | not within {_LONGEST_S} s | | | | | | | |"
            failed |= line.startswith("FAILED")
            print(line, flush=True)
    return int(failed)


if __name__ == "__main__":
    warnings.simplefilter("ignore", RobotDynWarning)
    if "--letters" in sys.argv:
        print(row(sys.argv[1], sys.argv[-1]))
    else:
        sys.exit(main(named(sys.argv[1:])))
