"""`python -m tests.campaigns.estimates --scenes 600 --seed 1`: judge error estimates; exit code 1 if one misleads.

Or if the order is said to be seen, and the estimate is not 0.3 to 10 of the error, in more than one of a hundred runs.

With `--held`: scenes of dry friction and rigid stops with an accuracy that is asked for; exit code 1 if one is missed.
With `--requests 400`: smooth ones likewise; exit code 1 if one is missed, or refused although a run was good enough.
With `--layers 400`: a joint on a spring that rubs in a thin layer, or on bristles; judged as the random scenes.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from statistics import fmean

from robot_dyn.simulation import AccuracyError
from tests.campaigns.estimates.asked import Answer, answer
from tests.campaigns.estimates.held import FAMILIES, meet
from tests.campaigns.estimates.judge import FAR, LEAST, MOST, judge
from tests.campaigns.estimates.layers import judge_layer
from tests.campaigns.estimates.switching import scene_of_all


def one(task: tuple[int, int], layers: bool = False) -> dict:
    """Judge the estimate of one scene; return plain values."""
    judged = judge_layer(*task) if layers else judge(*task, scene_of_all)
    statistics = judged.run.statistics
    return {
        "text": str(judged), "family": judged.scene.family, "misleads": judged.misleads, "ratio": judged.ratio,
        "usable": judged.usable, "verdict": str(judged.run.error.verdict), "full": not judged.run.error.note,
        "cost": statistics.companion_evaluations / max(1, statistics.evaluations),
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--show", action="store_true", help="print every scene")
    parser.add_argument("--held", action="store_true", help="scenes of dry friction and rigid stops")
    parser.add_argument("--requests", type=int, default=0)
    parser.add_argument("--layers", type=int, default=0, help="scenes of a joint that crosses a thin layer")
    options = parser.parse_args()
    if options.held:
        return _held(options.scenes, options.seed, options.show)
    numbers = range(options.first, options.first + (options.requests or options.layers or options.scenes))
    if options.requests:
        return _requests([(options.seed, i) for i in numbers], options.processes, options.show)
    found = []
    with ProcessPoolExecutor(options.processes) as pool:
        for each in pool.map(
            partial(one, layers=options.layers > 0), [(options.seed, i) for i in numbers], chunksize=4
        ):
            found.append(each)
            each["off"] = each["verdict"] == "order seen" and not LEAST <= each["ratio"] <= FAR
            if options.show or each["misleads"] or each["off"]:
                what = "MISLEADS" if each["misleads"] else "OFF     " if each["off"] else "        "
                print(what, each["text"], flush=True)
    for family in sorted({each["family"] for each in found}):
        those = [each for each in found if each["family"] == family and each["usable"]]
        within = sum(each["full"] and LEAST <= each["ratio"] <= MOST for each in those)
        full, verdicts = sum(each["full"] for each in those), Counter(each["verdict"] for each in those)
        print(f"{family:9s} usable {len(those)}, to the end {full}, within {LEAST}–{MOST}: {within}; {dict(verdicts)}")
    seen = [each for each in found if each["verdict"] == "order seen"]
    off, cost = sum(each["off"] for each in seen), fmean(each["cost"] for each in found)
    print(f"order seen {len(seen)} of {len(found)}, {off} outside {LEAST}–{FAR}; companions take {cost:.2f} runs")
    misleading = sum(each["misleads"] for each in found)
    print(f"seed {options.seed}: {misleading} of {len(found)} mislead")
    return int(misleading > 0 or off > len(seen) / 100)


def ask(task: tuple[int, int]) -> tuple[str, bool | None, str]:
    """The family of a scene with an accuracy that is asked for, whether it was met, None if refused, and the words."""
    family = FAMILIES[task[1] % 2]
    try:
        found = meet(*task)
    except AccuracyError as error:
        return family, None, f"{task[0]}/{task[1]} {family}: refused, {error}"
    return family, found.met, str(found)


def reply(task: tuple[int, int]) -> Answer:
    return answer(*task)


def _requests(tasks: list[tuple[int, int]], processes: int, show: bool) -> int:
    found = []
    with ProcessPoolExecutor(processes) as pool:
        for each in pool.map(reply, tasks, chunksize=4):
            found.append(each)
            if show or each.refusal or not each.met:
                print("refused " if each.refusal else "        " if each.met else "MISSED  ", each, flush=True)
    made = [each for each in found if not each.refusal]
    below, missed = sum(each.refused_below for each in found), sum(not each.met for each in made)
    less, told = sum(each.estimated > each.asked / 2 for each in made), sum(each.told for each in made)
    print(f"{len(found)} requests: {missed} missed, {len(found) - len(made)} refused, {below} of these at an estimate")
    print(f"below what was asked; {less} met with a margin below 2; the truth of {told} of {len(made)} is sure enough")
    return int(missed + below > 0)


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
