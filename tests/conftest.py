"""Settings of the whole suite."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# Wall time says nothing about correctness on a shared machine, and a failure must come again.
settings.register_profile(
    "robot_dyn", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.load_profile("robot_dyn")

# Before NumPy is loaded; workers and commands inherit it. Matrices of arms are small, and threads of BLAS wait for each
# other in loops that take the cores from other workers: with two of them a comparison of 101 joints took eight times as
# much CPU time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Machine code of test runs is kept apart from the user's; workers, commands and the next run share it.
os.environ.setdefault("ROBOT_DYN_CACHE", str(Path(__file__).parents[1] / ".pytest_cache" / "machine_code"))


def pytest_collection_finish() -> None:
    """Search for garbage less often, and not among the 10 000 collected tests: it took 7 % of the processor time."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture(autouse=True)
def obeyed_interrupts() -> None:
    """Ctrl-C as in a terminal: shells ignore it for what runs in the background, a command that ended in this process.

    Programs hand that on to those that they start.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A valid call of every public callable by its name; what they take is computed once for each worker."""
    from tests.wrong_arguments import examples

    return examples(tmp_path_factory.mktemp("public"))


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Chromium, one for each worker."""
    from tests.browser import FLAGS, chromium

    path = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield launched
        launched.close()
