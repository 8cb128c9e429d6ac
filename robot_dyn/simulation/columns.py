"""Columns of a table, with quantity, joint and unit, as a dictionary, a DataFrame or a Dataset.

A heading is a quantity, its joint or effect, and its unit, for example "q elbow_joint [rad]". In a Dataset, a quantity
with a column for each joint has the dimensions row and joint.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any, final

import numpy as np

from robot_dyn.foundations.errors import QueryError, shorten
from robot_dyn.foundations.extras import needs

EXTRA = "data"

Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]  # dimensions, numbers and attributes


@final
@dataclass(frozen=True, eq=False)
class Column:
    """A column of a table.

    Attributes:
        quantity: Name of the quantity, for example "q".
        values: Values, one per row.
        unit: Unit; empty if there is none.
        component: Joint, effect or number that the quantity belongs to; empty if it has one column only.
        title: The quantity in words.
        dimension: Name of the axis of `component` if that is not the joints.
    """

    quantity: str
    values: np.ndarray
    unit: str = ""
    component: str = ""
    title: str = ""
    dimension: str = ""

    @property
    def heading(self) -> str:
        """Quantity, joint and unit, for example "q elbow_joint [rad]"."""
        return f"{self.quantity}{' ' * bool(self.component)}{self.component}" + f" [{self.unit}]" * bool(self.unit)


def by_heading(columns: Iterable[Column]) -> dict[str, np.ndarray]:
    """Return the columns as a dictionary.

    Raises:
        QueryError: If two columns have the same heading.
    """
    columns = list(columns)
    table = {column.heading: column.values for column in columns}
    for column in columns:
        if table[column.heading] is not column.values:
            raise QueryError(f"two columns would be named {shorten(column.heading)!r}; give effects other names")
    return table


def data_frame(columns: Iterable[Column], attributes: Mapping[str, str]) -> Any:
    """Return a `pandas.DataFrame` of the columns, with `attributes` as its `attrs`."""
    frame = needs("pandas", extra=EXTRA).DataFrame(by_heading(columns))
    frame.attrs |= attributes
    return frame


def data_set(
    columns: Iterable[Column],
    joint_names: tuple[str, ...],
    attributes: Mapping[str, str],
    more: Mapping[str, Variable] | None = None,
) -> Any:
    """Return an `xarray.Dataset`: a quantity with a column for each joint is one variable over rows and joints.

    Args:
        columns: Columns; the first one is the coordinate of the rows.
        joint_names: Values of the coordinate `joint`.
        attributes: Attributes of the Dataset.
        more: Further variables.
    """
    columns = list(columns)
    by_heading(columns)  # raises an error for a name that occurs twice
    row, coordinates, variables = columns[0].quantity, {"joint": list(joint_names)}, dict(more or {})
    for quantity, grouped in groupby(columns, lambda column: column.quantity):
        group = list(grouped)
        components, name = tuple(column.component for column in group), re.sub(r"[\s/]", "_", quantity)
        if name in variables:
            raise QueryError(f"two variables would be named {shorten(name)!r}; give effects other names")
        units = " or ".join(dict.fromkeys(column.unit for column in group if column.unit))
        about = {key: text for key, text in (("units", units), ("long_name", group[0].title)) if text}
        if components == ("",):
            variables[name] = (row,), group[0].values, about
            continue
        over = "joint" if components == joint_names else group[0].dimension or f"{name}_number"
        coordinates.setdefault(over, list(components))
        variables[name] = (row, over), np.stack([column.values for column in group], axis=1), about
    coordinates |= {name: variables.pop(name) for name in (row, "t") if name in variables}
    return needs("xarray", extra=EXTRA).Dataset(variables, coordinates, dict(attributes))
