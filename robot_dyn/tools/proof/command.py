"""The `prove` command: proves where an arm will be."""

from __future__ import annotations

from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import Json, Scene, app, bar, say, say_json


@app.command(rich_help_panel="Trust it", short_help="Prove where the arm of a scene will be.")
def prove(
    scene: Scene,
    until: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Time up to which to prove; that of the scene unless given.")
    ] = None,
    bits: Annotated[int, typer.Option(help="Precision of the balls.")] = 100,
    budget: Annotated[float, typer.Option(metavar="SECONDS", help="Time that it may take.")] = 60.0,
    as_json: Json = False,
) -> None:
    """Prove where the arm of a scene will be: balls that hold q and v; exit code 1 if not up to the end."""
    setup = rd.read_scene(scene)
    with bar(setup.duration_s if until is None else until, "proving") as advance:
        proof = rd.tools.proof.prove(setup, until, bits, budget_s=budget, on_progress=advance)
    say_json(proof) if as_json else say(proof)
    if not proof.proven:
        raise typer.Exit(1)
