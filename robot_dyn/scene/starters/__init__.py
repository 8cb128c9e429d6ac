"""Scene files to start from, each tested; `robot-dyn scene NAME` prints one."""

from __future__ import annotations

from importlib.resources import files

from robot_dyn.foundations.errors import SceneError, nearest


def starter_names() -> tuple[str, ...]:
    """Names of the starter scenes."""
    return tuple(sorted(file.name.removesuffix(".toml") for file in files(__name__).iterdir() if ".toml" in file.name))


def starter(name: str) -> str:
    """The text of a starter scene; raises SceneError for an unknown name."""
    if name not in starter_names():
        raise SceneError(f"no scene {name!r}; {nearest(name, starter_names())}")
    return (files(__name__) / f"{name}.toml").read_text(encoding="utf-8")


def opening(name: str) -> str:
    """Its first line, which says what it is."""
    return starter(name).partition("\n")[0].lstrip("# ")
