"""Tables of a scene that belong to tools: entry points `robot_dyn.scene_tables`, imported where a scene has them."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from pydantic import create_model

from robot_dyn.scene.schema import Part

Schema = TypeVar("Schema", bound=Part)


def tool_tables() -> dict[str, EntryPoint]:
    """Return the entry points of tools' tables by the name of the table."""
    return {entry.name: entry for entry in entry_points(group="robot_dyn.scene_tables")}


def with_tool_tables(schema: type[Schema], keys: Iterable[str]) -> type[Schema]:
    """Return the schema of a scene with the tables of tools that are among its keys.

    Args:
        schema: The schema of the core.
        keys: Keys at the top of the scene.
    """
    tables = tool_tables()
    used: dict[str, Any] = {key: (tables[key].load() | None, None) for key in keys if key in tables}
    return create_model(schema.__name__, __base__=schema, **used) if used else schema
