"""Some hundred mutants of each kind of input: accepted or refused, never another exception or a hang.

More by hand: python -m tests.fuzz scenes --cases 20000; ROBOT_DYN_FUZZ_CASES sets how many there are here.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.campaign import CASES, FUZZERS, run


@pytest.mark.parametrize("name", FUZZERS)
def test_no_mutant_raises_a_foreign_exception_or_hangs(name: str, tmp_path: Path) -> None:
    counts, findings = run(name, CASES, 0, tmp_path)
    assert not findings, findings[:5]
    assert counts["refused"] > CASES // 10 and counts["accepted"] > 0  # else it would try nothing
