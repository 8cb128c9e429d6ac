"""The names that a folder offers: its stub `__init__.pyi` lists them, and each is imported when first used (PEP 562).

Tools and tests import names that a folder lists; a module of the core imports modules, as contracts see. Names above
`__all__` are documented as public; names below it are not, nor are those of a stub without `__all__`.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as of typing, whose import takes longer than all of this
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def public_names(spec: Any) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package, so that importing it imports none of its modules.

    Args:
        spec: Its `__spec__`. Lines of the stub are such as `from robot_dyn.model.robot import Robot as Robot`; a module
            that is offered as a whole is `from robot_dyn import effects as effects`.
    """
    stub = spec.loader.get_data(spec.origin.removesuffix(".py") + ".pyi").decode()
    homes = _homes(stub)
    names = sorted(_homes(stub.partition("__all__")[0]))

    def public(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {spec.name!r} has no attribute {name!r}")
        home = homes[name]
        return import_module(f"{home}.{name}") if home == spec.name else getattr(import_module(home), name)

    return public, lambda: names, names


def _homes(stub: str) -> dict[str, str]:
    """The module of each name."""
    lines = (line.split() for line in stub.splitlines() if line.startswith("from "))
    return {name: module for _, module, _, name, *_ in lines}
