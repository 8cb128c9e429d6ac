"""A small sweep that tests share: two bars in a plane, of which some runs diverge and some cannot be made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import Work
from robot_dyn.tools.sweeps.rows import digest_of

pytest.importorskip("pyarrow")

SCENE = """
robot = "planar_2r"
duration_s = 0.05
method = "RK4"
step_s = 0.001
record_every_s = 0.001

[start]
q = [0.4, 0.9]

[[effect]]
kind = "gravity"

[[effect]]
kind = "viscous_friction"
viscous_N_m_s_per_rad = 0.5

[control]
kind = "pd"
kp = 40.0
kd = 4.0

[reference]
kind = "hold"
"""
VARY = {
    "viscous_friction.viscous": sw.lognormal(median=0.5, sigma_of_log=0.3),
    "q0": sw.normal(mean=[0.4, 0.9], sd=0.1),
    "mass_scale": sw.normal(mean=1.0, sd=0.45),  # 1.3 % are negative, which is refused
    "kd": sw.choice([4.0, 4000.0]),  # too much for the step
}
FIGURES = {"error": sw.rms_tracking_error(), "peak": sw.peak("v"), "end": sw.final("q", "joint_2")}


def scene(folder: Path, text: str = SCENE) -> Path:
    """The scene as a file."""
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def swept(folder: Path, runs: int = 200, **changes: Any) -> sw.Sweep:
    """The sweep of a scene in a folder."""
    path = folder / "scene.toml"
    given = {"runs": runs, "seed": 3, "vary": VARY, "figures": FIGURES} | changes
    return sw.Sweep(str(path if path.exists() else scene(folder)), **given)


def digest(sweep: sw.Sweep) -> str:
    """Return the digest of all rows of a sweep, made in one piece."""
    return digest_of([Work(sweep).rows(0, sweep.runs)])


def names_in(folder: Path) -> list[str]:
    """Return the names of what a folder of a sweep holds, that of its design without its digest."""
    return sorted("design" if path.name.startswith("design-") else path.name for path in folder.iterdir())


def of_figure(folder: Path, name: str, kp: Any, runs: int = 512, **changes: Any) -> sw.SweepResult:
    """A sweep of two steps a run, whose one figure, "f", of own_figures.py depends on kp, and kd in 0 … 1, alone."""
    scene(folder, SCENE.replace("duration_s = 0.05", "duration_s = 0.002"))
    vary = {"kp": kp, "kd": sw.uniform(low=0.0, high=1.0)} | changes.pop("vary", {})
    sweep = swept(folder, runs, vary=vary, figures={"f": f"tests.tools.sweeps.own_figures:{name}"}, **changes)
    return sw.run(sweep, folder / f"out {sweep.design} {sweep.seed}", threads=1, chunk=runs)
