"""What is made when it is first asked for, such as a kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final


@final
class OnFirstUse(dict[str, Any]):
    """What is made of a name when it is first looked up."""

    def __init__(self, make: Callable[[str], Any]) -> None:
        super().__init__()
        self._make = make

    def __missing__(self, name: str) -> Any:
        made = self[name] = self._make(name)
        return made
