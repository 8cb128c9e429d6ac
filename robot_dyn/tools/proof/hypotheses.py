"""The hypotheses of a theorem: the start of the motion, a point or a box around it, and the exact numbers assumed."""

from __future__ import annotations

from fractions import Fraction
from math import isfinite

import numpy as np
from flint import arb

from robot_dyn import Setup
from robot_dyn.foundations import Ball, QueryError, shown
from robot_dyn.tools.proof.enclosure.balls import upper
from robot_dyn.tools.proof.enclosure.lohner import box
from robot_dyn.tools.proof.enclosure.step import State
from robot_dyn.tools.proof.motion import Motion


def start(names: tuple[str, ...], centre: tuple[object, object], widths: tuple[float, float]) -> State:
    """Return the set of starts: its centre is rounded to the current precision, and the set includes the rounding."""
    balls = [numbers_of(name, x, names) for name, x in zip(("q0", "v0"), centre, strict=True)]
    q, v = (tuple((+x).mid() for x in values) for values in balls)
    r = [
        upper((x - c).abs_upper() + arb(width))
        for values, rounded, width in zip(balls, (q, v), widths, strict=True)
        for x, c in zip(values, rounded, strict=True)
    ]
    return State(Fraction(0), q, v, box(r))


def numbers_of(name: str, values: object, joint_names: tuple[str, ...]) -> list[arb]:
    """Return one ball for each joint, from decimals as text, numbers, which are exact, or balls.

    Raises:
        QueryError: If the values are anything else.
    """
    balls, message = [], f"{name} must be {len(joint_names)} finite numbers, or decimals as text, got {shown(values)}"
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
        raise QueryError(message) from None
    return balls


def assumed(about: Motion, setup: Setup, own_q: bool, own_v: bool, widths: tuple[float, float]) -> tuple[str, ...]:
    """Describe the exact numbers assumed by a theorem, in sentences.

    Args:
        about: The motion.
        setup: Setup of the motion.
        own_q: True if the user replaced the position at the start.
        own_v: True if the user replaced the velocity at the start.
        widths: Widths of the set of starts, in q and in v.
    """
    edits = about.robot.edits
    sentences = [
        f"the decimals in the file of {about.robot.name}, exactly",
        f"gravity {edits.gravity} m/s² as float64, a binary number",
    ]
    if edits != type(edits)(gravity=edits.gravity):
        sentences.append("locks, payloads, armature and other edits as float64")
    for name, own, stated, width in zip("qv", (own_q, own_v), (setup.q0, setup.v0), widths, strict=True):
        start = "as passed, decimals of a text exactly" if own else f"{stated.tolist()} as float64"
        sentences.append(f"{name}(0) {start}" + (f", and all others within {width:g}" if width else ""))
    sentences += [f"coefficients of {effect.name} as float64" for effect in about.effects]
    if about.controller is not None:
        sentences.append(f"gains and reference of {about.controller.name} as float64, control without delay")
    return (*sentences, "times as float64")
