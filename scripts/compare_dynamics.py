"""Cross-check M, C, N of robots by two implementations, as `robot-dyn compare`, with --quick for a few robots."""

from __future__ import annotations

import sys

from robot_dyn.cli import main

QUICK = ["ur5", "panda", "kinova", "mimic_chain", "--samples", "3"]

if __name__ == "__main__":
    arguments = sys.argv[1:] or ["--all"]
    sys.argv[1:] = ["compare", *(QUICK if arguments == ["--quick"] else arguments)]
    main()
