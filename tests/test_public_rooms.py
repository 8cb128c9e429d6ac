"""The public names of a room are those of its stub: each is there, and importing the room imports no module of it."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import robot_dyn as rd

ROOMS = ("effects", "control", "integrate")


@pytest.mark.parametrize("name", ROOMS)
def test_each_public_name_is_defined_where_the_stub_says(name: str) -> None:
    room = import_module(f"robot_dyn.{name}")
    assert getattr(rd, name) is room
    assert room.__all__ == dir(room) != []
    for public in room.__all__:
        assert getattr(room, public) is not None
        if public in rd.__all__:
            assert getattr(room, public) is getattr(rd, public)


@pytest.mark.parametrize("name", ROOMS)
def test_no_public_name_is_that_of_a_module(name: str) -> None:
    """`from room import name` would give one or the other, by what was imported before."""
    folder = Path(str(import_module(f"robot_dyn.{name}").__file__)).parent
    modules = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert not modules & set(import_module(f"robot_dyn.{name}").__all__)


def test_an_unknown_name_of_a_room_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'robot_dyn\.effects' has no attribute 'Friction'"):
        rd.effects.Friction  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_importing_the_rooms_imports_no_numpy() -> None:
    code = "import sys, robot_dyn.effects, robot_dyn.control, robot_dyn.integrate; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "False"
