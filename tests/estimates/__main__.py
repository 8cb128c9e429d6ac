"""`python -m tests.estimates --scenes 600 --seed 1`: judge error estimates; exit code 1 if one misleads.

With `--held`: scenes of dry friction and rigid stops with an accuracy that is asked for; exit code 1 if one is missed.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

from robot_dyn.simulation.accuracy import AccuracyError
from tests.estimates.held import FAMILIES, meet
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
    parser.add_argument("--held", action="store_true", help="scenes of dry friction and rigid stops")
    options = parser.parse_args()
    if options.held:
        return _held(options.scenes, options.seed, options.show)
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


def ask(task: tuple[int, int]) -> tuple[str, bool | None, str]:
    """The family of a scene with an accuracy that is asked for, whether it was met, None if refused, and the words."""
    family = FAMILIES[task[1] % 2]
    try:
        found = meet(*task)
    except AccuracyError as error:
        return family, None, f"{task[0]}/{task[1]} {family}: refused, {error}"
    return family, found.met, str(found)


def _held(scenes: int, seed: int, show: bool) -> int:
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(ask, [(seed, i) for i in range(scenes)], chunksize=2))
    for _, met, text in found:
        if show or not met:
            print("MISSED  " if met is False else "        ", text)
    for family in FAMILIES:
        those = [met for of, met, _ in found if of == family]
        print(f"{family:9s} met {those.count(True)}, missed {those.count(False)}, refused {those.count(None)}")
    return int(any(met is False for _, met, _ in found))


if __name__ == "__main__":
    sys.exit(main())
