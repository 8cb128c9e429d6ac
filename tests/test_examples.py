"""Every page of examples/ runs as a student runs it, closes its energy ledger, and shows what it says it shows."""

from __future__ import annotations

import io
import re
import runpy
import subprocess
import sys
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
LOOP = (ROOT / "docs" / "how_to" / "a_real_control_loop.md").read_text(encoding="utf-8")
PAGES = {page.stem: page for page in sorted((ROOT / "examples").glob("*.py"))}
TEXTBOOK = sorted((ROOT / "examples" / "textbook").glob("*.py"))
TESTED = {
    "adaptive_control",
    "pendulum",
    "double_pendulum",
    "planar_2r_arm",
    "panda_computed_torque",
    "ur5_circle",
    "panda_payload",
}


def test_every_page_is_tested_and_fits_a_screen() -> None:
    assert set(PAGES) == TESTED
    assert max(len(page.read_text().splitlines()) for page in PAGES.values()) <= 70


def printed_by(page: Path) -> str:
    """Return what a page prints in this process; warnings are errors."""
    out = io.StringIO()
    with redirect_stdout(out):
        runpy.run_path(str(page), run_name="__main__")
    return out.getvalue()


def test_a_page_runs_as_a_script() -> None:
    command = [sys.executable, "-W", "error", str(PAGES["pendulum"])]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "energy ledger" in done.stdout


def test_the_pages_of_the_textbook_are_there() -> None:
    assert len(TEXTBOOK) >= 5


@pytest.mark.parametrize("page", TEXTBOOK, ids=lambda path: path.stem)
def test_a_page_of_the_textbook_runs_and_its_residual_is_small(page: Path) -> None:
    """DOP853 at rtol 1e-11 or less over some 10² steps keeps 1e-9 of quantities of order 10."""
    (residual,) = re.findall(r"^residual: (\S+)$", printed_by(page), flags=re.MULTILINE)
    assert float(residual) < 1e-9
    assert len(page.read_text().splitlines()) <= 60  # a page


@cache
def output(name: str, runs: int) -> str:
    """What a page prints. Each of its runs ends, closes its ledger and knows its error to the end.

    1e-9 of the energy exchanged: the tolerances of the pages are 1e-8 a step or less, and what they leave is 1e-11.
    """
    text = printed_by(PAGES[name])
    closures = re.findall(r"^energy ledger: .* (\S+) of the energy exchanged$", text, re.MULTILINE)
    errors = re.findall(r"^error of q \[.*\]: (?:about )?(\S+) .*\((?:order seen|bounded.*)\)$", text, re.MULTILINE)
    assert len(re.findall(r"^finished at", text, re.MULTILINE)) == len(closures) == len(errors) == runs
    assert max(map(float, closures)) <= 1e-9
    assert max(map(float, errors)) <= 1e-6
    return text


def number(label: str, text: str) -> float:
    """The number that follows a label."""
    (found,) = re.findall(rf"{re.escape(label)}\s+(\S+)", text)
    return float(found)


def row(label: str, text: str) -> list[float]:
    """The numbers of the line of a table that starts with a label."""
    (found,) = re.findall(rf"^{re.escape(label)} +([-+.e\d ]+)$", text, re.MULTILINE)
    return [float(x) for x in found.split()]


def test_pendulum_has_the_period_of_the_elliptic_integral() -> None:
    """Order 8 at h = 0.01 s errs by rounding alone over ten periods of 2 s each, by less than 1e-11 s."""
    assert number("difference of periods:", output("pendulum", runs=1)) < 1e-11


def test_double_pendulum_keeps_its_energy_and_parts_from_its_neighbour() -> None:
    text = output("double_pendulum", runs=1)
    assert number("energy drifts by", text) < 1e-9
    assert number("after  2.0 s:", text) < 1e-4
    assert number("after 10.0 s:", text) > 0.1


def test_planar_arm_rests_at_its_target_only_without_gravity() -> None:
    """With gravity the steady error is N(q)/kp, some 0.08 rad, and both are printed."""
    text = output("planar_2r_arm", runs=2)
    assert number("steady error in zero gravity:", text) < 1e-9
    assert number("steady error in standard gravity:", text) > 0.05
    _, error = re.findall(r"^error at rest: \[(.*)\]", text, re.MULTILINE)
    _, weight = re.findall(r"^N\(q\)/kp there: \[(.*)\]", text, re.MULTILINE)
    assert [float(x) for x in error.split()] == pytest.approx([float(x) for x in weight.split()], abs=1e-7)


@pytest.mark.long
def test_computed_torque_beats_independent_joints_and_the_integral_leaves_nothing() -> None:
    text = output("panda_computed_torque", runs=4)
    pd, pid, gravity, computed = (row(name, text) for name in ("PD", "PID", "PD + gravity", "computed torque"))
    rms, last = 0, -1
    assert computed[rms] < pd[rms] / 3
    assert computed[last] < pd[last] / 3
    assert computed[rms] < gravity[rms] < pd[rms]
    assert pid[last] < pd[last] / 100


@pytest.mark.long
def test_the_table_of_controllers_is_what_the_example_prints() -> None:
    """Two digits, the last one by one at most."""
    text = output("panda_computed_torque", runs=4)
    table = re.findall(r"^\| ([^|]+) \| ([\d.e-]+) \| ([\d.e-]+) \| ([\d.e-]+) \|$", LOOP, re.MULTILINE)
    assert len(table) == 4
    for label, *stated in table:
        printed = row(label.removesuffix(" on diag M(q_mid)"), text)
        for x, y in zip(stated, printed, strict=True):
            assert abs(float(x) - y) <= 1.5 * 10 ** (np.floor(np.log10(y)) - 1), (label, x, y)


@pytest.mark.long
def test_circle_is_round_with_the_exact_model_and_nearly_so_with_a_wrong_one() -> None:
    """1e-9 of a radius of 0.1 m is what `rd.control.circle` promises; the integration adds 1e-12 m."""
    text = output("ur5_circle", runs=2)
    assert number("radius error, exact model:", text) < 2e-10
    assert 1e-4 < number("radius error, model 20 % too heavy:", text) < 4e-3


@pytest.mark.long
def test_payload_costs_either_controller_and_computed_torque_less() -> None:
    text = output("panda_payload", runs=4)
    for name in ("feed-forward", "computed torque"):
        assert row(f"{name}, empty hand", text)[0] < 1e-9
    forward, computed = (row(f"{name}, 2 kg in the hand", text) for name in ("feed-forward", "computed torque"))
    assert 1e-3 < computed[0] < forward[0]
    assert computed[1] < forward[1]


@pytest.mark.long
def test_adaptive_control_spends_the_fall_of_its_lyapunov_function() -> None:
    """dV/dt = −sᵀ K s; the trapezoidal rule over samples of 10 ms errs by 3e-4 of the integral."""
    text = output("adaptive_control", runs=1)
    assert number("V falls by", text) == pytest.approx(number("the integral of sᵀ K s is", text), rel=1e-3)
    first, last = (float(x) for x in re.findall(r"(\S+) rad in the", text))
    assert last < first / 10
