"""A campaign: many mutants of a fuzzer in one process, each with a time limit; what they did, counted."""

from __future__ import annotations

import importlib
import os
import signal
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from robot_dyn import RobotDynError
from robot_dyn.foundations import RobotDynWarning

FUZZERS = ("urdf", "run_files", "scenes", "arguments", "queries", "cache")
CASES = int(os.environ.get("ROBOT_DYN_FUZZ_CASES", "60"))  # of each of six fuzzers in the suite
MORE = 120  # in `make test-long`
MANY = 4000  # in `make stress`
MEMORY_BYTES = 4 * 2**30  # of a campaign by hand


class HangError(BaseException):
    """Internal: a case that took too long."""


def run(name: str, cases: int, seed: int, folder: Path, limit_s: int = 30) -> tuple[Counter[str], list[str]]:
    """How many cases were accepted and refused, and a text for each that did neither."""
    fuzzer = importlib.import_module(f"tests.campaigns.fuzz.{name}")
    seeds = fuzzer.seeds(folder)
    counts, findings = Counter[str](), list[str]()
    for case in range(cases):
        rng = np.random.default_rng([seed, case])
        mutant = fuzzer.mutate(rng, seeds[int(rng.integers(len(seeds)))])
        result = _outcome(fuzzer, mutant, folder, limit_s)
        counts[result.partition(":")[0]] += 1
        if result not in ("accepted", "refused"):
            findings.append(f"{name} --seed {seed}, case {case}: {result}")
    return counts, findings


def _outcome(fuzzer: Any, mutant: Any, folder: Path, limit_s: int) -> str:
    try:
        with limited(limit_s), warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", RobotDynWarning)
            return fuzzer.attempt(mutant, folder)
    except RobotDynError as error:
        return "refused" if str(error).isprintable() else f"control characters: {error!r}"
    except HangError:
        return "hang"
    except (Exception, SystemExit) as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        return f"foreign: {type(error).__name__}: {str(error)[:200]!r} at {frame.filename}:{frame.lineno}"


@contextmanager
def limited(seconds: int) -> Iterator[None]:
    """A HangError in what takes longer, where there are alarms."""

    def expire(*_: object) -> None:
        raise HangError

    if os.name != "posix":
        yield
        return
    before = signal.signal(signal.SIGALRM, expire)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def limit_memory() -> None:
    """For a process that does nothing else: what asks for more memory gets a MemoryError."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
