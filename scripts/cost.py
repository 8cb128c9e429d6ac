"""What each effect, the control and each algorithm cost on Panda under computed torque: counted, timed, and drawn.

It is `rd.cost`; table and figure are those of docs/accuracy_and_time.md.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import robot_dyn as rd
from robot_dyn.cli.studies import cost_rows
from robot_dyn.scene.starters import starter

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
SCENE, QUICK = "panda_computed_torque", "pendulum"


def markdown(result: rd.Cost) -> str:
    """The rows of `robot-dyn cost` as a table of Markdown."""
    lines = ["| per | what | first / second | instructions | ratio | time | ratio |", "|---|---|---|--:|--:|--:|--:|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in cost_rows(result))])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a pendulum, and no figure: to see that it works")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds, compiling not counted")
    options = parser.parse_args()
    name = QUICK if options.quick else SCENE
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.toml"
        path.write_text(starter(name), encoding="utf-8")
        setup = rd.read_scene(path)
    result = rd.cost(setup, budget_s=1.0 if options.quick else options.budget, repeats=2 if options.quick else 200)
    print(f"{result.sentence}\n\n{markdown(result)}\n")
    print("\n".join(f"left out: {each}" for each in result.left_out))
    print(", ".join(f"{key} {value}" for key, value in result.environment.items()))
    if not options.quick:
        rd.save_result(result, PICTURES / f"cost_{name}.png")
