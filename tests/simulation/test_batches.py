"""Each run of a random batch is the run that `simulate` makes; more of them by `python -m tests.campaigns.batches`."""

from __future__ import annotations

import pytest

from tests.campaigns.batches.judge import judge
from tests.campaigns.batches.scenes import FAMILIES
from tests.long import third

SEED = 20261123


@pytest.mark.parametrize("index", [0, *third(range(1, len(FAMILIES)))])
def test_each_run_of_a_batch_is_the_run_of_simulate(index: int) -> None:
    """To a hundred times what a push by a few roundings grows to; the same steps, samples and outcome."""
    judged = judge(SEED, index)
    assert judged.alike, str(judged)
