"""Kills of drivers, of workers and of both while sweeps run: what is lost, what is doubled, whether bits differ.

    python -m tests.campaigns.sweep_kills --drivers 200 --workers 20 --seed 1

Drivers are forked and run 1 to 3 threads; they are killed (SIGKILL) at a random moment, or end themselves at a random
call to the system inside a write. Workers are processes of Dask, killed one or all at a time; then the driver is killed
with them. Each is resumed, by another engine, until the sweep is complete. The digest of all rows must be that of a
sweep without kills, in other chunks, and each chunk must have one file. Exit code 1 if a sweep is wrong.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import distributed
import psutil

from robot_dyn.foundations import files
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import begun
from tests.tools.sweeps.swept import swept

RUNS, CHUNK = 20_000, 256
CALLS = "open", "fsync", "replace"


def fill(plan: sw.Sweep, out: str, calls: int, options: dict[str, Any]) -> None:
    """A driver, by two workers of Dask without options; it ends itself after `calls` calls inside writes, if any."""
    if calls:
        files.os = Counted(calls)
    if options:
        sw.run(plan, out, **options)
        return
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        sw.run(plan, out, cluster=client)


class Counted:
    """The module `os`, whose calls inside writes end the process when no more are left."""

    def __init__(self, calls: int) -> None:
        self.left = calls

    def __getattr__(self, name: str) -> Any:
        plain = getattr(os, name)

        def call(*given: Any) -> Any:
            self.left -= 1
            if self.left == 0:
                os._exit(9)
            return plain(*given)

        return call if name in CALLS else plain


def start(plan: sw.Sweep, out: str, calls: int = 0, **options: Any) -> Any:
    """A driver in a forked process."""
    driver = multiprocessing.get_context("fork").Process(target=fill, args=(plan, out, calls, options))
    driver.start()
    return driver


def descendants(driver: Any) -> list[psutil.Process]:
    """Processes that make chunks: those that Dask's nannies started, and start again."""
    with suppress(psutil.Error):
        every = psutil.Process(driver.pid).children(recursive=True)
        return [each for each in every if "spawn_main" in " ".join(each.cmdline())]
    return []


def kill(processes: list[psutil.Process]) -> int:
    """How many were killed."""
    killed = 0
    for each in processes:
        with suppress(psutil.Error):
            each.send_signal(signal.SIGKILL)
            killed += 1
    return killed


def check(plan: sw.Sweep, out: str, expected: str) -> str:
    """What is wrong with a complete folder; "complete, same bits" if nothing is."""
    result = sw.run(plan, out, threads=1)  # makes nothing
    names = sorted(path.name for path in (Path(out) / "rows").glob("[!.]*"))  # without those of writers just killed
    if names != [f"{k:06d}.parquet" for k in range(result.folder.count)]:
        return f"DIFFERS: {len(names)} files, {result.folder.count} chunks"
    if len(result.table("run")["run"]) != RUNS:
        return "DIFFERS: rows are lost or doubled"
    return "complete, same bits" if result.verify() == expected else "DIFFERS: other bits"


def drivers(plan: sw.Sweep, out: str, counts: dict[str, int], most: int) -> None:
    """Drivers that are killed until the sweep is complete."""
    while True:
        spent, inside = counts["driver"] + counts["inside a write"] >= most, random.random() < 0.5
        calls = random.randint(1, 150) if inside and not spent else 0
        driver = start(plan, out, calls, threads=random.randint(1, 3))
        if not spent and not inside:
            driver.join(random.uniform(0.0, 1.5))
            if driver.is_alive():
                driver.kill()
        driver.join()
        counts["driver"] += driver.exitcode == -signal.SIGKILL
        counts["inside a write"] += driver.exitcode == 9
        if driver.exitcode == 0:
            return


def workers(plan: sw.Sweep, out: str, counts: dict[str, int], most: int) -> None:
    """A driver of two workers, of which one or both are killed; at last all processes at once, then a resumption."""
    driver, before = start(plan, out), counts["worker"]
    end = before + random.randint(1, 6)
    while driver.is_alive() and counts["worker"] < min(end, most):
        time.sleep(random.uniform(0.2, 3.0))
        if some := descendants(driver):
            counts["worker"] += kill(some if random.random() < 0.3 else random.sample(some, 1))
    if driver.is_alive():
        every = psutil.Process(driver.pid).children(recursive=True)
        driver.kill()
        counts["all at once"] += 1 + kill(every)
    driver.join()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drivers", type=int, default=200)
    parser.add_argument("--workers", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    random.seed(given.seed)
    wrong = 0
    counts = {"driver": 0, "inside a write": 0, "worker": 0, "all at once": 0}
    with tempfile.TemporaryDirectory() as folder:
        plan = swept(Path(folder), RUNS, seed=5)
        expected = sw.run(plan, f"{folder}/whole", chunk=1024).verify()
        print(f"without kills: {expected}", flush=True)
        for number in range(given.drivers + given.workers):
            left = counts["driver"] + counts["inside a write"] < given.drivers
            if not left and counts["worker"] >= given.workers:
                break
            out = f"{folder}/out{number}"
            begun(plan, Path(out), CHUNK).prepare()
            if not left:
                workers(plan, out, counts, given.workers)
            drivers(plan, out, counts, given.drivers)
            verdict = check(plan, out, expected)
            wrong += verdict.startswith("DIFFERS")
            print(verdict, f"sweep {number}", counts, sep="; ", flush=True)
    print(f"{wrong} wrong sweeps; {counts}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
