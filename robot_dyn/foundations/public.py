"""The public names of a package: its stub `__init__.pyi` lists them, and each is imported when first used (PEP 562)."""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as of typing, whose import takes longer than all of this
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def public_names(spec: Any) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package, so that importing it imports none of its modules.

    Args:
        spec: Its `__spec__`. Lines of the stub are such as `from robot_dyn.model.robot import Robot as Robot`; a room
            that is public itself is `from robot_dyn import effects as effects`.
    """
    stub = spec.loader.get_data(spec.origin.removesuffix(".py") + ".pyi").decode()
    lines = (line.split() for line in stub.splitlines() if line.startswith("from "))
    homes = {name: module for _, module, _, name, *_ in lines}
    names = sorted(homes)

    def public(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {spec.name!r} has no attribute {name!r}")
        home = homes[name]
        return import_module(f"{home}.{name}") if home == spec.name else getattr(import_module(home), name)

    return public, lambda: names, names
