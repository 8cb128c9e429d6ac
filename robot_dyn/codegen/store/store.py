"""Where machine code is kept: a folder (`robot_dyn.codegen.store.cache`), or anything else that keeps bytes by key."""

from __future__ import annotations

from typing import Protocol


class Store(Protocol):
    """Payloads by key."""

    def load(self, key: str) -> bytes | None:
        """The payload of a key; None if there is no such key."""
        ...

    def save(self, key: str, payload: bytes, about: str = "") -> None:
        """Keep a payload, with a text about it."""
        ...
