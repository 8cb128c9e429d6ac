"""A short tour of an installed robot_dyn, for Pythons and versions that the test suite does not run on."""

import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np

import robot_dyn as rd

arm = rd.load("planar_2r")
q, v = np.array([0.3, -0.8]), np.array([0.5, 0.4])
for dynamics in (rd.Lagrangian(arm), rd.compiled(arm)):
    for ours, theirs in ((dynamics.M(q), arm.M(q)), (dynamics.C(q, v) @ v, arm.C(q, v) @ v), (dynamics.N(q), arm.N(q))):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)
assert rd.compare(rd.load("panda")).ok

plant, controller = (
    rd.Plant(arm, [rd.effects.ViscousFriction(0.1)]),
    rd.control.PD(rd.control.quintic(q, q + 0.5, 0.1), kp=40.0, kd=4.0),
)
setup = rd.Setup(plant, q, duration_s=0.2, controller=controller, method="RK4")
runs = [rd.simulate(setup, engine=each) for each in ("interpreted", "compiled")]
np.testing.assert_allclose(runs[0].q, runs[1].q, rtol=0, atol=1e-11)
many = rd.rollouts(setup, np.tile(q, (3, 1)))
np.testing.assert_allclose(many.q[2], runs[0].q, rtol=0, atol=1e-11)
rd.simulate(plant, q0=q, duration_s=0.2)

with tempfile.TemporaryDirectory() as folder:
    path = runs[1].save(Path(folder) / "run.npz")
    np.testing.assert_array_equal(rd.read(path).q, runs[1].q)
    rd.plot(runs[1]).save(Path(folder) / "run.png")
    rd.replay(runs[1]).save(Path(folder) / "run.html")
print("Python", sys.version.split()[0], *(f"{name} {version(name)}" for name in ("pin", "numpy", "scipy", "llvmlite")))
