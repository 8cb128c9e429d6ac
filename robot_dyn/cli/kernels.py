"""What the command line says of compiled kernels: which formulation won, and what is kept on disk."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import Any

from robot_dyn.cli.terminal import table
from robot_dyn.codegen.dynamics import CompiledDynamics
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.trace.trace import QUANTITIES
from robot_dyn.model.robot import Robot

Document = dict[str, Any]


def formulations(robot: Robot) -> Document:
    """For each quantity the instructions of each formulation, and what serves it."""
    compiled = CompiledDynamics(robot)
    quantities = {name: {"served_by": compiled.served_by(name)} for name in QUANTITIES}
    return {name: row | {"instructions": compiled.instructions.get(name, {})} for name, row in quantities.items()}


def formulation_table(answer: Document) -> Iterator[Any]:
    """That answer as a table."""
    rows = []
    for name, row in answer.items():
        counts = dict(row["instructions"])
        own = counts.pop(row["served_by"], None)
        others = ", ".join(f"{implementation} {count}" for implementation, count in counts.items())
        rows.append([name, row["served_by"], "" if own is None else str(own), others])
    yield "compiled"
    headings = ("quantity", "served by", "instructions", "others")
    yield table(headings, rows, words=("quantity", "served by", "others"), wrap=True)


def cache(store: Store | None, removed: int) -> Document:
    """The kernels kept on disk; `folder` is null where there is no cache."""
    kernels = list(store.entries()) if store else []
    return {
        "folder": str(store.folder) if store else None,
        "removed": removed,
        "bytes": sum(each.size for each in kernels),
        "kernels": kernels,
    }


def cache_tables(answer: Document) -> Iterator[Any]:
    """That answer as a table."""
    if answer["folder"] is None:
        yield "no cache: compiled kernels are not kept"
        return
    if answer["removed"]:
        yield f"removed: {answer['removed']} kernels"
    if answer["kernels"]:
        rows = []
        for each in answer["kernels"]:
            used = datetime.fromtimestamp(each.used).strftime("%Y-%m-%d %H:%M")
            rows.append([each.key[:12], each.about, f"{each.size / 1024:.0f}", used])
        yield table(("kernel", "about", "KiB", "last used"), rows, words=("kernel", "about", "last used"))
    count = len(answer["kernels"])
    yield f"{count} kernel{'' if count == 1 else 's'}, {answer['bytes'] / 2**20:.1f} MiB in {answer['folder']}"
