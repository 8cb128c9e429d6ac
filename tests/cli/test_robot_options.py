"""Options of a robot on the command line: the same for every command that takes one, and those of `rd.load`."""

from __future__ import annotations

import inspect
import json
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.cli import RobotOptions
from tests.command import run
from tests.scene.test_scene_loading import MJCF, URDF

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
TAKING = {
    "robot_dyn.cli.commands.query": ("info", "query", "compare"), "robot_dyn.cli.commands.show": ("show_",),
    "robot_dyn.cli.commands.cost": ("work_precision", "certify"), "robot_dyn.tools.motors.command": ("budget",),
    "robot_dyn.tools.stress.command": ("stress",), "robot_dyn.tools.export.command": ("export_c",),
    "robot_dyn.tools.symbols.command": ("derive",),
}  # fmt: skip


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "rig.urdf").write_text(URDF, encoding="utf-8")
    (tmp_path / "rig.xml").write_text(MJCF, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("topic", "name"), [(topic, name) for topic, names in TAKING.items() for name in names])
def test_every_command_that_takes_a_robot_has_all_options(topic: str, name: str) -> None:
    command = getattr(import_module(topic), name)
    parameters = inspect.signature(command).parameters
    assert {*RobotOptions.__dataclass_fields__} <= {*parameters}
    assert "options" not in parameters


def test_masses_give_inertias_from_shapes_and_are_told() -> None:
    by_link = ["--mass", "one=2", "--mass", "two=3"]
    for given, options in (
        (["--total-mass", "7"], {"total_mass": 7.0}),
        (["--density", "900"], {"density": 900.0}),
        (["--density", "900", "--allow-overlap"], {"density": 900.0, "allow_overlap": True}),
        (by_link, {"mass": {"one": 2.0, "two": 3.0}}),
    ):
        done = run("query", "rig.urdf", "--q", "0.3,-0.7", "--json", *given)
        theirs = rd.load("rig.urdf", inertia="from_shapes", **options)  # pyright: ignore[reportArgumentType]
        M = np.array(rd.Plant(theirs).M([0.3, -0.7]))
        assert done.returncode == 0 and "estimated from shapes, so torques are rough" in done.stderr
        assert np.array_equal(json.loads(done.stdout)["M"], M)
    told = run("info", "rig.urdf", *by_link).stdout
    assert "estimated: one: collision box" in told and "finding: links 'one', 'two'" in told


def test_what_is_left_out_of_mjcf_is_told() -> None:
    assert "tendon 'cable': tendons are not supported; left out" in run("info", "rig.xml", "--without", "tendon").stdout
    done = run("show", "rig.xml", "--without", "tendon, equality", "--html", "rig.html")
    assert done.returncode == 0 and "left out" in done.stderr


def test_gravity_is_that_of_the_mounted_robot() -> None:
    """As `with_(gravity=…)`, also before joints are locked; three numbers are needed."""
    mounted = rd.load("rig.urdf").with_(gravity=(-9.0, 0.5, 2.0))
    for options, robot, q in (
        ([], mounted, [0.3, -0.7]),
        (["--lock", f"{mounted.joint_names[0]}=0.3"], mounted.with_(lock={mounted.joint_names[0]: 0.3}), [-0.7]),
    ):
        done = run("query", "rig.urdf", "--q", ",".join(map(str, q)), "--gravity", "-9,0.5,2", "--json", *options)
        assert np.array_equal(json.loads(done.stdout)["N"], robot.N(np.array(q)))
    refused = run("query", "rig.urdf", "--gravity", "9.81")
    assert refused.returncode == 2 and "--gravity" in refused.stderr
