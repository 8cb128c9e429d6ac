"""Store what a tree computes, and compare another tree with it: 87 runs, 30 sweeps and 55 timings.

    python scripts/before.py                             write runs and sweeps to build/before
    python scripts/before.py --compare build/before      compute them again; exit code 1 if one is off
    python scripts/before.py --time                      write timings to build/before/timings.json
    python scripts/before.py --pairs 30 --old OLD_TREE   time both trees in turns; new/old of each timing

`--only TEXT` takes the cases and timings whose name contains a text. Each tree is timed by its own copy of this script,
in a process of its own, with one thread. Numbers may differ by rounding times the growth of the motion; see
referee/results.py. After a rename only referee/library.py has to change.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import IO

ROOT = Path(__file__).parents[1]
THREADS = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL", "NUMBA")}
os.environ.update(THREADS)  # before NumPy is imported

from referee import library, results, runs, sweeps, timings  # noqa: E402
from referee.results import Result  # noqa: E402

Cases = dict[str, Callable[[], Result]]


def groups(pattern: str, pushes: bool) -> dict[str, Cases]:
    """Return what computes each run and each sweep whose name contains a text."""
    cases = {name: partial(_of_run, case, pushes) for name, case in runs.cases().items()}
    all_cases: dict[str, Cases] = {"runs": cases, "sweeps": dict(sweeps.sweeps(pushes))}
    return {kind: {name: x for name, x in of.items() if pattern in name} for kind, of in all_cases.items()}


def _of_run(case: Callable[[], runs.Case], pushes: bool) -> Result:
    return results.run_case(case(), pushes)


def write(folder: Path, pattern: str) -> int:
    """Write the results of this tree."""
    began = perf_counter()
    for kind, cases in groups(pattern, pushes=True).items():
        done = {}
        for name, compute in cases.items():
            done[name] = compute()
            print(f"{kind}: {name}", flush=True)
        results.save(done, folder, kind)
    (folder / "about.json").write_text(json.dumps(about(), indent=1), encoding="utf-8")
    size = sum(path.stat().st_size for path in folder.iterdir() if path.is_file())
    print(f"{folder}: {size / 2**20:.1f} MiB in {perf_counter() - began:.0f} s")
    return 0


def compare(folder: Path, pattern: str) -> int:
    """Compare the results of this tree with stored ones; return 1 if one is off or missing."""
    began, rows = perf_counter(), []
    for kind, cases in groups(pattern, pushes=False).items():
        stored = {name: x for name, x in results.load(folder, kind).items() if pattern in name}
        rows += results.compare(kind, stored, lambda name, cases=cases: cases[name]())
    off = [row for row in rows if row.faults]
    same = sum(row.is_same for row in rows)
    print(f"\n{len(rows)} compared in {perf_counter() - began:.0f} s, {same} with the same bits, {len(off)} off")
    if rows:
        worst = max(rows, key=lambda row: row.ratio)
        print(f"largest difference over growth and rounding: {worst.ratio:.2g}, in {worst.case}, {worst.quantity}")
    return int(bool(off) or not rows)


def time(folder: Path, turns: int, pattern: str) -> int:
    """Write and print the timings of this tree."""
    measured = timings.measured(turns, pattern)
    print("| timing | median, µs | spread |\n|---|--:|--:|")
    for name, of in measured.items():
        print(f"| {name} | {1e6 * of['median_s']:.4g} | {100 * of['spread']:.0f} % |")
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"about": about(), "timings": measured}, indent=1, ensure_ascii=False)
    (folder / "timings.json").write_text(text, encoding="utf-8")
    return 0


class Worker:
    """A process that times calls of one tree by its own copy of this script."""

    def __init__(self, tree: Path) -> None:
        place = os.environ | THREADS | {"PYTHONPATH": f"{tree}{os.pathsep}{tree / 'scripts'}"}
        command = [sys.executable, str(tree / "scripts" / "before.py"), "--worker"]
        self._process = subprocess.Popen(
            command, env=place, cwd=tree, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._questions: IO[str] = self._process.stdin
        self._answers: IO[str] = self._process.stdout
        self.tree = self.answer("tree")

    def answer(self, question: str) -> str:
        """Return the line that the process answers; an empty one if it cannot."""
        print(question, file=self._questions, flush=True)
        line = self._answers.readline()
        if not line:
            raise RuntimeError("a process that times a tree has ended; its error is printed above")
        return line.strip()

    def seconds(self, name: str) -> float | None:
        answer = self.answer(name)
        return float(answer) if answer else None

    def close(self) -> None:
        self._questions.close()
        self._process.wait(timeout=60)


def work() -> int:
    """Answer each line of standard input: the tree, or the seconds of one call of a timing."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what calls print is no answer
    timer = timings.Timer()
    for line in sys.stdin:
        name = line.strip()
        try:
            print(library.tree() if name == "tree" else timer.seconds(name), file=answers)
        except Exception as error:  # a timing that this tree lacks
            print(f"{name}: {type(error).__name__}: {error}", file=sys.stderr)
            print(file=answers)
    return 0


