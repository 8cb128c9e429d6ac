"""Options that commands share, one by one and in groups.

    @command("Trust it")
    def certify(robot: Name, options: RobotOptions = AS_STATED, results: Results = PRINTED): ...

has the fields of `RobotOptions` and of `Results` as options, instead of `options` and `results`.
"""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, is_dataclass
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, final, get_type_hints

import typer

from robot_dyn.cli import arguments, completion
from robot_dyn.cli.terminal import show
from robot_dyn.foundations.errors import ModelWarning
from robot_dyn.foundations.files import target

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot

Name = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="A name of `robot-dyn list`, or the path of a URDF or MJCF file.",
        autocompletion=completion.robots,
    ),
]
Dark = Annotated[bool, typer.Option("--dark", help="Draw for dark screens.")]
Budget = Annotated[float, typer.Option(metavar="SECONDS", help="Time to spend, compiling not counted.")]
Repeats = Annotated[int, typer.Option(min=1, help="How often each is timed at most, while the budget lasts.")]
Scene = Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file; `robot-dyn scene` prints some.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that are there already.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, as documented in docs/reference/json.md.")]
Positions = Annotated[str | None, typer.Option(help="Positions in rad or m: 0.1,-0.2,… or joint=0.1,…; 0 by default.")]
Effects = Annotated[str | None, typer.Option(help='"urdf" adds the friction that the file states.')]
Payloads = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LINK=MASS@X,Y,Z", help="Add a body to a link, in kg and m, as tool0=5kg@0,0,0.1; may be repeated."
    ),
]


@dataclass(frozen=True)
class FileOptions:
    """How a URDF or MJCF file is read, each None unless given.

    With a mass, a total mass or a density, links without inertia get that of their shape.
    """

    package_dir: Annotated[
        list[str] | None, typer.Option(help="Folder in which ROS packages are searched; may be repeated.")
    ] = None
    xacro: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Expand a xacro file, which runs its expressions; may be repeated; '' for no argument.",
        ),
    ] = None
    mass: Annotated[
        list[str] | None,
        typer.Option(metavar="LINK=KG", help="Mass of a link without inertia, which its shape gives; may be repeated."),
    ] = None
    total_mass: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Mass of the robot, shared by links without inertia, from shapes."),
    ] = None
    density: Annotated[
        float | None, typer.Option(metavar="KG/M³", help="Density of links without inertia, from shapes.")
    ] = None
    allow_overlap: Annotated[
        bool | None,
        typer.Option("--allow-overlap", help="Count what closed parts of a mesh share as often as they fill it."),
    ] = None

    @property
    def stated(self) -> dict[str, object]:
        """Value by option, of those that are given."""
        values = {f"--{field.name.replace('_', '-')}": getattr(self, field.name) for field in fields(self)}
        return {option: value for option, value in values.items() if value is not None and value != []}

    @property
    def reading(self) -> dict[str, Any]:
        """Arguments of the functions that read a file."""
        return {
            "package_dirs": self.package_dir or (),
            "xacro": None if self.xacro is None else arguments.expansion(self.xacro),
            "mass": arguments.assignments("--mass", self.mass, "link") if self.mass else None,
            "total_mass": self.total_mass,
            "density": self.density,
            "allow_overlap": self.allow_overlap or False,
        }


@final
@dataclass(frozen=True)
class RobotOptions(FileOptions):
    """How the robot of a command is read, each None unless given."""

    lock: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=VALUE",
            help="Lock a joint at a value in rad or m; may be repeated.",
            autocompletion=completion.locks,
        ),
    ] = None
    without: Annotated[
        str | None,
        typer.Option(metavar="WHAT,…", help="What is left out of MJCF: tendon, equality, free, ball."),
    ] = None

    def load(self, name: str, *, quiet: bool = False) -> Robot:
        """Return the robot of a name or path; `quiet` suppresses its warnings."""
        import robot_dyn as rd

        estimated = {"--mass", "--total-mass", "--density"} & self.stated.keys()
        without = {part.strip() for part in (self.without or "").split(",") if part.strip()}
        with warnings.catch_warnings():
            if quiet:
                warnings.simplefilter("ignore", ModelWarning)
            inertia = "from_shapes" if estimated else "stated"
            robot = rd.load(name, inertia=inertia, without=without, **self.reading)
        return robot.with_(lock=arguments.assignments("--lock", self.lock)) if self.lock else robot


@final
@dataclass(frozen=True)
class Results:
    """What becomes of the result of a command: a figure, a table, text or JSON."""

    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PLOT.png", help="Draw it, as a .png, .svg or .pdf.")
    ] = None
    csv: Annotated[str | None, typer.Option("--csv", metavar="TABLE.csv", help="Write its rows as a table.")] = None
    dark: Dark = False
    force: Force = False
    as_json: Json = False

    def files(self, of: type, *inputs: str | None) -> list[Path]:
        """Return the paths to write a figure and a table of a class of results to, checked before the work is done."""
        from robot_dyn.report.figure import ResultError
        from robot_dyn.report.save import table_kind
        from robot_dyn.view.plots.plots import PICTURES

        read, paths = [path for path in inputs if path and os.path.isfile(path)], []
        for path, kinds in ((self.output, PICTURES), (self.csv, table_kind(of))):
            if path:
                paths.append(target(path, kinds, ResultError, [*read, *paths], self.force))
        return paths

    def give(self, result: Any, paths: Iterable[Path], drawn: Any = None, **more: Any) -> None:
        """Write a result, or the one that is `drawn`, and show it with more answers by key."""
        import robot_dyn as rd

        theme = "dark" if self.dark else "light"
        writes = [partial(rd.accuracy.save_result, drawn or result, path, theme=theme) for path in paths]
        show(result, as_json=self.as_json, more=more, writes=writes)


FILE_AS_STATED, AS_STATED = FileOptions(), RobotOptions()  # defaults of the parameters of commands
PRINTED = Results()


def with_fields(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function in which the fields of options stand for each parameter whose default is a group of options."""
    hints, stated = get_type_hints(function, include_extras=True), inspect.signature(function).parameters
    groups = {name: each.default for name, each in stated.items() if is_dataclass(each.default)}

    @wraps(function)
    def replaced(**given: Any) -> Any:
        for name, group in groups.items():
            given[name] = type(group)(**{each.name: given.pop(each.name) for each in fields(group)})
        return function(**given)

    defaults: dict[str, Any] = {}
    for name, each in stated.items():
        if name in groups:
            hints |= get_type_hints(type(each.default), include_extras=True)
            defaults |= {field.name: field.default for field in fields(each.default)}
        else:
            defaults[name] = each.default
    parameters = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hints[name])
        for name, default in defaults.items()
    ]
    replaced.__signature__ = inspect.Signature(parameters)  # pyright: ignore[reportAttributeAccessIssue]
    replaced.__annotations__ = {name: hints[name] for name in defaults}
    return replaced
