"""`python -m tests.campaigns.run_pairs --pairs 200 --seed 1`: pairs of runs, compared; exit code 1 if a law is broken.

Pairs of one motion, recorded at different periods: none parts. Pairs whose motions differ by ten times the larger of
their estimated errors, recorded at one period: at least 99 % part. The same recorded at two periods is counted without
a law: a difference at times that one run did not record is not in its data. Scenes are those of
`tests.campaigns.estimates`: smooth motion, dry and regularised friction, impacts, stops, bristles, sampled control,
windows of force.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

import robot_dyn as rd
from tests.campaigns.estimates.held import held_scene
from tests.campaigns.estimates.scenes import Scene
from tests.campaigns.estimates.switching import scene_of_all

TIMES = 10.0  # the larger of two estimated errors: how far motions of a pair are apart
NEAR = 0.05  # of that, to which it is met
MOST_MISSED = 0.01  # of pairs that differ
SHAPES = ((1, 1), (2, 1), (5, 3), (13, 10), (7, 5))  # ratios of periods, besides random ones


@dataclass(frozen=True)
class Pair:
    """Two runs, compared.

    Attributes:
        label: Scene and periods.
        family: Family of the scene.
        parted: Whether they part.
        conclusive: Whether enough was compared to say that they do not.
        fraction: Fraction of the time that was compared.
        apart: Largest distance of the motions over the larger estimated error; 0 for one motion.
        off: Largest |b − a| of q that is compared, over its bound.
    """

    label: str
    family: str
    parted: bool
    conclusive: bool
    fraction: float
    apart: float
    off: float

    def __str__(self) -> str:
        verdict = "parts" if self.parted else "does not part" if self.conclusive else "inconclusive"
        return f"{self.label}: {verdict}, compared {self.fraction:.0%}, off {self.off:.2g} of the bound"


def scene_of_a_pair(seed: int, index: int) -> Scene:
    """Scene number `index`: every third with dry friction or rigid stops."""
    return held_scene(seed, index // 3)[0] if index % 3 == 2 else scene_of_all(seed, index - index // 3)


def periods(seed: int, index: int, duration: float) -> tuple[float, float]:
    """Two periods of record that differ; every other time in a simple ratio."""
    rng = np.random.default_rng([seed, index, 23])
    first = float(duration * 10 ** rng.uniform(-2.3, -0.9))
    if index % 2:
        return first, float(duration * 10 ** rng.uniform(-2.3, -0.9))
    p, q = SHAPES[int(rng.integers(1, len(SHAPES)))]
    return first, first * p / q


def one_motion(seed: int, index: int) -> Pair | None:
    """A scene, recorded at two periods; None if its error is not estimated."""
    scene = scene_of_a_pair(seed, index)
    both = periods(seed, index, scene.setup.duration_s)
    a, b = (rd.simulate(replace(scene.setup, record_every_s=h)) for h in both)
    return None if not (_estimated(a) and _estimated(b)) else _compared(scene, a, b, both, 0.0)


def two_motions(seed: int, index: int, at_one_period: bool = True) -> Pair | None:
    """A scene from two velocities, so near that motions differ by `TIMES` the larger estimate; None if none is found.

    They differ by that at the samples of the first.
    """
    scene = scene_of_a_pair(seed, index)
    way = np.random.default_rng([seed, index, 29]).normal(size=len(scene.setup.q0))
    both = periods(seed, index, scene.setup.duration_s)
    recorded = replace(scene.setup, record_every_s=both[0])
    a = rd.simulate(recorded)
    if not _estimated(a):
        return None
    assert a.error is not None
    size, aim = a.error.largest, TIMES * a.error.largest
    for _ in range(12):
        moved = replace(recorded, v0=scene.setup.v0 + size * way)
        q = rd.simulate(moved, estimate_error=False).q
        if q.shape != a.q.shape or not (apart := float(np.abs(q - a.q).max())) > 0:
            return None
        if abs(apart / aim - 1) < NEAR:
            seconds = both if not at_one_period else (both[0], both[0])
            b = rd.simulate(replace(moved, record_every_s=seconds[1]))
            if not _estimated(b):
                return None
            assert b.error is not None
            larger = max(a.error.largest, b.error.largest)
            if abs(apart / (TIMES * larger) - 1) < 2 * NEAR:
                return _compared(scene, a, b, seconds, apart / larger)
            aim = TIMES * larger
        size *= aim / apart
    return None


def _estimated(run: rd.Trajectory) -> bool:
    return run.outcome.ending == "finished" and run.error is not None and run.error.largest < 1e-2


def _compared(scene: Scene, a: rd.Trajectory, b: rd.Trajectory, both: tuple[float, float], apart: float) -> Pair:
    found = rd.diff_runs(a, b)
    difference = found.difference
    assert difference is not None
    off = float((np.abs(difference.q).max(axis=1) / difference.bound).max(initial=0.0))
    label = f"{scene.label} {a.statistics.method} every {both[0]:.3g} and {both[1]:.3g} s"
    return Pair(label, scene.family, found.parted_s is not None, found.is_conclusive, found.fraction, apart, off)


def _one_motion(task: tuple[int, int]) -> Pair | None:
    return one_motion(*task)


def _at_one_period(task: tuple[int, int]) -> Pair | None:
    return two_motions(*task)


def _at_two_periods(task: tuple[int, int]) -> Pair | None:
    return two_motions(*task, at_one_period=False)


CAMPAIGNS = {
    "one motion at two periods": _one_motion,
    f"{TIMES:g} times the larger estimate, at one period": _at_one_period,
    f"{TIMES:g} times the larger estimate, at two periods": _at_two_periods,
}


def first_pairs(make: Callable[[tuple[int, int]], Pair | None], seed: int, pairs: int, processes: int) -> list[Pair]:
    """The first pairs of a seed that there are."""
    found: list[Pair] = []
    with ProcessPoolExecutor(processes) as pool:
        for start in count(0, 60):
            tasks = [(seed, index) for index in range(start, start + 60)]
            found += [pair for pair in pool.map(make, tasks, chunksize=2) if pair is not None]
            if len(found) >= pairs:
                return found[:pairs]
    raise AssertionError


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--show", action="store_true", help="print every pair")
    options = parser.parse_args()
    broken = False
    for name, make in CAMPAIGNS.items():
        pairs = first_pairs(make, options.seed, options.pairs, options.processes)
        differ = make is not _one_motion
        for pair in pairs:
            wrong = pair.conclusive and not pair.parted if differ else pair.parted  # of two periods, counted only
            if options.show or wrong:
                print("AGAINST" if wrong else "       ", pair)
        parted, told = (sum(pair.parted for pair in pairs), sum(not (p.parted or p.conclusive) for p in pairs))
        worst, mean = max(pair.off for pair in pairs), sum(pair.fraction for pair in pairs) / len(pairs)
        print(
            f"{name}: {parted} of {len(pairs)} part, {told} inconclusive; compared {mean:.0%} of the time in the mean,"
        )
        print(f"largest |b − a| over its bound {worst:.2g}", flush=True)
        if make is _one_motion:
            broken = broken or parted > 0
        elif make is _at_one_period:
            broken = broken or parted < (1 - MOST_MISSED) * len(pairs)
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
