"""Compiled code outlives its process: the second one compiles nothing and gives the same bits."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

ASK = """
import json, numpy as np, robot_dyn as rd
from robot_dyn.codegen.llvm import machine_code
compiled, object_file = [], machine_code.object_file
machine_code.object_file = lambda *given: compiled.append(given) or object_file(*given)
arm = rd.load("planar_2r")
q, v, tau = np.array([0.3, -0.8]), np.array([0.5, 0.4]), np.array([1.0, -2.0])
one = rd.Compiled(arm).forward_dynamics(q, v, tau)
many = rd.Compiled(arm).forward_dynamics(np.tile(q, (100, 1)), np.tile(v, (100, 1)), np.tile(tau, (100, 1)))
print(json.dumps([len(compiled), one.tolist(), many[7].tolist()]))
"""


def ask(folder: Path) -> list:
    environment = os.environ | {"ROBOT_DYN_CACHE": str(folder)}
    done = subprocess.run([sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


def test_a_second_process_compiles_nothing(tmp_path: Path) -> None:
    first = ask(tmp_path / "kernels")
    second = ask(tmp_path / "kernels")
    assert first[0] > 0
    assert second[0] == 0
    assert second[1:] == first[1:]


def test_damaged_code_is_compiled_anew(tmp_path: Path) -> None:
    first = ask(tmp_path / "kernels")
    for entry in (tmp_path / "kernels").iterdir():
        damaged = bytearray(entry.read_bytes())
        damaged[len(damaged) // 2] ^= 1
        entry.write_bytes(damaged)
    again = ask(tmp_path / "kernels")
    assert again[0] > 0
    assert again[1:] == first[1:]
