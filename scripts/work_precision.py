"""Error against time: a pendulum, a double pendulum, UR5, Panda-7, a stiff scene, and one with stops.

Each is `rd.work_precision`; the diagrams are those of docs/accuracy_and_time.md.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import robot_dyn as rd
from robot_dyn.cli.studies import lines
from robot_dyn.cli.terminal import say
from robot_dyn.scene.starters import starter

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
SCENES = ("pendulum", "double_pendulum", "ur5_pd", "panda", "flyball_governor", "stops")
LONGEST_S = 3.0
READY = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])


def setup(name: str) -> rd.Setup:
    """A starter scene, or the free swing of Panda-7."""
    if name == "panda":
        arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
        return rd.Setup(rd.Plant(arm), READY)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.toml"
        path.write_text(starter(name), encoding="utf-8")
        made = rd.read_scene(path)
    return replace(made, duration_s=min(made.duration_s, LONGEST_S))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join(SCENES)}; all if none", default=SCENES)
    parser.add_argument("--quick", action="store_true", help="one scene and two methods: to see that it works")
    parser.add_argument("--budget", type=float, default=120.0, help="seconds for each scene, compiling not counted")
    options = parser.parse_args()
    if unknown := set(options.scenes) - set(SCENES):
        parser.error(f"no scene {', '.join(sorted(unknown))}; there are {', '.join(SCENES)}")
    if options.quick:
        say(*lines(rd.work_precision(setup("pendulum"), methods=["DOP853", "rk4"], budget_s=2.0)))
    for each in () if options.quick else options.scenes:
        print(f"\n## {each}\n", flush=True)
        result = rd.work_precision(setup(each), budget_s=options.budget)
        say(*lines(result))
        rd.save_result(result, PICTURES / f"accuracy_{each}.png")
