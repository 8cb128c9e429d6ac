"""Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = Υ, by Pinocchio and a Lagrangian."""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as of typing, whose import takes longer than all of this
if TYPE_CHECKING:
    from typing import Any


def _homes() -> dict[str, str]:
    """Public names and their modules, of lines such as `from robot_dyn.model.robot import Robot as Robot`."""
    stub = __spec__.loader.get_data(f"{__path__[0]}/__init__.pyi").decode()  # pyright: ignore[reportOptionalMemberAccess, reportAttributeAccessIssue]
    words = (line.split() for line in stub.splitlines() if line.startswith("from "))
    return {name: module for _, module, _, name, *_ in words}


# Each is imported when it is first used, so that `import robot_dyn` stays light (PEP 562, SPEC 1).
_HOME = _homes()
__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("robot-dyn")
    if name not in _HOME:
        raise AttributeError(f"module 'robot_dyn' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
