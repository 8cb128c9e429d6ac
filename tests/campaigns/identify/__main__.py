"""`python -m tests.campaigns.identify --logs 10 --clean 100 --seed 1`: plant faults in logs and judge the verdicts.

Exit code 1 if, of faults whose residual is at least three times the noise, the true cause is first in less than 80 % or
among the first two in less than 95 %, first in less than 60 % of a kind, or if a cause is named on more than 3 % of the
clean logs.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence

import robot_dyn as rd
from tests.campaigns.identify.planted import FAULTS, Judged, judge


def figures(rows: Sequence[Judged]) -> tuple[int, float, float]:
    """Return the number of faults that can be seen, and the parts with the true cause first and among the first two."""
    seen = [row for row in rows if row.ratio >= 3.0]
    count = max(len(seen), 1)
    return len(seen), sum(row.rank == 0 for row in seen) / count, sum(0 <= row.rank <= 1 for row in seen) / count


def main() -> int:
    """Judge all logs; print wrong verdicts, and a table by kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=10, help="logs of each fault")
    parser.add_argument("--clean", type=int, default=100, help="logs without a fault")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    rows: dict[str, list[Judged]] = {fault: [] for fault in (*FAULTS, "")}
    for fault, judged in rows.items():
        for index in range(options.logs if fault else options.clean):
            try:
                row = judge(1000 * options.seed + index, fault)
            except rd.RobotDynError as error:
                print(f"ERROR {fault or 'clean'} {index}: {error}", flush=True)
                continue
            judged.append(row)
            if (row.ratio >= 3.0 and row.rank > 0) or (not fault and row.first):
                print("MISSED", row, flush=True)
    bad = False
    for fault in FAULTS:
        count, first, two = figures(rows[fault])
        bad |= count > 0 and first < 0.6
        print(f"{fault:15s} {len(rows[fault])} logs, {count} seen; first {first:.0%}, among two {two:.0%}")
    count, first, two = figures([row for fault in FAULTS for row in rows[fault]])
    false = sum(bool(row.first) for row in rows[""]) / max(len(rows[""]), 1)
    bad |= first < 0.8 or two < 0.95 or false > 0.03
    print(f"seed {options.seed}: {count} seen; first {first:.1%}, among two {two:.1%}; false alarms {false:.1%}")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
