"""A campaign by hand: python -m tests.campaigns.fuzz run_files --cases 20000 --seed 1."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.campaigns.fuzz.campaign import FUZZERS, limit_memory, run

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("fuzzer", choices=FUZZERS)
parser.add_argument("--cases", type=int, default=1000)
parser.add_argument("--seed", type=int, default=0)
given = parser.parse_args()
limit_memory()
with tempfile.TemporaryDirectory() as folder:
    counts, findings = run(given.fuzzer, given.cases, given.seed, Path(folder))
print(*findings, sep="\n", end="\n" if findings else "")
print(f"{given.fuzzer}: {given.cases} cases, {dict(counts)}")
sys.exit(bool(findings))
