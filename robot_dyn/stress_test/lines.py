"""Lines to paste: values as the Python that makes them, and a robot as it is loaded."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.model.catalog import find, list_robots
from robot_dyn.model.edits import Edits
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.origin import portable

_HEAD = "import numpy as np\nimport robot_dyn as rd\n\n"


@final
@dataclass(frozen=True)
class Loading:
    """How a robot is loaded.

    Attributes:
        python: Of Python, with the imports.
        words: Of the command line, quoted; empty if the command line cannot load it.
    """

    python: str
    words: str

    @staticmethod
    def of(robot: Robot, package_dirs: Iterable[str | Path] = (), xacro: Mapping[str, Any] | None = None) -> Loading:
        """How a robot is loaded in the folder of the process; the path of its file as run files keep it."""
        source = robot.description.source
        if not Path(source).is_file():
            return Loading(f"{_HEAD}# robot: the one that was given to rd.stress\n", "")
        name, folders = _name(source), [str(each) for each in package_dirs]
        arguments = [repr(name)]
        words = [name]
        if folders:
            arguments.append(f"package_dirs={folders!r}")
            words += [word for each in folders for word in ("--package-dir", each)]
        if xacro is not None:
            arguments.append(f"xacro={dict(xacro)!r}")
            words += [
                word for key, x in (xacro or {"": ""}).items() for word in ("--xacro", f"{key}={x}" if key else "")
            ]
        edits = robot.edits
        words += [word for joint, value in edits.lock for word in ("--lock", f"{joint}={value!r}")]
        changes = _changes(edits)
        others = ".with_(" + ", ".join(changes) + ")" if changes else ""
        elsewhere = Path(name).name == name and name not in list_robots() and not Path(name).is_file()
        place = f"# to be run in the folder of {name}\n" * elsewhere
        python = f"{_HEAD}{place}robot = rd.load({', '.join(arguments)}){others}\n"
        return Loading(python, "" if len(changes) > bool(edits.lock) else shlex.join(words))


def _name(source: str) -> str:
    """The name of a robot of the catalog, or the path of a file from the folder of the process."""
    path = Path(source).resolve()
    return next((name for name in list_robots() if find(name) == path), None) or portable(source, Path.cwd())


def _changes(edits: Edits) -> list[str]:
    """Keyword arguments of `with_`."""
    new, made = Edits(), []
    for name in ("gravity", "mass_scale"):
        if getattr(edits, name) != getattr(new, name):
            made.append(f"{name}={expression(getattr(edits, name))}")
    if edits.payloads:
        made.append(f"payload={expression(edits.payloads)}")
    for name in ("armature", "masses", "inertias", "lock"):
        if getattr(edits, name):
            made.append(f"{name}={expression(dict(getattr(edits, name)))}")
    return made


def expression(value: Any) -> str:
    """The Python that makes a value: numbers, arrays, payloads, effects, controllers, methods and setups of a robot."""
    if isinstance(value, Robot):
        return "robot"
    if isinstance(value, np.ndarray | np.generic):
        return expression(value.tolist())
    if isinstance(value, bool | str | int | None):
        return repr(value)
    if isinstance(value, float):
        return (
            repr(value) if np.isfinite(value) else f"{'-' if value < 0 else ''}np.{'nan' if value != value else 'inf'}"
        )
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(expression, value))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{expression(k)}: {expression(x)}' for k, x in value.items())}}}"
    if isinstance(value, Integrator) and not isinstance(value, Adaptive):
        return f"rd.method({value.name!r})"
    return f"rd.{type(value).__name__}({', '.join(_arguments(value))})"


def _arguments(value: Any) -> list[str]:
    """Keyword arguments of a dataclass, but for those that are its defaults."""
    made = []
    for each in fields(value):
        given = getattr(value, each.name)
        default = each.default if each.default_factory is MISSING else each.default_factory()
        if each.init and not (default is not MISSING and np.array_equal(np.asarray(given), np.asarray(default))):
            made.append(f"{each.name}={expression(given)}")
    return made


def assigned(state: Mapping[str, Any]) -> str:
    """Lines that name the values of a state."""
    return "".join(f"{name} = {expression(x)}\n" for name, x in state.items())
