"""Commands that keep house: cache."""

from __future__ import annotations

from typing import Annotated

import typer

from robot_dyn.cli.app import Json, app
from robot_dyn.cli.terminal import say, say_json


@app.command()
def cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove them; each is compiled anew when asked for.")] = False,
    as_json: Json = False,
) -> None:
    """List the compiled kernels kept on disk, with their sizes."""
    from robot_dyn.cli import kernels
    from robot_dyn.codegen.store.cache import default_store

    store = default_store()
    removed = store.clear() if store and clear else 0
    answer = kernels.cache(store, removed)
    say_json(answer) if as_json else say(*kernels.cache_tables(answer))
