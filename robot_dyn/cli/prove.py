"""The command that proves where an arm will be: prove."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn.cli.app import Json, app, bar
from robot_dyn.cli.terminal import say, say_json

if TYPE_CHECKING:
    from robot_dyn.proof.theorem import Proof


@app.command()
def prove(
    scene: Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file; `robot-dyn scene` prints some.")],
    until: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Time up to which to prove; that of the scene unless given.")
    ] = None,
    bits: Annotated[int, typer.Option(help="Precision of the balls.")] = 100,
    budget: Annotated[float, typer.Option(metavar="SECONDS", help="Time that it may take.")] = 60.0,
    as_json: Json = False,
) -> None:
    """Prove where the arm of a scene will be: balls that hold q and v; exit code 1 if not up to the end."""
    setup = rd.read_scene(scene)
    with bar(setup.duration_s if until is None else until) as advance:
        made = rd.prove(setup, until, bits, budget_s=budget, on_progress=advance)
    say_json(document(made)) if as_json else say(*made.summary.split("\n"))
    if not made.proven:
        raise typer.Exit(1)


def document(made: Proof) -> dict[str, Any]:
    """A theorem as plain data (docs/json.md)."""
    q, v = made.decimals
    return {
        "robot": made.robot,
        "joints": list(made.joint_names),
        "proven": made.proven,
        "asked_s": made.asked_s,
        "until_s": made.until_s,
        "why_not": made.why_not,
        "q": list(q),
        "v": list(v),
        "radius_q": made.radius_q.tolist(),
        "radius_v": made.radius_v.tolist(),
        "bits": made.bits,
        "steps": len(made.nodes) - 1,
        "assumed": list(made.assumed),
        "trusted": list(made.trusted),
    }
