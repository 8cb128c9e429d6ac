"""The public names of a room are those of its stub: each is there, and importing the room imports no module of it."""

from __future__ import annotations

import re
from importlib import import_module
from inspect import signature
from operator import attrgetter
from pathlib import Path

import pytest
from IPython.core.completer import IPCompleter, provisionalcompleter

import robot_dyn as rd

TOOLS = ("doctor", "motors", "proof", "stress", "sweeps")
ROOMS = ("effects", "control", "integrate", "accuracy", "tools", *(f"tools.{name}" for name in TOOLS))


@pytest.mark.parametrize("name", ROOMS)
def test_each_public_name_is_defined_where_the_stub_says(name: str) -> None:
    room = import_module(f"robot_dyn.{name}")
    assert attrgetter(name)(rd) is room
    assert room.__all__ == dir(room) != []
    for public in room.__all__:
        assert getattr(room, public) is not None
        if public in rd.__all__:
            assert getattr(room, public) is getattr(rd, public)


@pytest.mark.parametrize("name", ["", *ROOMS])
def test_the_docstring_of_a_room_is_a_map_of_its_names(name: str) -> None:
    """`help(rd.effects)` names each of them, since nobody finds what it leaves out."""
    room = attrgetter(name)(rd) if name else rd
    assert [each for each in room.__all__ if not re.search(rf"\b{each}\b", str(room.__doc__))] == []


def test_names_of_every_day_are_few_and_each_has_a_reason() -> None:
    """The table of docs/developers/decisions/names.md."""
    text = (Path(__file__).parents[1] / "docs/developers/decisions/names.md").read_text(encoding="utf-8")
    reasons = [re.findall(r"`(\w+)`", line.split("|")[1]) for line in text.splitlines() if line.startswith("| `")]
    assert sorted(name for names in reasons for name in names) == rd.__all__


def test_a_class_to_be_subclassed_states_the_methods_to_write_first() -> None:
    rooms = (rd.effects, rd.control)
    bases = ["Conservative", "Dissipative", "Active", "Bound", "Stateful", "Controller", "Stateless", "Block"]
    for name in bases:
        base = next(getattr(room, name) for room in rooms if name in room.__all__)
        after = str(base.__doc__).split("define\n\n", 1)
        assert len(after[0]) < 200, name
        methods = re.findall(r"^ +def (\w+)\((.*?)\): \.\.\. +# \S", after[1], re.MULTILINE)
        assert len(methods) == 2, name
        for method, arguments in methods:
            if hasattr(base, method):
                assert set(arguments.split(", ")) - {"z"} <= set(signature(getattr(base, method)).parameters), name


def test_options_by_keyword_complete_in_a_session() -> None:
    """IPython completes from the signature: names of edits and of the options of a run are in it."""
    completer = IPCompleter(namespace={"rd": rd, "arm": rd.load("planar_2r")})
    for text, names in {
        "arm.with_(": ["gravity=", "payload=", "mass_scale="],
        "rd.simulate(arm, ": ["duration_s=", "controller=", "on_progress="],
        "rd.rollouts(arm, ": ["duration_s=", "params="],
        "rd.advise(arm, ": ["duration_s=", "controller="],
    }.items():
        with provisionalcompleter():
            found = {each.text for each in completer.completions(text, len(text))}
        assert found >= set(names), (text, sorted(found)[:40])


def test_an_unknown_name_of_a_room_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'robot_dyn\.effects' has no attribute 'Friction'"):
        rd.effects.Friction  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]
