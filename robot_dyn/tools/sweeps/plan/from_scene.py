"""The sweep that a scene states in its table `[sweep]`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robot_dyn.foundations import SweepError, shorten, shown
from robot_dyn.scene import read_both
from robot_dyn.tools.sweeps.imported import is_import_path
from robot_dyn.tools.sweeps.plan.sweep import Sweep


def from_scene(path: str | Path, **changes: Any) -> Sweep:
    """The sweep that a scene states in its table `[sweep]`.

    Args:
        path: Of the scene.
        **changes: Attributes of `Sweep` in place of those that are stated.

    Raises:
        SceneError: If the scene cannot be read.
        SweepError: If it states no sweep, or one that is not allowed.
    """
    stated_table = getattr(read_both(path)[0], "sweep", None)
    table = {} if stated_table is None else stated_table.model_dump(exclude_unset=True)
    for name, text in table.get("figures", {}).items():
        if is_import_path(text):
            raise SweepError(
                f"figures: {name}: {shorten(text)} runs code, and a scene is data; give it in Python or --figure"
            )
    stated = table | changes
    for name in ("vary", "figures"):
        if not isinstance(more := changes.get(name, {}), Mapping):
            raise SweepError(f"{name}: give them by name, as {{'kp': …}}, got {shown(more)}")
        stated[name] = {**table.get(name, {}), **more}
    if "runs" not in stated:
        raise SweepError(f"{path}: how many runs? give runs=, or a table [sweep] with them")
    return Sweep(str(path), **stated)
