"""The command sweep: a scene into a folder, resumed, and what is asked of the folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import run_sweep
from tests import command
from tests.promised import check_document
from tests.tools.sweeps.swept import SCENE, scene


def test_a_scene_is_swept_into_a_folder_and_asked(tmp_path: Path) -> None:
    path, out = (
        scene(tmp_path, SCENE + '\n[sweep]\nruns = 70\nvary = {kp = "uniform(low=10, high=20)"}\n'),
        tmp_path / "out",
    )
    said = command.run(
        "sweep", str(path), "-o", str(out), "--figure", "worst=peak('tracking_error')", "--runs", "96",
        "--design", "latin",
        "--probability", "worst > 0.001", "--samples", "samples('q', 'u', every=48)",
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    assert "96 finished, 0 diverged, 0 raised" in said.stdout and "probability of worst > 0.001" in said.stdout
    assert sw.read_sweep(out).sweep.samples == sw.samples("q", "u", every=48)
    again = command.run("sweep", "run", str(out), "--json", "--probability", "failed")
    found = json.loads(again.stdout)
    check_document("sweep", found)
    assert found["status"] == {"runs": 96, "chunks": 2, "missing": 0}
    assert found["specification"]["design"] == "latin" and found["probabilities"]["failed"]["estimate"] == 0.0
    assert "SHA-256" in command.run("sweep", "verify", str(out)).stdout
    for setting in (("--runs", "40"), ("--seed", "0"), ("--vary", "q0=[0.1]")):  # the folder keeps its own
        assert command.run("sweep", "run", str(out), *setting).returncode == 2
    assert command.run("sweep", "export", str(out), "-o", str(tmp_path / "rows.csv")).returncode == 0
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 97


def test_a_sweep_that_is_not_complete_says_what_is_left(tmp_path: Path) -> None:
    path, out = scene(tmp_path), tmp_path / "out"
    options = "--runs", "100", "--vary", "kp=uniform(low=10, high=20)", "--chunk", "10", "--job", "1/2"
    said = command.run("sweep", str(path), "-o", str(out), *options)
    assert said.returncode == 0 and "5 of 10 chunks are missing" in said.stdout
    assert "5 of 10 chunks" in command.run("sweep", "status", str(out)).stdout


def test_ctrl_c_summarises_the_chunks_that_are_kept_and_ends_with_130(tmp_path: Path, monkeypatch) -> None:
    """Also the one job of an array."""

    def interrupted(make: Callable[..., object], *_: object) -> None:
        make(0, lambda _: None)
        raise KeyboardInterrupt

    monkeypatch.setattr(run_sweep, "fill_by_threads", interrupted)
    path, out = scene(tmp_path), tmp_path / "out"
    options = "--runs", "40", "--vary", "kp=uniform(low=10, high=20)", "--chunk", "10", "--job", "1/2"
    ended = command.run("sweep", str(path), "-o", str(out), *options)
    assert ended.returncode == 130 and "interrupted" in ended.stderr
    assert "3 of 4 chunks are missing" in ended.stdout
