"""The `prove` command: proves where an arm will be."""

from __future__ import annotations

import typer

import robot_dyn as rd
from robot_dyn.cli import Json, Scene, bar, command, show


@command("Trust it")
def prove(
    scene: Scene,
    /,
    until: float | None = None,
    bits: int = 100,
    budget: float = 60.0,
    as_json: Json = False,
) -> None:
    """Prove where the arm of a scene will be.

    It prints balls that hold q and v. The exit code is 1 if the proof does not reach the end.

    Options:
        until (SECONDS): Time up to which to prove; that of the scene unless given.
        bits: Precision of the balls.
        budget (SECONDS): Time that it may take.
    """
    setup = rd.read_scene(scene)
    with bar(setup.duration_s if until is None else until, "proving") as advance:
        proof = rd.tools.proof.prove(setup, until, bits, budget_s=budget, on_progress=advance)
    show(proof, as_json=as_json)
    if not proof.proven:
        raise typer.Exit(1)
