"""`python -m tests.estimates --scenes 600 --seed 1`: judge error estimates; exit code 1 if one misleads."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

from tests.estimates.judge import LEAST, MOST, judge


def one(task: tuple[int, int]) -> dict:
    """What came of one scene, as plain values."""
    judged = judge(*task)
    return {
        "text": str(judged), "family": judged.scene.family, "misleads": judged.misleads, "ratio": judged.ratio,
        "silent": judged.silent, "usable": judged.usable, "verdict": str(judged.run.error.verdict),
        "full": not judged.run.error.note, "ending": str(judged.run.outcome.ending),
    }  # fmt: skip


def main() -> int:
    """Judge all scenes and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", action="store_true", help="print every scene")
    options = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(one, [(options.seed, i) for i in range(options.scenes)], chunksize=4))
    for each in found:
        good = each["full"] and LEAST <= each["ratio"] <= MOST
        if options.show or each["misleads"] or (each["family"] == "smooth" and each["usable"] and not good):
            print("MISLEADS" if each["misleads"] else "        ", each["text"])
    for family in sorted({each["family"] for each in found}):
        those = [each for each in found if each["family"] == family and each["usable"]]
        within = sum(each["full"] and LEAST <= each["ratio"] <= MOST for each in those)
        full, verdicts = sum(each["full"] for each in those), Counter(each["verdict"] for each in those)
        print(f"{family:9s} usable {len(those)}, to the end {full}, within {LEAST}–{MOST}: {within}; {dict(verdicts)}")
    misleading = sum(each["misleads"] for each in found)
    print(f"seed {options.seed}: {misleading} of {len(found)} mislead")
    return int(misleading > 0)


if __name__ == "__main__":
    sys.exit(main())
