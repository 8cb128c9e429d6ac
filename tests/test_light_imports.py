"""What is imported where it is needed: a fresh process that does this much has not imported these."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.test_tree import ROOMS

CONTROL = """import pathlib, importlib, robot_dyn.control as control
for file in pathlib.Path(control.__file__).parent.glob('*.py'):
    importlib.import_module(f'robot_dyn.control.{file.stem}')"""
SHOWN = """import robot_dyn as rd
arm, q = rd.load('pendulum'), [0.1]
rd.compare(arm, samples=1)._repr_html_()
rd.plot(rd.simulate(arm, q, duration_s=0.1, method='RK4', step_s=1e-3))._repr_png_()
rd.accuracy.cost(arm, q, budget_s=0.1, repeats=1)._repr_html_()"""
ARM = "import robot_dyn as rd; arm = rd.load('pendulum'); "
HEAVY = {"numba", "llvmlite", "casadi", "flint", "matplotlib", "scipy", "meshcat", "trimesh", "pydantic", "typer"}
ABOVE = {f"robot_dyn.{x}" for x in ("simulation", "codegen", "effects", "control", "view", "accuracy")}
ABOVE |= {"robot_dyn.tools", "robot_dyn.lagrange"}
COMMAND = (
    "import sys; sys.argv[1:] = {}\ntry:\n    from robot_dyn.cli import main; main()\nexcept SystemExit:\n    pass"
)
AT_ONCE = {"pinocchio", "yourdfpy", "trimesh", "scipy", "flint", "lxml", "numpy"}
CASES = {
    "the package": ("import robot_dyn", AT_ONCE | {"rich", "typer"}),
    "help": (COMMAND.format("['query', '--help']"), AT_ONCE),
    "the list of robots": (COMMAND.format("['list']"), AT_ONCE),
    "M of one arm": ("import robot_dyn as rd; rd.load('ur5').M([0.0] * 6)", HEAVY | ABOVE),
    "C of one arm": ("import robot_dyn as rd; rd.load('ur5').C([0.1] * 6, [0.2] * 6)", HEAVY | ABOVE),
    "rooms": (f"import {', '.join(f'robot_dyn.{each}' for each in ROOMS)}", {"numpy"}),
    "control, which never sees the plant": (
        CONTROL,
        {"robot_dyn.effects", "robot_dyn.simulation", "robot_dyn.integrate", "robot_dyn.codegen", "scipy"},
    ),
    "methods": ("from robot_dyn.integrate import explicit, gauss, rosenbrock, adaptive, methods", {"scipy"}),
    "forces of particles": ("import robot_dyn.lagrange.generalized_force", {"casadi"}),
    "a short run": (f"{ARM} rd.simulate(rd.Plant(arm), [0.1], duration_s=0.05)", {"casadi", "llvmlite"}),
    "results and figures": (SHOWN, {"IPython", "matplotlib.pyplot"}),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_not_needed_is_not_imported(name: str, tmp_path) -> None:
    """Where no machine code is in the store; that these are names of modules is looked up."""
    code, absent = CASES[name]
    code += f"\nimport sys, importlib.util\nprint([x for x in {sorted(absent)} if x in sys.modules])"
    code += f"\nassert all(map(importlib.util.find_spec, {sorted(absent)}))"
    place = os.environ | {"ROBOT_DYN_CACHE": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=place, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