def pairs(count: int, old_tree: Path, pattern: str, folder: Path) -> int:
    """Time two trees in turns, and print the median of new/old with its upper 95 % end."""
    old, new = Worker(old_tree.resolve()), Worker(ROOT)
    print(f"old: {old.tree}\nnew: {new.tree}\n")
    print("| timing | old, µs | new, µs | new/old | upper 95 % end |\n|---|--:|--:|--:|--:|")
    rows = {}
    for name in timings.names(pattern):
        if old.seconds(name) is None or new.seconds(name) is None:  # prepares both
            print(f"| {name} | | | missing in a tree | |", flush=True)
            continue
        times: list[tuple[float, float]] = []
        for k in range(count):
            order = (old, new) if k % 2 == 0 else (new, old)
            took = {worker: worker.seconds(name) or float("nan") for worker in order}
            times.append((took[old], took[new]))
        ratios = [after / before for before, after in times]
        row = {"old_s": median(x for x, _ in times), "new_s": median(x for _, x in times)}
        row |= {"ratio": median(ratios), "upper": timings.upper_end(ratios)}
        rows[name] = row
        cells = f"{1e6 * row['old_s']:.4g} | {1e6 * row['new_s']:.4g} | {row['ratio']:.3f} | {row['upper']:.3f}"
        print(f"| {name} | {cells} |", flush=True)
    for worker in (old, new):
        worker.close()
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"about": about(), "pairs": count, "timings": rows}, indent=1, ensure_ascii=False)
    (folder / "pairs.json").write_text(text, encoding="utf-8")
    return 0


def about() -> dict[str, str]:
    """Return what results and timings depend on."""
    git = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return library.versions() | {"commit": git.stdout.strip(), "machine": platform.processor() or platform.machine()}


def arguments() -> Namespace:
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "before", help="folder to write to")
    parser.add_argument("--compare", type=Path, metavar="FOLDER", help="compare with the results of a folder")
    parser.add_argument("--time", action="store_true", help="write timings")
    parser.add_argument("--turns", type=int, default=11, help="turns of --time")
    parser.add_argument("--pairs", type=int, metavar="N", help="pairs of timings of two trees")
    parser.add_argument("--old", type=Path, metavar="TREE", help="the old tree of --pairs")
    parser.add_argument("--only", default="", metavar="TEXT", help="take names that contain a text")
    parser.add_argument("--quick", action="store_true", help="write and compare two runs and one sweep")
    parser.add_argument("--worker", action="store_true", help="answer the questions of --pairs")
    options = parser.parse_args()
    if (options.pairs is None) != (options.old is None):
        parser.error("--pairs and --old go together")
    return options


def quick(folder: Path) -> int:
    """Write and compare two runs and a sweep, and time a query."""
    status = 0
    for pattern in ("dry friction, compiled", "springs, q0"):
        status |= write(folder, pattern) or compare(folder, pattern)
    return status | time(folder, 1, "UR5, pin")


def main() -> int:
    """Run what the command line asks for."""
    options = arguments()
    if options.worker:
        return work()
    if options.quick:
        return quick(options.output / "quick")
    if options.pairs is not None:
        return pairs(options.pairs, options.old, options.only, options.output)
    if options.time:
        return time(options.output, options.turns, options.only)
    if options.compare is not None:
        return compare(options.compare, options.only)
    return write(options.output, options.only)


if __name__ == "__main__":
    sys.exit(main())
