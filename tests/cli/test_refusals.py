"""A command that is refused: one line on stderr, exit code 2, no file changed, no work begun.

The commands and their lines are tests/snapshots/refused.json; a new one is a key there, renewed as snapshots are.
"""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path

import pytest

import robot_dyn as rd
from tests.command import refusal
from tests.scene.test_scene_loading import MJCF, URDF
from tests.snapshots import FOLDER, assert_text

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes and links of POSIX")
COMMANDS = sorted(json.loads((FOLDER / "refused.json").read_text(encoding="utf-8")))
SCENE = 'robot = "planar_2r"\nduration_s = 0.1\n[start]\nq = [0.4, 0.9]\n[[effect]]\nkind = "gravity"\n'
FILES = {
    "scene.toml": SCENE, "mistake.toml": SCENE.replace("duration_s", "duration"),
    "rig.urdf": URDF, "rig.xml": MJCF, "old.csv": "quantity,implementation", "other.csv": "x,y",
    "accuracy.csv": "method,engine", "cost.csv": "group,name", "table.csv": "t [s],q\n",
    "old.npz": "", "old.npz.csv": "", "old.json": '{\n "robot": "pendulum"\n}',
}  # fmt: skip
LINKS = {"link.npz": "scene.toml", "to_new.csv": "new.npz", "link.csv": "run.npz"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("refused")
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    for name, to in LINKS.items():
        (folder / name).symlink_to(to)
    os.mkfifo(folder / "pipe.npz")
    setup = rd.Setup(rd.Plant(rd.load("pendulum")), [0.1], duration_s=0.01, method="RK4")
    rd.simulate(setup).save(folder / "run.npz")
    rd.rollouts(setup, [[0.1], [0.2]]).save(folder / "runs.npz")
    return folder


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_refused_command_says_why_in_one_line_and_changes_nothing(
    command: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    words = shlex.split(command)
    if {"-o", "--csv"} & {*words}:  # refused before the work
        monkeypatch.setattr(rd, "simulate", None)
        monkeypatch.setattr(rd.tools.stress, "stress", None)
        for name in ("work_precision", "certify", "cost"):
            monkeypatch.setattr(rd.accuracy, name, None)

    def state() -> dict[str, tuple[int, ...]]:
        status = {path.name: path.lstat() for path in folder.iterdir()}
        return {name: (each.st_mode, each.st_ino, each.st_size, each.st_mtime_ns) for name, each in status.items()}

    before = state()
    assert_text("refused", command, refusal(words))
    assert state() == before
