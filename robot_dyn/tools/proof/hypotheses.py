"""The hypotheses of a theorem: where the motion starts, a point or a box about it, and which numbers are meant."""

from __future__ import annotations

from fractions import Fraction
from math import isfinite
from typing import Any

import numpy as np
from flint import arb

from robot_dyn import Setup
from robot_dyn.foundations import Ball, QueryError, shown
from robot_dyn.tools.proof.enclosure.balls import upper
from robot_dyn.tools.proof.enclosure.lohner import box
from robot_dyn.tools.proof.enclosure.step import State
from robot_dyn.tools.proof.motion import Motion


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
    balls, desired = [], f"{what} must be {len(joint_names)} finite numbers, or decimals as text, got {shown(values)}"
    try:
        array = np.asarray(values, dtype=object)
        if isinstance(values, np.ma.MaskedArray):
            raise ValueError
        if array.shape != (len(joint_names),):
            raise ValueError
        for x in array:
            if isinstance(x, bool | np.bool_ | bytes | complex) or (isinstance(x, str) and not isfinite(float(x))):
                raise ValueError
            balls.append(Ball().number(x))
            if not balls[-1].is_finite():
                raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise QueryError(desired) from None
    return balls


def assumed(about: Motion, setup: Setup, own_q: bool, own_v: bool, widths: tuple[float, float]) -> tuple[str, ...]:
    """Which numbers a theorem is about, in sentences.

    Args:
        about: The motion.
        setup: It is of.
        own_q: Whether a position at the start was given in place of that of the setup.
        own_v: Whether a velocity was.
        widths: Of the set of starts, in q and in v.
    """
    edits = about.robot.edits
    sentences = [
        f"of the file of {about.robot.name} the decimals as they stand",
        f"gravity {edits.gravity} m/s² as float64, a binary number",
    ]
    if edits != type(edits)(gravity=edits.gravity):
        sentences.append("locks, payloads, armature and other edits as float64")
    for name, own, known, width in zip("qv", (own_q, own_v), (setup.q0, setup.v0), widths, strict=True):
        start = "as given, decimals of a text exactly" if own else f"{known.tolist()} as float64"
        sentences.append(f"{name}(0) {start}" + (f", and all others within {width:g} of it" if width else ""))
    sentences += [f"coefficients of {each.name} as float64" for each in about.effects]
    if about.controller is not None:
        sentences.append(f"gains and reference of {about.controller.name} as float64, control without delay")
    return (*sentences, "times as float64")
