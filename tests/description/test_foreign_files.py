"""Foreign files load with the dynamics of a sound one and say what was assumed, or are refused for a stated reason."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import DescriptionError
from robot_dyn.simulation import robot_of
from robot_dyn.simulation.results.provenance import origin
from tests.campaigns.foreign import macros, markup, robots
from tests.campaigns.foreign.files import Foreign

TABLE = [file for topic in (markup, macros, robots) for file in topic.FILES]
LOADING = [file for file in TABLE if not file.refused]
Q, V, A = np.array([0.4, -0.7]), np.array([0.3, 0.9]), np.array([-0.6, 0.5])


def written(file: Foreign, folder: Path) -> Path:
    path = folder / "robot.urdf"
    path.write_bytes(file.text.encode() if isinstance(file.text, str) else file.text)
    return path


def test_table_is_wide() -> None:
    assert len(TABLE) >= 50
    assert len({file.id for file in TABLE}) == len(TABLE)


@pytest.mark.parametrize("file", LOADING, ids=[file.id for file in LOADING])
def test_foreign_file_has_the_dynamics_of_the_sound_one_and_says_what_was_assumed(file: Foreign, tmp_path) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = rd.load(written(file, tmp_path))
    assert [warning.category for warning in caught] == [ModelWarning] * bool(file.said)
    assert len(robot.findings) == len(file.said)
    for finding, fragments in zip(robot.findings, file.said, strict=True):
        assert not [each for each in fragments if each not in finding], finding
    for warning in caught:
        assert str(warning.message).startswith(f"arm: {robot.findings[0]}")
        assert warning.filename == __file__
    sound = rd.Robot.from_text(file.sound)
    assert robot.joint_names == sound.joint_names
    assert np.array_equal(robot.inverse_dynamics(Q, V, A), sound.inverse_dynamics(Q, V, A))
    assert np.array_equal(rd.Lagrangian(robot).M(Q), rd.Lagrangian(sound).M(Q))
    for bounds in ("lower", "upper", "effort_limit", "velocity_limit"):
        assert np.array_equal(getattr(robot, bounds), getattr(sound, bounds)), bounds


@pytest.mark.parametrize("file", LOADING, ids=[file.id for file in LOADING])
def test_robot_of_a_run_is_read_again_from_the_text_that_the_run_carries(file: Foreign, tmp_path: Path) -> None:
    """In UTF-8, whatever the file was written in, and with what was assumed."""
    with warnings.catch_warnings(action="ignore", category=ModelWarning):
        robot = rd.load(written(file, tmp_path))
    texts = origin(rd.Setup(rd.Plant(robot), np.zeros(robot.n), duration_s=1.0), compiled=False)

    class Run:
        metadata, joint_names = texts, robot.joint_names

    again = robot_of(Run())  # pyright: ignore[reportArgumentType]
    assert again.description.xml == robot.description.xml
    assert again.findings == robot.findings


@pytest.mark.parametrize("file", [each for each in TABLE if each.refused], ids=lambda file: file.id)
def test_foreign_file_is_refused_for_a_stated_reason(file: Foreign, tmp_path: Path) -> None:
    path = written(file, tmp_path)
    with pytest.raises(DescriptionError) as refusal:
        rd.load(path)
    message = str(refusal.value)
    assert message.startswith(f"{path}: ")
    assert not [each for each in file.refused if each not in message], message
