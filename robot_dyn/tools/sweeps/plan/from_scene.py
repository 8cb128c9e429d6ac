"""The sweep of a scene that states one in its table `[sweep]`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robot_dyn.foundations import SweepError, shown
from robot_dyn.scene import read_both
from robot_dyn.tools.sweeps.plan.sweep import Sweep
from robot_dyn.tools.sweeps.plan.texts import distribution_of, figure_of, samples_of_text


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
    vary = {name: distribution_of(text) for name, text in table.pop("vary", {}).items()}
    figures = {name: figure_of(name, text, imports=False) for name, text in table.pop("figures", {}).items()}
    stated = {"vary": vary, "figures": figures} | table
    for name in ("vary", "figures"):
        if not isinstance(more := changes.get(name, {}), Mapping):
            raise SweepError(f"{name}: give them by name, as {{'kp': …}}, got {shown(more)}")
        changes[name] = {**stated.pop(name), **more}
    if "samples" in stated:
        stated["samples"] = samples_of_text(stated["samples"])
    stated |= changes
    if "runs" not in stated:
        raise SweepError(f"{path}: how many runs? give runs=, or a table [sweep] with them")
    return Sweep(str(path), **stated)
