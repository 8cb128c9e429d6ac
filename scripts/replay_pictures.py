"""Pictures of replays for the README: UR5, Panda and Kinova on a plan, seen in Debian's Chromium.

Each arm follows a quintic under computed torque; its HTML replay is opened with the network off, moved to a time, and
photographed. Writes docs/pictures/NAME.png.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.measure import PICTURES, command_line

import robot_dyn as rd

ARMS = {
    "ur5": ({}, [0.3, -1.3, 1.4, -1.2, -1.2, 0.4], [0.9, 0.5, -0.6, 0.4, 0.5, 0.8]),
    "panda": (
        {"panda_finger_joint1": 0.02},
        [-0.4, -0.3, 0.3, -2.0, 0.2, 1.8, 0.6],
        [0.9, 0.5, -0.4, 0.4, 0.3, 0.4, 0.5],
    ),
    "kinova": ({}, [0.5, 2.6, 1.4, 0.6, 1.2, 0.4], [0.9, 0.5, -0.4, 0.6, 0.5, 0.4]),
}
FLAGS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--disable-background-networking"]


def motion(name: str) -> rd.Trajectory:
    """The arm on its plan, with its model 20 % too heavy."""
    lock, start, way = ARMS[name]
    arm = rd.load(name)
    names = [joint for joint in arm.joint_names if joint not in lock]
    more = dict.fromkeys(names[len(start) :], 0.5)  # fingers
    arm = arm.with_(lock=lock | more) if lock or more else arm
    q0 = np.array(start)
    kp, kd = rd.control.gains_from(1.0, bandwidth_rad_s=15.0)
    control = rd.control.ComputedTorque(arm.with_(mass_scale=1.2), rd.control.quintic(q0, q0 + way, 1.5), kp=kp, kd=kd)
    return rd.simulate(rd.Plant(arm, "urdf"), q0=q0, duration_s=2.0, controller=control, record_every_s=0.005)


def photograph(browser: Any, page: Path, picture: Path, t: float) -> None:
    """The page from disk, with the network off, at a time."""
    context = browser.new_context(viewport={"width": 1000, "height": 900}, offline=True, color_scheme="light")
    tab = context.new_page()
    tab.goto(page.as_uri())
    tab.wait_for_selector("#plots .mark:last-of-type", state="attached")
    tab.wait_for_timeout(500)
    tab.evaluate(f"replay.seek({t})")
    tab.wait_for_timeout(500)
    tab.screenshot(path=picture)
    context.close()


def main() -> None:
    quick = command_line(__doc__, "one arm, into a temporary folder").parse_args().quick
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("this script photographs pages in Chromium: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    folder = Path(tempfile.mkdtemp()) if quick else PICTURES
    folder.mkdir(exist_ok=True)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as pages:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        for name in list(ARMS)[: 1 if quick else None]:
            run = motion(name)
            page = rd.replay(run).save(Path(pages) / f"{name}.html")
            photograph(browser, page, folder / f"{name}.png", t=0.8)
            print(f"{folder / name}.png: {run.outcome.ending}, page of {page.stat().st_size / 1e6:.1f} MB")
        browser.close()


if __name__ == "__main__":
    main()
