"""Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = Υ, by Pinocchio and a Lagrangian."""

from __future__ import annotations

from robot_dyn.public import public_names

TYPE_CHECKING = False  # as of typing, whose import takes longer than all of this
if TYPE_CHECKING:
    from typing import Any

_public, _, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("robot-dyn")
    return _public(name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
