"""`python -m tests.campaigns.sweeps flips --count 400 --seed 1`: folders of sweeps; exit code 1 if a law is broken.

- flips: A bit of a chunk is flipped: the answer is of the whole folder, or one error.
- repeats: A run by itself, `result.run(i)`, has the bits of its row.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from robot_dyn import RobotDynError
from robot_dyn.tools import sweeps as sw
from tests.tools.sweeps.swept import SCENE, scene, swept

NOISE = '\n[[control.position]]\nkind = "noise"\ndeviation_rad = 0.01\n'
STOPS = '[[effect]]\nkind = "joint_stops"\nstiffness_N_m_per_rad = 100.0\nlower_rad = -1.0\nupper_rad = 1.0\n\n'
SCENES = {
    "PD": SCENE,
    "noise": SCENE.replace('kind = "pd"\n', 'kind = "pd"\nperiod_s = 0.005\n') + NOISE,
    "stops": SCENE.replace("[control]", STOPS + "[control]"),
    "chosen steps": SCENE.replace('method = "RK4"\nstep_s = 0.001\n', ""),
}
ROWS_OF_A_SWEEP = 20

Read = Callable[[], dict[str, np.ndarray]]


def flips(file: Path, read: Read, count: int, rng: np.random.Generator) -> Iterator[str]:
    """Flip bits of a file, one at a time, and read what it belongs to; what is silent or no error of ours."""
    whole, data = read(), file.read_bytes()
    refused = 0
    for _ in range(count):
        at, bit = int(rng.integers(len(data))), int(rng.integers(8))
        file.write_bytes(data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :])
        try:
            now = read()
        except RobotDynError:
            refused += 1
            continue
        except Exception as error:
            yield f"ERROR {file.name}, byte {at}, bit {bit}: {type(error).__name__}: {error}"
            continue
        if now.keys() != whole.keys() or any(now[name].tobytes() != x.tobytes() for name, x in whole.items()):
            yield f"SILENT {file.name}, byte {at}, bit {bit}"
    file.write_bytes(data)
    print(f"{file.name}: {count} flips, {refused} refused", flush=True)


def flipped(count: int, seed: int, folder: Path) -> Iterator[str]:
    """Flips of a chunk: of its rows, and of its samples."""
    rng = np.random.default_rng([seed, 1])
    done = sw.run(swept(folder, 64, samples="q"), folder / "out", chunk=32)

    def table() -> dict[str, np.ndarray]:
        read = sw.read_sweep(done.path)
        read.verify()
        return {name: np.asarray(x, "U" if x.dtype == object else None) for name, x in read.table().items()}

    def samples() -> dict[str, np.ndarray]:
        kept = sw.read_sweep(done.path).samples()
        return {name: kept[name].values for name in kept.variables}

    for read in (table, samples):
        yield from flips(min((done.path / "rows").glob("*.parquet")), read, count, rng)


def repeated(count: int, seed: int, folder: Path) -> Iterator[str]:
    """Rows of finished runs, made again one by one."""
    rng, rows = np.random.default_rng([seed, 2]), 0
    while rows < count:
        for name, text in SCENES.items():
            place = folder / f"{name} {rows}"
            place.mkdir()
            vary = {"q0": sw.normal(mean=[0.4, 0.9], sd=0.4), "kp": sw.uniform(low=20.0, high=60.0)}
            sweep = swept(scene(place, text).parent, 200, vary=vary, seed=int(rng.integers(2**31)))
            done = sw.run(sweep, place / "out", chunk=int(rng.integers(1, 200)), threads=2)
            table = done.table()
            finished = np.flatnonzero(table["outcome"] == "finished")
            for i in rng.choice(finished, min(ROWS_OF_A_SWEEP, len(finished), count - rows), replace=False).tolist():
                run, rows = done.run(i), rows + 1
                same = run.q[-1, 1] == table["end"][i] and np.abs(run.extremes[1]).max() == table["peak"][i]
                if not same or run.q[0].tolist() != [table["q0[0]"][i], table["q0[1]"][i]]:
                    yield f"DIFFERS {name}, sweep of seed {sweep.seed}, run {i}"
    print(f"{rows} rows repeated", flush=True)


LAWS = {"flips": flipped, "repeats": repeated}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("law", choices=LAWS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=50, help="flips of a chunk and as many of a shard, or rows")
    options = parser.parse_args()
    findings = 0
    with tempfile.TemporaryDirectory() as folder:
        for finding in LAWS[options.law](options.count, options.seed, Path(folder)):
            print(finding, flush=True)
            findings += 1
    print(f"{findings} findings")
    return int(bool(findings))


if __name__ == "__main__":
    sys.exit(main())
