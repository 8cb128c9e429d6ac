"""The `export-c` command: writes the equations of an arm as C."""

from __future__ import annotations

from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import AS_STATED, Effects, Force, Json, RobotOptions, bar, command, show, to_stderr
from robot_dyn.foundations import QueryError

RobotOrScene = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="A name of `robot-dyn list`, the path of a URDF or MJCF file, or a scene.toml."
    ),
]


@command("Files")
def export_c(
    robot: RobotOrScene,
    /,
    output: str,
    quantities: str | None = None,
    dtype: str = "float64",
    name: str | None = None,
    controller: bool = False,
    effects: Effects = None,
    force: Force = False,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Write an arm, a scene or its controller as C.

    The folder then holds a header, a source file, CMakeLists.txt and a self-test for ctest.

    Options:
        output (FOLDER): Folder for the files.
        quantities (M,C,N,…): Functions: M, C, N, inverse_dynamics, forward_dynamics; by default all of up to 8 joints.
        dtype: float64 for double, float32 for float.
        name: Prefix of the names in C.
        controller: Write the tick of the scene's controller instead.
    """
    if robot.endswith(".toml"):
        if options.stated or effects:
            raise QueryError(f"{robot}: a scene states its robot and effects; leave out the options of a robot")
        setup = rd.read_scene(robot)
        if controller and setup.controller is None:
            raise QueryError(f"{robot}: states no controller; add [control], or leave out --controller")
        exported = setup.controller if controller and setup.controller else setup.plant
    elif controller:
        raise QueryError("--controller needs a scene that states one: robot-dyn export-c scene.toml --controller")
    else:
        arm = options.load(robot)
        exported = rd.Plant(arm, effects) if effects else arm
    names = None if quantities is None else [x.strip() for x in quantities.split(",")]
    with bar(description="exporting"):
        source = rd.tools.export.c_source(exported, names, dtype=dtype, name=name)
    paths = source.write(output, force=force)
    show(source, as_json=as_json)
    for path in paths:
        to_stderr(f"written: {path}")
