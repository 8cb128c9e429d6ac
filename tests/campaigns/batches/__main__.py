"""`python -m tests.campaigns.batches --scenes 300 --seed 1`: compare batches with single runs; exit code 1 if not."""

from __future__ import annotations

import argparse
import sys
from collections import Counter

from tests.campaigns.batches.judge import judge


def main() -> int:
    """Compare all batches; print those that differ, and the worst."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first batch")
    parser.add_argument("--show", action="store_true", help="print every batch")
    options = parser.parse_args()
    worst, counts = None, Counter[str]()
    for index in range(options.first, options.first + options.scenes):
        judged = judge(options.seed, index)
        again = "made again" in judged.runs.statistics.engine
        counts.update(runs=len(judged.runs), differ=not judged.alike, made_again=again, batches=1)
        if options.show or not judged.alike:
            print("        " if judged.alike else "DIFFERS ", judged, flush=True)
        if worst is None or judged.ratio > worst.ratio:
            worst = judged
    print(f"seed {options.seed}: {dict(counts)}; the worst is {worst}")
    return int(counts["differ"] > 0)


if __name__ == "__main__":
    sys.exit(main())
