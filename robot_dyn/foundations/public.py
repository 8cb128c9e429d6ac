"""Public names of a folder: its stub `__init__.pyi` lists them, and they are imported on first use (PEP 562).

Tools and tests import names that a folder lists; modules of the core import modules, so that contracts on imports hold.
Names above `__all__` are documented as public; names below it, and names of a stub without `__all__`, are not.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # same as in typing, which takes longer to import than this module
if TYPE_CHECKING:
    from collections.abc import Callable
    from importlib.abc import SourceLoader
    from typing import Protocol

    class Spec(Protocol):
        """The `__spec__` of a package that is read from a source file."""

        name: str
        origin: str
        loader: SourceLoader


def public_names(spec: Spec) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package, so that importing it imports none of its modules.

    Args:
        spec: `__spec__` of the package. Lines of its stub read `from robot_dyn.model.robot import Robot as Robot`, or
            `from robot_dyn import effects as effects` for a whole module.
    """
    stub = spec.loader.get_data(spec.origin.removesuffix(".py") + ".pyi").decode()
    homes = _homes(stub)
    names = sorted(_homes(stub.partition("__all__")[0]))

    def public(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {spec.name!r} has no attribute {name!r}")
        home = homes[name]
        return import_module(f"{home}.{name}") if home == spec.name else getattr(import_module(home), name)

    return public, lambda: names, names


def _homes(stub: str) -> dict[str, str]:
    """Return the module of each name."""
    lines = (line.split() for line in stub.splitlines() if line.startswith("from "))
    return {name: module for _, module, _, name, *_ in lines}
