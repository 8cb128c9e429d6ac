"""Error against time: a pendulum, a double pendulum, UR5, Panda-7, a stiff scene, and one with stops.

Each is `rd.accuracy.work_precision`; the diagrams are those of docs/studies/work_precision.md.
"""

from __future__ import annotations

from dataclasses import replace

from benchmarks.measure import PICTURES, READY, command_line, panda, starter_setup

import robot_dyn as rd
from robot_dyn.cli.terminal import say

SCENES = ("pendulum", "double_pendulum", "ur5_pd", "panda", "flyball_governor", "stops")
LONGEST_S = 3.0


def setup(name: str) -> rd.Setup:
    """A starter scene, or the free swing of Panda-7."""
    if name == "panda":
        return rd.Setup(rd.Plant(panda()), READY)
    scene = starter_setup(name)
    return replace(scene, duration_s=min(scene.duration_s, LONGEST_S))


if __name__ == "__main__":
    parser = command_line(__doc__, "one scene and two methods: to see that it works")
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join(SCENES)}; all if none", default=SCENES)
    parser.add_argument("--budget", type=float, default=120.0, help="seconds for each scene, compiling not counted")
    options = parser.parse_args()
    if unknown := set(options.scenes) - set(SCENES):
        parser.error(f"no scene {', '.join(sorted(unknown))}; there are {', '.join(SCENES)}")
    if options.quick:
        say(rd.accuracy.work_precision(setup("pendulum"), methods=["DOP853", "RK4"], budget_s=2.0))
    for each in () if options.quick else options.scenes:
        print(f"\n## {each}\n", flush=True)
        result = rd.accuracy.work_precision(setup(each), budget_s=options.budget)
        say(result)
        result.save(PICTURES / f"accuracy_{each}.png")
