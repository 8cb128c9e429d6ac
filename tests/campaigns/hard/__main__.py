"""`python -m tests.campaigns.hard --seed 20261122 --write`: run all hard cases; the report is in build/hard_cases.

Exit code 1 if a figure is wrong without a word. With --family and --case, only those are run, and the report keeps the
others as they were; without --full, the short cases.
"""

from __future__ import annotations

import argparse
import sys
import traceback
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from time import process_time

from robot_dyn import ModelWarning
from tests.campaigns.hard.case import Row
from tests.campaigns.hard.families import FAMILIES
from tests.campaigns.hard.report import Result, summarise, write

BUILD = Path(__file__).parents[3] / "build" / "hard_cases"


def run(task: tuple[str, int, int]) -> Result:
    """One case of a family; an exception that escapes is a row that does not hold."""
    name, index, seed = task
    case = FAMILIES[name].CASES[index]
    start = process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            rows = list(case.rows(seed))
    except Exception:  # a case that breaks is a result too
        rows = [Row(case.name, "crash: " + traceback.format_exc(limit=-3), float("nan"), 0.0)]
    return Result(name, case.name, seed, tuple(rows), process_time() - start)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--family", action="append", choices=list(FAMILIES))
    parser.add_argument("--case", default="", help="only cases whose name holds this text")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--full", action="store_true", help="the long cases too")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--write", type=Path, nargs="?", const=BUILD, help="folder of the report")
    options = parser.parse_args()
    tasks = [
        (name, index, options.seed)
        for name in options.family or FAMILIES
        for index, case in enumerate(FAMILIES[name].CASES)
        if (options.full or not case.full) and options.case in case.name
    ]
    if not tasks:
        parser.error(f"no case that is asked for holds {options.case!r}; the long ones need --full")
    if options.write:
        options.write.mkdir(parents=True, exist_ok=True)
    print(f"seed {options.seed}", flush=True)
    results = []
    with ProcessPoolExecutor(options.workers) as pool:
        for result in pool.map(run, tasks):
            results.append(result)
            for row in result.rows:
                print(
                    f"{row.verdict:6s} {result.family}: {row.case}: {row.found:.3g} of {row.allowed:.3g}"
                    f" {row.measure}; {row.program} {row.said}",
                    flush=True,
                )
            print(f"       {result.family}: {result.case}: {result.seconds:.1f} s", flush=True)
            if options.write:  # after each case, so that one that is stopped leaves those before it
                write(result, options.write)
    if options.write:
        summarise(options.write)
    count = Counter(row.verdict for result in results for row in result.rows)
    print(f"seed {options.seed}: {dict(count)}")
    return int(count["SILENT"] > 0)


if __name__ == "__main__":
    sys.exit(main())
