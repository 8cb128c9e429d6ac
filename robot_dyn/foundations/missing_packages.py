"""Errors for missing required packages, for example after `pip install --no-deps robot-dyn`.

Python calls the last finder in `sys.meta_path` only if no other has found the module. This one acts only on imports
from this package, so that other libraries and `importlib.util.find_spec` are not affected.
"""

from __future__ import annotations

import sys

# Modules of required packages; `extras.needs` imports modules of extras.
_REQUIRED = {
    "PIL", "casadi", "collada", "flint", "llvmlite", "lxml", "matplotlib", "meshcat", "pinocchio", "platformdirs",
    "pydantic", "pydantic_core", "rich", "scipy", "trimesh", "typer", "yourdfpy",
}  # fmt: skip
# Distributions whose names differ from their modules.
_DISTRIBUTIONS = {
    "PIL": "pillow", "collada": "pycollada", "flint": "python-flint", "pinocchio": "pin", "pydantic_core": "pydantic",
}  # fmt: skip


class MissingPackages:
    """A module finder that finds nothing, and raises if this package imports a missing required package."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        """Return None.

        Raises:
            MissingExtraError: If a module of this package imports a required package that is not installed.
        """
        if name not in _REQUIRED:
            return
        frame = sys._getframe(1)
        while frame is not None and frame.f_globals.get("__name__") == "importlib._bootstrap":
            frame = frame.f_back  # the frame of the import statement
        if frame is not None and str(frame.f_globals.get("__name__")).partition(".")[0] == "robot_dyn":
            from robot_dyn.foundations.errors import MissingExtraError

            package = _DISTRIBUTIONS.get(name, name)
            raise MissingExtraError(f"{package} is not installed: pip install {package}")


def install() -> None:
    """Append the finder, once per process."""
    if MissingPackages not in sys.meta_path:
        sys.meta_path.append(MissingPackages)
