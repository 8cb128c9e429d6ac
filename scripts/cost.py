"""What each effect, the control and each algorithm cost on Panda under computed torque: counted, timed, and drawn.

It is `rd.accuracy.cost`; table and figure are those of docs/studies/cost.md.
"""

from __future__ import annotations

from benchmarks.measure import PICTURES, command_line, starter_setup

import robot_dyn as rd
from robot_dyn.accuracy.costs.cost import cost_rows

SCENE, QUICK = "panda_computed_torque", "pendulum"


def markdown(result: rd.accuracy.Cost) -> str:
    """The rows of `robot-dyn cost` as a table of Markdown."""
    lines = ["| per | what | first / second | instructions | ratio | time | ratio |", "|---|---|---|--:|--:|--:|--:|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in cost_rows(result))])


if __name__ == "__main__":
    parser = command_line(__doc__, "a pendulum, and no figure: to see that it works")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds, compiling not counted")
    options = parser.parse_args()
    name = QUICK if options.quick else SCENE
    result = rd.accuracy.cost(
        starter_setup(name), budget_s=1.0 if options.quick else options.budget, repeats=2 if options.quick else 200
    )
    print(f"{result.sentence}\n\n{markdown(result)}\n")
    print("\n".join(f"left out: {each}" for each in result.left_out))
    print(", ".join(f"{key} {value}" for key, value in result.environment.items()))
    if not options.quick:
        result.save(PICTURES / f"cost_{name}.png")
