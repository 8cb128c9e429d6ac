"""Values of arguments: scenes, numbers by joint, assignments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from robot_dyn.foundations.errors import QueryError, nearest, shorten

if TYPE_CHECKING:
    import numpy as np

    from robot_dyn.description.edits import Payload
    from robot_dyn.simulation.results.trajectory import Trajectory
    from robot_dyn.simulation.setup.setup import Setup


def scene(source: str, robot_options: Mapping[str, object]) -> Setup | None:
    """Return the setup of a scene file, or None for a robot; raise QueryError for options that only robots have."""
    import robot_dyn as rd

    if not source.lower().endswith(".toml"):
        return None
    if of_robots := [name for name, value in robot_options.items() if value]:
        raise QueryError(f"{of_robots[0]} applies to robots only, because a scene states it itself; remove it")
    return rd.read_scene(source)


def run(path: str) -> Trajectory:
    """Return the run in a file; raise QueryError for a batch."""
    import robot_dyn as rd

    result = rd.read(path)
    if isinstance(result, rd.Rollouts):
        raise QueryError(
            f"{path}: contains {len(result)} runs, but a single run is needed; save one in Python, for example"
            f" rd.read({path!r})[0].save('run.npz')"
        )
    return result


def assignments(option: str, texts: list[str], kind: str = "joint") -> dict[str, float]:
    """Return values by joint, or by link, from texts NAME=VALUE; raise QueryError if a name occurs twice."""
    values = {name: number(option, value) for name, value in pairs(option, texts, f"{kind.upper()}=VALUE").items()}
    if len(values) < len(texts):
        raise QueryError(f"{option} names a {kind} twice: {', '.join(texts)}")
    return values


def pairs(option: str, texts: list[str] | None, form: str = "NAME=VALUE") -> dict[str, str]:
    """Return the texts after the first =, by the text before it."""
    parts = {text: text.partition("=") for text in texts or ()}
    for text, (name, equals, _) in parts.items():
        if not (equals and name.strip()):
            raise QueryError(f"{option} must be {form}, got {shorten(text)!r}")
    return {name.strip(): value for name, _, value in parts.values()}


def payload(text: str) -> Payload:
    """Return the payload of LINK=MASS@X,Y,Z, in kg and m; without @, its centre of mass is the origin of the link."""
    from robot_dyn.description.edits import Payload

    link, equals, body = text.rpartition("=")
    mass, place = _placed(body)
    if not (equals and link.strip()) or place is None:
        raise QueryError(f"--payload must be LINK=MASS@X,Y,Z in kg and m, such as tool0=5kg@0,0,0.1; got {text!r}")
    com = tuple(number("--payload, place in m", entry) for entry in place)
    return Payload(link.strip(), number("--payload, mass in kg", mass.strip().removesuffix("kg")), com)  # pyright: ignore[reportArgumentType]


def link_and_place(option: str, text: str) -> tuple[str, tuple[float, ...]]:
    """Return the link and the point of LINK@X,Y,Z, in m; without @, the point is the origin of the link."""
    link, place = _placed(text)
    if not link.strip() or place is None:
        raise QueryError(f"{option} must be LINK@X,Y,Z in m, such as tool0@0,0,0.1; got {text!r}")
    return link.strip(), tuple(number(f"{option}, place in m", entry) for entry in place)


def _placed(text: str) -> tuple[str, list[str] | None]:
    """Return the text before @X,Y,Z, and the three numbers, 0 without @; None if there are not three."""
    what, at, place = text.partition("@")
    numbers = place.removesuffix("m").split(",") if at else ["0"] * 3
    return what, numbers if len(numbers) == 3 else None


def number(option: str, text: str) -> float:
    """Convert a text to a number."""
    try:
        return float(text)
    except ValueError:
        raise QueryError(f"{option}: {text.strip()!r} is not a number") from None


def vector(option: str, text: str | None, joint_names: tuple[str, ...]) -> np.ndarray:
    """Return one number per joint, from numbers separated by commas or blanks, or from joint=value pairs, else 0."""
    import numpy as np

    words = (text or "").replace(",", " ").split()
    if any("=" in word for word in words):
        values = assignments(option, words)
        for name in values:
            if name not in joint_names:
                raise QueryError(f"{option}: no joint {name!r}; {nearest(name, joint_names)}")
        return np.array([values.get(name, 0.0) for name in joint_names])
    if text is None:
        return np.zeros(len(joint_names))
    if len(words) != len(joint_names):
        numbers = f"{len(joint_names)} number{'s' if len(joint_names) > 1 else ''}"
        raise QueryError(f"{option} needs {numbers} ({', '.join(joint_names)}), got {len(words)}")
    return np.array([number(option, word) for word in words])
