"""Loops in scenes: what a file says is the controller made by hand; what has no meaning is refused at its place."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import robot_dyn as rd
from tests.command import run

HEAD = """robot = "planar_2r"
duration_s = 0.1
method = "rk4"
step_s = 1e-3
estimate_error = false
engine = "interpreted"
[start]
q = [0.3, -0.4]
[[effect]]
kind = "gravity"
"""
LOOP = """[control]
kind = "pd"
kp = 50.0
kd = [5.0, 4.0]
period_s = 0.004
measurement_delay_periods = 1.0
actuation_delay_periods = 0.4
noise_seed = 5
[[control.position]]
kind = "noise"
deviation_rad = 1e-3
[[control.position]]
kind = "quantisation"
resolution_rad = {joint_1 = 1e-4, joint_2 = 2e-4}
[[control.velocity]]
kind = "differences"
[[control.velocity]]
kind = "low_pass"
cutoff_rad_per_s = 300.0
order = 1
[[control.actuation]]
kind = "low_pass"
cutoff_rad_per_s = 400.0
[[control.actuation]]
kind = "quantisation"
resolution_N_m = 0.01
[[control.actuation]]
kind = "rate_limit"
rate_N_m_per_s = 2000.0
[reference]
kind = "hold"
q = [0.5, 0.1]
"""


def by_hand() -> rd.control.Loop:
    q = rd.control.hold([0.5, 0.1])
    return rd.control.Loop(
        rd.control.PD(q, 50.0, [5.0, 4.0], 0.004),
        [rd.control.Noise(1e-3), rd.control.Quantisation([1e-4, 2e-4])],
        [rd.control.Differences(), rd.control.LowPass(300.0, 1)],
        [rd.control.LowPass(400.0), rd.control.Quantisation(0.01), rd.control.RateLimit(2000.0)], 1.0, 0.4, 5,
    )  # fmt: skip


def test_a_loop_of_a_scene_is_that_of_python(tmp_path: Path) -> None:
    file = tmp_path / "loop.toml"
    file.write_text(HEAD + LOOP, encoding="utf-8")
    setup = rd.read_scene(file)
    one, two = rd.simulate(setup), rd.simulate(setup, controller=by_hand())
    np.testing.assert_array_equal(one.q, two.q)
    np.testing.assert_array_equal(one.controller_states, two.controller_states)
    saved = rd.load_run(rd.save_run(one, tmp_path / "run"))
    np.testing.assert_array_equal(saved.controller_states, one.controller_states)


def test_explain_says_what_stands_in_the_loop_and_what_it_takes(tmp_path: Path) -> None:
    file = tmp_path / "loop.toml"
    file.write_text(HEAD + LOOP, encoding="utf-8")
    said = run("explain", str(file)).stdout
    for line in (
        "u = kp (q_d − q) + kd (v_d − v)",
        "measurement_delay_periods = 1.0  (scene)",
        "position: quantisation, y = Δ ⌊x/Δ + ½⌋",
        "resolution_rad = {'joint_1': 0.0001, 'joint_2': 0.0002}  (scene)",
        "order = 2  (default)",
        "machine code of a tick of the control: ",
        "; pd alone takes 8",
    ):
        assert line in said, line
    assert "of the control" not in said.partition("\ncontrol: ")[0]  # nothing is left out
    file.write_text(HEAD + LOOP.partition("measurement_delay")[0], encoding="utf-8")
    said = run("explain", str(file)).stdout
    assert (
        "of the control: measurement_delay, actuation_delay, noise, quantisation, low_pass, differences, rate_limit"
        in said
    )
    assert "machine code of a tick of the control: 8 instructions\n" in said
