"""Cross-check M, C, N of robots by two implementations, as `robot-dyn compare`.

python scripts/compare_dynamics.py             all robots
python scripts/compare_dynamics.py --quick     a few robots
python scripts/compare_dynamics.py --write     all robots; the worst of each quantity to docs/data/cross_check.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import robot_dyn as rd
from robot_dyn.cli import main

QUICK = ["ur5", "panda", "kinova", "mimic_chain", "--samples", "3"]
TABLE = Path(__file__).parents[1] / "docs" / "data" / "cross_check.csv"


def write() -> None:
    """Write the worst agreement of each quantity over all robots that load, and print how many agree."""
    results = {}
    for name in rd.list_robots():
        try:
            results[name] = rd.compare(rd.load(name))
        except rd.RobotDynError as refused:
            print(f"{name}: {refused}", file=sys.stderr)
    worsts = {}
    for robot, result in results.items():
        for quantity, agreement in result.quantities.items():
            worsts[quantity] = max((agreement.tolerance_fraction, robot, agreement), worsts.get(quantity, (-1.0,)))
    rows, exact = [], []
    for quantity, (_, robot, worst) in worsts.items():
        if worst.error:
            rows.append((quantity, f"{worst.error:.1e}", f"{worst.tolerance:.1e}", robot, worst.entry or "—"))
        else:
            exact.append(quantity)
    if exact:
        rows.append((", ".join(exact), "0", "1.0e-12", "all", "—"))
    with TABLE.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerows([("quantity", "worst error", "allowed", "robot", "where"), *rows])
    agree = sum(result.ok for result in results.values())
    print(f"{agree} of {len(results)} robots agree, {sum(result.n for result in results.values())} joints in all")


if __name__ == "__main__":
    arguments = sys.argv[1:] or ["--all"]
    if arguments == ["--write"]:
        write()
    else:
        sys.argv[1:] = ["compare", *(QUICK if arguments == ["--quick"] else arguments)]
        main()
