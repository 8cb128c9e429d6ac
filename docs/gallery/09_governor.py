"""Watt's governor.

The couplers are so stiff that a deviation decays within 0.12 ms; the steps of Rodas5P are longer than that.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import robot_dyn as rd
from robot_dyn.scene.starters import starter

with TemporaryDirectory() as folder:
    scene = Path(folder, "governor.toml")
    scene.write_text(starter("flyball_governor"), encoding="utf-8")
    setup = rd.read_scene(scene)
run = rd.simulate(setup, method="Rodas5P", rtol=1e-6, atol=1e-8, record_every_s=0.02)
page = rd.replay(run)
