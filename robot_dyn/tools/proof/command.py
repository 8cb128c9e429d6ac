"""The `prove` command: proves bounds on the motion of an arm."""

from __future__ import annotations

import typer

import robot_dyn as rd
from robot_dyn.cli import Json, Scene, bar, command, show


@command("Verification")
def prove(
    scene: Scene,
    /,
    until: float | None = None,
    bits: int = 100,
    budget: float = 60.0,
    as_json: Json = False,
) -> None:
    """Prove where the arm of a scene will be.

    The result is printed as balls that contain q and v. The exit code is 1 if the proof does not reach the end.

    Options:
        until (SECONDS): End time of the proof; by default the duration of the scene.
        bits: Precision of the balls.
        budget (SECONDS): Limit on computing time.
    """
    setup = rd.read_scene(scene)
    with bar(setup.duration_s if until is None else until, "proving") as advance:
        proof = rd.tools.proof.prove(setup, until, bits, budget_s=budget, on_progress=advance)
    show(proof, as_json=as_json)
    if not proof.proven:
        raise typer.Exit(1)
