"""`StatedScene`: a function that a folder names as its scene and that its reader has not named. It is not imported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, final

from robot_dyn.foundations import SweepError


@final
@dataclass(frozen=True, eq=False)
class StatedScene:
    """The setup of a sweep as its folder states it, for reading results without calling the function of the scene.

    Attributes:
        path: Import path of the function.
        setup: The table "setup" of the specification.
        units: Units of columns by name.
        joint_types: Types of the joints, "revolute", "continuous" or "prismatic"; None if unknown.
        bytes_expected: Size of rows and samples on disk.
    """

    path: str
    setup: Mapping[str, Any]
    units: Mapping[str, str]
    joint_types: tuple[str | None, ...]
    bytes_expected: int

    def refuse(self) -> NoReturn:
        """Raise SweepError, since the function is not called unless the reader names it."""
        raise SweepError(
            f"the folder names the function {self.path} as its scene, which is called only if you name it:"
            f" sw.read(folder, scene={self.path!r}), or --scene {self.path}"
        )


def stated_scene(path: str, setup: Mapping[str, Any]) -> StatedScene:
    """Return the scene of a stored specification; TypeError, KeyError or AttributeError if it is not one."""
    units, types, size = dict(setup["units"]), tuple(setup["joint_types"]), setup["bytes_expected"]
    if not isinstance(size, int) or not all(
        isinstance(x, str) for x in (path, *units, *units.values(), *filter(None, types))
    ):
        raise TypeError("setup: units, joint_types or bytes_expected")
    return StatedScene(path, dict(setup), units, types, size)
