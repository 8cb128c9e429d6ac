"""Of each run of a sweep, whether an event happened, from the columns of its folder."""

from __future__ import annotations

from robot_dyn.foundations import SweepError, nearest
from robot_dyn.tools.sweeps.expression import Expression, Truth
from robot_dyn.tools.sweeps.folder.folder import Folder
from robot_dyn.tools.sweeps.folder.rows import FINISHED, NUMBERS, OUTCOMES
from robot_dyn.tools.sweeps.plan.sweep import Sweep


def happened(sweep: Sweep, folder: Folder, text: str) -> Truth:
    """Whether an event of columns and outcomes by name did; SweepError if it is not one, or a name is unknown."""
    expression = Expression(text)
    numbers, outcomes = {*sweep.figures, *sweep.columns, *NUMBERS}, {*OUTCOMES, "failed"}
    for name in expression.names:
        if name not in numbers | outcomes:
            raise SweepError(f"no column {name!r}; {nearest(name, sorted(numbers | outcomes))}")
    found = folder.columns(name for name in expression.names if name in numbers)
    if outcomes & set(expression.names):
        outcome = folder.columns(("outcome",))["outcome"]
        found |= {name: outcome == name for name in OUTCOMES} | {"failed": outcome != FINISHED}
    return expression.of(found)
