"""Mutants of each kind of input are accepted or refused; never another exception or a hang.

More in `make test-long` and `make stress`, and by hand: python -m tests.campaigns.fuzz scenes --cases 20000.
ROBOT_DYN_FUZZ_CASES sets how many there are here.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.campaigns.fuzz.campaign import CASES, FUZZERS, MANY, MORE, run
from tests.long import long, stress


@pytest.mark.parametrize("cases", [CASES, *long([MORE]), *stress([MANY])])
@pytest.mark.parametrize("name", FUZZERS)
def test_no_mutant_raises_a_foreign_exception_or_hangs(name: str, cases: int, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)  # mutants of queries name files that are written
    counts, findings = run(name, cases, 0, tmp_path)
    assert not findings, findings[:5]
    assert counts["refused"] > cases // 10 and counts["accepted"] > 0  # else it would try nothing
