"""Errors for required packages that are missing, after `pip install --no-deps robot-dyn` with some of them.

The last entry of `sys.meta_path` is asked for a module only after all others have not found it. It answers imports
that stand in this package alone, so that other libraries and `importlib.util.find_spec` see no difference.
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
    """A finder of modules that finds none, and raises if this package imports a required one."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        """Return None.

        Raises:
            MissingExtraError: If a module of this package imports a required package, which is not installed.
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
    """Append the finder, once in a process."""
    if MissingPackages not in sys.meta_path:
        sys.meta_path.append(MissingPackages)
