"""A tour of robot_dyn with pin, numpy, lxml and platformdirs alone; other packages are named where they are needed."""

import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import robot_dyn as rd
from robot_dyn.foundations import CatalogError, MissingExtraError

began = time.perf_counter()
assert not any(map(find_spec, ("scipy", "casadi", "llvmlite", "matplotlib", "pydantic", "trimesh", "typer")))

arm = rd.load("planar_2r")
q, v = np.array([0.3, -0.8]), np.array([0.5, 0.4])
textbook = rd.Lagrangian(arm)
for ours, theirs in ((textbook.M(q), arm.M(q)), (textbook.C(q, v) @ v, arm.C(q, v) @ v), (textbook.N(q), arm.N(q))):
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14)  # some units of rounding
assert rd.compare(arm, samples=3).ok

plant = rd.Plant(arm, [rd.effects.ViscousFriction(0.1)])
assert np.all(np.linalg.eigvals(rd.linearise(plant, np.array([-np.pi / 2, 0.0])).A).real < 0)  # it hangs at rest
ends = {}
for method in ("RK4", "DP8", "GaussLegendre6", "Rodas5PFixed", "DOP853"):
    run = rd.simulate(plant, q0=q, duration_s=0.02, method=method)
    ends[method] = run.q[-1]
for method, end in ends.items():  # all are of order 4 or more; the step is 1 ms
    np.testing.assert_allclose(end, ends["DOP853"], rtol=0, atol=1e-8, err_msg=method)

with tempfile.TemporaryDirectory() as folder:
    assert run.save(Path(folder) / "run.csv").stat().st_size
    for package, call in {
        "casadi": lambda: rd.compiled(arm),
        "matplotlib": lambda: rd.plot(run),
        "pydantic": lambda: run.save(Path(folder) / "run.npz"),
        "trimesh": lambda: rd.replay(run),
        "scipy": lambda: rd.tools.doctor.check_urdf,
        "example-robot-data": lambda: rd.load("panda"),
    }.items():
        try:
            call()
        except (MissingExtraError, CatalogError) as error:
            assert f"pip install {package}" in str(error), error
        else:
            raise AssertionError(f"{package} was not needed")
print(f"four packages: {len(ends)} methods, {time.perf_counter() - began:.1f} s, Python {sys.version.split()[0]}")
