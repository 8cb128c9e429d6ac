"""Tested scene files to start from; `robot-dyn scene NAME` prints one."""

from __future__ import annotations

from importlib.resources import files

from robot_dyn.foundations.errors import SceneError, nearest


def starter_names() -> tuple[str, ...]:
    """Return the names of the starter scenes."""
    return tuple(sorted(file.name.removesuffix(".toml") for file in files(__name__).iterdir() if ".toml" in file.name))


def starter(name: str) -> str:
    """Return the text of a starter scene; raise a SceneError for an unknown name."""
    if name not in starter_names():
        raise SceneError(f"no scene {name!r}; {nearest(name, starter_names())}")
    return (files(__name__) / f"{name}.toml").read_text(encoding="utf-8")


def opening(name: str) -> str:
    """Return the first line of a starter scene, which describes it."""
    return starter(name).partition("\n")[0].lstrip("# ")
