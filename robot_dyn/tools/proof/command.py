"""The `prove` command: proves where an arm will be."""

from __future__ import annotations

from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import Json, Scene, bar, command, show


@command("Trust it")
def prove(
    scene: Scene,
    until: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Time up to which to prove; that of the scene unless given.")
    ] = None,
    bits: Annotated[int, typer.Option(help="Precision of the balls.")] = 100,
    budget: Annotated[float, typer.Option(metavar="SECONDS", help="Time that it may take.")] = 60.0,
    as_json: Json = False,
) -> None:
    """Prove where the arm of a scene will be.

    It prints balls that hold q and v. The exit code is 1 if the proof does not reach the end.
    """
    setup = rd.read_scene(scene)
    with bar(setup.duration_s if until is None else until, "proving") as advance:
        proof = rd.tools.proof.prove(setup, until, bits, budget_s=budget, on_progress=advance)
    show(proof, as_json=as_json)
    if not proof.proven:
        raise typer.Exit(1)
