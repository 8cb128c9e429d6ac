"""What a theorem assumes: which numbers are meant."""

from __future__ import annotations

from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.studies.proof.motion import Motion


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
    made = [
        f"of the file of {about.robot.name} the decimals as they stand",
        f"gravity {edits.gravity} m/s² as float64, a binary number",
    ]
    if edits != type(edits)(gravity=edits.gravity):
        made.append("locks, payloads, armature and other edits as float64")
    for name, own, known, width in zip("qv", (own_q, own_v), (setup.q0, setup.v0), widths, strict=True):
        start = "as given, decimals of a text exactly" if own else f"{known.tolist()} as float64"
        made.append(f"{name}(0) {start}" + (f", and all others within {width:g} of it" if width else ""))
    made += [f"coefficients of {each.name} as float64" for each in about.effects]
    if about.controller is not None:
        made.append(f"gains and reference of {about.controller.name} as float64, control without delay")
    return (*made, "times as float64")
