"""The first run of a process in machine code: processor time over that of the import, late imports included.

Each number is the median of new processes, which find modules as bytecode, as installed ones are.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.measure import Effort, printed, row, table

_PROCESSES = 5
_RUN = """
import time
import robot_dyn as rd
arm, q = rd.load("ur5"), [0.3, -1.2, 1.1, -0.4, 0.6, 0.2]
setup = rd.Setup({}, q, [0.1] * 6, duration_s=0.2, engine="compiled", estimate_error=False, {})
began = time.process_time()
rd.simulate(setup)
print(time.process_time() - began)
"""
_SCENES = {
    "RK4, PD and viscous friction": (
        "rd.Plant(arm, [rd.effects.ViscousFriction(0.5)])",
        "controller=rd.control.PD(rd.control.hold(q), kp=80.0, kd=8.0), method='RK4'",
    ),
    "DOP853, joint stops": (
        "rd.Plant(arm, rd.effects.joint_stops([x - 0.3 for x in q], [x + 0.3 for x in q], 1e4, 10.0))",
        "method=rd.integrate.Adaptive(method='DOP853')",
    ),
    "Rodas5P, stiff friction": (
        "rd.Plant(arm, [rd.effects.RegularisedCoulombFriction(2.0, 1e-3), rd.effects.ViscousFriction(500.0)])",
        "method=rd.integrate.Adaptive(method='Rodas5P')",
    ),
}  # fmt: skip


def first_run(effort: Effort) -> None:
    """From an empty store, and from what the process before left in it."""
    scenes = dict([*_SCENES.items()][: 1 if effort.quick else None])
    table("what", "empty store, s", "from the store, s")
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in scenes.items():
            code = _RUN.format(*scene)
            if not effort.quick:
                _spent(code, Path(folder), Path(folder, name, "bytecode"))
            stores = [Path(folder, name, str(k)) for k in range(1 if effort.quick else _PROCESSES)]
            cold, warm = ([_spent(code, Path(folder), store) for store in stores] for _ in range(2))
            row(name, f"{np.median(cold):.2f}", f"{np.median(warm):.3f}")


def _spent(code: str, folder: Path, store: Path) -> float:
    """Processor time of a new process."""
    return printed(code, ROBOT_DYN_CACHE=str(store), PYTHONPYCACHEPREFIX=str(folder / "bytecode"))[0]
