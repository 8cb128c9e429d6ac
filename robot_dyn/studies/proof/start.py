"""Where a motion starts: a point of decimals or floats, or a box about it."""

from __future__ import annotations

from fractions import Fraction
from math import isfinite
from typing import Any

import numpy as np
from flint import arb

from robot_dyn.arithmetic import Ball
from robot_dyn.errors import QueryError, shown
from robot_dyn.studies.proof.enclosure.balls import upper
from robot_dyn.studies.proof.enclosure.lohner import box
from robot_dyn.studies.proof.enclosure.step import State


def start(names: tuple[str, ...], given: tuple[Any, Any], widths: tuple[float, float]) -> State:
    """The set of starts: its centre has the precision in force, and what that rounds belongs to the set."""
    balls = [numbers_of(what, x, names) for what, x in zip(("q0", "v0"), given, strict=True)]
    q, v = (tuple((+x).mid() for x in known) for known in balls)
    r = [
        upper((x - c).abs_upper() + arb(width))
        for known, centre, width in zip(balls, (q, v), widths, strict=True)
        for x, c in zip(known, centre, strict=True)
    ]
    return State(Fraction(0), q, v, box(r))


def numbers_of(what: str, values: Any, joint_names: tuple[str, ...]) -> list[Any]:
    """One ball for each joint, of decimals as text, of numbers, which are taken exactly, or of balls.

    Raises:
        QueryError: If they are anything else.
    """
    made, wanted = [], f"{what} must be {len(joint_names)} finite numbers, or decimals as text, got {shown(values)}"
    try:
        array = np.asarray(values, dtype=object)
        if isinstance(values, np.ma.MaskedArray):
            raise ValueError
        if array.shape != (len(joint_names),):
            raise ValueError
        for x in array:
            if isinstance(x, bool | np.bool_ | bytes | complex) or (isinstance(x, str) and not isfinite(float(x))):
                raise ValueError
            made.append(Ball().number(x))
            if not made[-1].is_finite():
                raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise QueryError(wanted) from None
    return made
