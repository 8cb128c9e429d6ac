"""The command for the cache of compiled kernels: cache."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import TYPE_CHECKING, Any

from robot_dyn.cli.application import FILES, command
from robot_dyn.cli.options import Json
from robot_dyn.cli.terminal import show
from robot_dyn.foundations.answer import Table

if TYPE_CHECKING:
    from robot_dyn.cli.report import CacheDocument


@command(FILES)
def cache(clear: bool = False, as_json: Json = False) -> None:
    """List or remove the compiled kernels stored on disk.

    Options:
        clear: Remove them; each is compiled again when needed.
    """
    from robot_dyn.codegen.store.cache import default_store

    store = default_store()
    removed = store.clear() if store and clear else 0
    kernels = list(store.entries()) if store else []
    answer: CacheDocument = {
        "folder": str(store.folder) if store else None,
        "removed": removed,
        "bytes": sum(kernel.size for kernel in kernels),
        "kernels": kernels,
    }
    show([*_lines(answer)], as_json=as_json, document=answer)


def _lines(answer: CacheDocument) -> Iterator[Any]:
    """Yield the answer as text."""
    if answer["folder"] is None:
        yield "no cache: compiled kernels are not stored"
        return
    if answer["removed"]:
        yield f"removed: {answer['removed']} kernels"
    if answer["kernels"]:
        rows = []
        for kernel in answer["kernels"]:
            used = datetime.fromtimestamp(kernel.used).strftime("%Y-%m-%d %H:%M")
            rows.append((kernel.key[:12], kernel.about, f"{kernel.size / 1024:.0f}", used))
        yield Table(("kernel", "about", "KiB", "last used"), tuple(rows), right=("KiB",))
    count = len(answer["kernels"])
    yield f"{count} kernel{'' if count == 1 else 's'}, {answer['bytes'] / 2**20:.1f} MiB in {answer['folder']}"
